// Lettering at rest is as readable as the full mesh shows it, to Tesseract where that is installed (apt-get install tesseract-ocr).
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import { mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { decodePng, drawn, openClient, PROGRAM, settled, startServer, test } from './harness.mjs';

const VIEWPORT = { width: 900, height: 640 };
/** The sign at the door of the demo scene, "ROOM 2.14" in letters of 4 to 6 cm: its middle and size, in metres. */
const SIGN = { middle: [0.39, 1.62, -2.8], width: 0.44, height: 0.15 };
/** So far away letters are 11 pixels high, and the scene is not drawn in full. */
const DISTANCE_M = 3;
/** Tesseract wants letters of some 60 pixels. */
const ENLARGED = 8;

/** The pixels of the sign alone. */
async function pictureOfSign(page) {
  const box = await page.evaluate(({ middle, width, height }) => {
    const { viewport } = globalThis.spectra;
    const [low, high] = [-0.5, 0.5].map((share) =>
      viewport.project([middle[0] + width * share, middle[1] - height * share, middle[2]]),
    );
    return { x: low.x, y: low.y, width: high.x - low.x, height: high.y - low.y };
  }, SIGN);
  return page.screenshot({ clip: box });
}

/** How much light and dark change within the picture: the standard deviation of its green. */
function contrastOf(png) {
  const image = decodePng(png);
  const green = [];
  for (let y = 0; y < image.height; y += 1) for (let x = 0; x < image.width; x += 1) green.push(image.at(x, y)[1]);
  const mean = green.reduce((sum, value) => sum + value, 0) / green.length;
  return Math.sqrt(green.reduce((sum, value) => sum + (value - mean) ** 2, 0) / green.length);
}

/** What Tesseract reads; null without it. */
async function readBy(browser, png) {
  if (spawnSync('tesseract', ['--version']).error !== undefined) return null;
  const { width, height } = decodePng(png);
  const page = await browser.newPage({ viewport: { width: width * ENLARGED, height: height * ENLARGED } });
  await page.setContent(
    `<body style="margin:0"><img width="${width * ENLARGED}" src="data:image/png;base64,${png.toString('base64')}"></body>`,
  );
  await page.waitForFunction(() => document.querySelector('img').complete);
  const input = await page.screenshot();
  await page.close();
  // As a block, as a line and as words here and there: what it takes a few pixels for differs.
  const ways = ['6', '7', '11'];
  return ways
    .map((way) => spawnSync('tesseract', ['-', '-', '--psm', way, '--dpi', '150'], { input, encoding: 'utf8' }).stdout.trim())
    .join(' | ');
}

export function addLetteringTests(browser) {
  test('Lettering of 5 cm reads at rest as well as the full mesh shows it', async () => {
    const scratch = mkdtempSync(join(tmpdir(), 'spectra-e2e-lettering-'));
    const scene = join(scratch, 'demo.ply');
    const made = spawnSync(PROGRAM, ['demo-scene', scene, '--vertices', '1200000', '--quiet'], { encoding: 'utf8' });
    assert.equal(made.status, 0, made.stderr);
    const server = await startServer([scene]);
    const { page } = await openClient(browser, server.url, VIEWPORT);
    await settled(page, 180_000);
    await page.evaluate(
      ({ middle, distance }) => {
        const { settings } = globalThis.spectra;
        settings.setMethod('visible_only');
        globalThis.spectra.setView({ eye: [middle[0], middle[1], middle[2] + distance], target: middle });
        const sheet = new CSSStyleSheet();
        sheet.replaceSync('body * { visibility: hidden } canvas { visibility: visible !important }');
        document.adoptedStyleSheets.push(sheet);
      },
      { middle: SIGN.middle, distance: DISTANCE_M },
    );
    const look = async () => {
      await page.waitForTimeout(1000);
      await settled(page);
      await drawn(page);
      const vertices = await page.evaluate(() => globalThis.spectra.store.shown.vertices);
      return { vertices, png: await pictureOfSign(page) };
    };
    const rest = await look();
    await page.evaluate(() => globalThis.spectra.setQuality({ mode: 'manual', pixel_error: 0.001, colour_bits: 8 }));
    const full = await look();
    assert.ok(rest.vertices < full.vertices, `${rest.vertices} vertices at rest, ${full.vertices} in full: nothing is compared`);
    const [shown, wanted] = [contrastOf(rest.png), contrastOf(full.png)];
    assert.ok(
      shown > 0.95 * wanted,
      `the sign has a contrast of ${shown.toFixed(1)} levels at rest, ${wanted.toFixed(1)} in full`,
    );
    const words = await readBy(browser, rest.png);
    if (words === null) console.log('        tesseract is not installed: nobody has read the sign');
    else assert.match(words, /ROOM/i);
    console.log(`        contrast ${shown.toFixed(1)} of ${wanted.toFixed(1)} levels; read: ${JSON.stringify(words)}`);
    await page.close();
    await server.stop();
    rmSync(scratch, { recursive: true });
  });
}
