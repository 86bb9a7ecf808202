// The connection to the station: state by server-sent events, commands by POST.
import type { Job, Lane, Live, Lock, Me, Printer, State } from './types';

// Readings of one lane, the newest at `end`. Kept outside the page's state: they are drawn, not rendered.
export const KEPT = 600;
export class Trace {
  readonly mg = [new Float32Array(KEPT), new Float32Array(KEPT), new Float32Array(KEPT)];
  end = 0; // readings so far
  hostMs = 0; // when the newest came from the unit
  fresh = false; // not drawn yet
  take(first: number, flat: number[], hostMs: number) {
    if (first > this.end + KEPT || first < this.end) this.mg.forEach((axis) => axis.fill(0));
    this.end = first;
    for (let i = 0; i + 2 < flat.length; i += 3) {
      for (let axis = 0; axis < 3; ++axis) this.mg[axis][this.end % KEPT] = flat[i + axis];
      ++this.end;
    }
    this.hostMs = hostMs;
    this.fresh = true;
  }
  // The mean of the newest tenth of a second, in g.
  now(): [number, number, number] {
    const n = Math.min(10, this.end);
    return [0, 1, 2].map((axis) => {
      let sum = 0;
      for (let i = 1; i <= n; ++i) sum += this.mg[axis][(this.end - i) % KEPT];
      return n ? sum / n / 1000 : 0;
    }) as [number, number, number];
  }
}

// `entry`: may this browser use the station? Not known until it was asked.
// `me`: who works on this page, where the machine has operators with PINs.
export interface Snapshot { state: State | null; connected: boolean; crowded: boolean; entry: 'unknown' | 'open' | 'sign_in'; me: Me; live: Record<number, Live> }
export const traces = new Map<number, Trace>();
let snapshot: Snapshot = { state: null, connected: false, crowded: false, entry: 'unknown', me: { operators: [], operator: null }, live: {} };
const listeners = new Set<() => void>();
export const current = () => snapshot;
export function subscribe(listener: () => void) {
  listeners.add(listener);
  return () => { listeners.delete(listener); };
}
function change(part: Partial<Snapshot>) {
  snapshot = { ...snapshot, ...part };
  listeners.forEach((listener) => listener());
}

// One stream of events for all tabs and windows of this browser, which has six connections for one address: the tab that
// holds the lock has the stream and passes the events on. A tab that no one sees takes no part.
const channel = new BroadcastChannel('sixpoint-events');
const LOCK = 'sixpoint-stream';
const QUIET_MS = 15000; // of a stream; a new one begins with the whole state
const SILENT_MS = 25000; // of the tab with the stream: another one takes it
interface Passed { name: string; data: unknown }
interface LiveEvent { queue: number[]; lanes: { lane: number; first: number; host_ms: number; mg: number[]; live: Live }[] }
let stream: EventSource | null = null;
let part: AbortController | null = null; // this tab takes part
let lastEventMs = 0;
let early: Passed[] | null = null; // what came while the state was on its way

function takeLive(data: LiveEvent) {
  let differs = false;
  const live = { ...snapshot.live };
  for (const each of data.lanes) {
    let trace = traces.get(each.lane);
    if (!trace) traces.set(each.lane, (trace = new Trace()));
    trace.take(each.first, each.mg, each.host_ms);
    const old = live[each.lane];
    if (!old || old.stillness !== each.live.stillness || old.dwell !== each.live.dwell ||
        old.face !== each.live.face || Math.abs((old.angle_deg ?? 0) - (each.live.angle_deg ?? 0)) > 0.3) {
      live[each.lane] = each.live;
      differs = true;
    }
  }
  const queue = snapshot.state?.queue ?? [];
  const same = queue.length === data.queue.length && queue.every((lane, i) => lane === data.queue[i]);
  if (!same && snapshot.state) change({ state: { ...snapshot.state, queue: data.queue }, live });
  else if (differs) change({ live });
}
function put(part: Partial<State>) { if (snapshot.state) change({ state: { ...snapshot.state, ...part } }); }
const uses: Record<string, (data: never) => void> = {
  state: (state: State) => change({ state, connected: true, crowded: false }),
  lane: (lane: Lane) => put({ lanes: snapshot.state?.lanes.map((each) => (each.lane === lane.lane ? lane : each)) }),
  job: (job: Job) => put({ job }),
  lock: (lock: Lock) => put({ lock }),
  printer: (printer: Printer) => put({ printer }),
  live: takeLive,
  lost: () => change({ connected: false }),
  crowded: (state: State) => change({ state, connected: false, crowded: true }),
};
function take(event: Passed) {
  lastEventMs = Date.now();
  uses[event.name](event.data as never);
}
function pass(name: string, data: unknown = null) {
  take({ name, data });
  channel.postMessage({ name, data });
}
channel.onmessage = ({ data }: MessageEvent<Passed>) => {
  if (!part || stream) return;
  if (early) early.push(data); else take(data);
};

// The stream of this browser, until it ends or this tab leaves; then another tab may have it.
function hold(signal: AbortSignal): Promise<void> {
  return new Promise((done) => {
    const events = stream = new EventSource('/api/events');
    early = null;
    lastEventMs = Date.now();
    for (const name of ['state', 'lane', 'job', 'lock', 'printer', 'live'])
      events.addEventListener(name, (event) => pass(name, JSON.parse((event as MessageEvent<string>).data)));
    const end = () => { clearInterval(watch); events.close(); if (stream === events) stream = null; done(); };
    // The browser tries again by itself, except after an answer that is no stream.
    events.onerror = () => pass('lost');
    const watch = setInterval(() => {
      if (events.readyState !== EventSource.CLOSED && Date.now() - lastEventMs <= QUIET_MS) return;
      if (events.readyState === EventSource.CLOSED) void showWithoutStream();
      pass('lost');
      end();
      again();
    }, 1000);
    signal.addEventListener('abort', end);
  });
}

// Takes part: with the state as it is now, and in the queue for the stream. `steal` where the tab that has it is silent.
function connect(steal = false) {
  leave();
  const own = part = new AbortController();
  lastEventMs = Date.now();
  const request = steal ? { steal: true } : { signal: own.signal };
  navigator.locks.request(LOCK, request, () => (own.signal.aborted ? undefined : hold(own.signal))).catch(() => {
    if (part === own && stream) { leave(); again(); } // another tab took it
  });
  early = [];
  void ask<State>('/api/state').then((answer) => {
    if (part !== own || !early) return; // the stream brought it
    const meanwhile = early;
    early = null;
    if (answer.ok) take({ name: 'state', data: answer.data });
    meanwhile.forEach(take);
  });
  const watch = setInterval(() => {
    if (part !== own) return clearInterval(watch);
    if (!stream && Date.now() - lastEventMs > SILENT_MS) { clearInterval(watch); connect(true); }
  }, 1000);
}
function leave() {
  part?.abort();
  part = null;
  stream = null;
}
function again() { setTimeout(() => { if (!stream && !document.hidden) void enter(); }, 1000); }

let leaving: ReturnType<typeof setTimeout> | undefined;
document.addEventListener('visibilitychange', () => {
  clearTimeout(leaving);
  if (!document.hidden) {
    if (!part && snapshot.entry === 'open') void enter();
  } else leaving = setTimeout(leave, 10000);
});

// Too many pages have a stream: this one shows the state as it is now, and tries again.
async function showWithoutStream() {
  const answer = await ask<State>('/api/state');
  if (answer.ok) pass('crowded', answer.data);
}

// Connects where this browser is signed in; else the page asks for a code.
async function enter() {
  try {
    const answer = await fetch('/api/me', { headers: { 'X-Sixpoint-Client': secret } });
    if (answer.status === 401) return change({ entry: 'sign_in' });
    if (answer.ok) {
      const me: Me & { client: string; clock_ms: number } = await answer.json();
      client = me.client;
      takeClock(me);
      change({ entry: 'open', me });
      return connect();
    }
  } catch { /* the station is not there: it is asked again */ }
  change({ connected: false });
  setTimeout(() => { void enter(); }, 1000);
}

// A code of the station, or its token, for a session of this browser.
export async function signIn(code: string): Promise<Refusal | null> {
  const answer = await ask('/api/session', { code });
  if (!answer.ok) return answer.error;
  void enter();
  return null;
}

// An empty name signs out.
export async function operatorIs(name: string, pin: string): Promise<Refusal | null> {
  const answer = await ask<Me>('/api/operator', { name, pin });
  if (answer.ok) change({ me: answer.data });
  return answer.ok ? null : answer.error;
}

// The same person after a reload of the page, another one in another window.
const key = 'sixpoint-client';
function clientId(): string {
  let id = sessionStorage.getItem(key);
  if (!id) {
    id = Array.from(crypto.getRandomValues(new Uint8Array(12)), (byte) => byte.toString(16).padStart(2, '0')).join('');
    sessionStorage.setItem(key, id);
  }
  return id;
}
const secret = clientId();
// What the station calls this window before others (a lane's `client`).
export let client = '';

// A command is for now: after this time no one waits for it any more, and the station refuses it by its own clock.
const COMMAND_MS = 5000;
const READ_MS = 20000;
let clockAhead: number | null = null;  // not known before the first answer
const takeClock = (me: { clock_ms: number }) => { clockAhead = me.clock_ms - performance.now(); };
const before = (): Record<string, string> =>
  (clockAhead === null ? {} : { 'X-Sixpoint-Before': String(Math.round(performance.now() + clockAhead + COMMAND_MS)) });

export interface Refusal { what: string; hint: string }
export async function ask<T>(path: string, body?: unknown): Promise<{ ok: true; data: T } | { ok: false; error: Refusal }> {
  try {
    // A read that nobody answered in time is asked once more: what it should have shown would stay empty.
    const read = () => fetch(path, { signal: AbortSignal.timeout(READ_MS) });
    const answer = await (body === undefined ? read().catch(read) : fetch(path, {
      method: 'POST',
      headers: { 'Content-Type': 'application/json', 'X-Sixpoint-Client': secret, ...before() },
      body: JSON.stringify(body),
      signal: AbortSignal.timeout(COMMAND_MS),
    }));
    const data = await answer.json();
    if (answer.status === 401 && path !== '/api/session') change({ entry: 'sign_in' });
    // Idle for too long, or signed out in another window: the page asks for the PIN again.
    if (data.error?.code === 'operator_needed') change({ me: { ...snapshot.me, operator: null } });
    // This machine may have slept, which stops the browser's clock and not the station's: without the station's time as
    // it is now no command would be taken any more, however often it is given.
    if (data.error?.code === 'too_late') {
      const me = await ask<{ clock_ms: number }>('/api/me');
      if (me.ok) takeClock(me.data);
    }
    return answer.ok ? { ok: true, data } : { ok: false, error: data.error };
  } catch {
    return { ok: false, error: { what: 'the station does not answer', hint: '' } };
  }
}

// The printed address has its code behind #, which no server sees; it does not stay in the history.
const code = location.hash.match(/^#code=([\w-]+)$/)?.[1];
if (code) {
  history.replaceState(null, '', '/');
  // A code that was used leads to a browser that is signed in already, or to the form.
  void signIn(code).then((refused) => { if (refused) void enter(); });
} else void enter();
