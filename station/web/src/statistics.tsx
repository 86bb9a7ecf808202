// How the station works: yields, failure codes, capability, gage studies.
import { useEffect, useState } from 'preact/hooks';
import type { SetProblem } from './lock';
import { S } from './strings';
import { ask } from './connection';
import type { GageView, Group, StatisticsView, Studies } from './types';

const T = S.statistics;
const figure = (value: number) => (Math.abs(value) >= 100 ? value.toFixed(0) : value.toPrecision(3));
const index = (value: number) => value.toFixed(Math.abs(value) >= 100 ? 0 : 2);

function Tile({ name, value, small }: { name: string; value: string; small?: string }) {
  return <div class="tile"><span>{name}</span><b>{value}</b><small>{small}</small></div>;
}

function Row({ group, name }: { group: Group; name: string }) {
  return (
    <tr>
      <th scope="row">{name || T.notStated}</th><td>{group.runs}</td><td>{group.units}</td>
      <td>{T.percent(group.yield)} <small>{T.interval(group.yield)}</small></td>
      <td>{T.percent(group.first_pass_yield)} <small>{T.interval(group.first_pass_yield)}</small></td>
      <td>{T.seconds(group.seconds_per_unit.median)}</td>
    </tr>
  );
}

function Codes({ view }: { view: StatisticsView }) {
  const codes = view.all.failure_codes;
  if (!codes.length) return <p>{T.noCodes}</p>;
  return (
    <div class="table"><table>
      <thead><tr><th scope="col">{T.code}</th><th scope="col">{T.times}</th><th scope="col">{T.next}</th></tr></thead>
      <tbody>{codes.map(({ code, runs }) => (
        <tr>
          <th scope="row">{view.codes[code]?.meaning ?? code} <small>{code}</small></th>
          <td class="bar"><svg width="120" height="16" aria-hidden="true"><rect width={Math.max(3, (120 * runs) / codes[0].runs)} height="16" fill="#0b5cad" /></svg> {runs}</td>
          <td>{view.codes[code]?.next_action}</td>
        </tr>
      ))}</tbody>
    </table></div>
  );
}

function Capabilities({ view }: { view: StatisticsView }) {
  const rows = Object.entries(view.capability);
  const title = (name: string) => (view.titles[name] ? T.quantityTitle(view.titles[name]) : name);
  const differ = view.limits_differ.length > 0 && <p>{T.limitsDiffer(view.limits_differ.map(title))}</p>;
  if (!rows.length) return differ || <p>{T.noCapability}</p>;
  return (
    <><div class="table"><table>
      <thead><tr>{[T.quantity, T.n, T.meanOf, T.sd, T.cp, T.cpk].map((each) => <th scope="col">{each}</th>)}</tr></thead>
      <tbody>{rows.map(([name, one]) => (
        <tr>
          <th scope="row">{title(name)}</th>
          <td>{one.n}</td><td>{figure(one.mean)}</td><td>{figure(one.sd)}</td><td>{one.cp === null ? '–' : index(one.cp)}</td>
          <td><b>{index(one.cpk)}</b> <small>{index(one.cpk_interval[0])} – {index(one.cpk_interval[1])}</small></td>
        </tr>
      ))}</tbody>
    </table></div>{differ}</>
  );
}

function Gage({ setProblem }: { setProblem: SetProblem }) {
  const [studies, setStudies] = useState<Studies | null>(null);
  const [study, setStudy] = useState('');
  const [quantity, setQuantity] = useState('zero_offset_mg');
  const [axis, setAxis] = useState('x');
  const [view, setView] = useState<GageView | null>(null);
  useEffect(() => {
    void ask<Studies>('/api/gage-rr').then((answer) => { if (answer.ok) setStudies(answer.data); else setProblem(answer.error); });
  }, []);
  if (!studies?.studies.length) return <p>{T.gageNone}</p>;
  const axes = studies.quantities.find((each) => each.name === quantity)?.axes ?? [''];
  const used = { study: study || studies.studies[0], quantity, axis: axes.includes(axis) ? axis : axes[0] };
  const compute = async () => {
    const answer = await ask<GageView>(`/api/gage-rr?${new URLSearchParams(used)}`);
    setProblem(answer.ok ? null : answer.error);
    setView(answer.ok ? answer.data : null);
  };
  return (
    <>
      <div class="buttons">
        <label>{T.study} <select value={used.study} onChange={(event) => setStudy(event.currentTarget.value)}>{studies.studies.map((each) => <option>{each}</option>)}</select></label>
        <label>{T.quantity} <select value={quantity} onChange={(event) => setQuantity(event.currentTarget.value)}>
          {studies.quantities.map((each) => <option value={each.name}>{T.quantityTitle(each)}</option>)}</select></label>
        {axes[0] !== '' && <label>{T.axis} <select value={used.axis} onChange={(event) => setAxis(event.currentTarget.value)}>{axes.map((each) => <option>{each}</option>)}</select></label>}
        <button type="button" onClick={compute}>{T.compute}</button>
      </div>
      <div role="status">
        {view && (
          <div class={view.usable ? 'result good' : 'result bad'}>
            <p class="verdict small"><b aria-hidden="true">{view.usable ? '✔' : '✖'}</b> {view.usable ? T.gageUsable : T.gageBad}</p>
            <p>{T.gageText(view.grr_percent, view.ndc, view.judgement)}</p>
            <p>{T.gageOf(view.parts, view.operators, view.trials)}</p>
            <div class="table"><table>
              <thead><tr>{[T.source, T.sd, T.share, T.studyShare].map((each) => <th scope="col">{each}</th>)}</tr></thead>
              <tbody>{Object.entries(view.components).map(([name, one]) => (
                <tr><th scope="row">{T.sources[name] ?? name}</th><td>{figure(one.sd)}</td><td>{one.contribution_percent.toFixed(1)}</td><td>{one.study_percent.toFixed(1)}</td></tr>
              ))}</tbody>
            </table></div>
          </div>
        )}
      </div>
    </>
  );
}

export function Statistics({ setProblem }: { setProblem: SetProblem }) {
  const [view, setView] = useState<StatisticsView | null>(null);
  const [question, setQuestion] = useState({ by: '', from: '', to: '' });
  const load = async () => {
    const answer = await ask<StatisticsView>(`/api/statistics?${new URLSearchParams(question)}`);
    setProblem(answer.ok ? null : answer.error);
    if (answer.ok) setView(answer.data);
  };
  useEffect(() => { void load(); }, [question.by, question.from, question.to]);
  const set = (part: Partial<typeof question>) => setQuestion({ ...question, ...part });
  return (
    <div class="files">
      <section aria-labelledby="statistics-title">
        <h2 id="statistics-title">{T.title}</h2>
        <div class="buttons">
          <label>{T.by} <select value={question.by} onChange={(event) => set({ by: event.currentTarget.value })}>
            {Object.entries(T.groups).map(([name, text]) => <option value={name}>{text}</option>)}</select></label>
          <label>{T.from} <input type="date" value={question.from} onChange={(event) => set({ from: event.currentTarget.value })} /></label>
          <label>{T.to} <input type="date" value={question.to} onChange={(event) => set({ to: event.currentTarget.value })} /></label>
          <button type="button" onClick={load}>{T.refresh}</button>
        </div>
        {!view ? <p>…</p> : view.all.runs === 0 ? <p>{T.none}</p> : (
          <>
            <div class="tiles">
              <Tile name={T.yield} value={T.percent(view.all.yield)} small={T.interval(view.all.yield)} />
              <Tile name={T.first} value={T.percent(view.all.first_pass_yield)} small={T.interval(view.all.first_pass_yield)} />
              <Tile name={T.perUnit} value={T.seconds(view.all.seconds_per_unit.median)} />
              <Tile name={T.units} value={String(view.all.units)} small={`${view.all.runs} ${T.runs.toLowerCase()}`} />
            </div>
            {view.groups.length > 0 && (
              <div class="table"><table>
                <thead><tr>{[T.groups[view.by], T.runs, T.units, T.yield, T.first, T.perUnit].map((each) => <th scope="col">{each}</th>)}</tr></thead>
                <tbody>{view.groups.map((group) => <Row group={group} name={group.name} />)}<Row group={view.all} name={T.all} /></tbody>
              </table></div>
            )}
            <p>{T.intervals}</p>
          </>
        )}
      </section>
      {view && view.all.runs > 0 && (
        <>
          <section aria-labelledby="codes-title"><h2 id="codes-title">{T.codes}</h2><Codes view={view} /></section>
          <section aria-labelledby="capability-title"><h2 id="capability-title">{T.capability}</h2><Capabilities view={view} /></section>
        </>
      )}
      <section aria-labelledby="gage-title"><h2 id="gage-title">{T.gage}</h2><Gage setProblem={setProblem} /></section>
    </div>
  );
}
