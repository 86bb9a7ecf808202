// The connection to the station: state by server-sent events, commands by POST.
import type { Job, Lane, Live, Lock, State } from './types';

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

export interface Snapshot { state: State | null; connected: boolean; live: Record<number, Live> }
export const traces = new Map<number, Trace>();
let snapshot: Snapshot = { state: null, connected: false, live: {} };
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

function connect() {
  const events = new EventSource('/api/events');
  let lastEventMs = Date.now();
  const on = <T>(name: string, use: (data: T) => void) =>
    events.addEventListener(name, (event) => { lastEventMs = Date.now(); use(JSON.parse((event as MessageEvent<string>).data)); });
  on<State>('state', (state) => change({ state, connected: true }));
  on<Lane>('lane', (lane) => {
    if (!snapshot.state) return;
    const lanes = snapshot.state.lanes.map((each) => (each.lane === lane.lane ? lane : each));
    change({ state: { ...snapshot.state, lanes } });
  });
  on<Job>('job', (job) => { if (snapshot.state) change({ state: { ...snapshot.state, job } }); });
  on<Lock>('lock', (lock) => { if (snapshot.state) change({ state: { ...snapshot.state, lock } }); });
  interface LiveEvent { queue: number[]; lanes: { lane: number; first: number; host_ms: number; mg: number[]; live: Live }[] }
  on<LiveEvent>('live', (data) => {
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
  });
  // The browser tries again by itself, except after an answer that is no stream.
  events.onerror = () => change({ connected: false });
  const watch = setInterval(() => {
    if (events.readyState === EventSource.CLOSED || Date.now() - lastEventMs > 15000) {
      clearInterval(watch);
      events.close();
      change({ connected: false });
      setTimeout(connect, 1000);
    }
  }, 1000);
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
export const client = clientId();

export interface Refusal { what: string; hint: string }
export async function ask<T>(path: string, body?: unknown): Promise<{ ok: true; data: T } | { ok: false; error: Refusal }> {
  try {
    const answer = await fetch(path, body === undefined ? {} : {
      method: 'POST',
      headers: { 'Content-Type': 'application/json', 'X-Sixpoint-Client': client },
      body: JSON.stringify(body),
    });
    const data = await answer.json();
    return answer.ok ? { ok: true, data } : { ok: false, error: data.error };
  } catch {
    return { ok: false, error: { what: 'the station does not answer', hint: '' } };
  }
}

connect();
