// A browser that is not signed in asks for a code; one that is gives a code to the next.
import { useState } from 'preact/hooks';
import { S } from './strings';
import { ask, operatorIs, signIn, type Refusal } from './connection';
import type { Me } from './types';

const E = S.entry;

export function SignIn() {
  const [code, setCode] = useState('');
  const [problem, setProblem] = useState<Refusal | null>(null);
  const send = async (event: Event) => {
    event.preventDefault();
    setProblem(await signIn(code.trim()));
  };
  return (
    <section class="entry" aria-labelledby="entry-title">
      <h2 id="entry-title">{E.title}</h2>
      <p>{E.text}</p>
      <form class="sign" onSubmit={send}>
        <label class="wide">{E.code} <input value={code} required maxLength={200} spellcheck={false} autocomplete="off" autofocus onInput={(event) => setCode(event.currentTarget.value)} /></label>
        <button type="submit" class="primary" disabled={!code.trim()}>{E.submit}</button>
      </form>
      <div role="alert">{problem && <p class="notice bad"><b aria-hidden="true">✖ </b>{problem.what}. {problem.hint}</p>}</div>
    </section>
  );
}

// Who works on this page: a name as it is typed, or where the machine has operators, one with a PIN.
export function WhoWorks({ me, typed, setTyped, setProblem }: {
  me: Me; typed: string; setTyped: (name: string) => void; setProblem: (problem: Refusal | null) => void;
}) {
  const [name, setName] = useState('');
  const [pin, setPin] = useState('');
  if (!me.operators.length) {
    return <label>{S.operator} <input value={typed} maxLength={60} autocomplete="name" onInput={(event) => setTyped(event.currentTarget.value)} /></label>;
  }
  if (me.operator) {
    return (
      <p class="who"><b>{S.pin.here(me.operator.name, me.operator.role)}</b>{' '}
        <button type="button" onClick={async () => setProblem(await operatorIs('', ''))}>{S.pin.out}</button></p>
    );
  }
  const begin = async (event: Event) => {
    event.preventDefault();
    const refused = await operatorIs(name || me.operators[0], pin);
    setPin('');
    setProblem(refused);
  };
  return (
    <form class="who" aria-label={S.pin.title} onSubmit={begin}>
      <label>{S.pin.name} <select value={name || me.operators[0]} onChange={(event) => setName(event.currentTarget.value)}>{me.operators.map((each) => <option>{each}</option>)}</select></label>
      <label>{S.pin.pin} <input data-serial type="password" inputMode="numeric" value={pin} maxLength={12} autocomplete="off" onInput={(event) => setPin(event.currentTarget.value)} /></label>
      <button type="submit" disabled={pin.length < 4}>{S.pin.submit}</button>
    </form>
  );
}

export function AnotherBrowser({ setProblem }: { setProblem: (problem: Refusal | null) => void }) {
  const [code, setCode] = useState('');
  const make = async () => {
    const answer = await ask<{ code: string }>('/api/code', {});
    if (answer.ok) setCode(answer.data.code);
    setProblem(answer.ok ? null : answer.error);
  };
  return code
    ? <p role="status">{E.next} <b class="code">{`${location.origin}/#code=${code}`}</b></p>
    : <button type="button" onClick={make}>{E.another}</button>;
}
