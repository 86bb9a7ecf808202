// The unit as a box, turned by CSS so that the side that is up is up.
import { useEffect, useRef } from 'preact/hooks';
import { follow } from './frames';
import { S } from './strings';
import { POSES, type Pose } from './types';

type Vector = [number, number, number];
const UP: Record<Pose, Vector> = {
  '+x': [1, 0, 0], '-x': [-1, 0, 0], '+y': [0, 1, 0], '-y': [0, -1, 0], '+z': [0, 0, 1], '-z': [0, 0, -1],
};

// The smallest turn of the case that brings its direction `up` to the top, as a CSS matrix. The case has
// x to the right, y away and z up; CSS has x right, y down, z to the viewer.
export function turn(up: Vector): string {
  const n = Math.hypot(...up) || 1;
  const [x, y, z] = up.map((each) => each / n);
  let r: number[][];
  if (z < -0.9999) r = [[1, 0, 0], [0, -1, 0], [0, 0, -1]];
  else {
    const k = 1 / (1 + z);
    r = [[1 - k * x * x, -k * x * y, -x], [-k * x * y, 1 - k * y * y, -y], [x, y, z]];
  }
  // css = (X, -Z, -Y): rows and columns change places and signs.
  const order = [0, 2, 1], sign = [1, -1, -1];
  const m = (i: number, j: number) => (sign[i] * sign[j] * r[order[i]][order[j]]).toFixed(4);
  return `matrix3d(${m(0, 0)},${m(1, 0)},${m(2, 0)},0,${m(0, 1)},${m(1, 1)},${m(2, 1)},0,${m(0, 2)},${m(1, 2)},${m(2, 2)},0,0,0,0,1)`;
}

function Sides() {
  return <>{POSES.map((pose) => <span class={`side side-${pose[0] === '+' ? 'p' : 'n'}${pose[1]}`}>{S.face(pose)}</span>)}</>;
}

export function PosePicture({ pose, small }: { pose: Pose; small?: boolean }) {
  const place = useRef<HTMLDivElement>(null);
  useEffect(() => { if (place.current) place.current.style.transform = turn(UP[pose]); }, [pose]);
  return (
    <div class={small ? 'scene small' : 'scene'} role="img" aria-label={S.poseLabel(pose)}>
      <div class="view" aria-hidden="true"><div class="case" ref={place}><Sides /></div></div>
    </div>
  );
}

// Follows the readings of a lane.
export function LiveBox({ lane, text }: { lane: number; text: string }) {
  const place = useRef<HTMLDivElement>(null);
  useEffect(() => follow(lane, (trace) => { if (place.current) place.current.style.transform = turn(trace.now()); }), [lane]);
  return (
    <div class="scene live" role="img" aria-label={S.boxLive(text)}>
      <div class="view" aria-hidden="true"><div class="case" ref={place}><Sides /></div></div>
    </div>
  );
}
