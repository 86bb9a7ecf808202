// What the station says (docs/station.md).
export type Pose = '+x' | '-x' | '+y' | '-y' | '+z' | '-z';
export const POSES: Pose[] = ['+z', '-z', '+x', '-x', '+y', '-y'];

export interface Run {
  phase: string; wanted: Pose | null; prompt: string; open: Pose[];
  taken: { round: string; pose: Pose; tilt_deg: number }[];
  of: number; refusals: number; last_refusal: string; waiting_since_ms: number; started_ms: number;
}
export interface Result {
  kind: 'jig' | 'capture'; serial: string; verdict: string; reasons: string[]; stored: boolean;
  residual_mg?: number | null; as_found_residual_mg?: number | null; run?: string; constants_id?: string | null;
  kept_here?: boolean; documents?: string[]; can_write?: boolean; quantities?: Quantity[];
  problem?: string; file?: string; repeat_sides?: string[]; written?: boolean; write_begun?: boolean; next_actions?: string[];
  coverage_factor?: number;
}
export interface Me { operators: string[]; operator: { name: string; role: string } | null }
export interface Quantity {
  name: string; title: string; unit: string; axis: string; value: number; expanded_uncertainty: number;
  low: number | null; high: number | null; verdict: string;
}
export interface TodayRun {
  run: string; serial: string; started: string; verdict: string; operator: string; written: boolean; documents: string[];
}
export interface Lane {
  lane: number; device: string; message: string; turns_by_itself: boolean; jig_fault: string | null;
  state: 'absent' | 'idle' | 'resuming' | 'running' | 'unit_away' | 'wrong_unit' | 'capturing' | 'done';
  unit: { serial: string; firmware: string; model: string; battery_mv: number } | null;
  scan: { serial: string; matches: boolean } | null;
  operator: string; client: string; write: boolean; run: Run | null; result: Result | null;
  capture: { side: Pose | null; number: number; of: number; placed: boolean; until_ms: number; side_s: number; again: Pose[] } | null;
  log: { id: number; kind: string; text: string; at_ms: number }[];
}
export interface Live { stillness: string; dwell: number; face: Pose | null; angle_deg: number | null }
export interface Job {
  state: string; done: number; total: number; current: string; error: string; summary: Record<string, number>;
  files: { input: string; status: string; reasons: string[]; still_error_mg: { before: number | null; after: number | null } }[];
}
export interface Signature { made_at: string; operator: string; reason: string; new_baseline: boolean }
export interface Lock { locked: boolean; reasons: string[]; check_units: string[]; known_bad?: Record<string, string[]>; signature: Signature | null; problem: string }
export interface Label { run: string; serial: string; state: 'waiting' | 'printed' | 'unconfirmed'; problem: string; failures: number }
export interface Printer { printer: string; labels: Label[] }
export interface State {
  station: string; version: string; write_default: boolean; jig_due: string | null; jig_over: boolean; jig_exception: { reason: string; signed_by: string } | null; lanes: Lane[]; queue: number[]; virtual_hands: number[]; job: Job; lock: Lock | null; printer: Printer | null;
}

export interface Title { name: string; title: string; unit: string; axis?: string }
export interface Chart {
  serial: string; name: string; in_force: boolean; baseline: number; centre: number; sigma: number; lower: number; upper: number;
  mean_range: number; upper_range: number; values: number[]; times: string[];
  signals: { point: number; rule: number; meaning: string }[];
}
export interface CheckUnitsView extends Lock {
  charts: Chart[]; titles: Record<string, Title>; baseline_runs: number; locking_rules: number[];
}
export interface Proportion { count: number; of: number; value: number | null; interval: [number, number] }
export interface Group {
  name: string; runs: number; units: number; yield: Proportion; first_pass_yield: Proportion;
  failure_codes: { code: string; runs: number }[]; seconds_per_unit: { median: number | null };
}
export interface Capability {
  n: number; mean: number; sd: number; cp: number | null; cpk: number; cpk_interval: [number, number];
}
export interface StatisticsView {
  by: string; all: Group; groups: Group[]; capability: Record<string, Capability>; limits_differ: string[];
  titles: Record<string, Title>;
  codes: Record<string, { meaning: string; cause: string; next_action: string }>;
}
export interface Studies { studies: string[]; quantities: (Title & { axes: string[] })[] }
export interface GageView {
  study: string; quantity: string; axis: string; parts: number; operators: number; trials: number; grr_percent: number; ndc: number;
  judgement: string; usable: boolean; pooled: boolean;
  components: Record<string, { variance: number; sd: number; contribution_percent: number; study_percent: number }>;
}
