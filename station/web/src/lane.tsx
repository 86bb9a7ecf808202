// One lane in front, and all lanes as cards.
import { useEffect, useState } from 'preact/hooks';
import { LiveBox, PosePicture } from './box';
import { ResultBox, tone } from './result';
import { S } from './strings';
import { useSounds } from './sounds';
import { ask, client, type Refusal } from './connection';
import { Spark, TraceChart } from './traces';
import { POSES, type Lane, type Live, type Lock, type Pose, type Printer, type State } from './types';

const BUSY = ['running', 'unit_away', 'wrong_unit', 'resuming', 'capturing'];

// For practice without hardware: buttons turn and unplug a virtual unit.
export function VirtualHand({ lane, setProblem }: { lane: number; setProblem: (problem: Refusal | null) => void }) {
  const [tilt, setTilt] = useState(false);
  const hand = async (body: object) => {
    const answer = await ask(`/api/lanes/${lane}/hand`, body);
    setProblem(answer.ok ? null : answer.error);
  };
  return (
    <section class="hand" aria-label={S.hand.title}>
      <h3>{S.hand.title}</h3>
      <div class="buttons">
        {POSES.map((pose) => (
          <button type="button" onClick={() => { void hand({ do: 'turn', pose, tilt_deg: tilt ? 7.2 : 0 }); setTilt(false); }}>{S.face(pose)}</button>
        ))}
        <label class="check"><input type="checkbox" checked={tilt} onChange={(event) => setTilt(event.currentTarget.checked)} /> {S.hand.tilt}</label>
        <button type="button" onClick={() => hand({ do: 'lean' })}>{S.hand.lean}</button>
        <button type="button" onClick={() => hand({ do: 'knock' })}>{S.hand.knock}</button>
        <button type="button" onClick={() => hand({ do: 'unplug' })}>{S.hand.unplug}</button>
        <button type="button" onClick={() => hand({ do: 'plug' })}>{S.hand.plug}</button>
        <button type="button" onClick={() => hand({ do: 'swap' })}>{S.hand.swap}</button>
      </div>
    </section>
  );
}

// Milliseconds since 1970, anew after each `step_ms`.
function useNow(step_ms: number): number {
  const [now, setNow] = useState(Date.now());
  useEffect(() => {
    const timer = setInterval(() => setNow(Date.now()), step_ms);
    return () => clearInterval(timer);
  }, [step_ms]);
  return now;
}

function nowText(live: Live | undefined): string {
  return live?.face ? S.nowFace(live.face, live.angle_deg ?? 0) : S.nowUnknown;
}

function Placements({ lane }: { lane: Lane }) {
  const run = lane.run!;
  const elapsed = Math.max(0, useNow(1000) - run.started_ms) / 1000;
  // By the time that the placements so far took; the first two say too little.
  const left = run.taken.length > 1 ? (elapsed / run.taken.length) * (run.of - run.taken.length) : 0;
  return (
    <section class="placements" aria-label={S.takenPoses}>
      <p>{S.placements(run.taken.length, run.of)} · {S.phase[run.phase]} · <span class="clock">{S.elapsed(S.minutes(elapsed), left > 0 ? S.minutes(left) : '')}</span></p>
      <ol>
        {Array.from({ length: run.of }, (_, i) => {
          const taken = run.taken[i];
          return taken
            ? <li class="taken" title={S.rounds[taken.round]}><b aria-hidden="true">✔</b>{S.face(taken.pose)}</li>
            : <li aria-hidden="true">·</li>;
        })}
      </ol>
    </section>
  );
}

export function CaptureSteps({ lane, say }: { lane: Lane; say: (word: string, body?: object) => void }) {
  const capture = lane.capture!;
  const left = Math.max(0, Math.ceil((capture.until_ms - useNow(250)) / 1000));
  return (
    <div class="capture">
      {capture.again.length > 0 && <p class="notice bad" role="alert"><b aria-hidden="true">✖ </b>{S.files.again(capture.again)}</p>}
      <p>{S.files.sideOf(capture.number, capture.of)}</p>
      {capture.side && !capture.placed && (
        <button type="button" class="primary" onClick={() => say('placed')}>{S.files.placed}</button>
      )}
      {capture.placed && <p class="count" role="timer">{left > 0 ? S.files.rest(left) : S.files.next}</p>}
    </div>
  );
}

export function LaneView({ lane, live, operator, virtual, lock, printer, writeDefault, setProblem }: {
  lane: Lane; live: Live | undefined; operator: string; virtual: boolean; lock: Lock | null; printer: Printer | null; writeDefault: boolean; setProblem: (problem: Refusal | null) => void;
}) {
  const watches = !!lock && !!lane.unit && lock.check_units.includes(lane.unit.serial);
  const locked = !!lock?.locked && !watches;
  const [write, setWrite] = useState(writeDefault);
  const [sure, setSure] = useState(false);
  const busy = BUSY.includes(lane.state);
  const mine = !busy || lane.client === client || lane.client === '';
  const say = async (word: string, body: object = {}) => {
    const answer = await ask(`/api/lanes/${lane.lane}/${word}`, body);
    setProblem(answer.ok ? null : answer.error);
  };
  const start = async () => {
    const answer = await ask('/api/run', { lane: lane.lane, operator, write });
    setProblem(answer.ok ? null : answer.error);
  };
  const writeNow = async () => {
    const answer = await ask('/api/run', { lane: lane.lane, operator, write: true, last_run: true });
    setProblem(answer.ok ? null : answer.error);
  };
  useEffect(() => {
    const press = (event: KeyboardEvent) => {
      if (event.key === 'Backspace' && lane.state === 'running' && mine && !(event.target instanceof HTMLInputElement)) {
        event.preventDefault();
        void say('undo');
      }
    };
    window.addEventListener('keydown', press);
    return () => window.removeEventListener('keydown', press);
  }, [lane.state, mine]);
  useEffect(() => setSure(false), [lane.state]);
  useSounds(lane);

  // What came out stays until the next start, also when the unit is out; of another unit it is one line.
  const result = busy ? null : lane.result;
  const others = !!result && !!lane.unit && lane.unit.serial !== result.serial;
  const wanted: Pose | null = lane.state === 'running' ? lane.run?.wanted ?? null : lane.capture?.side ?? null;
  const shown = lane.state === 'running' ? live?.stillness : undefined;
  const refusal = lane.state === 'running' ? lane.run?.last_refusal : '';
  return (
    <section class={`lane state-${lane.state}`} aria-labelledby="lane-title">
      <h2 id="lane-title">{S.lane(lane.lane)} <small>{lane.unit ? S.unit(lane.unit.serial, lane.unit.firmware) : lane.device}</small>{watches && <b class="tag">{S.lock.checkUnit}</b>}</h2>
      <p class="prompt" role="status" aria-live="polite">{locked && (lane.state === 'idle' || lane.state === 'done') ? S.lock.prompt : S.prompt(lane)}</p>
      {(lane.state === 'wrong_unit' || lane.state === 'unit_away') && <p class="notice bad"><b aria-hidden="true">⚠ </b>{lane.message}</p>}
      {lane.jig_fault && (
        <p class="notice bad" role="alert"><b aria-hidden="true">⚠ </b>{S.jigStopped(lane.jig_fault)}
          {!busy && <>{' '}<button type="button" class="danger" onClick={() => say('jig-free')}>{S.jigFree}</button></>}
        </p>
      )}
      {lane.log.length > 0 && lane.log[lane.log.length - 1].kind === 'problem' && <p class="notice bad" role="alert"><b aria-hidden="true">⚠ </b>{S.problemLog(lane.log[lane.log.length - 1].text)}</p>}
      {lane.scan && <p class={lane.scan.matches ? 'notice good' : 'notice bad'}><b aria-hidden="true">{lane.scan.matches ? '✔ ' : '✖ '}</b>{S.scanned(lane.scan.serial, lane.scan.matches)}</p>}
      <p class="notice bad refusal" role="alert" hidden={!refusal}><b aria-hidden="true">✖ </b>{refusal && S.refused(refusal, wanted)}</p>

      {result && (others ? <p class={`last word-${tone(result.verdict)}`}>{S.lastUnit(result)}</p> : <ResultBox result={result} writeNow={writeNow} printer={printer} setProblem={setProblem} />)}
      {lane.state === 'running' && lane.run && (
        <div class={`still still-${shown}`}>
          <span>{shown ? S.stillness[shown === 'leaving' && refusal ? 'refused' : shown] : ''}</span>
          <progress max={1} value={shown === 'dwelling' ? live?.dwell ?? 0 : 0} aria-label={S.stillness.dwelling} />
        </div>
      )}
      {lane.state === 'capturing' && <CaptureSteps lane={lane} say={say} />}
      <div class="buttons">
        {(lane.state === 'idle' || lane.state === 'done') && (
          <>
            <button type="button" class="primary" disabled={locked || !!lane.jig_fault} onClick={start}>{lane.result?.kind === 'jig' && lane.result.verdict !== 'refused' ? S.again : S.start}</button>
            <label class="check"><input type="checkbox" checked={write} onChange={(event) => setWrite(event.currentTarget.checked)} /> {S.write}</label>
          </>
        )}
        {busy && mine && lane.state === 'running' && (
          <button type="button" onClick={() => say('undo')} disabled={!lane.run?.taken.length}>{S.undoKey}</button>
        )}
        {busy && mine && !sure && <button type="button" onClick={() => setSure(true)}>{S.stop}</button>}
        {busy && mine && sure && (
          <span class="sure" role="group" aria-label={S.stopSure}>{S.stopSure}{' '}
            <button type="button" class="danger" onClick={() => say('stop')}>{S.stopYes}</button>{' '}
            <button type="button" onClick={() => setSure(false)}>{S.stopNo}</button>
          </span>
        )}
        {busy && !mine && (
          <span>{S.held(lane.operator)} <button type="button" onClick={() => say('take', { operator })}>{S.takeOver}</button></span>
        )}
      </div>
      <div class="pictures">
        {wanted && (
          <figure><figcaption>{S.wantedTitle}: <b>{S.poseText(wanted)}</b></figcaption><PosePicture pose={wanted} /></figure>
        )}
        {lane.state !== 'absent' && lane.state !== 'unit_away' && (
          <figure><figcaption>{S.nowTitle} <b>{nowText(live)}</b></figcaption><LiveBox lane={lane.lane} text={nowText(live)} /></figure>
        )}
      </div>
      {lane.state === 'running' && lane.run && <Placements lane={lane} />}
      {lane.state !== 'absent' && lane.state !== 'capturing' && <TraceChart lane={lane.lane} />}
      {virtual && <VirtualHand lane={lane.lane} setProblem={setProblem} />}
    </section>
  );
}

export function LaneCards({ state, chosen, follow, setFollow, choose }: {
  state: State; chosen: number; follow: boolean; setFollow: (on: boolean) => void; choose: (lane: number) => void;
}) {
  return (
    <section class="cards" aria-label={S.lanes}>
      <label class="check"><input type="checkbox" checked={follow} onChange={(event) => setFollow(event.currentTarget.checked)} /> {S.follow}</label>
      <ul>
        {state.lanes.map((lane) => {
          const place = state.queue.indexOf(lane.lane);
          const verdict = lane.state === 'done' && lane.result ? lane.result.verdict : '';
          return (
            <li>
              <button type="button" class={`card state-${lane.state} verdict-${verdict}`} aria-current={chosen === lane.lane ? 'true' : undefined} onClick={() => choose(lane.lane)}>
                <span class="number">{lane.lane}</span>
                <span class="what">
                  <b>{verdict ? `${S.verdictSigns[verdict]} ${S.verdict(lane.result!)}` : lane.state === 'running' && lane.run ? S.done(lane.run.taken.length, lane.run.of) : S.states[lane.state]}</b>
                  <span>{lane.unit?.serial ?? '–'}</span>
                  <span class="next">{place === 0 ? '☞ ' : ''}{place >= 0 && lane.run?.wanted ? S.prompt(lane) : place >= 0 ? S.states[lane.state] : ' '}</span>
                </span>
                <Spark lane={lane.lane} />
              </button>
            </li>
          );
        })}
      </ul>
    </section>
  );
}
