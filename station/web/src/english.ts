// Every English text of the page; the others have its type.
import type { Lane, Pose, Proportion, Result, Signature, Title } from './types';

export const axisOf = (pose: Pose) => pose[1].toUpperCase();
export const faceName = (pose: Pose) =>
  `${pose[0] === '+' ? '+' : '−'}${axisOf(pose)}`;

export type Strings = typeof EN;

export const EN = {
  title: 'Sixpoint station',
  tabs: { jig: 'Jig', today: 'Today', files: 'My files', check: 'Check units', statistics: 'Statistics' } as Record<string, string>,
  language: 'Language',
  sounds: 'Sounds',
  connection: {
    crowded: 'Too many pages of this station are open. This one is a moment late and shows no readings. Close other ones.',
    lost: 'The station does not answer. Is the program still running? Trying again …',
  },
  entry: {
    title: 'Sign this browser in',
    text: 'Open the address that the station printed when it started, or type the code at the end of it. A browser that is signed in shows a new code: "Let another browser in".',
    code: 'Code',
    submit: 'Sign in',
    another: 'Let another browser in',
    next: 'This address works in one browser, for ten minutes:',
  },
  operator: 'Your name',
  pin: {
    title: 'Who works here?',
    name: 'Name', pin: 'PIN', submit: 'Begin',
    here: (name: string, role: string) => `${name} (${role})`,
    out: 'Sign out',
  },
  scan: 'Scan a label',
  scanGo: 'Find',
  lanes: 'Lanes',
  follow: 'Show the lane that waits for me',
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
    // With the unit's old constants an angle may be wrong by 20 degrees: the text gives only the side.
    angle > 30 ? 'on none of its sides' : `${faceName(pose)} side up`,
  nowUnknown: 'not known yet',

  stillness: {
    moving: 'It moves. Let it lie still.',
    settling: 'Coming to rest …',
    dwelling: 'Measuring: do not touch',
    leaving: 'Taken. Turn it.',
    refused: 'Not taken.',
  } as Record<string, string>,

  // What to do next, in the largest letters of the page.
  prompt(lane: Lane): string {
    switch (lane.state) {
      case 'absent': return 'Plug a unit in';
      case 'idle': return lane.scan && !lane.scan.matches ? 'This is not the unit that was scanned' : 'Ready to measure';
      case 'resuming': return lane.capture ? 'Plug the unit in: its recording goes on' : 'Plug the unit in: its run goes on';
      case 'unit_away': return 'The unit is unplugged: plug it in again';
      case 'wrong_unit': return 'Another unit is plugged in';
      case 'capturing': return lane.capture?.side
        ? (lane.capture.placed ? `Let it lie still: ${faceName(lane.capture.side)} side up` : `Lay it down: ${faceName(lane.capture.side)} side up`)
        : 'Recording';
      case 'done': return EN.donePrompt(lane.result);
      case 'running':
        if (lane.run?.phase === 'writing') return 'Writing the constants: do not unplug';
        if (!lane.run?.wanted) return 'Working …';
        return `${lane.run.phase === 'reseating' ? 'Lift it off, put it back: ' : ''}${faceName(lane.run.wanted)} side up`;
    }
  },
  donePrompt: (r: Result | null): string => {
    if (r?.kind === 'capture') {
      return r.verdict === 'pass' ? 'The calibration file is done' : r.file ? 'The calibration file cannot be used' : 'No calibration file was made';
    }
    switch (r?.verdict) {
      case 'refused': return 'Not measured: read why below';
      case 'inconclusive': return 'No verdict: read why below';
      case 'stopped': return 'Stopped: not measured to its end';
      default: return 'This unit is done';
    }
  },
  phase: {
    measuring: 'First round: each of the six sides',
    verifying: 'Second round: each side, reached from another side than before',
    reseating: 'Taken off and put back',
    writing: 'Writing the constants',
    rechecking: 'Checking what was written',
    finished: 'Complete',
  } as Record<string, string>,
  placements: (done: number, of: number) => `${done} of ${of} placements`,
  done: (done: number, of: number) => `${done} of ${of}`,
  elapsed: (elapsed: string, left: string) => `${elapsed} so far${left ? `, about ${left} left` : ''}`,
  minutes: (s: number) => `${Math.floor(s / 60)}:${String(Math.floor(s % 60)).padStart(2, '0')} min`,
  rounds: { faces: 'first round', faces_reversed: 'second round', reseat: 'put back', recheck: 'after writing' } as Record<string, string>,
  refused: (text: string, wanted: Pose | null) => `Not taken: ${text}.${wanted ? ` Now: ${faceName(wanted)} side up.` : ''}`,
  takenPoses: 'Taken so far',

  start: 'Start the measurement',
  again: 'Measure this unit again',
  write: 'Write the constants into the unit',
  undoKey: 'Undo the last placement (Backspace)',
  stop: 'Stop this run',
  stopSure: 'Really stop? What was measured is stored.',
  stopYes: 'Yes, stop',
  stopNo: 'No, go on',
  jigStopped: (why: string) => `The jig stopped: ${why}. Look at it: does the unit sit right, and is no hand in the jig?`,
  jigFree: 'The jig is free: it may turn again',
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
  verdict: (r: Result): string => (r.kind === 'jig' && r.verdict === 'refused' ? 'Not measured' : EN.verdicts[r.verdict] ?? r.verdict),
  verdictSigns: {
    pass: '✔', conditional_pass: '✔?', conditional_fail: '✖?', fail: '✖', inconclusive: '?', stopped: '■', refused: '✖',
  } as Record<string, string>,
  // The biggest words of the page: what came out, and what the hands do next.
  pane: (r: Result): { word: string; act: string } => {
    switch (r.verdict) {
      case 'pass':
      case 'conditional_pass': {
        const word = `${r.verdict === 'pass' ? 'PASS' : 'CONDITIONAL PASS'} - ${r.written ? 'WRITTEN' : 'NOT WRITTEN'}`;
        return { word, act: r.written ? 'Take it out. Next unit.' : 'The unit still holds its old constants.' };
      }
      case 'conditional_fail':
      case 'fail': return {
        word: r.verdict === 'fail' ? 'FAIL' : 'CONDITIONAL FAIL',
        act: `${r.written ? 'The constants were written into it. ' : ''}Put it into the red tray.`,
      };
      case 'inconclusive':
      case 'stopped': {
        const word = r.verdict === 'stopped' ? 'STOPPED' : 'NO VERDICT';
        if (r.written) {
          return { word: `${word} - WRITTEN, NOT CHECKED`, act: 'The unit now holds the new constants, and they were not checked. Measure it again, and write again.' };
        }
        if (r.write_begun) {
          return { word: `${word} - PERHAPS WRITTEN`, act: 'The unit holds its old constants or the new ones: nobody knows which. Measure it again, and write again.' };
        }
        return { word, act: r.verdict === 'stopped' ? 'It was not measured to its end.' : r.next_actions?.length ? 'Do what is written below, then measure it again.' : 'Read why, below.' };
      }
      default: return { word: 'NOT MEASURED', act: 'Read why, below.' };
    }
  },
  writeNow: 'Write now',
  writeNowText: 'Writes these constants into the unit, reads them back, and measures two sides again.',
  lastUnit: (r: Result) => `Last unit: ${r.serial}, ${EN.pane(r).word}`,
  table: {
    title: 'Measured values and limits',
    quantity: 'Quantity', axis: 'Axis', value: 'Value', limits: 'Limits', uncertainty: (k: number) => `U (k = ${k})`, margin: 'Margin',
    limit: (low: string, high: string) => (low && high ? `${low} to ${high}` : low ? `from ${low}` : high ? `up to ${high}` : 'none'),
  },
  residual: (after: number, before: number | null) =>
    `Error of the new constants, on readings that they were not made from: ${after.toFixed(1)} mg${before === null ? '' : ` (of those that the unit had: ${before.toFixed(0)} mg)`}`,
  stored: (r: Result) => r.stored ? `Stored as run ${(r.run ?? '').slice(0, 12)}`
    : r.kept_here ? `Kept here as run ${(r.run ?? '').slice(0, 12)}; it will be sent when the store answers` : r.problem ?? 'Storing …',
  todo: 'What to do',
  documents: { certificate: 'Certificate (PDF)', json: 'Certificate (JSON)', dcc: 'Certificate (DCC)', label: 'Label (ZPL)', report: 'Report (JSON)', save: 'Save the PDF' },
  label: {
    waiting: (why: string) => `Label: waiting for the printer${why ? ` (${why})` : ''}`,
    printed: (_why: string) => 'Label: printed',
    unconfirmed: (_why: string) => 'Label: sent; the printer did not confirm it. Look there, and print it again if it is missing.',
    print: 'Print the label', again: 'Print label again',
  },
  unit: (serial: string, firmware: string) => `${serial}, firmware ${firmware}`,

  today: {
    title: 'Runs of this station today',
    search: 'Serial number, or scan a label',
    found: (serial: string) => `All runs of ${serial}`,
    none: 'No run yet.',
    list: 'List of runs',
    units: (n: number, passed: number) => `${n} ${n === 1 ? 'unit' : 'units'} today, ${passed} passed`,
    table: { time: 'Time', serial: 'Unit', verdict: 'Verdict', operator: 'Operator', papers: 'Papers' },
  },
  jigDue: (date: string, over: boolean, signedBy: string) => (!over ? `Jig due for calibration on ${date}`
    : signedBy ? `The jig was due for calibration on ${date}: ${signedBy} signed that it is used all the same`
      : `The jig was due for calibration on ${date}: nothing is measured until it is calibrated, or an engineer signs (--jig-exception)`),
  lock: {
    title: 'Station locked',
    text: 'A check unit is out of control. Until an engineer signs, only check units are measured here.',
    knownBad: (unit: string, codes: string[]) => `In each shift ${unit} must fail with ${codes.join(', ')}.`,
    next: (units: string[]) => `Measure a check unit again (${units.join(', ')}) and look at its charts.`,
    sign: 'Sign as engineer',
    signTitle: 'Engineer\'s signature',
    name: 'Engineer\'s name',
    reason: 'What was found and done',
    newBaseline: 'The jig was changed: begin new charts',
    submit: 'Sign: the station may go on',
    cancel: 'Not now',
    prompt: 'Station locked: check units only',
    checkUnit: 'Check unit',
    problem: (text: string) => `The check units cannot be asked now: ${text}`,
  },
  check: {
    title: 'Check units of this station',
    text: (runs: number) => `A check unit stays at the station and is measured like any other unit. After ${runs} runs its charts count: from then on a point out of control locks the station.`,
    open: 'In control: the station is open',
    none: 'This station has no check unit yet.',
    noRuns: 'No check unit was measured at this station yet.',
    signed: (s: Signature) => `Last signature: ${s.operator}, ${s.made_at.slice(0, 16).replace('T', ' ')}: ${s.reason}${s.new_baseline ? ' (new charts begun)' : ''}`,
    change: 'Add a check unit, or remove one',
    serial: 'Serial number',
    name: 'Who decides',
    reason: 'Why',
    add: 'This is a check unit',
    remove: 'It is no longer a check unit',
    done: 'Recorded.',
    chart: (title: string, serial: string) => `${title}: check unit ${serial}`,
    label: (title: string, serial: string, points: number, last: string, limits: string, signals: number) =>
      `${title} of check unit ${serial}: ${points} points, the last ${last}${limits}${signals ? `, ${signals} signals` : ''}`,
    within: (low: string, high: string) => `, limits ${low} and ${high}`,
    tooFew: (points: number, runs: number) => `${points} of ${runs} runs until limits can be computed`,
    inControl: 'in control',
    outOfControl: 'out of control',
    shown: 'shown, does not lock',
    locks: 'locks the station',
    signal: (point: number, time: string, rule: number, meaning: string) =>
      `Point ${point} (${time.slice(0, 16).replace('T', ' ')}), rule ${rule}: ${meaning}`,
    charts: 'Control charts',
    upper: '+3σ', lower: '−3σ', mean: 'mean', range: 'moving range', rangeLimit: 'limit', baseline: 'baseline',
    legend: 'A square with a number: the point breaks the one of Nelson\'s rules that has this number.',
  },
  statistics: {
    title: 'Statistics',
    by: 'Compare by',
    groups: { '': 'nothing', station: 'station', jig: 'jig', operator: 'operator', firmware: 'firmware' } as Record<string, string>,
    from: 'From', to: 'Before',
    refresh: 'Compute again',
    none: 'No runs were stored yet.',
    all: 'all', notStated: 'not stated',
    yield: 'Yield', first: 'First-pass yield', perUnit: 'Time per unit', runs: 'Runs', units: 'Units',
    percent: (p: Proportion) => p.value === null ? '–' : `${(100 * p.value).toFixed(1)} %`,
    interval: (p: Proportion) => p.value === null ? '' : `${p.count} of ${p.of}; ${(100 * p.interval[0]).toFixed(0)} to ${(100 * p.interval[1]).toFixed(0)} %`,
    intervals: 'Small figures: counts and the 95 % interval. Time: median of all runs of a unit together.',
    seconds: (s: number | null) => s === null ? '–' : s < 120 ? `${s.toFixed(0)} s` : `${(s / 60).toFixed(1)} min`,
    codes: 'Why units did not pass',
    noCodes: 'No run failed.',
    code: 'Failure code', times: 'Runs', next: 'What to do',
    capability: 'Capability',
    quantity: 'Quantity', n: 'Units', meanOf: 'Mean', sd: 'SD', cp: 'Cp', cpk: 'Cpk (95 % interval)',
    noCapability: 'Too few units for capability.',
    limitsDiffer: (names: string[]) => `No Cpk, for units were judged by different limits: ${names.join('; ')}.`,
    quantityTitle: (t: Title) => `${t.title}${t.axis ? ` ${t.axis}` : ''}${t.unit ? `, ${t.unit}` : ''}`,
    gage: 'Gage study (R&R)',
    gageNone: 'The store has no gage study. Measure one with: sixpoint jig --study NAME --operator WHO',
    study: 'Study', axis: 'Axis', compute: 'Compute',
    gageUsable: 'The gage can be used', gageBad: 'The gage cannot be used',
    gageText: (grr: number, ndc: number, judgement: string) => `${grr.toFixed(1)} % of the total variation, ${ndc} distinct categories: ${judgement}`,
    gageOf: (parts: number, operators: number, trials: number) => `${parts} parts, ${operators} operators, ${trials} trials`,
    source: 'Source', share: 'Share of variance, %', studyShare: '% of study variation',
    sources: {
      grr: 'Gage R&R', repeatability: 'Repeatability', reproducibility: 'Reproducibility', operator: 'Operator',
      'part x operator': 'Part × operator', part: 'Part to part', total: 'Total',
    } as Record<string, string>,
  },

  problemLog: (text: string) => `Problem: ${text}`,
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
    captureStop: 'Stop recording',
    kept: 'What was recorded is kept. The side that was just being recorded is asked for again.',
    placed: 'It lies there',
    sideOf: (n: number, of: number) => `Side ${n} of ${of}`,
    rest: (s: number) => `Do not touch it for ${s} s`,
    next: 'Turning the unit …',
    checkTitle: '2. Or check a file that you have',
    checkText: 'A calibration file that was recorded without this program: is every side in it?',
    check: 'Check',
    save: 'Save its constants',
    saved: (file: string) => file ? `Constants saved in ${file} and in the store.` : 'Constants saved in the store.',
    usable: 'This file can be used: every side is in it.',
    notUsable: 'This file cannot be used yet.',
    again: (sides: Pose[]) => `The unit did not lie still for long enough on ${sides.map(faceName).join(', ')}: it moved, or lay on another side. Only ${sides.length === 1 ? 'this side is' : 'these sides are'} asked for again; the others are kept.`,
    repeat: (sides: string[]) => `Repeat ${sides.length === 1 ? 'this side' : 'these sides'}: ${sides.join(', ')}`,
    sideOk: 'recorded', sideMissing: 'repeat',
    cannotHelp: 'A recording of this unit cannot help.',
    repairTitle: '3. Repair my files',
    repairText: 'Every affected recording of the folder is repaired into another folder. Your originals are not changed.',
    folder: 'Folder with recordings',
    thisFolder: 'this folder',
    output: 'Folder for repaired files',
    repair: 'Repair my files',
    cancel: 'Stop after this file',
    progress: (done: number, total: number) => `${done} of ${total} files`,
    status: {
      repaired: 'repaired', not_affected: 'not affected', not_repairable: 'cannot be repaired yet',
      already_repaired: 'repaired before', outdated: 'outdated', failed: 'failed',
    } as Record<string, string>,
    jobStates: { running: 'Working …', done: 'Done.', cancelled: 'Stopped.', failed: 'It did not work.' } as Record<string, string>,
    table: { file: 'File', status: 'Result', before: 'Error before, mg', after: 'after, mg', why: 'Why' },
    none: 'No .gt3x files here.',
    file: 'File',
  },
};
