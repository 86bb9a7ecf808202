// Live traces: uPlot for the lane in front, a few strokes on a canvas for the others.
import { useEffect, useRef } from 'preact/hooks';
import uPlot from 'uplot';
import 'uplot/dist/uPlot.min.css';
import { follow } from './frames';
import { S } from './strings';
import { KEPT, type Trace } from './connection';

// Told apart by dash as well as by colour.
const AXES = [
  { name: 'X', colour: '#0b5cad', dash: [] as number[] },
  { name: 'Y', colour: '#a33b00', dash: [10, 4] },
  { name: 'Z', colour: '#00693e', dash: [3, 3] },
];

// Milliseconds from the unit's report to the drawn line, of the newest reading; for tests and benchmarks.
const delays: number[] = [];
(window as unknown as { sixpointDelays: number[] }).sixpointDelays = delays;
function drawn(trace: Trace) {
  if (!trace.fresh) return;
  trace.fresh = false;
  delays.push(Date.now() - trace.hostMs);
  if (delays.length > 20000) delays.splice(0, 10000);
}

export function TraceChart({ lane }: { lane: number }) {
  const place = useRef<HTMLDivElement>(null);
  const values = useRef<HTMLParagraphElement>(null);
  useEffect(() => {
    if (!place.current) return;
    const box = place.current;
    const x = Float64Array.from({ length: KEPT }, (_, i) => (i - KEPT + 1) / 100);
    const lines = [0, 1, 2].map(() => new Float64Array(KEPT));
    const plot = new uPlot({
      width: Math.max(200, box.clientWidth), height: 190, legend: { show: false }, cursor: { show: false },
      scales: { x: { time: false, range: [-KEPT / 100, 0] }, y: { range: [-1.35, 1.35] } },
      axes: [{ font: '14px sans-serif', size: 26, space: 90 }, { font: '14px sans-serif', size: 40, splits: () => [-1, -0.5, 0, 0.5, 1] }],
      series: [{}, ...AXES.map((axis) => ({ stroke: axis.colour, width: 2, dash: axis.dash, points: { show: false } }))],
    }, [x, ...lines] as unknown as uPlot.AlignedData, box);
    const resize = new ResizeObserver(() => plot.setSize({ width: Math.max(200, box.clientWidth), height: 190 }));
    resize.observe(box);
    let told = 0;
    const end = follow(lane, (trace) => {
      for (let axis = 0; axis < 3; ++axis)
        for (let i = 0; i < KEPT; ++i) lines[axis][i] = trace.mg[axis][(trace.end + i) % KEPT] / 1000;
      plot.setData([x, ...lines] as unknown as uPlot.AlignedData, false);
      plot.redraw(true, false);
      drawn(trace);
      if (Date.now() - told >= 250 && values.current) {
        told = Date.now();
        const now = trace.now();
        values.current.querySelectorAll('b').forEach((each, axis) => { each.textContent = now[axis].toFixed(3); });
      }
    });
    return () => { end(); resize.disconnect(); plot.destroy(); };
  }, [lane]);
  return (
    <figure class="traces">
      <figcaption>{S.traces}</figcaption>
      <div ref={place} aria-hidden="true" />
      <p ref={values} class="values">
        {AXES.map((axis) => (
          <span class={`axis-${axis.name.toLowerCase()}`}>
            <svg width="44" height="8" aria-hidden="true"><line x1="0" y1="4" x2="44" y2="4" stroke={axis.colour} stroke-width="3" stroke-dasharray={axis.dash.join(' ')} /></svg>
            {axis.name} <b>0.000</b> g
          </span>
        ))}
      </p>
    </figure>
  );
}

// A card's small picture of the same.
export function Spark({ lane }: { lane: number }) {
  const place = useRef<HTMLCanvasElement>(null);
  useEffect(() => follow(lane, (trace) => {
    const canvas = place.current;
    const pen = canvas?.getContext('2d');
    if (!canvas || !pen) return;
    const { width, height } = canvas;
    pen.clearRect(0, 0, width, height);
    AXES.forEach((axis, i) => {
      pen.strokeStyle = axis.colour;
      pen.setLineDash(axis.dash);
      pen.beginPath();
      for (let k = 0; k < KEPT; k += 6) {
        const g = trace.mg[i][(trace.end + k) % KEPT] / 1000;
        pen.lineTo((k / KEPT) * width, height * (0.5 - g / 2.7));
      }
      pen.stroke();
    });
    drawn(trace);
  }), [lane]);
  return <canvas ref={place} width={150} height={44} aria-hidden="true" />;
}
