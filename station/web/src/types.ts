// What the station says (docs/station.md).
export type Pose = '+x' | '-x' | '+y' | '-y' | '+z' | '-z';
export const POSES: Pose[] = ['+z', '-z', '+x', '-x', '+y', '-y'];

export interface Run {
  phase: string; wanted: Pose | null; prompt: string; open: Pose[];
  taken: { round: string; pose: Pose; tilt_deg: number }[];
  of: number; refusals: number; last_refusal: string; waiting_since_ms: number;
}
export interface Result {
  kind: 'jig' | 'capture'; serial: string; verdict: string; reasons: string[]; stored: boolean;
  residual_mg?: number | null; as_found_residual_mg?: number | null; run?: string; constants_id?: string | null;
  problem?: string; file?: string; repeat_sides?: string[]; written?: boolean;
}
export interface Lane {
  lane: number; device: string; message: string; turns_by_itself: boolean;
  state: 'absent' | 'idle' | 'resuming' | 'running' | 'unit_away' | 'wrong_unit' | 'capturing' | 'done';
  unit: { serial: string; firmware: string; model: string; battery_mv: number } | null;
  scan: { serial: string; matches: boolean } | null;
  operator: string; client: string; write: boolean; run: Run | null; result: Result | null;
  capture: { side: Pose | null; number: number; of: number; placed: boolean; until_ms: number; side_s: number } | null;
  log: { id: number; kind: string; text: string; at_ms: number }[];
}
export interface Live { stillness: string; dwell: number; face: Pose | null; angle_deg: number | null }
export interface Job {
  state: string; done: number; total: number; current: string; error: string; summary: Record<string, number>;
  files: { input: string; status: string; reasons: string[]; still_error_mg: { before: number | null; after: number | null } }[];
}
export interface State {
  station: string; version: string; lanes: Lane[]; queue: number[]; virtual_hands: number[]; job: Job;
}
