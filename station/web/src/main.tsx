import { render } from 'preact';
import { useEffect, useReducer, useRef, useState } from 'preact/hooks';
import './page.css';
import { CheckUnits } from './check';
import { Files } from './files';
import { LaneCards, LaneView } from './lane';
import { LockBanner } from './lock';
import { Statistics } from './statistics';
import { S } from './strings';
import { ask, current, subscribe, type Refusal } from './station';

// A label scanner is a keyboard that types a serial number and Enter faster than a person.
function useScanner(found: (serial: string) => void) {
  const text = useRef('');
  const last = useRef(0);
  useEffect(() => {
    const press = (event: KeyboardEvent) => {
      const inField = event.target instanceof HTMLInputElement || event.target instanceof HTMLSelectElement;
      if (inField || event.ctrlKey || event.altKey || event.metaKey) return;
      if (event.timeStamp - last.current > 80) text.current = '';
      if (event.key.length === 1 && /[A-Za-z0-9]/.test(event.key)) {
        text.current += event.key;
        last.current = event.timeStamp;
      } else if (event.key === 'Enter' && text.current.length >= 6) {
        event.preventDefault();
        found(text.current.toUpperCase());
        text.current = '';
      }
    };
    window.addEventListener('keydown', press, true);
    return () => window.removeEventListener('keydown', press, true);
  });
}

function Page() {
  const [, again] = useReducer((n: number) => n + 1, 0);
  useEffect(() => subscribe(() => again(0)), []);
  const { state, connected, live } = current();
  const [tab, setTab] = useState(() => (location.hash.slice(1) in S.tabs ? location.hash.slice(1) : 'jig'));
  const [chosen, setChosen] = useState(1);
  const [follow, setFollow] = useState(true);
  const [operator, setOperator] = useState(localStorage.getItem('sixpoint-operator') ?? '');
  const [scanned, setScanned] = useState('');
  const [problem, setProblem] = useState<Refusal | null>(null);

  const scan = async (serial: string) => {
    const answer = await ask<{ lane: number }>('/api/scan', { serial });
    if (answer.ok) { setChosen(answer.data.lane); setFollow(false); setProblem(null); setScanned(''); }
    else setProblem(answer.error);
  };
  useScanner(scan);

  const queue = state?.queue ?? [];
  // Shows the lane that waits longest for the operator, until the operator chooses one.
  const busyHere = queue.includes(chosen) || state?.lanes[chosen - 1]?.state === 'idle';
  useEffect(() => { if (follow && queue.length && !busyHere) setChosen(queue[0]); }, [follow, queue.join(), busyHere]);
  useEffect(() => {
    const press = (event: KeyboardEvent) => {
      if (event.target instanceof HTMLInputElement || event.target instanceof HTMLSelectElement || !state) return;
      const step = event.key === 'ArrowRight' ? 1 : event.key === 'ArrowLeft' ? -1 : 0;
      if (step && tab === 'jig' && state.lanes.length > 1) {
        setFollow(false);
        setChosen((n) => ((n - 1 + step + state.lanes.length) % state.lanes.length) + 1);
      }
    };
    window.addEventListener('keydown', press);
    return () => window.removeEventListener('keydown', press);
  }, [tab, state?.lanes.length]);
  const go = (name: string) => { setTab(name); location.hash = name; };

  const lane = state?.lanes[chosen - 1];
  return (
    <>
      <header>
        <h1>{state?.station || S.title}</h1>
        <nav aria-label={S.title}>
          {Object.entries(S.tabs).map(([name, text]) => (
            <button type="button" aria-current={tab === name ? 'page' : undefined} onClick={() => go(name)}>{text}</button>
          ))}
        </nav>
        <label>{S.operator} <input value={operator} maxLength={60} autocomplete="name" onInput={(event) => {
          setOperator(event.currentTarget.value);
          localStorage.setItem('sixpoint-operator', event.currentTarget.value);
        }} /></label>
        <form onSubmit={(event) => { event.preventDefault(); if (scanned) void scan(scanned.trim()); }}>
          <label>{S.scan} <input value={scanned} maxLength={40} spellcheck={false} autocomplete="off" onInput={(event) => setScanned(event.currentTarget.value)} /></label>
          <button type="submit">{S.scanGo}</button>
        </form>
      </header>
      <main>
        <div role="alert">
          {!connected && state && <p class="notice bad"><b aria-hidden="true">⚠ </b>{S.connection.lost}</p>}
          {problem && <p class="notice bad"><b aria-hidden="true">✖ </b>{problem.what}. {problem.hint}{' '}
            <button type="button" onClick={() => setProblem(null)}>OK</button></p>}
        </div>
        {state?.lock?.locked && <LockBanner lock={state.lock} setProblem={setProblem} />}
        {!state ? <p>…</p> : tab === 'files' ? <Files state={state} setProblem={setProblem} />
          : tab === 'check' ? <CheckUnits state={state} setProblem={setProblem} />
          : tab === 'statistics' ? <Statistics setProblem={setProblem} /> : (
          <div class={state.lanes.length > 1 ? 'bench' : 'bench single'}>
            {lane && <LaneView key={chosen} lane={lane} live={live[chosen]} operator={operator}
              virtual={state.virtual_hands.includes(chosen)} lock={state.lock} setProblem={setProblem} />}
            {state.lanes.length > 1 && (
              <LaneCards state={state} chosen={chosen} follow={follow} setFollow={setFollow}
                choose={(n) => { setChosen(n); setFollow(false); }} />
            )}
          </div>
        )}
      </main>
      <footer>{state?.version}</footer>
    </>
  );
}

render(<Page />, document.getElementById('page')!);
