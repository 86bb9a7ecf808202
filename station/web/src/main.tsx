import { render } from 'preact';
import { useEffect, useReducer, useState } from 'preact/hooks';
import './page.css';
import { CheckUnits } from './check';
import { AnotherBrowser, SignIn, WhoWorks } from './entry';
import { Files } from './files';
import { LaneCards, LaneView } from './lane';
import { LockBanner } from './lock';
import { Statistics } from './statistics';
import { Today } from './today';
import { soundsAreOn, turnSounds } from './sounds';
import { chooseLanguage, language, LANGUAGES, S } from './strings';
import { serialOf, useScanner } from './scanner';
import { ask, current, subscribe, type Refusal } from './connection';

function Page() {
  const [, again] = useReducer((n: number) => n + 1, 0);
  useEffect(() => subscribe(() => again(0)), []);
  const { state, connected, crowded, entry, me, live } = current();
  const [tab, setTab] = useState(() => (location.hash.slice(1) in S.tabs ? location.hash.slice(1) : 'jig'));
  const [chosen, setChosen] = useState(1);
  const [follow, setFollow] = useState(true);
  const [operator, setOperator] = useState(localStorage.getItem('sixpoint-operator') ?? '');
  const [scanned, setScanned] = useState('');
  const [looked, setLooked] = useState('');  // whose runs the tab "Today" shows
  const [problem, setProblem] = useState<Refusal | null>(null);
  const [sounds, setSounds] = useState(soundsAreOn());

  const go = (name: string) => { setTab(name); location.hash = name; };
  const scan = async (label: string) => {
    if (tab === 'today') return setLooked(serialOf(label));
    const answer = await ask<{ lane: number }>('/api/scan', { serial: label });
    setScanned('');
    if (answer.ok) { setChosen(answer.data.lane); setFollow(false); setProblem(null); go('jig'); }
    else setProblem(answer.error);
  };
  const dismiss = () => {
    setProblem(null);
    void ask('/api/scan', { dismiss: true });  // a label that no lane holds blocks the start until then
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
  const lane = state?.lanes[chosen - 1];
  // In the tab's title: what a person in another window must know.
  useEffect(() => { document.title = `${lane ? S.prompt(lane) : S.title} - ${state?.station || S.title}`; }, [lane && S.prompt(lane), state?.station]);
  return (
    <>
      <header>
        <h1>{state?.station || S.title}</h1>
        <nav aria-label={S.title}>
          {Object.entries(S.tabs).map(([name, text]) => (
            <button type="button" aria-current={tab === name ? 'page' : undefined} onClick={() => go(name)}>{text}</button>
          ))}
        </nav>
        {entry === 'open' && <WhoWorks me={me} typed={operator} setProblem={setProblem} setTyped={(name) => {
          setOperator(name);
          localStorage.setItem('sixpoint-operator', name);
        }} />}
        <form class="scan" onSubmit={(event) => { event.preventDefault(); if (scanned) void scan(scanned.trim()); }}>
          <label>{S.scan} <input data-serial value={scanned} maxLength={80} spellcheck={false} autocomplete="off" onInput={(event) => setScanned(event.currentTarget.value)} /></label>
          <button type="submit">{S.scanGo}</button>
        </form>
      </header>
      <main>
        <div role="alert">
          {!connected && state && <p class="notice bad"><b aria-hidden="true">⚠ </b>{crowded ? S.connection.crowded : S.connection.lost}</p>}
          {problem && <p class="notice bad"><b aria-hidden="true">✖ </b>{problem.what}. {problem.hint}{' '}
            <button type="button" onClick={dismiss}>OK</button></p>}
        </div>
        {entry !== 'sign_in' && state?.lock?.locked && <LockBanner lock={state.lock} setProblem={setProblem} />}
        {entry === 'sign_in' ? <SignIn /> : !state ? <p>…</p> : tab === 'files' ? <Files state={state} setProblem={setProblem} />
          : tab === 'today' ? <Today state={state} serial={looked} setSerial={setLooked} setProblem={setProblem} />
          : tab === 'check' ? <CheckUnits state={state} setProblem={setProblem} />
          : tab === 'statistics' ? <Statistics setProblem={setProblem} /> : (
          <div class={state.lanes.length > 1 ? 'bench' : 'bench single'}>
            {lane && <LaneView key={chosen} lane={lane} live={live[chosen]} operator={operator}
              virtual={state.virtual_hands.includes(chosen)} lock={state.lock} printer={state.printer} writeDefault={state.write_default} setProblem={setProblem} />}
            {state.lanes.length > 1 && (
              <LaneCards state={state} chosen={chosen} follow={follow} setFollow={setFollow}
                choose={(n) => { setChosen(n); setFollow(false); }} />
            )}
          </div>
        )}
      </main>
      <footer>{entry === 'open' && <AnotherBrowser setProblem={setProblem} />} <label class="check"><input type="checkbox" checked={sounds} onChange={(event) => { turnSounds(event.currentTarget.checked); setSounds(event.currentTarget.checked); }} /> {S.sounds}</label>
        <label>{S.language} <select value={language} onChange={(event) => chooseLanguage(event.currentTarget.value)}>
          {Object.entries(LANGUAGES).map(([name, text]) => <option value={name} lang={name}>{text}</option>)}
        </select></label>
        <span>{state?.version}</span>{state?.jig_due && <b>{S.jigDue(state.jig_due.slice(0, 10), state.jig_over, state.jig_exception?.signed_by ?? '')}</b>}</footer>
    </>
  );
}

render(<Page />, document.getElementById('page')!);
