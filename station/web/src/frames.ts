// When the readings of a lane are drawn.
import { traces, type Trace } from './connection';

const calm = matchMedia('(prefers-reduced-motion: reduce)');
const CALM_MS = 250;

// Calls `draw` where there are new readings: at the screen's own rate, and four times a second for people whose system asks
// for less motion. The answer ends it.
export function follow(lane: number, draw: (trace: Trace) => void): () => void {
  let frame = 0, timer = 0, seen = 0;
  const step = () => {
    const trace = traces.get(lane);
    if (trace && trace.end !== seen) {
      seen = trace.end;
      draw(trace);
    }
    if (calm.matches) timer = window.setTimeout(step, CALM_MS);
    else frame = requestAnimationFrame(step);
  };
  step();
  return () => { cancelAnimationFrame(frame); clearTimeout(timer); };
}
