// What a run came to: the biggest words, what to do, where it is stored, its papers, its numbers.
import { useState } from 'preact/hooks';
import type { SetProblem } from './lock';
import { ask } from './connection';
import { S } from './strings';
import type { Printer, Quantity, Result } from './types';

const GOOD = ['pass', 'conditional_pass'];
// The colour of the pane: good, bad, or (no verdict, stopped, not measured) neither.
export const tone = (verdict: string) =>
  GOOD.includes(verdict) ? 'good' : ['fail', 'conditional_fail'].includes(verdict) ? 'bad' : 'none';

export function Papers({ run, documents }: { run: string; documents: string[] }) {
  const names: [string, string][] = [['certificate.pdf', S.documents.certificate], ['certificate.json', S.documents.json],
    ['certificate.dcc.xml', S.documents.dcc],
    ['label.zpl', S.documents.label], ['report.json', S.documents.report]];
  const there = names.filter(([file]) => documents.includes(file));
  if (!there.length) return null;
  const at = `/api/runs/${run}`;
  return (
    <p class="links">{there.map(([file, text]) => file === 'certificate.pdf'
      ? <><a href={`${at}/${file}`} target="_blank" rel="noopener">{text}</a><a href={`${at}/${file}?download=1`} download>{S.documents.save}</a></>
      : <a href={`${at}/${file}`} download>{text}</a>)}</p>
  );
}

// What became of a run's label, where the station has a printer, and the way to print it again.
export function PrintedLabel({ run, documents, printer, setProblem }: {
  run: string; documents: string[]; printer: Printer | null; setProblem: SetProblem;
}) {
  if (!printer || !documents.includes('label.zpl')) return null;
  const label = printer.labels.find((each) => each.run === run);
  const print = async () => {
    const answer = await ask(`/api/runs/${run}/print`, {});
    setProblem(answer.ok ? null : answer.error);
  };
  return (
    <p class="label">{label && <span role="status">{S.label[label.state](label.problem)}</span>}{' '}
      <button type="button" onClick={() => { void print(); }}>{label ? S.label.again : S.label.print}</button></p>
  );
}

const shown = (value: number) => (Math.abs(value) >= 100 ? value.toFixed(0) : Math.abs(value) >= 1 ? value.toFixed(2) : value.toFixed(3));

function Values({ quantities, coverage, open }: { quantities: Quantity[]; coverage: number; open: boolean }) {
  const T = S.table;
  const [shows, setShows] = useState(open);
  return (
    <details open={open} onToggle={(event) => setShows(event.currentTarget.open)}>
      <summary>{T.title}</summary>
      {shows && <div class="table" tabIndex={0} role="region" aria-label={T.title}>
        <table>
          <thead><tr><th scope="col">{T.quantity}</th><th scope="col">{T.axis}</th><th scope="col">{T.value}</th><th scope="col">{T.limits}</th><th scope="col">{T.uncertainty(coverage)}</th><th scope="col">{T.margin}</th></tr></thead>
          <tbody>{quantities.map((q) => {
            const to = [q.low === null ? Infinity : q.value - q.low, q.high === null ? Infinity : q.high - q.value];
            const margin = Math.min(...to);
            const bad = q.verdict !== 'pass';
            return (
              <tr class={bad ? 'beyond' : ''}>
                <th scope="row">{bad && <b aria-hidden="true">✖ </b>}{q.title}{q.unit && `, ${q.unit}`}</th><td>{q.axis.toUpperCase()}</td><td>{shown(q.value)}</td>
                <td>{T.limit(q.low === null ? '' : shown(q.low), q.high === null ? '' : shown(q.high))}</td>
                <td>{shown(q.expanded_uncertainty)}</td><td>{Number.isFinite(margin) ? shown(margin) : ''}</td>
              </tr>
            );
          })}</tbody>
        </table>
      </div>}
    </details>
  );
}

export function ResultBox({ result, writeNow, printer = null, setProblem }: {
  result: Result; writeNow?: () => void; printer?: Printer | null; setProblem?: SetProblem;
}) {
  const jig = result.kind === 'jig';
  const pane = S.pane(result);
  const kind = tone(result.verdict);
  return (
    <section class={`result ${kind}`} aria-label={S.verdict(result)}>
      <div class="pane">
        <p class="verdict"><b aria-hidden="true">{S.verdictSigns[result.verdict] ?? '?'}</b> {jig ? pane.word : S.verdict(result)}</p>
        {jig && <p class="act">{pane.act}</p>}
        {writeNow && result.can_write && <p><button type="button" class="primary" onClick={writeNow}>{S.writeNow}</button> {S.writeNowText}</p>}
        <p>{result.serial}{jig && result.verdict !== 'refused' && <> · {S.stored(result)}</>}</p>
      </div>
      {result.next_actions && result.next_actions.length > 0 && <p class="todo"><b>{S.todo}:</b> {result.next_actions.join(' ')}</p>}
      {result.reasons.map((reason) => <p>{reason}</p>)}
      {typeof result.residual_mg === 'number' && <p>{S.residual(result.residual_mg, result.as_found_residual_mg ?? null)}</p>}
      {result.repeat_sides && result.repeat_sides.length > 0 && <p>{S.files.repeat(result.repeat_sides)}</p>}
      {result.kind === 'capture' && result.stored && <p>{S.files.saved(result.problem ? '' : `${result.file}.constants.json`)}</p>}
      {result.kind === 'capture' && result.problem && <p>{result.problem}</p>}
      {result.run && <Papers run={result.run} documents={result.documents ?? []} />}
      {result.run && setProblem && <PrintedLabel run={result.run} documents={result.documents ?? []} printer={printer} setProblem={setProblem} />}
      {result.quantities && result.quantities.length > 0 && <Values quantities={result.quantities} coverage={result.coverage_factor ?? 2} open={kind === 'bad'} />}
    </section>
  );
}
