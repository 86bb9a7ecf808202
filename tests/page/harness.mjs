// What every scenario uses: a station of its own, a browser, and a few checks that fail loudly.
import { spawn } from 'node:child_process';
import { mkdirSync, mkdtempSync, rmSync, readFileSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { createServer as createHttpServer } from 'node:http';
import { createServer } from 'node:net';
import { tmpdir } from 'node:os';
import { dirname, join } from 'node:path';
import { createInterface } from 'node:readline';
import { fileURLToPath } from 'node:url';

export const source = join(dirname(fileURLToPath(import.meta.url)), '..', '..');
const require = createRequire(join(source, 'station', 'web', 'package.json'));
const { chromium } = require('playwright-core');
export const axeSource = readFileSync(require.resolve('axe-core/axe.min.js'), 'utf8');

export const [scenario, program, shots, usbStation] = process.argv.slice(2);
mkdirSync(shots, { recursive: true });

const cleanups = [];
export async function clean() {
  for (const cleanup of cleanups.reverse()) await cleanup();
}

export function folder() {
  const path = mkdtempSync(join(tmpdir(), 'sixpoint-page-'));
  cleanups.push(() => rmSync(path, { recursive: true, force: true }));
  return path;
}

// What the programs keep of a store stands in the user's folder: not that of who runs the tests.
process.env.HOME = process.env.XDG_DATA_HOME = folder();

// The token of a station, from the file that its user alone may read; by the station's address.
const homes = new Map();
const token = (url) => readFileSync(join(homes.get(new URL(url).origin), 'state', 'token'), 'utf8').trim();
function ask(url, path, body, headers = {}) {
  const sent = { headers: { Authorization: `Bearer ${token(url)}`, ...headers } };
  return fetch(new URL(path, url), body === undefined ? sent : { ...sent, method: 'POST', body: JSON.stringify(body) });
}

// Starts `sixpoint station` on a free port; answers with its address and a way to end it.
export async function station(devices, { home = folder(), port = 0, more = [] } = {}) {
  const child = spawn(program, [
    'station', '--port', String(port), '--store', join(home, 'store.db'), '--state', join(home, 'state'), '--files', home,
    '--station', 'Bench 1', ...devices.flatMap((device) => ['--device', device]), ...more,
  ], { stdio: ['ignore', 'pipe', 'pipe'], env: { ...process.env, HOME: home, XDG_DATA_HOME: home } });
  let said = '';
  child.stderr.on('data', (data) => { said += data; });
  const ended = new Promise((resolve) => child.once('exit', (code, signal) => resolve(code ?? signal)));
  const printed = await new Promise((resolve, reject) => {
    let text = '';
    child.stdout.on('data', (data) => {
      text += data;
      if (text.includes('\n')) resolve(text.trim().split('\n')[0]);
    });
    child.once('exit', () => reject(new Error(`the station ended: ${said}`)));
  });
  const url = `${new URL(printed).origin}/`;
  homes.set(new URL(url).origin, home);
  const end = async (signal = 'SIGTERM') => {
    child.kill(signal);
    return ended;
  };
  cleanups.push(() => end('SIGKILL'));
  const api = async (path, body, headers) => {
    const answer = await ask(url, path, body, headers);
    return { status: answer.status, json: await answer.json().catch(() => null) };
  };
  return { url, printed, home, end, api, pid: child.pid };
}

// The same with a unit on emulated USB, which outlives the station (usb_station.cpp): `tell` does what a hand does.
export async function stationOnUsb(words = []) {
  const home = folder();
  const port = await new Promise((resolve) => {
    const probe = createServer().listen(0, '127.0.0.1', () => { const { port } = probe.address(); probe.close(() => resolve(port)); });
  });
  // Reports that nobody reads in time are lost. That happens on a machine that is busy with other tests (once 4.8 %), and says
  // nothing of a cable.
  const limits = join(home, 'limits.toml');
  writeFileSync(limits, '[lost_samples_percent]\nhigh = 20\n');
  const child = spawn(usbStation, [
    program, 'station', '--port', String(port), '--store', join(home, 'store.db'), '--state', join(home, 'state'), '--files', home,
    '--station', 'Bench 1', '--device', '{device}', '--limits', limits, ...words,
  ], { stdio: ['pipe', 'pipe', 'pipe'], env: { ...process.env, HOME: home, XDG_DATA_HOME: home } });
  const lines = [];
  let said = '';
  child.stderr.on('data', (data) => { said += data; });
  createInterface({ input: child.stdout }).on('line', (line) => lines.push(line));
  let ended;
  child.once('exit', (code, signal) => { ended = code ?? signal; });
  cleanups.push(async () => { child.stdin.end(); await until('the unit is put away', () => ended !== undefined); });
  const line = (test) => until(`a line of the station on USB (${said})`, () => {
    if (ended !== undefined) throw new Error(`the station on USB ended with ${ended}: ${said}`);
    const at = lines.findIndex(test);
    return at >= 0 && lines.splice(at, 1)[0];
  });
  const serial = (await line((text) => text.startsWith('serial '))).slice(7);
  const url = `${new URL(await line((text) => text.startsWith('http'))).origin}/`;
  homes.set(new URL(url).origin, home);
  const tell = async (word) => {
    child.stdin.write(`${word}\n`);
    check((await line((text) => text === 'ok' || text === 'failed')) === 'ok', `${word} is done`);
  };
  const api = async (path) => (await ask(url, path)).json();
  const again = () => line((text) => text.startsWith('http'));
  return { serial, url, tell, api, again, home };
}

let browser;
async function launch() {
  if (!browser) {
    browser = await chromium.launch({
      executablePath: process.env.CHROMIUM,
      args: ['--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run',
        '--disable-background-networking', '--disable-component-update', '--disable-sync',
        '--host-resolver-rules=MAP rebound.example 127.0.0.1, MAP bench-3 127.0.0.1'],
    });
    cleanups.push(() => browser.close());
  }
}

// Another page, on another port of this machine.
export async function serve(page) {
  const server = createHttpServer((request, response) => response.setHeader('Content-Type', 'text/html').end(page(request)));
  await new Promise((resolve) => server.listen(0, '127.0.0.1', resolve));
  cleanups.push(() => { server.closeAllConnections(); server.close(); });
  return `http://localhost:${server.address().port}/`;
}
export async function bare(url) {
  await launch();
  const page = await (await browser.newContext()).newPage();
  await page.goto(url);
  return page;
}

// A new browser, signed in by a code of its own, unless `url` has one. Its person asks for less motion: drawing takes the
// processor here, and the other tests wait for it.
export async function open(url, { width = 1500, height = 1000, ...more } = {}) {
  await launch();
  const context = await browser.newContext({ viewport: { width, height }, acceptDownloads: true, ignoreHTTPSErrors: true, locale: 'en-US', reducedMotion: 'reduce', ...more });
  const page = await context.newPage();
  page.setDefaultTimeout(60_000);
  const problems = [];
  page.on('pageerror', (error) => problems.push(`page error: ${error.message}`));
  page.on('console', (message) => {
    // A refused command is an answer like any other; the browser notes it as an error of its own.
    if (message.type() === 'error' && !/status of (4|5)\d\d|ERR_CONNECTION|ERR_INCOMPLETE/.test(message.text())) problems.push(message.text());
  });
  page.problems = problems;
  await page.goto(new URL(url).hash ? url : `${url}#code=${(await (await ask(url, '/api/code', {})).json()).code}`);
  await page.getByText('Bench 1').first().waitFor();
  return page;
}

// What every open page shows at a failure: a machine of CI keeps the words and no picture.
export async function describe() {
  for (const page of browser?.contexts().flatMap((each) => each.pages()) ?? []) {
    const text = await page.locator('body').innerText({ timeout: 5000 }).catch((error) => `no text: ${error.message}`);
    console.error(`the page ${page.url()} shows:\n${text.slice(0, 3000)}\nproblems: ${page.problems ?? 'none'}`);
  }
}

export function check(condition, what) {
  if (!condition) throw new Error(`not so: ${what}`);
}

export async function until(what, test, seconds = 60) {
  const end = Date.now() + seconds * 1000;
  for (;;) {
    const answer = await test();
    if (answer) return answer;
    if (Date.now() > end) throw new Error(`never came: ${what}`);
    await new Promise((resolve) => setTimeout(resolve, 40));
  }
}

// Serious and critical findings of axe; none is allowed. The page forbids foreign scripts, so axe comes in by
// the debugger and not by a script element.
export async function axe(page) {
  await page.evaluate(axeSource);
  const result = await page.evaluate(() => window.axe.run(document, { resultTypes: ['violations'] }));
  const text = result.violations.map((each) => `${each.id} (${each.impact}): ${each.nodes.map((node) => node.target.join(' ') + ' ' + (node.any[0]?.message ?? '')).join('; ')}`);
  check(result.violations.length === 0, `axe finds nothing, but: ${text.join('\n')}`);
  check(result.passes === undefined || result.testEngine.name === 'axe-core', 'axe ran');
}

// A picture of a state of the page; axe looks at each of them.
export async function shot(page, name) {
  await page.screenshot({ path: join(shots, `${name}.png`), fullPage: true });
  await axe(page);
}

// The technician: looks at what the page wants in the biggest words and turns the (virtual) unit there.
const wantedFace = async (page) => ((await page.locator('.prompt').textContent()) ?? '').match(/([+−][XYZ]) side up/)?.[1];
const turn = (page, face) => page.locator('.hand').getByRole('button', { name: face, exact: true }).click();
export async function turnAsAsked(page) {
  const face = await until('a wanted side', () => wantedFace(page));
  await turn(page, face);
  return face;
}

// The same until the page shows that a side is being read, which lasts a second: a busy browser may miss one, and gets the next.
export async function turnUntilDwelling(page) {
  let turned;
  await until('a side that is being read', async () => {
    if (turned && await page.locator('.still-dwelling').count()) return true;
    const face = await wantedFace(page);
    if (face && face !== turned) await turn(page, face);
    turned = face ?? turned;
    return false;
  });
}

// Placements, as many as the page counts.
export async function taken(page) {
  return page.locator('.placements li.taken').count();
}
export async function place(page, count) {
  const hasResult = async () => (await page.locator('.result').count()) > 0;
  for (let turns = 0; await taken(page) < count; ++turns) {
    const before = await taken(page);
    const asked = await page.locator('.prompt').textContent();
    // A result that is there before the first turn is of the run before; later on, the run ended behind the count.
    const face = await until('a wanted side', async () => (await wantedFace(page)) ?? (turns > 0 && (await hasResult()) && 'none'));
    if (face === 'none') return;
    await turn(page, face);
    await until('the pose is taken', async () =>
      (await taken(page)) > before || (await hasResult()) || (await page.locator('.prompt').textContent()) !== asked);
    if (await hasResult()) return;
    // The prompt may be a moment ahead of the count: who turns once too often has one placement too many.
    await until('the count', async () => (await taken(page)) > before, 1).catch(() => {});
  }
}
