// What the end-to-end tests share: the server program, Chromium, and pixels of screenshots.
import assert from 'node:assert/strict';
import { execFileSync, spawn } from 'node:child_process';
import { copyFileSync, existsSync, mkdirSync } from 'node:fs';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { inflateSync } from 'node:zlib';
import { chromium } from 'playwright-core';

const here = (path) => fileURLToPath(new URL(path, import.meta.url));
export const PROGRAM = process.env.SPECTRA_BIN ?? here('../../build/release/bin/spectra');
const SHOTS = here('./screenshots/');

/** Starts `spectra serve` with the built client and waits until it says where it listens. */
export async function startServer(args, port = 0) {
  if (!existsSync(PROGRAM)) throw new Error(`there is no server program at ${PROGRAM}; build it or set SPECTRA_BIN`);
  const child = spawn(
    PROGRAM,
    [
      'serve',
      ...args,
      '--listen',
      `127.0.0.1:${port}`,
      ...(args.includes('--web') ? [] : ['--web', process.env.SPECTRA_WEB ?? here('../dist')]),
    ],
    {
      stdio: ['ignore', 'pipe', 'pipe'],
    },
  );
  let output = '';
  const exited = new Promise((resolve) => child.once('exit', resolve));
  // A test that fails leaves its server running.
  process.once('exit', () => child.kill('SIGKILL'));
  const url = await new Promise((resolve, reject) => {
    const read = (chunk) => {
      output += chunk;
      const found = /listening on (http:\/\/127\.0\.0\.1:\d+)/.exec(output);
      if (found) resolve(`${found[1]}/`);
    };
    child.stdout.on('data', read);
    child.stderr.on('data', read);
    child.once('exit', (code) => reject(new Error(`the server ended with ${code}:\n${output}`)));
    child.once('error', reject);
  });
  return {
    url,
    port: Number(new URL(url).port),
    output: () => output,
    signal: (name) => child.kill(name),
    stop: async () => {
      child.kill('SIGTERM');
      await exited;
    },
  };
}

let demo = null;
/** The server of the demo scene for all tests that neither stop it nor want options of their own; it ends with them. */
export function demoServer() {
  demo ??= startServer(['--demo']);
  return demo;
}

let small = null;
/** The demo scene of few vertices, for what is about words, boxes and keys: a machine without a GPU draws it in half the time. */
export function smallDemoServer(scratch) {
  small ??= startServer([smallDemoScene(scratch)]);
  return small;
}

export function smallDemoScene(scratch) {
  const file = join(scratch, 'small-demo.ply');
  if (!existsSync(file)) execFileSync(PROGRAM, ['demo-scene', file, '--vertices', '40000', '--quiet']);
  return file;
}

export function startBrowser() {
  mkdirSync(SHOTS, { recursive: true });
  return chromium.launch({
    executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium',
    args: ['--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--disable-background-networking'],
  });
}

/** Pages of the test that runs: one that has failed has left its own open. */
const opened = [];

/** Opens the client in a browser or one of its contexts; `problems` collects what the browser complained about (a breach of the content policy among it). */
export async function openClient(browser, url, viewport = { width: 1440, height: 900 }, { fusing = 'robot' } = {}) {
  const page = await browser.newPage(viewport === null ? undefined : { viewport });
  opened.push(page);
  // Colours come from the robot unless a test is about something else: what a setting costs is counted then.
  await page.addInitScript((kept) => {
    if (location.protocol === 'about:') return;
    if (localStorage.getItem('spectra.preferences') === null) localStorage.setItem('spectra.preferences', kept);
  }, JSON.stringify({ fusing }));
  const problems = [];
  page.on('console', (message) => {
    if (message.type() === 'error' || message.type() === 'warning') problems.push(message.text());
  });
  page.on('pageerror', (error) => problems.push(error.message));
  await page.goto(url);
  return { page, problems };
}

/** Waits until the picture shows the newest settings in full, and has been drawn. */
export async function settled(page, timeout = 60_000) {
  await page.waitForFunction(
    () => {
      const store = globalThis.spectra?.store;
      return store?.connected && store.complete !== null && store.behindSince === null && store.wanted === null;
    },
    null,
    { timeout },
  );
  await drawn(page);
}

/** Waits until what is to be drawn has been drawn and is on the screen, and nothing says any more that it is not. */
export async function drawn(page) {
  await page.waitForFunction(() => globalThis.spectra.viewport.isUpToDate && globalThis.spectra.store.hereSince === null, null, {
    polling: 'raf',
  });
  for (let i = 0; i < 3; i += 1) await page.evaluate(() => new Promise((resolve) => requestAnimationFrame(resolve)));
}

/** What the GPU holds, and how many tiles the page has to draw. */
export function gpuObjects(page) {
  return page.evaluate(() => {
    const { geometries, textures, programs } = globalThis.spectra.viewport.gpuObjects;
    return { geometries, textures, programs, tiles: globalThis.spectra.tiles.size };
  });
}

/**
 * Nothing was left behind between the two. A geometry is on the GPU from the first time that its tile is drawn, and a coarse tile may
 * be drawn for the first time while a setting changes: so there are at most as many geometries as tiles.
 */
export function assertGpuObjects(before, after) {
  const { geometries, ...others } = after;
  assert.deepEqual(others, { textures: before.textures, programs: before.programs, tiles: before.tiles });
  assert.ok(geometries >= before.geometries && geometries <= after.tiles, `${geometries} geometries for ${after.tiles} tiles`);
}

/** A screenshot under another name, so that the next of its own name does not replace it. */
export function keep(name, as) {
  copyFileSync(`${SHOTS}${name}.png`, `${SHOTS}${as}.png`);
}

export async function screenshot(page, name) {
  return decodePng(await page.screenshot({ path: `${SHOTS}${name}.png` }));
}

/** Pixels of an 8-bit RGB or RGBA PNG that is not interlaced, as Chromium writes it. */
export function decodePng(file) {
  let width = 0;
  let height = 0;
  let channels = 4;
  const parts = [];
  for (let at = 8; at < file.length;) {
    const size = file.readUInt32BE(at);
    const type = file.toString('latin1', at + 4, at + 8);
    const body = file.subarray(at + 8, at + 8 + size);
    if (type === 'IHDR') {
      width = body.readUInt32BE(0);
      height = body.readUInt32BE(4);
      channels = body[9] === 6 ? 4 : 3;
    } else if (type === 'IDAT') parts.push(body);
    at += size + 12;
  }
  const raw = inflateSync(Buffer.concat(parts));
  const stride = width * channels;
  const pixels = Buffer.alloc(stride * height);
  for (let row = 0; row < height; row += 1) {
    const filter = raw[row * (stride + 1)];
    for (let i = 0; i < stride; i += 1) {
      const left = i >= channels ? pixels[row * stride + i - channels] : 0;
      const above = row > 0 ? pixels[(row - 1) * stride + i] : 0;
      const corner = row > 0 && i >= channels ? pixels[(row - 1) * stride + i - channels] : 0;
      let guess = 0;
      if (filter === 1) guess = left;
      else if (filter === 2) guess = above;
      else if (filter === 3) guess = (left + above) >> 1;
      else if (filter === 4) {
        const p = left + above - corner;
        const [a, b, c] = [Math.abs(p - left), Math.abs(p - above), Math.abs(p - corner)];
        guess = a <= b && a <= c ? left : b <= c ? above : corner;
      }
      pixels[row * stride + i] = raw[row * (stride + 1) + 1 + i] + guess;
    }
  }
  return {
    width,
    height,
    at: (x, y) => {
      const i = Math.round(y) * stride + Math.round(x) * channels;
      return [pixels[i], pixels[i + 1], pixels[i + 2]];
    },
  };
}

const tests = [];
/** Registers a test for runTests(). */
export function test(name, body) {
  tests.push({ name, body });
}

/** Runs all tests in order, or those of whose names SPECTRA_E2E is a part. */
export async function runTests() {
  let failed = 0;
  const wanted = tests.filter(({ name }) => name.includes(process.env.SPECTRA_E2E ?? ''));
  for (const { name, body } of wanted) {
    const begun = Date.now();
    opened.length = 0;
    try {
      await body();
      console.log(`ok      ${name} (${Date.now() - begun} ms)`);
    } catch (error) {
      failed += 1;
      console.log(`FAILED  ${name}\n${error instanceof Error ? error.stack : error}`);
    }
    for (const page of opened) await page.close();
  }
  for (const server of [demo, small]) if (server !== null) await (await server).stop();
  return { passed: wanted.length - failed, failed };
}
