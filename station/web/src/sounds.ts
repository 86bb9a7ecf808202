// Short tones for hands that are busy: taken, refused, passed, not passed.
import { useEffect, useRef } from 'preact/hooks';
import type { Lane } from './types';

type Sound = 'taken' | 'refused' | 'passed' | 'failed';
// Hertz, one tone after the other, 0.12 s each. Up is good, down is not.
const TONES: Record<Sound, number[]> = {
  taken: [880], refused: [330, 330], passed: [660, 880, 1320], failed: [440, 330, 220],
};
const TONE_S = 0.12;

// What was played, for tests.
const played: Sound[] = [];
(window as unknown as { sixpointSounds: Sound[] }).sixpointSounds = played;

let context: AudioContext | null = null;
export const soundsAreOn = () => localStorage.getItem('sixpoint-sounds') !== 'off';
export const turnSounds = (on: boolean) => localStorage.setItem('sixpoint-sounds', on ? 'on' : 'off');

function play(sound: Sound) {
  if (!soundsAreOn()) return;
  played.push(sound);
  context ??= new AudioContext();  // silent until the page was clicked once: the browser's rule
  const volume = context.createGain();
  volume.gain.value = 0.2;
  volume.connect(context.destination);
  TONES[sound].forEach((hertz, i) => {
    const tone = context!.createOscillator();
    tone.frequency.value = hertz;
    tone.connect(volume);
    tone.start(context!.currentTime + i * TONE_S);
    tone.stop(context!.currentTime + (i + 0.8) * TONE_S);
  });
}

// Of the lane in front; what happened before it came to the front makes no sound.
export function useSounds(lane: Lane) {
  const last = lane.log.length ? lane.log[lane.log.length - 1].id : 0;
  const heard = useRef(last);
  const verdict = lane.state === 'done' ? lane.result?.verdict ?? '' : '';
  const seen = useRef(verdict);
  useEffect(() => {
    // Lines come several at a time; a new run counts them from 1 again.
    const fresh = lane.log.filter((line) => line.id > (last < heard.current ? 0 : heard.current)).map((line) => line.kind);
    if (fresh.includes('refused')) play('refused');
    else if (fresh.includes('accepted')) play('taken');
    heard.current = last;
  }, [last]);
  useEffect(() => {
    if (verdict && verdict !== seen.current) play(verdict === 'pass' || verdict === 'conditional_pass' ? 'passed' : 'failed');
    seen.current = verdict;
  }, [verdict]);
}
