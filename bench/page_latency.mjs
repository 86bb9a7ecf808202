// Sixteen lanes at 100 Hz in real time, one page open: from a report's arrival at the program to the line
// on the page, and what the server takes meanwhile.
//   node bench/page_latency.mjs 16 build/sixpoint build/screenshots      (16: lanes)
import { readFileSync } from 'node:fs';
import * as h from '../tests/page/harness.mjs';

const lanes = Number(h.scenario);
const seconds = 20;
const cpuTicks = (pid) => {
  const fields = readFileSync(`/proc/${pid}/stat`, 'utf8').split(') ')[1].split(' ');
  return Number(fields[11]) + Number(fields[12]);
};
const peakKb = (pid) => Number(/VmHWM:\s+(\d+)/.exec(readFileSync(`/proc/${pid}/status`, 'utf8'))[1]);
try {
  const station = await h.station(Array.from({ length: lanes }, (_, i) => `virtual:seed=${100 + i},pace=real`));
  const page = await h.open(station.url, { width: 1900, height: 1050 });
  for (let lane = 1; lane <= lanes; ++lane) {
    await h.until('ready', async () => (await station.api(`/api/lanes/${lane}`)).json.state === 'idle');
    await station.api('/api/run', { lane });
  }
  await new Promise((resolve) => setTimeout(resolve, 3000));
  await page.evaluate(() => { window.sixpointDelays.length = 0; });
  const ticks = cpuTicks(station.pid);
  await new Promise((resolve) => setTimeout(resolve, seconds * 1000));
  const delays = (await page.evaluate(() => [...window.sixpointDelays])).sort((a, b) => a - b);
  const cores = (cpuTicks(station.pid) - ticks) / 100 / seconds;
  const at = (part) => delays[Math.min(delays.length - 1, Math.floor(delays.length * part))];
  console.log(`${lanes} lanes at 100 Hz, ${delays.length} drawn updates in ${seconds} s`);
  console.log(`report to drawn trace  p50 ${at(0.5).toFixed(0)} ms, p95 ${at(0.95).toFixed(0)} ms, ${(at(0.95) / 150).toFixed(2)} of the 150 ms allowed; the oldest sample of a report is 50 ms older`);
  console.log(`server                 ${cores.toFixed(2)} cores (1 allowed), ${(peakKb(station.pid) / 1024).toFixed(0)} MB at most (200 allowed)`);
} finally {
  await h.clean();
}
