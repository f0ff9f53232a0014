// How long a setting takes that is made in the browser, beside the robot's way over a link of 5 Mbit/s and a round trip of 100 ms. Drawing apart,
// which software does here.
//
//   node browser_bench.mjs SCENE.ply        after a build of the program and of the client
import { linkProxy } from '../../integration/node/link_proxy.mjs';
import { openClient, settled, startBrowser, startServer } from '../../../web/e2e/harness.mjs';

const scene = process.argv[2];
if (scene === undefined) throw new Error('usage: node browser_bench.mjs SCENE.ply');
const METHODS = [
  'visible_only',
  'thermal_only',
  'thermal_visible_blend',
  'histogram_distribution',
  'colour_mapped_threshold',
  'monochrome_threshold',
  'thermal_highlighting',
  'intensity_hue',
  'inverse_intensity_hue',
];
const ROUNDS = 3;

const setMethod = (page, method) => page.evaluate((id) => globalThis.spectra.settings.setMethod(id), method);
const median = (values) => values.sort((a, b) => a - b)[Math.floor(values.length / 2)];

/** Of the last setting: from the first drawn tile to the last one; they go to the GPU with the next picture. */
async function lastFused(page) {
  for (const worker of page.workers()) {
    const entry = await worker.evaluate(() => {
      const last = performance.getEntriesByName('tiles fused').at(-1);
      return last === undefined ? null : { start: last.startTime, ms: last.duration };
    });
    if (entry !== null) return entry;
  }
  return null;
}

const server = await startServer([scene]);
const link = await linkProxy(server.url, { rate_bytes_per_s: 625_000, delay_ms: 50 });
const browser = await startBrowser();
const { page: here } = await openClient(browser, server.url, undefined, { fusing: 'here' });
await settled(here, 600_000);
await here.waitForFunction(() => globalThis.spectra.store.fusingPlace === 'here', null, { timeout: 600_000 });
const times = new Map();
for (let round = 0; round < ROUNDS; round += 1) {
  for (const method of METHODS) {
    const before = await lastFused(here);
    await setMethod(here, method);
    let entry = null;
    while (entry === null || entry.start === before?.start) {
      await here.waitForTimeout(50);
      entry = await lastFused(here);
    }
    await settled(here, 120_000);
    times.set(method, [...(times.get(method) ?? []), entry.ms]);
  }
}
const shown = await here.evaluate(() => globalThis.spectra.store.shown);
await here.close();

const { page: robot } = await openClient(browser, link.url);
await settled(robot, 600_000);
console.log(`${shown.vertices} vertices in ${shown.tiles} tiles are drawn`);
console.log('method                    here, ms    robot over 5 Mbit/s, ms    ratio');
for (const method of METHODS) {
  const begin = performance.now();
  await setMethod(robot, method);
  await robot.waitForFunction(
    () => {
      const { store } = globalThis.spectra;
      return store.wanted === null && store.complete !== null && store.behindSince === null;
    },
    null,
    { timeout: 120_000, polling: 20 },
  );
  const robot_ms = performance.now() - begin;
  const here_ms = median(times.get(method));
  console.log(
    `${method.padEnd(24)} ${here_ms.toFixed(0).padStart(9)} ${robot_ms.toFixed(0).padStart(26)} ${(here_ms / robot_ms).toFixed(3).padStart(8)}`,
  );
}
await browser.close();
await link.close();
await server.stop();
