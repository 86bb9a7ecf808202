// A label scanner is a keyboard that types what the label says, and Enter. It is heard on every tab and in every field,
// also a slow one (500 ms a character): it is known by what it types, not by how fast.
import { useEffect, useRef } from 'preact/hooks';

const LONGEST_GAP_MS = 1500;
// The QR code of our labels ("sixpoint:SERIAL:RUN"), or a bare serial number ("MOS2A45130007").
const LABEL = /(?:sixpoint:[\x21-\x39\x3b-\x7e]{1,16}:[0-9a-f]{6,64}|[a-z]{3}[0-9][a-z][0-9]{8})$/i;
export const serialOf = (label: string) => (label.includes(':') ? label.split(':')[1] : label).toUpperCase();

type Field = HTMLInputElement | HTMLSelectElement;
const isField = (target: EventTarget | null): target is Field => target instanceof HTMLInputElement || target instanceof HTMLSelectElement;

export function useScanner(found: (label: string) => void) {
  const typed = useRef('');
  const last = useRef(0);
  const before = useRef('');  // what the field held before the first character
  useEffect(() => {
    const press = (event: KeyboardEvent) => {
      if (event.ctrlKey || event.altKey || event.metaKey) return;
      const field = isField(event.target) ? event.target : null;
      if (event.timeStamp - last.current > LONGEST_GAP_MS) typed.current = '';
      if (event.key.length === 1) {
        if (!typed.current) before.current = field?.value ?? '';
        typed.current += event.key;
        last.current = event.timeStamp;
        return;
      }
      if (event.key !== 'Enter') {
        if (event.key !== 'Shift') typed.current = '';
        return;
      }
      const label = typed.current.match(LABEL)?.[0];
      typed.current = '';
      // A field that asks for a serial number takes it as it is typed.
      if (!label || field?.dataset.serial !== undefined) return;
      event.preventDefault();
      event.stopPropagation();
      if (field) {
        field.value = before.current;
        field.dispatchEvent(new Event(field instanceof HTMLInputElement ? 'input' : 'change', { bubbles: true }));
      }
      found(label);
    };
    window.addEventListener('keydown', press, true);
    return () => window.removeEventListener('keydown', press, true);
  });
}
