// Every English text of the page.
import type { Lane, Pose, Result } from './types';

const axisOf = (pose: Pose) => pose[1].toUpperCase();
export const faceName = (pose: Pose) =>
  `${pose[0] === '+' ? '+' : '−'}${axisOf(pose)}`;

export const S = {
  title: 'Sixpoint station',
  tabs: { jig: 'Jig', files: 'My files' },
  connection: {
    live: 'Connected',
    lost: 'The station does not answer. Is the program still running? Trying again …',
  },
  operator: 'Your name',
  scan: 'Scan or type a serial number',
  scanGo: 'Find',
  lanes: 'Lanes',
  follow: 'Show the lane that needs a hand',
  lane: (n: number) => `Lane ${n}`,
  traces: 'Readings of the last six seconds, in g',
  axis: (name: string, g: string) => `${name} ${g} g`,

  face: faceName,
  poseText: (pose: Pose) => `${axisOf(pose)} axis ${pose[0] === '+' ? 'up' : 'down'}`,
  poseLabel: (pose: Pose) => `The unit with its ${faceName(pose)} side up`,
  boxLive: (text: string) => `How the unit lies now: ${text}`,
  wantedTitle: 'Turn it to',
  nowTitle: 'It lies',
  nowFace: (pose: Pose, angle: number) =>
    // By the unit's old constants an angle may be wrong by 20 degrees: only what is certain is said.
    angle > 30 ? 'on none of its sides' : `${faceName(pose)} side up`,
  nowUnknown: 'unknown yet',

  stillness: {
    moving: 'Moving. Let it rest.',
    settling: 'Settling …',
    dwelling: 'Measuring: do not touch',
    leaving: 'Taken. Turn it.',
  } as Record<string, string>,

  // What to do next, the biggest words on the page.
  prompt(lane: Lane): string {
    switch (lane.state) {
      case 'absent': return 'Plug a unit in';
      case 'idle': return lane.scan && !lane.scan.matches ? 'This is not the unit that was scanned' : 'Ready to measure';
      case 'resuming': return 'Plug the unit in: its run goes on';
      case 'unit_away': return 'The unit is unplugged: plug it in again';
      case 'wrong_unit': return 'Another unit is plugged in';
      case 'capturing': return lane.capture?.side
        ? (lane.capture.placed ? `Let it rest on ${faceName(lane.capture.side)} side up` : `Lay it down: ${faceName(lane.capture.side)} side up`)
        : 'Recording';
      case 'done': return lane.result?.kind === 'capture' ? 'The calibration file is done' : 'Take the unit out. The next one, please.';
      case 'running':
        if (lane.run?.phase === 'writing') return 'Writing the constants: do not unplug';
        if (!lane.run?.wanted) return 'Working …';
        return `${lane.run.phase === 'reseating' ? 'Lift it off, put it back: ' : ''}${faceName(lane.run.wanted)} side up`;
    }
  },
  phase: {
    measuring: 'First round: each of the six sides',
    verifying: 'Second round: from the other side',
    reseating: 'Taken off and put back',
    writing: 'Writing the constants',
    rechecking: 'Checking what was written',
    finished: 'Complete',
  } as Record<string, string>,
  placements: (done: number, of: number) => `${done} of ${of} placements`,
  rounds: { faces: 'first round', faces_reversed: 'second round', reseat: 'put back', recheck: 'after writing' } as Record<string, string>,
  refused: (text: string) => `Not taken: ${text}. Once more, please.`,
  takenPoses: 'Taken so far',

  start: 'Start the measurement',
  again: 'Measure this unit again',
  write: 'Write the constants into the unit',
  undo: 'Undo the last one',
  undoKey: 'Undo the last one (Backspace)',
  stop: 'Stop this run',
  stopSure: 'Really stop? What was measured is kept.',
  stopYes: 'Yes, stop',
  stopNo: 'No, go on',
  held: (who: string) => `${who || 'Someone else'} is at work on this lane.`,
  takeOver: 'Take this lane over',
  scanned: (serial: string, ok: boolean) => ok ? `Label ${serial}: matches` : `Label ${serial}: does not match this unit`,

  states: {
    absent: 'empty', idle: 'ready', resuming: 'waiting', running: 'running', unit_away: 'unplugged',
    wrong_unit: 'wrong unit', capturing: 'recording', done: 'done',
  } as Record<string, string>,
  verdicts: {
    pass: 'Pass', conditional_pass: 'Conditional pass', conditional_fail: 'Conditional fail', fail: 'Fail',
    inconclusive: 'No verdict', stopped: 'Stopped', refused: 'Cannot help',
  } as Record<string, string>,
  verdictSigns: {
    pass: '✔', conditional_pass: '✔?', conditional_fail: '✖?', fail: '✖', inconclusive: '?', stopped: '■', refused: '✖',
  } as Record<string, string>,
  residual: (after: number, before: number | null) =>
    before === null ? `${after.toFixed(1)} mg off on sides that were not fitted`
      : `${after.toFixed(1)} mg off on sides that were not fitted (as found: ${before.toFixed(0)} mg)`,
  stored: (r: Result) => r.stored ? `Stored as run ${(r.run ?? '').slice(0, 12)}` : r.problem ?? 'Storing …',
  documents: { certificate: 'Certificate (PDF)', json: 'Certificate (JSON)', label: 'Label (ZPL)', report: 'Report (JSON)' },
  unit: (serial: string, firmware: string) => `${serial}, firmware ${firmware}`,
  low: (mv: number) => `Battery ${(mv / 1000).toFixed(2)} V`,

  hand: {
    title: 'Practice: this unit is virtual. Turn it here.',
    tilt: 'next one tilted 7.2°', lean: 'Lean on an edge', knock: 'Knock', unplug: 'Unplug', plug: 'Plug in', swap: 'Swap for another',
  },

  files: {
    captureTitle: '1. Record a calibration file',
    captureText: 'Plug your unit in. It records while it lies on each of its six sides, one after the other, on a table that does not move. That takes about five minutes. The file is checked and the constants are saved.',
    captureLane: 'Unit',
    captureStart: 'Start recording',
    captureNone: 'No unit is plugged in.',
    placed: 'It lies there',
    sideOf: (n: number, of: number) => `Side ${n} of ${of}`,
    rest: (s: number) => `Leave it alone for ${s} s`,
    next: 'Turning the unit …',
    checkTitle: '2. Or check a file that you have',
    checkText: 'A calibration file that was recorded without this program: is every side in it?',
    check: 'Check',
    save: 'Save its constants',
    saved: (file: string) => `Constants saved in ${file} and in the store.`,
    usable: 'This file can be used: every side is in it.',
    notUsable: 'This file cannot be used yet.',
    repeat: (sides: string[]) => `Repeat ${sides.length === 1 ? 'this side' : 'these sides'}: ${sides.join(', ')}`,
    sideOk: 'recorded', sideMissing: 'repeat',
    cannotHelp: 'A recording of this unit cannot help.',
    repairTitle: '3. Repair my files',
    repairText: 'Every affected recording of the folder is mended into another folder. Your originals stay as they are.',
    folder: 'Folder with recordings',
    thisFolder: 'this folder',
    output: 'Folder for mended files',
    repair: 'Repair my files',
    cancel: 'Stop after this file',
    progress: (done: number, total: number) => `${done} of ${total} files`,
    status: {
      repaired: 'repaired', not_affected: 'not affected', not_repairable: 'cannot be repaired yet',
      already_repaired: 'repaired before', failed: 'failed',
    } as Record<string, string>,
    jobStates: { running: 'Working …', done: 'Done.', cancelled: 'Stopped.', failed: 'It did not work.' } as Record<string, string>,
    table: { file: 'File', status: 'Result', before: 'Error before, mg', after: 'after, mg', why: 'Why' },
    none: 'No .gt3x files here.',
    file: 'File',
  },
};
