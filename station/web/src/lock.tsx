// The lock: a station whose check unit is out of control says so on every screen, and takes the signature.
import { useState } from 'preact/hooks';
import { S } from './strings';
import { ask, type Refusal } from './connection';
import type { Lock } from './types';

const L = S.lock;
export type SetProblem = (problem: Refusal | null) => void;

export function SignForm({ setProblem, done, cancel }: { setProblem: SetProblem; done?: () => void; cancel?: () => void }) {
  const [name, setName] = useState('');
  const [reason, setReason] = useState('');
  const [anew, setAnew] = useState(false);
  const sign = async (event: Event) => {
    event.preventDefault();
    const answer = await ask('/api/station-lock', { operator: name.trim(), reason: reason.trim(), new_baseline: anew });
    setProblem(answer.ok ? null : answer.error);
    if (answer.ok) { setName(''); setReason(''); setAnew(false); done?.(); }
  };
  return (
    <form class="sign" aria-label={L.signTitle} onSubmit={sign}>
      <label>{L.name} <input value={name} required maxLength={60} autocomplete="off" onInput={(event) => setName(event.currentTarget.value)} /></label>
      <label class="wide">{L.reason} <input value={reason} required maxLength={190} autocomplete="off" onInput={(event) => setReason(event.currentTarget.value)} /></label>
      <label class="check"><input type="checkbox" checked={anew} onChange={(event) => setAnew(event.currentTarget.checked)} /> {L.newBaseline}</label>
      <div class="buttons">
        <button type="submit" class="primary" disabled={!name.trim() || !reason.trim()}>{L.submit}</button>
        {cancel && <button type="button" onClick={cancel}>{L.cancel}</button>}
      </div>
    </form>
  );
}

export function LockBanner({ lock, setProblem }: { lock: Lock; setProblem: SetProblem }) {
  const [open, setOpen] = useState(false);
  return (
    <section class="lock" aria-labelledby="lock-title">
      <h2 id="lock-title"><span aria-hidden="true">✖ </span>{L.title}</h2>
      <div role="alert">
        <p><b>{L.text}</b></p>
        <ul>{lock.reasons.map((reason) => <li>{reason}</li>)}</ul>
        <p>{L.next(lock.check_units)}</p>
        {Object.entries(lock.known_bad ?? {}).map(([unit, codes]) => <p>{L.knownBad(unit, codes)}</p>)}
      </div>
      {open
        ? <SignForm setProblem={setProblem} done={() => setOpen(false)} cancel={() => setOpen(false)} />
        : <button type="button" class="primary" onClick={() => setOpen(true)}>{L.sign}</button>}
    </section>
  );
}
