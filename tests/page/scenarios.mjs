// The page in a real browser, against virtual units:  node scenarios.mjs SCENARIO PROGRAM SCREENSHOTS
import { execFileSync } from 'node:child_process';
import { existsSync, mkdirSync, readFileSync, writeFileSync } from 'node:fs';
import { createServer as createNetServer } from 'node:net';
import { join } from 'node:path';
import * as h from './harness.mjs';

const { check, until } = h;
const button = (page, name) => page.getByRole('button', { name, exact: true });
const start = (page) => button(page, 'Start the measurement').click();
const prompt = (page) => page.locator('.prompt').first().textContent();
// Presses until the run is there, as a person does: on a busy machine an order may be older than the five seconds
// after which it is refused, and a run may be over at once without a verdict.
const begin = (page, ...names) => until(`${names[0]}: the run is there`, async () => {
  for (const name of names) {
    if (await button(page, name).isVisible()) await button(page, name).click({ timeout: 1000 }).catch(() => {});
  }
  return (await page.locator('.prompt', { hasText: /[+−][XYZ]/ }).count()) > 0;
});
// The same for a side of a calibration file.
const leave = async (page) => {
  const late = page.getByText('this command came too late');
  for (;;) {
    await button(page, 'It lies there').click();
    await page.getByText(/Do not touch it for/).or(late).first().waitFor();
    if (!(await late.isVisible())) return;
    await button(page, 'OK').click();
  }
};
// The side that is asked for now, or as soon as one is.
const wantedFace = (place) => until('a wanted side', async () => (await place.locator('.prompt').first().textContent())?.match(/[+−][XYZ]/)?.[0]);
const refusal = (page, text) => page.locator('.refusal', { hasText: text }).waitFor();

const scenarios = {
  // From the first look to the verdict, as a technician does it.
  async whole() {
    const station = await h.station(['virtual:seed=7,pace=10']);
    const page = await h.open(station.url);
    await button(page, 'Start the measurement').waitFor();
    await h.shot(page, 'whole-1-ready');
    await page.getByLabel('Your name').fill('Ada');
    await start(page);
    await h.place(page, 3);
    await h.turnUntilDwelling(page);
    await h.shot(page, 'whole-2-measuring');
    await h.place(page, 14);
    await page.locator('.result').waitFor();
    check((await page.locator('.result .verdict').textContent()).includes('PASS - NOT WRITTEN'), 'the verdict is a pass, and nothing is in the unit');
    await page.getByText(/Stored as run [0-9a-f]{12}/).waitFor();
    await h.shot(page, 'whole-3-verdict');
    const lane = (await station.api('/api/lanes/1')).json;
    check(lane.operator === 'Ada', 'the operator is in the record');
    check(lane.run.taken.length === 14, 'fourteen placements');
    check(lane.result.residual_mg < 3, `the constants fit unseen placements: ${lane.result.residual_mg} mg`);
    const report = (await station.api(`/api/runs/${lane.result.run}/report.json`)).json;
    check(report.schema === 'sixpoint/jig/1' && report.run === lane.result.run, 'it says what it is');
    check(report.serial === lane.unit.serial && report.verification.poses.length === 8, 'the store has the whole report');
    // "Write now": the same readings, two more placements, and the unit holds it.
    await button(page, 'Write now').click();
    await h.place(page, 16);
    await page.locator('.result .verdict', { hasText: 'PASS - WRITTEN' }).waitFor();
    await page.getByRole('link', { name: 'Label (ZPL)' }).waitFor();
    await h.shot(page, 'whole-4-written');
    await page.locator('.hand').getByRole('button', { name: 'Unplug', exact: true }).click();
    await page.getByText('Plug a unit in').waitFor();
    check(await page.locator('.result .verdict').isVisible(), 'the verdict stays when the unit is out');
    await page.locator('.hand').getByRole('button', { name: 'Swap for another', exact: true }).click();
    await page.getByText(`Last unit: ${lane.unit.serial}, PASS - WRITTEN`).waitFor();
    check((await page.locator('.result').count()) === 0, 'and is not taken for the next one\'s');
    await button(page, 'Today').click();
    await page.getByText('1 unit today, 1 passed').waitFor();
    check((await page.locator('tbody tr').count()) === 2, 'the run and its write');
    check((await page.locator('tbody tr').first().textContent()).includes('PASS - WRITTEN'), 'the newest first');
    await h.shot(page, 'whole-5-today');
    check(page.problems.length === 0, `no errors on the page: ${page.problems}`);
  },

  // The printed address opens one browser; the code does not stay in the address, another browser needs another one, and
  // the session outlives the program.
  async sign_in() {
    const home = h.folder();
    const devices = ['virtual:seed=7,pace=10'];
    const station = await h.station(devices, { home });
    const first = await h.open(station.printed);
    await button(first, 'Start the measurement').waitFor();
    check(first.url() === station.url, `the address has no code any more: ${first.url()}`);
    check((await first.evaluate(() => history.length)) <= 2, 'nor has the history');
    check((await first.evaluate(() => document.cookie)) === '', 'no script reads the session');
    const second = await h.bare(station.printed);  // the same code again
    await second.getByRole('heading', { name: 'Sign this browser in' }).waitFor();
    check((await second.getByText('MOS2').count()) === 0, 'nothing of the bench is shown');
    await h.shot(second, 'sign-in-1-asked');
    await second.getByLabel('Code').fill('AAAA-AAAA-AAAA');
    await button(second, 'Sign in').click();
    await second.getByText('this code was used, is too old, or never was one').waitFor();
    await button(first, 'Let another browser in').click();
    const address = await first.locator('.code').textContent();
    await h.shot(first, 'sign-in-2-code');
    await second.getByLabel('Code').fill(address.match(/code=(.*)/)[1].toLowerCase());
    await second.keyboard.press('Enter');
    await button(second, 'Start the measurement').waitFor();
    await station.end();
    await h.station(devices, { home, port: new URL(station.url).port });
    await first.reload();
    await button(first, 'Start the measurement').waitFor();
    check(first.problems.length === 0, `no errors on the page: ${first.problems}`);
  },

  // Operators with PINs: the page asks who works, the record has the name that signed in.
  async pins() {
    const home = h.folder();
    const env = { ...process.env, HOME: home, XDG_DATA_HOME: home };
    execFileSync(h.program, ['operator', 'add', 'Ada'], { input: '471100\n', env, stdio: ['pipe', 'ignore', 'ignore'] });
    const station = await h.station(['virtual:seed=7,jig=auto'], { home });
    const page = await h.open(station.url);
    await start(page);
    await page.getByText('no operator is signed in here').waitFor();
    await h.shot(page, 'pins-1-asked');
    await page.getByLabel('PIN').fill('0000');
    await button(page, 'Begin').click();
    await page.getByText('do not belong together').waitFor();
    await page.getByLabel('PIN').fill('471100');
    await page.keyboard.press('Enter');
    await page.getByText('Ada (technician)').waitFor();
    await start(page);
    await page.locator('.result .verdict', { hasText: 'PASS' }).waitFor();
    await page.getByText(/Stored as run/).waitFor();
    const lane = (await station.api('/api/lanes/1')).json;
    const certificate = (await station.api(`/api/runs/${lane.result.run}/certificate.json`)).json;
    check(certificate.operator === 'Ada' && certificate.operator_authenticated === true, JSON.stringify([certificate.operator, certificate.operator_authenticated]));
    await h.shot(page, 'pins-2-signed-in');
    await button(page, 'Sign out').click();
    await page.getByLabel('PIN').waitFor();
    check(page.problems.length === 0, `no errors on the page: ${page.problems}`);
  },

  // In German, at night, by ear.
  async german() {
    const station = await h.station(['virtual:seed=7,pace=10', 'virtual:seed=8,jig=auto']);
    const page = await h.open(station.url, { locale: 'de-DE', colorScheme: 'dark' });
    const ground = () => page.evaluate(() => getComputedStyle(document.body.parentElement).backgroundColor);
    check(await page.evaluate(() => document.documentElement.lang) === 'de', 'the page says that it is German');
    check(await ground() === 'rgb(14, 22, 30)', `dark: ${await ground()}`);
    const see = async (name) => { await h.axe(page); await h.shot(page, `german-${name}`); };
    await page.locator('.prompt', { hasText: 'Bereit zur Messung' }).waitFor();
    await see('1-ready');
    await begin(page, 'Messung beginnen', 'Dieses Gerät noch einmal messen');
    check((await page.locator('.prompt').textContent()).includes('nach oben'), 'the side is asked for in German');
    const side = (await page.locator('.prompt').textContent()).match(/[+−][XYZ]/)[0];
    await page.locator('.hand').getByRole('button', { name: side, exact: true }).click();
    await until('the side is taken', () => h.taken(page).then((count) => count > 0));
    check(/\d von 14 Lagen .* \d+:\d\d min vergangen/.test(await page.locator('.placements p').textContent()), await page.locator('.placements p').textContent());
    await until('a tone for it', async () => (await page.evaluate(() => window.sixpointSounds)).includes('taken'));
    await see('2-running');
    await page.locator('.cards').getByRole('button', { name: /^2/ }).click();
    await button(page, 'Messung beginnen').click();
    await page.locator('.result .verdict', { hasText: 'BESTANDEN - NICHT GESCHRIEBEN' }).waitFor();
    await until('a tone for the end', async () => (await page.evaluate(() => window.sixpointSounds)).at(-1) === 'passed');
    await see('3-done');
    await page.getByText('Messwerte und Grenzen').waitFor();
    for (const tab of ['Heute', 'Meine Dateien', 'Kontrollgeräte', 'Statistik']) {
      await button(page, tab).click();
      await until(`${tab} is there`, () => page.locator('main h2').count());
      await see(`4-${tab}`);
    }
    // Quiet, and in English again, also after a reload.
    await page.getByLabel('Töne').uncheck();
    await page.getByLabel('Sprache').selectOption('en');
    await button(page, 'Jig').click();
    await page.locator('.cards').getByRole('button', { name: /^2/ }).click();
    check(!await page.getByLabel('Sounds').isChecked(), 'the choice stays');
    await begin(page, 'Measure this unit again');
    await page.locator('.result .verdict', { hasText: 'PASS' }).waitFor();
    check((await page.evaluate(() => window.sixpointSounds)).length === 0, 'no tone after they were turned off');
    check(page.problems.length === 0, `no errors on the page: ${page.problems}`);
    // Light, as long as the machine is.
    const light = await h.open(station.url, { locale: 'fr-FR', colorScheme: 'light' });
    await light.locator('.prompt').waitFor();
    check(await light.evaluate(() => document.documentElement.lang) === 'en', 'English where there is no other');
  },

  // What the page says of the jig's due day, of a unit that was written and not checked, and of a run without a verdict is
  // what the station says.
  async words() {
    const home = h.folder();
    const limits = join(home, 'limits.toml');
    writeFileSync(limits, '[decision]\ncoverage_factor = 3\n');
    const overdue = ['--jig-due', '2020-01-01'];
    const unsigned = await h.station(['virtual:seed=8,jig=auto'], { more: overdue });
    const refused = await h.open(unsigned.url);
    const footer = (page) => page.locator('footer b').textContent();
    check(/2020-01-01: nothing is measured until .*--jig-exception/.test(await footer(refused)), await footer(refused));
    await start(refused);
    await refused.locator('.result .verdict', { hasText: 'NOT MEASURED' }).waitFor();
    check((await prompt(refused)) === 'Not measured: read why below', `no unit is done: ${await prompt(refused)}`);
    await unsigned.end();

    const station = await h.station(['virtual:seed=7,pace=10', 'virtual:seed=8,jig=auto'],
      { home, more: [...overdue, '--jig-exception', 'lab closed', '--jig-exception-by', 'Eve', '--limits', limits] });
    const page = await h.open(station.url);
    check(/2020-01-01: Eve signed/.test(await footer(page)), await footer(page));
    // Written, and stopped before it was measured again.
    await page.getByLabel('Write the constants into the unit').check();
    await start(page);
    await h.place(page, 15);
    await until('the check of what was written', async () => (await station.api('/api/lanes/1')).json.run?.phase === 'rechecking');
    await button(page, 'Stop this run').click();
    await button(page, 'Yes, stop').click();
    await page.locator('.result .verdict', { hasText: 'STOPPED - WRITTEN, NOT CHECKED' }).waitFor();
    check((await prompt(page)) === 'Stopped: not measured to its end', await prompt(page));
    await page.getByText('The unit now holds the new constants, and they were not checked.').waitFor();
    await h.shot(page, 'words-1-written');
    // Too many placements that are refused: what to do is what the station says, and no other time to wait.
    await begin(page, 'Measure this unit again');
    const sides = ['+x', '-x', '+y', '-y', '+z', '-z'];
    for (let i = 0; (await station.api('/api/lanes/1')).json.state !== 'done'; ++i) {
      await station.api('/api/lanes/1/hand', { do: 'turn', pose: sides[i % 6], tilt_deg: 9 });
      await new Promise((resolve) => setTimeout(resolve, 350));
    }
    await page.locator('.result .verdict', { hasText: 'NO VERDICT' }).waitFor();
    check((await prompt(page)) === 'No verdict: read why below', await prompt(page));
    const said = await page.locator('.result').innerText();
    check(/written below/.test(said) && /What to do: Look at jig, seat and cable/.test(said) && !/minutes/.test(said), said);
    // The expanded uncertainty has the factor of the limits file.
    await page.locator('.cards').getByRole('button', { name: /^2/ }).click();
    await start(page);
    await page.getByText('Measured values and limits').click();
    await page.getByRole('columnheader', { name: 'U (k = 3)' }).waitFor();
    check(page.problems.length === 0, `no errors on the page: ${page.problems}`);
  },

  // The same over TLS, as on another address; opened by the name that the certificate has.
  async tls() {
    const home = h.folder();
    const [cert, key] = ['cert.pem', 'key.pem'].map((name) => join(home, name));
    execFileSync('openssl', ['req', '-x509', '-newkey', 'ec', '-pkeyopt', 'ec_paramgen_curve:prime256v1', '-nodes', '-days', '2',
      '-subj', '/CN=bench', '-addext', 'subjectAltName=DNS:bench-3,IP:127.0.0.1', '-keyout', key, '-out', cert], { stdio: 'ignore' });
    const station = await h.station(['virtual:seed=7,pace=10'], { home, more: ['--tls-cert', cert, '--tls-key', key] });
    check(station.printed.startsWith('https://'), station.printed);
    const page = await h.open(station.printed.replace('127.0.0.1', 'bench-3'));
    await start(page);
    await h.place(page, 2);
    const cookies = await page.context().cookies();
    check(cookies.length === 1 && cookies[0].secure && cookies[0].httpOnly && cookies[0].sameSite === 'Strict', JSON.stringify(cookies));
    check(page.problems.length === 0, `no errors on the page: ${page.problems}`);
  },

  // Without a mouse: Tab to the button, Enter, Backspace to undo.
  async keyboard() {
    const station = await h.station(['virtual:seed=8,pace=10', 'virtual:seed=9,serial=MOS2A45130009,pace=10']);
    const page = await h.open(station.url);
    const reach = async (name) => {
      for (let i = 0; i < 60; ++i) {
        await page.keyboard.press('Tab');
        if (await page.evaluate((text) => document.activeElement?.textContent === text, name)) return;
      }
      throw new Error(`Tab does not reach '${name}'`);
    };
    await button(page, 'Start the measurement').waitFor();
    // A scanner types a serial number and Enter, wherever the focus is: its lane comes to the front.
    // On a busy machine the browser may get the keys slower than a scanner sends them: then again.
    const scan = (serial, text) => until(text, async () => {
      await page.keyboard.type(serial, { delay: 5 });
      await page.keyboard.press('Enter');
      return page.getByText(text).waitFor({ timeout: 3000 }).then(() => true, () => false);
    });
    await scan('MOS2A45130009', 'Label MOS2A45130009: matches');
    await scan('MOS2A45139999', 'no lane holds a unit MOS2A45139999');
    await h.shot(page, 'keyboard-1-scan');
    await reach('OK');
    await page.keyboard.press('Enter');
    await page.evaluate(() => document.activeElement?.blur());
    await page.keyboard.press('ArrowRight');
    await page.getByRole('heading', { name: /^Lane 1/ }).waitFor();
    await reach('Start the measurement');
    await page.keyboard.press('Enter');
    await until('it runs', async () => /side up/.test(await prompt(page)));
    for (let done = 0; done < 2; ++done) {
      const face = await wantedFace(page);
      await reach(face);
      await page.keyboard.press('Enter');
      await until('taken', async () => (await h.taken(page)) > done);
    }
    await page.keyboard.press('Backspace');
    await until('taken back', async () => (await h.taken(page)) === 1);
    await reach('Stop this run');
    const ring = await page.evaluate(() => getComputedStyle(document.activeElement).outlineWidth);
    check(parseFloat(ring) >= 3, `the focus is plainly seen (${ring})`);
    await h.shot(page, 'keyboard-2-focus');
    await page.keyboard.press('Enter');
    await reach('Yes, stop');
    await page.keyboard.press('Enter');
    await page.locator('.result .verdict', { hasText: 'Stopped' }).waitFor();
    check(page.problems.length === 0, `no errors on the page: ${page.problems}`);
  },

  // A slip of each kind is refused with its reason, and the run ends well all the same.
  async slips() {
    const station = await h.station(['virtual:seed=11,pace=5']);
    const page = await h.open(station.url);
    const hand = (name) => page.locator('.hand').getByRole('button', { name, exact: true }).click();
    // The browser's machine slept for a minute: its clock stood still, the station's did not.
    await page.evaluate(() => {
      const now = performance.now.bind(performance);
      performance.now = () => now() - 60_000;
    });
    await start(page);
    await page.getByText('this command came too late, and nothing was done').waitFor();
    await begin(page, 'Start the measurement');
    await h.place(page, 3);
    // Knocked while it is measured. On a busy machine the knock may come when the pose is taken: then again.
    await until('a knock in mid-reading', async () => {
      const before = await h.taken(page);
      await h.turnUntilDwelling(page);
      await hand('Knock');
      await until('it is decided', async () => (await h.taken(page)) > before || (await page.locator('.refusal', { hasText: 'moved during' }).isVisible()));
      return (await h.taken(page)) === before;
    });
    await refusal(page, 'moved during the reading');
    await h.shot(page, 'slips-1-moved');
    await hand('+Z');
    // No order to repeat the side that is done: the one that is wanted is named.
    await refusal(page, /Not taken: \+z is done already\. Now: [+−][XY] side up\.$/);
    await hand('Lean on an edge');
    await refusal(page, 'lies on none of its six faces');
    await h.shot(page, 'slips-2-edge');
    await page.getByLabel('next one tilted 7.2°').check();
    await h.turnAsAsked(page);
    await refusal(page, /Not taken: tilted \d+\.\d degrees/);
    await h.shot(page, 'slips-3-tilted');
    await h.place(page, 5);
    const placements = await h.taken(page);
    await button(page, 'Undo the last placement (Backspace)').click();
    await until('undone', async () => (await h.taken(page)) === placements - 1);
    await h.place(page, 13);
    // One of two is left to be put back: another face is the wrong one.
    const wanted = await wantedFace(page);
    await hand(wanted === '+Y' ? '−Y' : '+Y');
    await refusal(page, 'wrong face');
    await h.shot(page, 'slips-4-wrong-face');
    await h.place(page, 14);
    await page.locator('.result .verdict', { hasText: 'Pass' }).waitFor();
    check((await station.api('/api/lanes/1')).json.result.refusals >= 5, 'the slips are in the record');
  },

  // Pulled out and put back: the run goes on. Another unit in its place: nothing is mixed.
  async replug() {
    const station = await h.station(['virtual:seed=12,serial=MOS2A45130012,pace=10']);
    const page = await h.open(station.url);
    const hand = (name) => page.locator('.hand').getByRole('button', { name, exact: true }).click();
    await start(page);
    await h.place(page, 4);
    await hand('Unplug');
    const pulled = Date.now();
    await page.getByText('The unit is unplugged: plug it in again').waitFor();
    console.log(`unplugging was on the page after ${Date.now() - pulled} ms`);
    await h.shot(page, 'replug-1-unplugged');
    await hand('Plug in');
    await until('it goes on', async () => /[+−][XYZ] side up/.test(await prompt(page)));
    check((await h.taken(page)) === 4, 'what was taken is still there');
    await h.place(page, 6);
    await hand('Swap for another');
    await page.getByText('Another unit is plugged in').waitFor();
    await page.getByText('put MOS2A45130012 back').first().waitFor();
    await h.shot(page, 'replug-2-another');
    await button(page, 'Stop this run').click();
    await button(page, 'Yes, stop').click();
    // Another unit lies there: what came of the first one is one line with its serial number.
    await page.locator('.last', { hasText: 'MOS2A45130012' }).filter({ hasText: /stopped/i }).waitFor();
    const lane = (await station.api('/api/lanes/1')).json;
    check(lane.result.serial === 'MOS2A45130012', 'the run is the first unit\'s');
    check(page.problems.length === 0, `no errors on the page: ${page.problems}`);
  },

  // The page is loaded anew, and the program is killed and started again, in mid-run.
  async reload() {
    const home = h.folder();
    const devices = ['virtual:seed=13,pace=10'];
    const first = await h.station(devices, { home });
    let page = await h.open(first.url);
    await page.getByLabel('Your name').fill('Ada');
    await start(page);
    await h.place(page, 3);
    await page.reload();
    await until('the page knows the run', async () => (await h.taken(page)) === 3);
    check(await button(page, 'Stop this run').isVisible(), 'it is still the same person\'s run');
    await h.place(page, 8);
    await until('on the disk', () => existsSync(join(home, 'state')));
    await first.end('SIGKILL');
    await page.getByText('The station does not answer').waitFor();
    await h.shot(page, 'reload-1-station-gone');
    const second = await h.station(devices, { home, port: new URL(first.url).port });
    await page.getByText('The station does not answer').waitFor({ state: 'detached' });
    await until('the run goes on', async () => (await h.taken(page)) >= 8);
    await h.shot(page, 'reload-2-goes-on');
    await h.place(page, 14);
    await page.locator('.result .verdict', { hasText: 'Pass' }).waitFor();
    await page.getByText(/Stored as run/).waitFor();
    check((await second.api('/api/lanes/1')).json.operator === 'Ada', 'the operator survives too');
  },

  // One person, sixteen units, one session.
  async sixteen() {
    const devices = Array.from({ length: 16 }, (_, i) => `virtual:seed=${100 + i},pace=16`);
    const station = await h.station(devices);
    const page = await h.open(station.url, { width: 1900, height: 1050 });
    await page.locator('.card').nth(15).waitFor();
    for (let lane = 1; lane <= 16; ++lane) {
      await until('ready', async () => (await station.api(`/api/lanes/${lane}`)).json.state === 'idle');
      check((await station.api('/api/run', { lane, operator: 'Ada' })).status === 202, 'started');
    }
    const began = Date.now();
    let pictures = 0;
    const done = new Map(); // lane -> the question that was answered last
    await until('all sixteen are done', async () => {
      const view = await page.evaluate(() => ({
        lane: document.querySelector('#lane-title')?.textContent?.match(/Lane (\d+)/)?.[1],
        prompt: document.querySelector('.prompt')?.textContent,
        still: document.querySelector('.still')?.className ?? '',
        taken: document.querySelectorAll('.placements li.taken').length,
        refusal: document.querySelector('.refusal')?.textContent ?? '',
        finished: [...document.querySelectorAll('.card')].filter((card) => /verdict-./.test(card.className)).length,
      }));
      const face = view.prompt?.match(/[+−][XYZ]/)?.[0];
      const question = `${face} ${view.taken} ${view.refusal}`;
      if (face && !/dwelling|settling/.test(view.still) && done.get(view.lane) !== question) {
        done.set(view.lane, question);
        await page.locator('.hand').getByRole('button', { name: face, exact: true }).click();
        if (++pictures === 100) {
          await h.shot(page, 'sixteen-1-at-work');
        }
      }
      return view.finished === 16;
    }, 480);
    console.log(`sixteen units in ${((Date.now() - began) / 1000).toFixed(0)} s at sixteen times the real pace`);
    await h.shot(page, 'sixteen-2-done');
    for (let lane = 1; lane <= 16; ++lane) {
      const json = (await station.api(`/api/lanes/${lane}`)).json;
      check(json.result.verdict === 'pass', `lane ${lane} passes: ${JSON.stringify(json.result)}`);
    }
    check(page.problems.length === 0, `no errors on the page: ${page.problems}`);
  },

  // The customer: a calibration file, its check, and the repair of the archive.
  async files() {
    const home = h.folder();
    const constants = 'positive_lsb=311/310/287,negative_lsb=-204/-216/-234,zero_lsb=54/47/26';
    const truth = 'true_sensitivity_lsb_per_g=237.7/251.8/242.3,true_zero_lsb=49.9/95.8/60.8';
    const unit = `virtual:seed=7,serial=MOS2A45130007,firmware=1.5.0,calibrated=2013-11-12,${constants},${truth},pace=60`;
    mkdirSync(join(home, 'archive'));
    for (const day of [1, 2]) {
      const scenario = JSON.parse(readFileSync(join(h.source, 'tests/docs/scenario.json'), 'utf8'));
      scenario.seed = day;
      writeFileSync(join(home, `s${day}.json`), JSON.stringify(scenario));
      execFileSync(h.program, ['simulate', '--scenario', join(home, `s${day}.json`), '-o', join(home, 'archive', `day${day}.gt3x`)]);
    }
    const station = await h.station([unit, 'virtual:seed=7,firmware=1.8.0,pace=60'], { home });
    const page = await h.open(station.url);
    await button(page, 'My files').click();
    await h.axe(page);
    await button(page, 'Start recording').click();
    const capture = page.locator('section', { hasText: '1. Record' }).first();
    for (let side = 1; side <= 6; ++side) {
      await page.getByText(`Side ${side} of 6`).waitFor();
      const face = await wantedFace(capture);
      await capture.locator('.hand').getByRole('button', { name: face, exact: true }).click();
      if (side === 2) await h.shot(page, 'files-1-side');
      await button(page, 'It lies there').click();
      await until('the next side, or the end', async () =>
        (await capture.locator('.result').count()) > 0 || (await button(page, 'It lies there').count()) > 0);
    }
    await capture.locator('.result .verdict', { hasText: 'Pass' }).waitFor();
    await page.getByText(/Constants saved in/).first().waitFor();
    // The file that was just made, as one that a customer brought.
    await page.getByRole('button', { name: 'Check', exact: true }).click();
    await page.getByText('This file can be used: every side is in it.').waitFor();
    await h.shot(page, 'files-2-checked');
    // A recording in which two sides were forgotten.
    const partial = JSON.parse(readFileSync(join(h.source, 'tests/docs/scenario.json'), 'utf8'));
    partial.motions = ['+z', '-z', '+x', '-x'].map((pose) => ({ kind: 'still', duration_s: 40, pose }));
    writeFileSync(join(home, 'partial.json'), JSON.stringify(partial));
    execFileSync(h.program, ['simulate', '--scenario', join(home, 'partial.json'), '-o', join(home, 'partial.gt3x')]);
    await page.reload();
    await page.locator('#check-title').waitFor();
    await page.locator('section', { has: page.locator('#check-title') }).locator('select').selectOption('partial.gt3x');
    await page.getByRole('button', { name: 'Check', exact: true }).click();
    await page.locator('.result.bad .verdict.small').waitFor();
    const missing = await page.locator('.sides .missing').allTextContents();
    check(missing.some((text) => text.includes('+Y: ✖ repeat')) && missing.length >= 2, `the forgotten sides are named: ${missing}`);
    await h.shot(page, 'files-3-not-usable');
    // Repair.
    await page.getByLabel('Folder with recordings').selectOption('archive');
    await page.getByLabel('Folder for repaired files').fill('repaired');
    await button(page, 'Repair my files').click();
    await page.getByText('Done. 2 of 2 files, 2 repaired').waitFor();
    await h.shot(page, 'files-4-repaired');
    check(existsSync(join(home, 'repaired', 'day1.gt3x')), 'the repaired file is there');
    const job = (await station.api('/api/job')).json;
    check(job.files.every((file) => file.status === 'repaired'), 'all are repaired');
    // A unit whose recording cannot help is refused, with what can.
    await capture.locator('select').selectOption('2');
    await button(page, 'Start recording').click();
    await page.getByText('install a firmware from 1.4.0 to 1.7.0').first().waitFor();
    await h.shot(page, 'files-5-refused');
    // The lane says so, too.
    await button(page, 'Jig').click();
    const ended = async (lane, words) => {
      await page.locator('.cards').getByRole('button', { name: lane }).click();
      await until(words, async () => (await prompt(page)) === words);
    };
    await ended(/^2/, 'No calibration file was made');
    await ended(/^1/, 'The calibration file is done');
    check(page.problems.length === 0, `no errors on the page: ${page.problems}`);
  },

  // The papers of a run that wrote its constants into the unit.
  async certificate() {
    const station = await h.station(['virtual:seed=15,serial=MOS2A45130015,jig=auto']);
    const page = await h.open(station.url);
    await page.getByLabel('Your name').fill('Ada');
    await page.getByLabel('Write the constants into the unit').check();
    await start(page);
    await page.locator('.result .verdict', { hasText: 'Pass' }).waitFor();
    await page.getByText(/Stored as run/).waitFor();
    await h.shot(page, 'certificate-1-links');
    const fetched = async (name) => {
      const [download] = await Promise.all([page.waitForEvent('download'), page.getByRole('link', { name }).click()]);
      return readFileSync(await download.path());
    };
    // The browser shows the certificate in a tab of its own, where it is printed; it is saved only by the link that says so.
    const link = page.getByRole('link', { name: 'Certificate (PDF)' });
    const [tab, answer] = await Promise.all([page.context().waitForEvent('page'),
      page.context().waitForEvent('response', (each) => each.url().endsWith('/certificate.pdf')), link.click()]);
    const headers = await answer.allHeaders();
    check(headers['content-type'] === 'application/pdf' && headers['content-disposition'].startsWith('inline;'), `shown: ${JSON.stringify(headers)}`);
    await tab.close();
    const pdf = await fetched('Save the PDF');
    check(pdf.subarray(0, 5).toString() === '%PDF-' && pdf.length > 5000, 'a PDF comes');
    const json = JSON.parse((await fetched('Certificate (JSON)')).toString());
    check(json.unit.serial === 'MOS2A45130015' && json.operator === 'Ada', `it is this unit's and this operator's: ${json.operator}`);
    const label = (await fetched('Label (ZPL)')).toString();
    check(label.includes('^XA') && label.includes('MOS2A45130015'), 'a label comes after the read-back');
    const report = JSON.parse((await fetched('Report (JSON)')).toString());
    check(report.as_left.written === true && report.recheck.poses.length === 2, 'written, read back and measured again');
  },

  // The label of a unit that holds what was measured: the printer is away, the page says so, and no lane waits; after a
  // restart of the station it is printed as soon as the printer is there, and again when a person asks.
  async printer() {
    const printed = [];
    const printer = createNetServer((connection) => {
      let label = '';
      connection.on('data', (data) => { label += data; }).on('end', () => { printed.push(label); connection.end(); }).on('error', () => {});
    });
    const listen = (port) => new Promise((resolve) => printer.listen(port, '127.0.0.1', () => resolve(printer.address().port)));
    const port = await listen(0);
    await new Promise((resolve) => printer.close(resolve));
    const devices = ['virtual:seed=15,serial=MOS2A45130015,jig=auto'];
    const more = ['--printer', `tcp://127.0.0.1:${port}`];
    const station = await h.station(devices, { more });
    const page = await h.open(station.url);
    // Not written: no label, and nothing that offers one.
    await start(page);
    await page.locator('.result .verdict', { hasText: 'PASS - NOT WRITTEN' }).waitFor();
    await page.getByText(/Stored as run/).waitFor();
    check((await page.getByRole('button', { name: /[Ll]abel/ }).count()) === 0, 'no label without a write');
    await page.getByLabel('Write the constants into the unit').check();
    await button(page, 'Measure this unit again').click();
    await page.locator('.result .verdict', { hasText: 'PASS - WRITTEN' }).waitFor();
    await page.getByText(/Label: waiting for the printer \(.*refused/).waitFor();
    await button(page, 'Print label again').waitFor();
    await h.shot(page, 'printer-1-waiting');
    check((await station.api('/api/lanes/1')).json.state === 'done', 'the lane waits for no printer');
    check(printed.length === 0, 'nothing came');
    check((await station.end('SIGTERM')) === 0, 'the station ends in order');
    await listen(port);
    try {
      const next = await h.station(devices, { home: station.home, more });
      const other = await h.open(next.url);
      await h.until('the label of the run before', () => printed.length === 1);
      check(printed[0].startsWith('^XA') && printed[0].includes('MOS2A45130015'), 'it is the label');
      await button(other, 'Today').click();
      await other.getByText('Label: printed').waitFor();
      await button(other, 'Print label again').click();
      await h.until('the label again', () => printed.length === 2);
      check(printed[0] === printed[1], 'the same label');
      await h.shot(other, 'printer-2-printed');
      check(other.problems.length === 0 && page.problems.length === 0, `no errors: ${other.problems} ${page.problems}`);
    } finally {
      printer.close();
    }
  },

  // Six tabs of one browser, which has six connections for one address: they share one stream, each of them commands, and
  // what no one sees has none.
  async streams() {
    const station = await h.station(['virtual:seed=7,pace=10']);
    const page = await h.open(station.url);
    const context = page.context();
    const open = new Set();
    let most = 0;
    // From here on: the first tab's stream was opened before.
    const count = (request) => { if (request.url().endsWith('/api/events')) { open.add(request); most = Math.max(most, open.size); } };
    context.on('request', count);
    context.on('requestfinished', (request) => open.delete(request));
    context.on('requestfailed', (request) => open.delete(request));
    await page.reload();
    await page.getByText('Bench 1').first().waitFor();
    const tabs = [page];
    while (tabs.length < 6) {
      const tab = await context.newPage();
      tab.setDefaultTimeout(30_000);
      await tab.goto(station.url);
      tabs.push(tab);
    }
    for (const tab of tabs) await tab.locator('figcaption b', { hasText: /side up/ }).first().waitFor();
    check(open.size === 1 && most === 1, `one stream for six tabs, not ${open.size} (${most} at most)`);
    // The last tab commands; all of them show it.
    await start(tabs[5]);
    for (const tab of tabs) await tab.locator('.prompt', { hasText: /side up/ }).waitFor();
    await h.place(tabs[5], 1);
    // place() says when it may turn once too often.
    for (const tab of tabs) await until('the placement on every tab', async () => (await h.taken(tab)) >= 1);
    // The tab with the stream is closed: another one has it, and the others go on.
    const before = [...open];
    await tabs.shift().close();
    before.forEach((request) => open.delete(request)); // a closed tab says nothing of its requests
    await until('another tab has the stream', () => open.size === 1, 20);
    await h.place(tabs[4], 2);
    for (const tab of tabs) await until('the placement on every tab', async () => (await h.taken(tab)) >= 2);
    check(open.size === 1, `again one stream for five tabs, not ${open.size}`);
    // Hidden tabs give it back after ten seconds.
    const hide = (tab, hidden) => tab.evaluate((is) => {
      Object.defineProperty(document, 'hidden', { value: is, configurable: true });
      document.dispatchEvent(new Event('visibilitychange'));
    }, hidden);
    for (const tab of tabs) await hide(tab, true);
    await until('no stream where no one looks', () => open.size === 0, 30);
    await hide(tabs[2], false);
    await until('one where a person looks', () => open.size === 1, 20);
    await h.place(tabs[2], 2);
    check(await h.taken(tabs[2]) >= 2, 'it shows what is');
  },

  // A check unit goes out of control: every screen says so, only check units are measured, and an engineer's
  // signature (by keyboard) opens the station again.
  async lock() {
    const home = h.folder();
    const store = join(home, 'store.db');
    const run = (...words) => execFileSync(h.program, [...words, '--store', store], { stdio: ['ignore', 'pipe', 'pipe'] });
    const watcher = 'serial=MOS2A45130007,true_sensitivity_lsb_per_g=237.7/251.8/242.3,jig=auto';
    for (let seed = 1; seed <= 11; ++seed) {
      run('jig', '--device', `virtual:seed=${seed},${watcher},true_zero_lsb=49.9/95.8/60.8`, '--station', 'Bench 1', '--operator', 'Ada');
    }
    run('check-unit', 'add', 'MOS2A45130007', '--operator', 'Eve', '--reason', 'watches bench 1');
    const station = await h.station([
      'virtual:seed=8,serial=MOS2A45130008,pace=10',
      `virtual:seed=12,${watcher},true_zero_lsb=54.9/95.8/60.8`,  // five counts, 20 mg, off on X
    ], { home });
    const page = await h.open(station.url);
    await button(page, 'Check units').click();
    await page.locator('.control').nth(5).waitFor();
    await page.getByText('In control: the station is open').waitFor();
    check((await page.locator('.control .word-good').count()) === 6, 'six charts in control');
    const label = await page.locator('.control svg').nth(3).getAttribute('aria-label');
    check(/Zero offset x, mg of check unit MOS2A45130007: 11 points, the last .* limits/.test(label), `the chart says what it shows: ${label}`);
    await h.shot(page, 'lock-1-charts');
    // The check unit is measured, and has moved.
    check((await station.api('/api/run', { lane: 2, operator: 'Ada' })).status === 202, 'the check unit is measured');
    await page.getByRole('heading', { name: 'Station locked' }).waitFor();
    await page.getByText('a point beyond 3 sigma').first().waitFor();
    await page.locator('.control .word-bad').first().waitFor();
    check((await page.locator('.chart .rule').count()) > 0, 'the point carries the number of its rule');
    await page.getByText('locks the station').first().waitFor();
    await h.shot(page, 'lock-2-out-of-control');
    await button(page, 'Jig').click();
    await page.getByRole('heading', { name: 'Station locked' }).waitFor();
    check((await prompt(page)) === 'Station locked: check units only', 'the lane says so in its biggest words');
    check(await button(page, 'Start the measurement').isDisabled(), 'no other unit is started');
    await station.api('/api/run', { lane: 1, operator: 'Ada' });
    const refused = await until('the station refuses', async () => (await station.api('/api/lanes/1')).json.result);
    check(refused.verdict === 'refused' && /is locked/.test(refused.reasons.join()), `and the server refuses too: ${refused.reasons}`);
    await h.shot(page, 'lock-3-jig');
    // A signature without a name is none.
    check((await station.api('/api/station-lock', { operator: ' ', reason: 'x' }, { 'X-Sixpoint-Client': 'x' })).status === 400, 'a name is needed');
    check((await station.api('/api/station-lock', { operator: 'Mallory', reason: 'x' })).status === 403, 'and the page\'s own header');
    // By keyboard alone.
    const reach = async (test) => {
      for (let i = 0; i < 60; ++i) {
        await page.keyboard.press('Tab');
        if (await page.evaluate(test)) return;
      }
      throw new Error(`Tab does not reach ${test}`);
    };
    await reach(() => document.activeElement?.textContent === 'Sign as engineer');
    await page.keyboard.press('Enter');
    await reach(() => document.activeElement?.closest('label')?.textContent?.startsWith('Engineer') ?? false);
    await page.keyboard.type('Eve', { delay: 100 });
    await page.keyboard.press('Tab');
    await page.keyboard.type('seat cleaned', { delay: 100 });
    await h.shot(page, 'lock-4-signing');
    await page.keyboard.press('Enter');
    await page.getByRole('heading', { name: 'Station locked' }).waitFor({ state: 'detached' });
    check(await button(page, 'Start the measurement').isEnabled(), 'the station is open again');
    await button(page, 'Check units').click();
    await page.getByText('Last signature: Eve').waitFor();
    await page.getByText('seat cleaned').waitFor();
    await h.shot(page, 'lock-5-signed');
    // Check units are named and released here as well.
    await page.getByLabel('Serial number').last().fill('mos2a45130008');
    await page.getByLabel('Who decides').fill('Eve');
    await page.getByLabel('Why').fill('a second one');
    await button(page, 'This is a check unit').click();
    await page.getByText('MOS2A45130008: Recorded.').waitFor();
    check((await station.api('/api/check-units')).json.check_units.includes('MOS2A45130008'), 'it is in the store');
    check(page.problems.length === 0, `no errors on the page: ${page.problems}`);
  },

  // Yields, failure codes, capability and a gage study, from a store with runs of two operators.
  async statistics() {
    const home = h.folder();
    const store = join(home, 'store.db');
    const jig = (...words) => {
      try {
        execFileSync(h.program, ['jig', ...words, '--store', store, '--station', 'Bench 1'], { stdio: ['ignore', 'pipe', 'pipe'] });
      } catch (error) {
        if (error.status !== 1) throw error;  // 1: measured, and failed
      }
    };
    for (let seed = 1; seed <= 6; ++seed) jig('--device', `virtual:seed=${seed},jig=auto`, '--operator', seed % 2 ? 'Ada' : 'Bo');
    jig('--device', 'virtual:seed=9,serial=MOS2A45130009,jig=auto,zero_lsb=50/200/61,true_sensitivity_lsb_per_g=237.7/251.8/242.3,true_zero_lsb=49.9/199.8/60.8', '--operator', 'Bo');
    let seed = 100;  // of the noise; the parts' sensors are what they are
    for (const part of [1, 2, 3]) {
      for (const who of ['Ada', 'Bo', 'Ada', 'Bo']) {
        const device = `virtual:seed=${++seed},serial=MOS2A4514000${part},true_sensitivity_lsb_per_g=237.7/251.8/242.3,true_zero_lsb=${44 + 4 * part}/95.8/60.8,jig=auto`;
        jig('--device', device, '--operator', who, '--study', 'spring');
      }
    }
    const station = await h.station(['virtual:seed=8,pace=10'], { home });
    const page = await h.open(station.url);
    await button(page, 'Statistics').click();
    await page.locator('.tile', { hasText: 'Yield' }).first().waitFor();
    check((await page.locator('.tile').first().textContent()).includes('85.7 %6 of 7'), `six of seven: ${await page.locator('.tile').first().textContent()}`);
    await page.getByRole('rowheader', { name: 'zero_high' }).waitFor();
    await page.getByLabel('Compare by').selectOption('operator');
    const bo = page.locator('tr', { has: page.getByRole('rowheader', { name: 'Bo', exact: true }) });
    await bo.waitFor();
    check(/75\.0 %/.test(await bo.textContent()), `Bo's yield: ${await bo.textContent()}`);
    check(/\d\.\d\d – /.test(await page.getByRole('row', { name: /^Zero offset x, mg/ }).textContent()), 'Cpk with its interval');
    // The page says what the command says.
    const command = JSON.parse(execFileSync(h.program, ['statistics', '--store', store, '--by', 'operator', '--json']).toString());
    const shown = (await station.api('/api/statistics?by=operator')).json;
    check(JSON.stringify(shown.groups) === JSON.stringify(command.groups) && JSON.stringify(shown.capability) === JSON.stringify(command.capability), 'as the command line has it');
    await button(page, 'Compute').click();
    await page.getByText('3 parts, 2 operators, 2 trials').waitFor();
    const gage = (await station.api('/api/gage-rr?study=spring&quantity=zero_offset_mg&axis=x')).json;
    check(gage.grr_percent > 0 && gage.grr_percent < 30 && gage.usable, `a gage with some scatter: ${gage.grr_percent} %`);
    check((await page.locator('tr', { hasText: 'Part to part' }).textContent()).includes((gage.components.part.contribution_percent).toFixed(1)), 'the table has the parts');
    await h.shot(page, 'statistics-1');
    await page.getByLabel('Before').fill('2001-01-01');
    await page.getByText('No runs were stored yet.').waitFor();
    // A unit that was judged by other limits: there is no one Cpk.
    const wide = join(home, 'wide.toml');
    writeFileSync(wide, '[zero_offset_mg]\nlow = -2000\nhigh = 2000\n');
    jig('--device', 'virtual:seed=12,jig=auto', '--operator', 'Ada', '--limits', wide);
    await page.getByLabel('Before').fill('');
    await page.getByText('No Cpk, for units were judged by different limits: Zero offset x, mg').waitFor();
    check(await page.getByRole('row', { name: /^Zero offset x, mg/ }).count() === 0, 'and no row of the table');
    check(page.problems.length === 0, `no errors on the page: ${page.problems}`);
  },

  // What a technician with gloves reads at one metre, on a phone, a laptop and a screen: a letter of 5 mm needs
  // about 28 px at 96 dpi; a target for a gloved finger 44 px.
  async sizes() {
    const device = (i, settings) => `virtual:seed=${30 + i},${settings}`;
    for (const [lanes, sizes] of [[1, [['laptop', 1366, 768], ['phone', 390, 844]]], [4, [['laptop-4', 1366, 768], ['screen', 1920, 1080]]]]) {
      // One run by hand goes through all sizes; a unit whose jig turns by itself has a verdict for each.
      const station = await h.station(Array.from({ length: lanes }, (_, i) => device(i, 'pace=5')));
      const automatic = await h.station(Array.from({ length: lanes }, (_, i) => device(i, 'jig=auto')));
      const every = async (url, look) => {
        for (const [name, width, height] of sizes) {
          const page = await h.open(url, { width, height });
          await look(page, name);
          await page.close();
        }
      };
      const view = (page, name, what) => page.screenshot({ path: join(h.shots, `sizes-${name}-${what}.png`) });
      const bare = async (page, name, what) => {
        const over = await page.evaluate(() => document.documentElement.scrollWidth - document.documentElement.clientWidth);
        check(over <= 0, `${name} ${what}: nothing to scroll sideways (${over} px)`);
        await h.axe(page);
        await view(page, name, what);
      };
      const readable = async (page, name, selector, px) => {
        const found = await page.evaluate((css) => {
          const each = document.querySelector(css);
          const box = each.getBoundingClientRect();
          return { px: parseFloat(getComputedStyle(each).fontSize), top: box.top, bottom: box.bottom, height: innerHeight };
        }, selector);
        check(found.px >= px, `${name}: ${selector} is ${found.px} px high`);
        check(found.top >= 0 && found.bottom <= found.height, `${name}: ${selector} is on the screen without scrolling (${found.top} to ${found.bottom})`);
      };
      await every(station.url, async (page, name) => {
        await button(page, 'Start the measurement').waitFor();
        await readable(page, name, '.prompt', 36);
        const targets = await page.evaluate(() => [...document.querySelectorAll('main button, main select, nav button')].map((each) => [each.textContent, each.getBoundingClientRect().height]));
        for (const [text, high] of targets) check(high >= 44, `${name}: '${text}' is ${high} px high`);
        await bare(page, name, 'ready');
      });
      let placements = 0;
      for (const [name, width, height] of sizes) {
        const page = await h.open(station.url, { width, height });
        if (placements === 0) await start(page);
        else await button(page, 'Take this lane over').click();
        await h.place(page, placements += 2);
        await h.turnUntilDwelling(page);
        await page.evaluate(() => scrollTo(0, 0));
        await readable(page, name, '.prompt', 36);
        await readable(page, name, '.still span', 26);
        await readable(page, name, '.scene', 0);
        await bare(page, name, 'measuring');
        await h.place(page, ++placements);
        await page.locator('.hand').getByRole('button', { name: 'Lean on an edge', exact: true }).click();
        await refusal(page, 'none of its six faces');
        await page.evaluate(() => scrollTo(0, 0));
        await readable(page, name, '.refusal', 26);
        check(!(await page.locator('.still').textContent()).includes('Taken'), 'what was refused is not called taken');
        await bare(page, name, 'refused');
        if (name === 'phone') {  // on the smallest page the run is brought to its end
          await h.place(page, 14);
          await page.locator('.result .verdict', { hasText: 'Pass' }).waitFor();
        }
        await page.close();
      }
      check((await automatic.api('/api/run', { lane: 1, operator: 'Ada' })).status === 202, 'started');
      await every(automatic.url, async (page, name) => {
        await page.locator('.result .verdict', { hasText: 'Pass' }).waitFor();
        await page.evaluate(() => scrollTo(0, 0));
        await readable(page, name, '.result .verdict', 40);
        await bare(page, name, 'verdict');
        for (const tab of ['My files', 'Check units', 'Statistics']) {
          await button(page, tab).click();
          await page.locator('.files h2').first().waitFor();
          await bare(page, name, tab.toLowerCase().replace(' ', '-'));
        }
      });
      await station.end();
      await automatic.end();
    }
  },

  // Four drawings a second at most where the person's system asks for less motion, more where not.
  async motion() {
    const station = await h.station(['virtual:seed=7']);
    const inFourSeconds = async (reducedMotion) => {
      const page = await h.open(station.url, { reducedMotion });
      await page.locator('figcaption b', { hasText: /side up/ }).first().waitFor();
      const drawn = () => page.evaluate(() => new Promise((done) => {
        window.sixpointDelays.length = 0;
        setTimeout(() => done(window.sixpointDelays.length), 4000);
      }));
      return { page, drawn };
    };
    const calm = await inFourSeconds('reduce');
    const few = await calm.drawn();
    check(few >= 1 && few <= 17, `${few} drawings in four seconds with less motion`);
    await calm.page.close();
    const usual = await inFourSeconds('no-preference');
    await until('more drawings', async () => (await usual.drawn()) > 17);
  },

  // Four screens, one to sixteen lanes: nothing is scrolled sideways, and what a hand needs next is on the first screen.
  async layout() {
    const screens = [['bench', 1280, 800], ['wall', 1920, 1080], ['tablet', 820, 1180], ['phone', 390, 844]];
    for (const lanes of [1, 4, 16]) {
      const station = await h.station(Array.from({ length: lanes }, (_, i) => `virtual:seed=${50 + i},pace=10`));
      const seen = async (page, name, selector) => {
        const box = await page.locator(selector).first().boundingBox();
        const { width, height } = page.viewportSize();
        check(box && box.y >= 0 && box.y + box.height <= height && box.x >= 0 && box.x + box.width <= width,
          `${lanes} lanes, ${name}: ${selector} is on the first screen (${JSON.stringify(box)})`);
        return box;
      };
      const look = async (page, name, selectors) => {
        await page.evaluate(() => scrollTo(0, 0));
        for (const selector of selectors) await seen(page, name, selector);
        const over = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
        check(over <= 0, `${lanes} lanes, ${name}: ${over} px to scroll sideways`);
        await page.screenshot({ path: join(h.shots, `layout-${lanes}-${name}.png`) });
        if (name.startsWith('bench')) await h.axe(page);
      };
      let first = true;
      for (const [name, width, height] of screens) {
        const page = await h.open(station.url, { width, height });
        if (first) {
          await until('ready', async () => (await station.api('/api/lanes/1')).json.state === 'idle');
          if (lanes > 1) await page.locator('.card').first().click();
          await look(page, `${name}-ready`, ['.prompt', 'button.primary']);
          await start(page);
        }
        first = false;
        await page.locator('.still').waitFor();
        await look(page, `${name}-running`, ['.prompt', '.still', '.still progress', '.lane > .buttons button']);
        const bar = await page.locator('.still progress').boundingBox();
        check(bar.width > 0.5 * Math.min(width, 700), `${name}: the bar is ${bar.width} px wide`);
        if (width >= 1280) {
          const header = await page.locator('header').boundingBox();
          check(header.height < 100, `${lanes} lanes, ${name}: the header is one row (${header.height} px)`);
          const pane = await page.locator('.lane').boundingBox();
          check(lanes === 1 || pane.width >= 0.58 * width, `${name}: the work has ${pane.width} of ${width} px`);
        }
        await page.close();
      }
      await station.end();
    }
  },

  // A calibration file whose unit is pulled out, and whose page is loaded anew, in the middle.
  async capture() {
    const station = await h.station(['virtual:seed=7,serial=MOS2A45130007,pace=20']);
    const page = await h.open(station.url);
    await button(page, 'My files').click();
    await button(page, 'Start recording').click();
    const capture = page.locator('section', { hasText: '1. Record' }).first();
    const side = async (number, laid) => {
      await page.getByText(`Side ${number} of 6`).waitFor();
      const wanted = await wantedFace(capture);
      const face = laid ?? wanted;
      await capture.locator('.hand').getByRole('button', { name: face, exact: true }).click();
      await leave(page);
      return wanted;
    };
    const next = (number) => page.getByText(`Side ${number} of 6`).waitFor();
    const first = await side(1);
    await next(2);
    // Pulled out while it rests on its second side.
    const second = await side(2);
    await capture.locator('.hand').getByRole('button', { name: 'Unplug', exact: true }).click();
    await page.getByText('The unit is unplugged: plug it in again').waitFor();
    await page.getByText('What was recorded is kept').waitFor();
    await h.shot(page, 'capture-1-unplugged');
    await capture.locator('.hand').getByRole('button', { name: 'Plug in', exact: true }).click();
    await button(page, 'It lies there').waitFor();
    check((await capture.locator('.prompt').textContent()).includes(second), 'the side under way is asked again');
    await page.getByText('Side 2 of 6').waitFor();
    await side(2);
    await next(3);
    // The page is loaded anew: it is still the same person's.
    await page.reload();
    await page.getByText('Side 3 of 6').waitFor();
    check(await button(page, 'Stop recording').isVisible(), 'and may be stopped');
    // Laid on a side that was recorded already: in the end that side alone is asked for again.
    let wrong;
    for (const number of [3, 4, 5, 6]) {
      if (number === 5) wrong = await side(number, first); else await side(number);
      if (number < 6) await next(number + 1);
    }
    await page.getByText(/did not lie still for long enough on/).waitFor();
    check((await page.getByText(/did not lie still for long enough on/).first().textContent()).includes(wrong), `${wrong} is named`);
    await h.shot(page, 'capture-2-again');
    check((await side(5)) === wrong, 'and it alone is asked for');
    await capture.locator('.result .verdict', { hasText: 'Pass' }).waitFor();
    await page.getByText(/Constants saved in/).first().waitFor();
    await h.shot(page, 'capture-3-done');
    check(page.problems.length === 0, `no errors on the page: ${page.problems}`);
  },

  // Another page in the same browser: nothing that it sends does anything, nothing that it asks is
  // answered to it; and a name that was made to point here (DNS rebinding) is refused.
  async hostile() {
    const station = await h.station(['virtual:seed=7,serial=MOS2A45130007,pace=10']);
    await until('ready', async () => (await station.api('/api/lanes/1')).json.state === 'idle');
    const port = new URL(station.url).port;
    const evil = await h.serve((request) => (request.url === '/frame' ? `<iframe src="${station.url}"></iframe>` : '<form method=post enctype=text/plain><input name=x></form>'));
    const page = await h.open(station.url);  // this browser is signed in
    await page.goto(evil);
    const before = (await station.api('/api/state')).json;
    const commands = [['/api/run', { lane: 1 }], ['/api/capture', { lane: 1 }], ['/api/lanes/1/scan', { serial: 'MOS2A00000000' }],
      ['/api/check-units', { serial: 'MOS2A45130007', action: 'add', operator: 'E', reason: 'x' }],
      ['/api/station-lock', { operator: 'E', reason: 'x' }], ['/api/repair', { folder: '', output: 'out' }]];
    for (const [path, body] of commands) {
      for (const how of ['no-cors', 'cors', 'header', 'form', 'beacon']) {
        const seen = await page.evaluate(async ([url, text, kind]) => {
          const options = { method: 'POST', body: text, credentials: 'include' };
          try {
            if (kind === 'form') {
              const form = document.createElement('form');
              const field = Object.assign(document.createElement('input'), { name: text.slice(0, -1), value: '}' });
              Object.assign(form, { method: 'post', enctype: 'text/plain', action: url, target: 'elsewhere' });
              form.append(field);
              document.body.append(form, Object.assign(document.createElement('iframe'), { name: 'elsewhere' }));
              form.submit();
              return 'sent';
            }
            if (kind === 'beacon') return navigator.sendBeacon(url, text);
            if (kind === 'header') options.headers = { 'X-Sixpoint-Client': 'x', 'Content-Type': 'application/json' };
            const answer = await fetch(url, { ...options, mode: kind === 'no-cors' ? 'no-cors' : 'cors' });
            return answer.type === 'opaque' ? 'opaque' : `read ${answer.status}`;
          } catch (error) {
            return `blocked ${error.message}`;
          }
        }, [new URL(path, station.url).href, JSON.stringify(body), how]);
        check(!String(seen).startsWith('read'), `${path} by ${how}: ${seen}`);
      }
    }
    const got = await page.evaluate(async (url) => {
      const events = await new Promise((resolve) => {
        const source = new EventSource(`${url}api/events`);
        source.onopen = () => resolve('open');
        source.onerror = () => { source.close(); resolve('refused'); };
      });
      const read = await fetch(`${url}api/state`).then((answer) => answer.text(), () => 'blocked');
      return [events, read];
    }, station.url);
    check(got[0] === 'refused' && got[1] === 'blocked', `neither events nor state: ${got}`);
    await page.goto(`${evil}frame`);
    const inside = await page.frames()[1]?.evaluate(() => document.querySelectorAll('button').length).catch(() => 0);
    check(!inside, 'the station is in no frame');
    // The browser is told that this name is this machine; what it asks still carries the name.
    const rebound = await page.goto(`http://rebound.example:${port}/`);
    check(rebound.status() === 421, `another name: ${rebound.status()}`);
    const asked = await page.evaluate(async () => (await fetch('/api/run', { method: 'POST', body: '{"lane": 1}', headers: { 'X-Sixpoint-Client': 'x' } })).status);
    check(asked === 421, `nor a command under it: ${asked}`);
    const after = (await station.api('/api/state')).json;
    check(after.lanes[0].state === 'idle' && after.lanes[0].result === null && after.lanes[0].scan === null, JSON.stringify(after.lanes[0]));
    check(after.lock.check_units.length === 0 && after.lock.signature === null && after.job.state === 'none', 'nothing was decided, nothing begun');
    check(before.lanes[0].unit.serial === after.lanes[0].unit.serial, 'the same unit');
  },

  // A unit on emulated USB (hid:SERIAL behind the real hidapi), not a virtual one: pulled out and put back, the
  // program killed and started again, written and read back.
  async usb() {
    const station = await h.stationOnUsb();
    const page = await h.open(station.url);
    await page.getByText(station.serial).first().waitFor();
    check((await page.locator('.hand').count()) === 0, 'no buttons turn it');
    await page.getByLabel('Your name').fill('Ada');
    await page.getByLabel('Write the constants into the unit').check();
    await start(page);
    const place = async (count) => {
      for (let asked = ''; (await h.taken(page)) < count && !(await page.locator('.result').count());) {
        const text = await until('a wanted side', async () => {
          const now = (await prompt(page)) ?? '';
          const question = `${now} ${await h.taken(page)}`;
          return (/[+−][XYZ] side up/.test(now) && question !== asked && (asked = question) && now) || (await page.locator('.result').count()) > 0;
        });
        if (text === true) return;
        const [sign, axis] = text.match(/[+−][XYZ]/)[0];
        await station.tell(`turn ${sign === '+' ? '+' : '-'}${axis.toLowerCase()}`);
        const before = await h.taken(page);
        // What is refused is put there again, after a while: a unit that is never let rest is never measured.
        await until('it is taken, or asked otherwise', async () => (await h.taken(page)) > before || (await page.locator('.result').count()) > 0
          || (await prompt(page)) !== text, 8).catch(async () => console.log(`again: ${text}; ${await page.locator('.refusal').textContent()}`));
        if ((await h.taken(page)) === before) asked = '';
      }
    };
    await place(4);
    await station.tell('unplug');
    const pulled = Date.now();
    await page.getByText('The unit is unplugged: plug it in again').waitFor();
    console.log(`unplugging was on the page after ${Date.now() - pulled} ms`);
    await h.shot(page, 'usb-1-unplugged');
    await station.tell('plug');
    await until('it goes on', async () => /[+−][XYZ] side up/.test(await prompt(page)));
    check((await h.taken(page)) >= 4, `what was taken is still there: ${await h.taken(page)}`);
    await place(8);
    await station.tell('kill');
    await page.getByText('The station does not answer').waitFor();
    await station.tell('start');
    await station.again();
    await page.getByText('The station does not answer').waitFor({ state: 'detached' });
    await until('the run goes on', async () => (await h.taken(page)) >= 8, 20);
    await place(99);
    await page.locator('.result .verdict', { hasText: 'Pass' }).waitFor();
    await page.getByText(/Stored as run/).waitFor();
    await h.shot(page, 'usb-2-verdict');
    const lane = await station.api('/api/lanes/1');
    check(lane.device === `hid:${station.serial}`, `the lane is the USB device: ${lane.device}`);
    check(lane.result.written === true && lane.result.serial === station.serial && lane.operator === 'Ada', JSON.stringify(lane.result));
    const report = await station.api(`/api/runs/${lane.result.run}/report.json`);
    check(report.recheck.poses.length === 2 && report.verification.poses.length === 8, 'measured again with what was written');
    check(page.problems.length === 0, `no errors on the page: ${page.problems}`);
  },

  // A calibration file of the same: the unit records on while the program is killed, and nothing is lost.
  async usb_capture() {
    const station = await h.stationOnUsb(['--side-seconds', '10']);
    const page = await h.open(station.url);
    await button(page, 'My files').click();
    await page.getByText(station.serial).first().waitFor();
    await button(page, 'Start recording').click();
    const side = async (number) => {
      await page.getByText(`Side ${number} of 6`).waitFor();
      const [sign, axis] = await wantedFace(page);
      await station.tell(`turn ${sign === '+' ? '+' : '-'}${axis.toLowerCase()}`);
      await leave(page);
    };
    await side(1);
    await side(2);
    await page.getByText('Side 3 of 6').waitFor();
    await station.tell('unplug');
    await page.getByText('The unit is unplugged: plug it in again').waitFor();
    await station.tell('plug');
    await side(3);
    await page.getByText('Side 4 of 6').waitFor();
    await station.tell('kill');
    await page.getByText('The station does not answer').waitFor();
    await station.tell('start');
    await station.again();
    await page.getByText('The station does not answer').waitFor({ state: 'detached' });
    for (const number of [4, 5, 6]) await side(number);
    await page.locator('.result .verdict', { hasText: 'Pass' }).waitFor();
    await page.getByText(/Constants saved in/).first().waitFor();
    await h.shot(page, 'usb-capture');
    const lane = await station.api('/api/lanes/1');
    check(!/lost its recording/.test((lane.result.notes ?? []).join()), `nothing was asked twice: ${lane.result.notes}`);
    check(lane.result.serial === station.serial && lane.result.stored, JSON.stringify(lane.result));
    check(page.problems.length === 0, `no errors on the page: ${page.problems}`);
  },

  // Another person's page sees the run and may not touch it, until it takes it over.
  async operators() {
    const station = await h.station(['virtual:seed=14,pace=10']);
    const ada = await h.open(station.url);
    await ada.getByLabel('Your name').fill('Ada');
    await start(ada);
    await h.place(ada, 1);
    const bob = await h.open(station.url);
    await bob.getByLabel('Your name').fill('Bob');
    await bob.getByText('Ada is at work on this lane.').waitFor();
    check((await button(bob, 'Stop this run').count()) === 0, 'Bob cannot stop it');
    await h.shot(bob, 'operators-1-held');
    await button(bob, 'Take this lane over').click();
    await button(bob, 'Stop this run').waitFor();
    await ada.getByText('Bob is at work on this lane.').waitFor();
    await button(bob, 'Stop this run').click();
    await button(bob, 'Yes, stop').click();
    await ada.locator('.result .verdict', { hasText: 'Stopped' }).waitFor();
  },
};

try {
  if (!scenarios[h.scenario]) throw new Error(`there is no scenario '${h.scenario}'; there are: ${Object.keys(scenarios).join(' ')}`);
  await scenarios[h.scenario]();
  console.log(`${h.scenario}: done`);
} catch (error) {
  console.error(error.stack ?? error);
  await h.describe();
  process.exitCode = 1;
} finally {
  await h.clean();
}
