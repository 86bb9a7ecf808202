// The runs of today, and all runs of a unit whose label is scanned.
import { useEffect, useState } from 'preact/hooks';
import { Papers, PrintedLabel, tone } from './result';
import type { SetProblem } from './lock';
import { S } from './strings';
import { ask } from './connection';
import type { State, TodayRun } from './types';

const T = S.today;

export function Today({ state, serial, setSerial, setProblem }: {
  state: State; serial: string; setSerial: (serial: string) => void; setProblem: SetProblem;
}) {
  const [runs, setRuns] = useState<TodayRun[] | null>(null);
  const stored = state.lanes.map((lane) => lane.result?.run ?? '').join();
  useEffect(() => {
    let asked = true;
    // The day of the person who looks, not of Greenwich.
    const midnight = new Date(new Date().setHours(0, 0, 0, 0)).toISOString();
    const query = serial ? `serial=${encodeURIComponent(serial)}` : `from=${encodeURIComponent(midnight)}`;
    void ask<{ runs: TodayRun[] }>(`/api/runs?${query}`).then((answer) => {
      if (!asked) return;
      if (answer.ok) setRuns(answer.data.runs); else setProblem(answer.error);
    });
    return () => { asked = false; };
  }, [serial, stored]);
  const units = new Set((runs ?? []).map((run) => run.serial)).size;
  const passed = new Set((runs ?? []).filter((run) => tone(run.verdict) === 'good').map((run) => run.serial)).size;
  return (
    <div class="files">
      <section aria-labelledby="today-title">
        <h2 id="today-title">{serial ? T.found(serial) : T.title}</h2>
        <p><label>{T.search} <input data-serial value={serial} maxLength={80} spellcheck={false} autocomplete="off" onInput={(event) => setSerial(event.currentTarget.value.trim().toUpperCase())} /></label></p>
        {!runs ? <p>…</p> : !runs.length ? <p>{T.none}</p> : (
          <>
            {!serial && <p class="count">{T.units(units, passed)}</p>}
            <div class="table" tabIndex={0} role="region" aria-label={T.list}>
              <table>
                <thead><tr><th scope="col">{T.table.time}</th><th scope="col">{T.table.serial}</th><th scope="col">{T.table.verdict}</th><th scope="col">{T.table.operator}</th><th scope="col">{T.table.papers}</th></tr></thead>
                <tbody>{runs.map((run) => (
                  <tr>
                    <td>{new Date(run.started).toLocaleString([], serial ? { dateStyle: 'short', timeStyle: 'short' } : { timeStyle: 'short' })}</td>
                    <th scope="row">{run.serial}</th>
                    <td class={`word-${tone(run.verdict)}`}>{S.pane({ kind: 'jig', serial: run.serial, verdict: run.verdict, reasons: [], stored: true, written: run.written }).word}</td>
                    <td>{run.operator}</td>
                    <td><Papers run={run.run} documents={run.documents} /><PrintedLabel run={run.run} documents={run.documents} printer={state.printer} setProblem={setProblem} /></td>
                  </tr>
                ))}</tbody>
              </table>
            </div>
          </>
        )}
      </section>
    </div>
  );
}
