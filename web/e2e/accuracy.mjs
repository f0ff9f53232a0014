// What the status bar says of the picture, against the picture: on a link of 1 Mbit/s at random moments, and at rest.
//   SPECTRA_MOMENTS=50 SPECTRA_E2E='What the bar says' node e2e/run.mjs      (the suite itself looks at a few moments)
import assert from 'node:assert/strict';
import { demoServer, drawn, keep, openClient, screenshot, settled, test } from './harness.mjs';
import { startLink } from './link.mjs';

const MOMENTS = Number(process.env.SPECTRA_MOMENTS ?? 6);
/** The first sessions are short, with little but the first picture in them; later ones go on until most of the scene has come. */
const momentsOfSession = (session) => 4 + 8 * session;
const VIEWPORT = { width: 900, height: 640 };
const NOTHING = '#ff00ff';
const RANGE = { min: 5, max: 60 };
const THERMAL = { method: 'thermal_only', palette: 'white_hot', range: { mode: 'manual', ...RANGE }, missing: NOTHING };
const VISIBLE = { method: 'visible_only' };
const MBIT_BYTES_PER_S = 125_000;

/** The same numbers in every run. */
function randomNumbers(seed) {
  let state = seed;
  return () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return state / 2 ** 32;
  };
}

/** The scene alone, its background and what has no temperature in a colour that nothing has. */
async function hideInterface(page) {
  await page.evaluate((colour) => {
    globalThis.spectra.setBackground(colour);
    const sheet = new CSSStyleSheet();
    sheet.replaceSync('body * { visibility: hidden } canvas { visibility: visible !important }');
    document.adoptedStyleSheets.push(sheet);
  }, NOTHING);
}

/** What the thermal method is read by; the visible one does not show it. A method is changed alone: never is another palette seen first. */
async function setScale(page) {
  await page.evaluate(({ palette, range, missing }) => {
    const { settings } = globalThis.spectra;
    settings.setPalette(palette);
    settings.setRange(range.min, range.max, true);
    settings.setMissing(missing, true);
  }, THERMAL);
}

async function setTo(page, fusion) {
  await page.evaluate((method) => globalThis.spectra.settings.setMethod(method), fusion.method);
}

/** A page that always shows all that there is. */
async function openFull(browser, server) {
  const { page } = await openClient(browser, server.url, VIEWPORT);
  await page.waitForFunction(() => globalThis.spectra?.store.quality);
  await page.evaluate(() => globalThis.spectra.setQuality({ mode: 'manual', pixel_error: 0.001, colour_bits: 8 }));
  await page.waitForFunction(() => globalThis.spectra.store.quality.pixel_error === 0.001);
  await setScale(page);
  await hideInterface(page);
  return page;
}

/** The picture that the page would show if it had everything. */
async function fullPicture(full, fusion, pose, name) {
  await setTo(full, fusion);
  await full.evaluate(({ eye, target }) => globalThis.spectra.setView({ eye, target }), pose);
  await full.waitForTimeout(150);
  await settled(full);
  return screenshot(full, name);
}

const isNothing = ([r, g, b]) => r > 200 && b > 200 && g < 60;

/** The places where both pictures show the scene and what is beside it as well. */
function* places(a, b, box = { left: 0, top: 0, right: a.width, bottom: a.height }) {
  for (let y = Math.max(1, box.top); y < Math.min(a.height - 1, box.bottom); y += 1) {
    for (let x = Math.max(1, box.left); x < Math.min(a.width - 1, box.right); x += 1) {
      const isInside = [a, b].every((image) =>
        [
          [x, y],
          [x - 1, y],
          [x + 1, y],
          [x, y - 1],
          [x, y + 1],
        ].every(([i, j]) => !isNothing(image.at(i, j))),
      );
      if (isInside) yield [x, y];
    }
  }
}

/** Of the two methods, only the palette of the thermal one has no hue. Old and new colours are never drawn together. */
function isGrey(image) {
  const all = [...places(image, image)].map(([x, y]) => image.at(x, y));
  return all.filter(([r, g, b]) => Math.max(r, g, b) - Math.min(r, g, b) < 3).length > 0.9 * all.length;
}

const hasHue = ([r, g, b]) => Math.max(r, g, b) - Math.min(r, g, b) > 2;

/** What 95 % of the pixels do not exceed. Of the thermal method, those count that are not mixed with the colour of what is missing. */
function difference(a, b, isThermal) {
  const off = [];
  for (const [x, y] of places(a, b)) {
    const [p, q] = [a.at(x, y), b.at(x, y)];
    if (isThermal && (hasHue(p) || hasHue(q))) continue;
    off.push(Math.max(...p.map((value, channel) => Math.abs(value - q[channel]))));
  }
  off.sort((one, other) => one - other);
  return { pixels: off.length, levels: off[Math.floor(off.length * 0.95)] ?? 0 };
}

export function addAccuracyTests(browser) {
  test('What the bar says of colours and temperatures is never less than what they are off, on 1 Mbit/s', async () => {
    const server = await demoServer();
    const link = await startLink(server.port);
    const full = await openFull(browser, server);
    // The program of the page is in the cache: it is not what is slow.
    const context = await browser.newContext({ viewport: VIEWPORT });
    const { page: first } = await openClient(context, link.url, null);
    await settled(first);
    await first.close();
    const random = randomNumbers(Number(process.env.SPECTRA_SEED ?? 11));
    let page = null;
    let fusion = VISIBLE;
    let coarse = 0;
    const untrue = [];
    let [session, begins] = [0, 0];
    for (let moment = 0; moment < MOMENTS; moment += 1) {
      if (moment === begins) {
        begins += momentsOfSession(session);
        session += 1;
        await page?.close();
        link.rate = MBIT_BYTES_PER_S;
        ({ page } = await openClient(context, link.url, null));
        await page.waitForFunction(() => globalThis.spectra?.store.methods.length > 0);
        fusion = VISIBLE;
        await setTo(page, fusion);
        await setScale(page);
        await hideInterface(page);
        // The first view has another method, and is the picture until the colours of this one have come.
        await page.waitForFunction((method) => {
          const { store } = globalThis.spectra;
          return (
            store.pictureStands && store.wanted === null && store.fusion.method === method && store.otherMethods.length === 0
          );
        }, fusion.method);
      } else if (random() < 0.3) {
        fusion = fusion === VISIBLE ? THERMAL : VISIBLE;
        await setTo(page, fusion);
      } else if (random() < 0.5) {
        const [nearer, angle] = [random() * 0.8 - 0.2, random() - 0.5];
        await page.evaluate(
          ([share, azimuth]) => {
            globalThis.spectra.viewport.approach(share);
            globalThis.spectra.viewport.turn(azimuth, 0);
          },
          [nearer, angle],
        );
      }
      await page.waitForTimeout(100 + 1500 * random());
      // Nothing more comes: what is there is looked at in peace.
      link.rate = 0;
      const state = () =>
        page.evaluate(() => {
          const { store, viewport } = globalThis.spectra;
          const text = document.querySelector('[data-status="accuracy"]')?.textContent ?? null;
          return {
            error: store.accuracy,
            pose: viewport.pose,
            tiles: store.shown.tiles,
            text,
            method: store.fusion?.method,
            palette: store.fusion?.palette,
          };
        });
      let [before, said, image] = [null, null, null];
      do {
        await drawn(page);
        before = await state();
        image = await screenshot(page, `truth-${moment}-shown`);
        said = await state();
      } while (JSON.stringify(before) !== JSON.stringify(said));
      link.rate = MBIT_BYTES_PER_S;
      if (said.error === null) continue;
      const shows = isGrey(image) ? THERMAL : VISIBLE;
      const truth = await fullPicture(full, shows, said.pose, `truth-${moment}-full`);
      const { pixels, levels } = difference(image, truth, shows === THERMAL);
      const { colour_levels, temperature_celsius, rounding_levels } = said.error;
      const degrees = (levels * (RANGE.max - RANGE.min)) / 255;
      // The screen rounds what it shows, and the server what it sends.
      const isTrue =
        shows === VISIBLE
          ? levels <= Math.ceil(colour_levels + rounding_levels) + 1
          : degrees <= temperature_celsius + ((1 + rounding_levels) * (RANGE.max - RANGE.min)) / 255;
      const figures = shows === VISIBLE ? `${levels} levels` : `${degrees.toFixed(2)} degC`;
      const words = `moment ${moment}: ${figures} off over ${pixels} pixels, ${said.tiles} tiles; said: ${said.text}`;
      console.log(`        ${words}`);
      if (colour_levels > 0) coarse += 1;
      if (!isTrue) {
        untrue.push(`${words}; in force: ${said.method}, ${said.palette}`);
        for (const picture of ['shown', 'full']) keep(`truth-${moment}-${picture}`, `untrue-${moment}-${picture}`);
      }
    }
    assert.deepEqual(untrue, []);
    assert.ok(coarse >= MOMENTS / 3, `${coarse} moments with coarse tiles`);
    await context.close();
    await full.close();
    await link.stop();
  });
}
