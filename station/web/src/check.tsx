// Check units: who they are, and their control charts (individuals and moving range).
import { useEffect, useState } from 'preact/hooks';
import { SignForm, type SetProblem } from './lock';
import { S } from './strings';
import { ask } from './connection';
import type { Chart, CheckUnitsView, State, Title } from './types';

const C = S.check;
const LEFT = 70, RIGHT = 670, TOP = 16, BOTTOM = 196, RANGE_TOP = 226, RANGE_BOTTOM = 296;

function ChartPicture({ chart, title }: { chart: Chart; title: string }) {
  const { values } = chart;
  const ranges = values.slice(1).map((value, i) => Math.abs(value - values[i]));
  let low = Math.min(...values, ...(chart.in_force ? [chart.lower] : []));
  let high = Math.max(...values, ...(chart.in_force ? [chart.upper] : []));
  const margin = high > low ? 0.08 * (high - low) : 1;
  low -= margin;
  high += margin;
  const most = 1.1 * Math.max(...ranges, chart.in_force ? chart.upper_range : 0) || 1;
  const places = Math.min(6, Math.max(0, 2 - Math.floor(Math.log10(high - low))));
  const text = (value: number) => value.toFixed(places);
  const x = (i: number) => (values.length < 2 ? (LEFT + RIGHT) / 2 : LEFT + ((RIGHT - LEFT) * i) / (values.length - 1));
  const y = (value: number) => BOTTOM - ((BOTTOM - TOP) * (value - low)) / (high - low);
  const rangeY = (value: number) => RANGE_BOTTOM - ((RANGE_BOTTOM - RANGE_TOP) * value) / most;
  const points = (list: number[], at: (value: number) => number, first: number) => list.map((value, i) => `${x(i + first).toFixed(1)},${at(value).toFixed(1)}`).join(' ');
  const level = (at: number, name: string, value: number, dashed: boolean, label = at) => (
    <>
      <line x1={LEFT} x2={RIGHT} y1={at} y2={at} stroke="#56636e" stroke-dasharray={dashed ? '8 5' : undefined} />
      <text x={RIGHT + 6} y={label + 5}>{name} {text(value)}</text>
    </>
  );
  const middle = Math.min(BOTTOM - 18, Math.max(TOP + 18, y(chart.centre)));  // labels keep apart
  const edge = chart.in_force ? (x(chart.baseline - 1) + x(Math.min(chart.baseline, values.length - 1))) / 2 : 0;
  // Round numbers, four to eight of them.
  const rough = (high - low) / 4;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = power * (rough / power >= 5 ? 5 : rough / power >= 2 ? 2 : 1);
  const first = Math.ceil(low / step);
  const ticks = Array.from({ length: Math.floor(high / step) - first + 1 }, (_, i) => (first + i) * step);
  const rules = (i: number) => chart.signals.filter((signal) => signal.point === i).map((signal) => signal.rule).join(',');
  const last = values[values.length - 1];
  return (
    <svg class="chart" viewBox="0 0 800 320" role="img" aria-label={C.label(title, chart.serial, values.length, text(last),
      chart.in_force ? C.within(text(chart.lower), text(chart.upper)) : '', chart.signals.length)}>
      {chart.in_force && (
        <>
          <rect x={LEFT} y={TOP} width={edge - LEFT} height={BOTTOM - TOP} fill="#e8edf1" />
          <text x={LEFT + 4} y={TOP + 15}>{C.baseline}</text>
          {level(y(chart.upper), C.upper, chart.upper, true, Math.min(y(chart.upper), middle - 18))}
          {level(y(chart.centre), C.mean, chart.centre, false, middle)}
          {level(y(chart.lower), C.lower, chart.lower, true, Math.max(y(chart.lower), middle + 18))}
          {level(rangeY(chart.upper_range), C.rangeLimit, chart.upper_range, true)}
        </>
      )}
      {ticks.map((value) => (
        <>
          <line x1={LEFT - 5} x2={LEFT} y1={y(value)} y2={y(value)} stroke="#56636e" />
          <text x={LEFT - 8} y={y(value) + 6} text-anchor="end">{text(value)}</text>
        </>
      ))}
      <line x1={LEFT} x2={LEFT} y1={TOP} y2={BOTTOM} stroke="#56636e" />
      <polyline points={points(values, y, 0)} fill="none" stroke="#0b5cad" stroke-width="2" />
      <polyline points={points(ranges, rangeY, 1)} fill="none" stroke="#0b5cad" stroke-width="2" />
      <line x1={LEFT} x2={RIGHT} y1={RANGE_BOTTOM} y2={RANGE_BOTTOM} stroke="#56636e" />
      <text x="0" y={RANGE_TOP - 6}>{C.range}</text>
      {values.map((value, i) => (rules(i)
        ? <><rect x={x(i) - 7} y={y(value) - 7} width="14" height="14" fill="#a3190c" /><text class="rule" x={x(i)} y={y(value) < TOP + 24 ? y(value) + 24 : y(value) - 11} text-anchor="middle">{rules(i)}</text></>
        : <circle cx={x(i)} cy={y(value)} r="4" fill="#0b5cad" />))}
      <text x={LEFT} y="316">{chart.times[0]?.slice(0, 10)}</text>
      <text x={RIGHT} y="316" text-anchor="end">{chart.times[values.length - 1]?.slice(0, 10)}</text>
    </svg>
  );
}

function ChartFigure({ chart, view }: { chart: Chart; view: CheckUnitsView }) {
  const info: Title = view.titles[chart.name] ?? { name: chart.name, title: chart.name, unit: '' };
  const title = S.statistics.quantityTitle(info);
  const bad = chart.signals.length > 0;
  return (
    <figure class="control">
      <figcaption>{C.chart(title, chart.serial)}: <b class={bad ? 'word-bad' : 'word-good'}>
        {!chart.in_force ? C.tooFew(chart.values.length, view.baseline_runs) : bad ? `✖ ${C.outOfControl}` : `✔ ${C.inControl}`}</b></figcaption>
      <ChartPicture chart={chart} title={title} />
      {bad && (
        <ul>{chart.signals.slice(-4).map((signal) => (
          <li>{C.signal(signal.point + 1, chart.times[signal.point] ?? '', signal.rule, signal.meaning)} ({view.locking_rules.includes(signal.rule) ? C.locks : C.shown})</li>
        ))}</ul>
      )}
    </figure>
  );
}

function Designate({ units, setProblem, done }: { units: string[]; setProblem: SetProblem; done: () => void }) {
  const [serial, setSerial] = useState('');
  const [name, setName] = useState('');
  const [reason, setReason] = useState('');
  const [said, setSaid] = useState('');
  const decide = async (action: string) => {
    const answer = await ask('/api/check-units', { serial: serial.trim().toUpperCase(), action, operator: name.trim(), reason: reason.trim() });
    setProblem(answer.ok ? null : answer.error);
    setSaid(answer.ok ? `${serial.trim().toUpperCase()}: ${C.done}` : '');
    if (answer.ok) { setSerial(''); setReason(''); done(); }
  };
  const ready = serial.trim() && name.trim() && reason.trim();
  return (
    <form class="sign" aria-labelledby="designate-title" onSubmit={(event) => { event.preventDefault(); if (ready) void decide('add'); }}>
      <h3 id="designate-title">{C.change}</h3>
      <label>{C.serial} <input data-serial value={serial} maxLength={16} list="plugged-in" spellcheck={false} autocomplete="off" onInput={(event) => setSerial(event.currentTarget.value)} /></label>
      <datalist id="plugged-in">{units.map((each) => <option value={each} />)}</datalist>
      <label>{C.name} <input value={name} maxLength={60} autocomplete="off" onInput={(event) => setName(event.currentTarget.value)} /></label>
      <label class="wide">{C.reason} <input value={reason} maxLength={190} autocomplete="off" onInput={(event) => setReason(event.currentTarget.value)} /></label>
      <div class="buttons">
        <button type="submit" disabled={!ready}>{C.add}</button>
        <button type="button" disabled={!ready} onClick={() => decide('remove')}>{C.remove}</button>
        <span role="status">{said}</span>
      </div>
    </form>
  );
}

export function CheckUnits({ state, setProblem }: { state: State; setProblem: SetProblem }) {
  const [view, setView] = useState<CheckUnitsView | null>(null);
  const load = async () => {
    const answer = await ask<CheckUnitsView>('/api/check-units');
    if (answer.ok) setView(answer.data); else setProblem(answer.error);
  };
  // A run that was stored may have added a point.
  const stored = state.lanes.map((lane) => (lane.result?.stored ? lane.result.run : '')).join();
  useEffect(() => { void load(); }, [stored, state.lock]);
  if (!view) return <p>…</p>;
  const units = state.lanes.flatMap((lane) => (lane.unit ? [lane.unit.serial] : []));
  return (
    <div class="files">
      <section aria-labelledby="check-units-title">
        <h2 id="check-units-title">{C.title}</h2>
        <p>{C.text(view.baseline_runs)}</p>
        {!view.locked && <p class="notice good"><b aria-hidden="true">✔ </b>{C.open}</p>}
        <p class="chips">{view.check_units.length ? view.check_units.map((unit) => <b>{unit}</b>) : C.none}</p>
        {Object.entries(view.known_bad ?? {}).map(([unit, codes]) => <p>{S.lock.knownBad(unit, codes)}</p>)}
        {view.signature && <p>{C.signed(view.signature)}</p>}
        <Designate units={units} setProblem={setProblem} done={load} />
        {!view.locked && view.charts.length > 0 && <details><summary>{S.lock.signTitle}</summary><SignForm setProblem={setProblem} done={load} /></details>}
      </section>
      <section class="charts" aria-label={C.charts}>
        {view.charts.length ? view.charts.map((chart) => <ChartFigure chart={chart} view={view} />) : <p>{C.noRuns}</p>}
        {view.charts.length > 0 && <p>{C.legend}</p>}
      </section>
    </div>
  );
}
