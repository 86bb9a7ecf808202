// At home: a calibration file, and "repair my files".
import { useEffect, useState } from 'preact/hooks';
import { LiveBox, PosePicture } from './box';
import { CaptureSteps, VirtualHand } from './lane';
import { ResultBox } from './result';
import { S } from './strings';
import { ask, client, type Refusal } from './connection';
import { POSES, type State } from './types';

const F = S.files;
type SetProblem = (problem: Refusal | null) => void;

function Capture({ state, setProblem }: { state: State; setProblem: SetProblem }) {
  const [chosen, setChosen] = useState(() => (state.lanes.find((each) => each.capture) ?? state.lanes[0])?.lane ?? 1);
  const lane = state.lanes[chosen - 1];
  const say = async (word: string, body: object = {}) => {
    const answer = await ask(`/api/lanes/${chosen}/${word}`, body);
    setProblem(answer.ok ? null : answer.error);
  };
  const start = async () => {
    const answer = await ask('/api/capture', { lane: chosen });
    setProblem(answer.ok ? null : answer.error);
  };
  return (
    <section aria-labelledby="capture-title">
      <h2 id="capture-title">{F.captureTitle}</h2>
      <p>{F.captureText}</p>
      {state.lanes.length > 1 && (
        <label>{F.captureLane} <select value={chosen} onChange={(event) => setChosen(Number(event.currentTarget.value))}>
          {state.lanes.map((each) => <option value={each.lane}>{S.lane(each.lane)} {each.unit?.serial ?? S.states.absent}</option>)}
        </select></label>
      )}
      {lane?.capture ? (
        <>
          <p class="prompt" role="status">{S.prompt(lane)}</p>
          <div class="pictures">{lane.capture?.side && <figure><figcaption>{S.wantedTitle}: <b>{S.poseText(lane.capture.side)}</b></figcaption><PosePicture pose={lane.capture.side} /></figure>}</div>
          {lane.state !== 'capturing' && <p class="notice bad"><b aria-hidden="true">⚠ </b>{lane.message}. {F.kept}</p>}
          <CaptureSteps lane={lane} say={say} />
          <div class="buttons">{lane.client === client || lane.client === ''
            ? <button type="button" onClick={() => say('stop')}>{F.captureStop}</button>
            : <span>{S.held(lane.operator)} <button type="button" onClick={() => say('take')}>{S.takeOver}</button></span>}</div>
        </>
      ) : lane?.unit ? (
        <>
          <p>{S.unit(lane.unit.serial, lane.unit.firmware)}</p>
          <div class="pictures"><figure><figcaption>{S.nowTitle}</figcaption><LiveBox lane={chosen} text="" /></figure></div>
          <div class="buttons"><button type="button" class="primary" disabled={lane.state !== 'idle' && lane.state !== 'done'} onClick={start}>{F.captureStart}</button></div>
        </>
      ) : <p>{F.captureNone}</p>}
      {lane?.result?.kind === 'capture' && !lane.capture && <ResultBox result={lane.result} />}
      {state.virtual_hands.includes(chosen) && <VirtualHand lane={chosen} setProblem={setProblem} />}
    </section>
  );
}

interface Check {
  file: string; serial: string; usable: boolean; refusal: string[]; reasons: string[]; repeat_sides: string[];
  constants_file: string | null; stored_id: string | null; problem?: string;
}

function CheckFile({ files, reload, setProblem }: { files: string[]; reload: () => void; setProblem: SetProblem }) {
  const [file, setFile] = useState('');
  const [check, setCheck] = useState<Check | null>(null);
  const name = file || files[0] || '';
  const run = async (save: boolean) => {
    const answer = await ask<Check>('/api/check', { file: name, save });
    if (answer.ok) { setCheck(answer.data); setProblem(null); } else { setCheck(null); setProblem(answer.error); }
    if (save) reload();
  };
  return (
    <section aria-labelledby="check-title">
      <h2 id="check-title">{F.checkTitle}</h2>
      <p>{F.checkText}</p>
      {files.length === 0 ? <p>{F.none}</p> : (
        <div class="buttons">
          <label>{F.file} <select value={name} onChange={(event) => { setFile(event.currentTarget.value); setCheck(null); }}>
            {files.map((each) => <option>{each}</option>)}
          </select></label>
          <button type="button" onClick={() => run(false)}>{F.check}</button>
        </div>
      )}
      <div role="status">
        {check && (
          <div class={check.usable ? 'result good' : 'result bad'}>
            <p class="verdict small"><b aria-hidden="true">{check.usable ? '✔' : '✖'}</b> {check.usable ? F.usable : check.refusal.length ? F.cannotHelp : F.notUsable}</p>
            {check.refusal.map((text) => <p>{text}</p>)}
            {check.reasons.map((text) => <p>{text}</p>)}
            {check.refusal.length === 0 && (
              <ul class="sides">{POSES.map((pose) => {
                const missing = check.repeat_sides.includes(pose);
                return <li class={missing ? 'missing' : ''}><PosePicture pose={pose} small />{S.face(pose)}: {missing ? `✖ ${F.sideMissing}` : `✔ ${F.sideOk}`}</li>;
              })}</ul>
            )}
            {check.usable && !check.stored_id && <button type="button" class="primary" onClick={() => run(true)}>{F.save}</button>}
            {check.stored_id && <p>{F.saved(check.constants_file ?? '')} {check.problem}</p>}
          </div>
        )}
      </div>
    </section>
  );
}

function Repair({ state, folders, setProblem }: { state: State; folders: string[]; setProblem: SetProblem }) {
  const [folder, setFolder] = useState('');
  const [output, setOutput] = useState('repaired');
  const job = state.job;
  const start = async () => {
    const answer = await ask('/api/repair', { folder, output });
    setProblem(answer.ok ? null : answer.error);
  };
  const mg = (value: number | null) => (value === null ? '–' : value.toFixed(1));
  return (
    <section aria-labelledby="repair-title">
      <h2 id="repair-title">{F.repairTitle}</h2>
      <p>{F.repairText}</p>
      <div class="buttons">
        <label>{F.folder} <select value={folder} onChange={(event) => setFolder(event.currentTarget.value)}>
          <option value="">{F.thisFolder}</option>
          {folders.map((each) => <option>{each}</option>)}
        </select></label>
        <label>{F.output} <input value={output} maxLength={100} onInput={(event) => setOutput(event.currentTarget.value)} /></label>
        {job.state === 'running'
          ? <button type="button" onClick={() => ask('/api/repair/cancel', {})}>{F.cancel}</button>
          : <button type="button" class="primary" onClick={start}>{F.repair}</button>}
      </div>
      {job.state !== 'none' && (
        <div>
          <p role="status">{F.jobStates[job.state]} {F.progress(job.done, job.total)}{Object.entries(job.summary).map(([name, n]) => `, ${n} ${F.status[name] ?? name}`).join('')}{job.error && `: ${job.error}`}</p>
          <progress max={Math.max(1, job.total)} value={job.done} aria-label={F.progress(job.done, job.total)} />
          {job.files.length > 0 && (
            <div class="table"><table>
              <thead><tr><th scope="col">{F.table.file}</th><th scope="col">{F.table.status}</th><th scope="col">{F.table.before}</th><th scope="col">{F.table.after}</th><th scope="col">{F.table.why}</th></tr></thead>
              <tbody>{job.files.map((row) => (
                <tr class={`status-${row.status}`}><td>{row.input}</td><td>{F.status[row.status] ?? row.status}</td><td>{mg(row.still_error_mg.before)}</td><td>{mg(row.still_error_mg.after)}</td><td>{row.reasons.join('; ')}</td></tr>
              ))}</tbody>
            </table></div>
          )}
        </div>
      )}
    </section>
  );
}

export function Files({ state, setProblem }: { state: State; setProblem: SetProblem }) {
  const [list, setList] = useState<{ folders: string[]; files: { name: string }[] }>({ folders: [], files: [] });
  const reload = async () => {
    const answer = await ask<{ folders: string[]; files: { name: string }[] }>('/api/files?path=');
    if (answer.ok) setList(answer.data); else setProblem(answer.error);
  };
  const captured = state.lanes.map((lane) => lane.result?.file ?? '').join();
  useEffect(() => { void reload(); }, [captured, state.job.state]);
  return (
    <div class="files">
      <Capture state={state} setProblem={setProblem} />
      <CheckFile files={list.files.map((each) => each.name)} reload={reload} setProblem={setProblem} />
      <Repair state={state} folders={list.folders} setProblem={setProblem} />
    </div>
  );
}
