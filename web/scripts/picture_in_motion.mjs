// Makes docs/images/drive.webp: the browser while the simulated robot drives through the demo office, quicker than it was.
//   node scripts/picture_in_motion.mjs [OUT.webp]    (after `npm run build`; needs img2webp of Debian's package webp)
import { execFileSync } from 'node:child_process';
import { mkdtempSync, rmSync, statSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { openClient, startBrowser, startServer } from '../e2e/harness.mjs';

const out = process.argv[2] ?? fileURLToPath(new URL('../../docs/images/drive.webp', import.meta.url));
const SIZE = { width: 960, height: 560 };
const SHOWN_MS = 160;
const EVERY_MS = 1000;
const MOST_BYTES = 1_500_000;

const scratch = mkdtempSync(join(tmpdir(), 'spectra-motion-'));
const server = await startServer(['--demo-drive']);
const browser = await startBrowser();
try {
  const { page } = await openClient(browser, server.url, SIZE);
  await page.emulateMedia({ reducedMotion: 'reduce' });
  await page.waitForFunction(() => globalThis.spectra?.store.scene?.vertex_count > 0, null, { timeout: 120_000 });
  await page.getByRole('button', { name: 'Collapse the panel' }).click();
  await page.keyboard.press('g');
  const pictures = [];
  let still = 0;
  let vertices = 0;
  // Along with the robot as long as the map grows, then all of it.
  let left = Infinity;
  while (left > 0) {
    if (left === Infinity && (still >= 15 || pictures.length >= 65)) {
      await page.keyboard.press('f');
      left = 10;
    }
    left -= 1;
    const begin = Date.now();
    // What the robot has not measured yet is noted, block by block.
    await page.evaluate(() => {
      const { store } = globalThis.spectra;
      store.closedNotes = store.notes.map(({ key }) => key);
    });
    const file = join(scratch, `${String(pictures.length).padStart(3, '0')}.png`);
    await page.screenshot({ path: file });
    pictures.push(file);
    const now = await page.evaluate(() => globalThis.spectra.store.scene?.vertex_count ?? 0);
    still = now === vertices ? still + 1 : 0;
    vertices = now;
    await page.waitForTimeout(Math.max(0, EVERY_MS - (Date.now() - begin)));
  }
  for (let quality = 60; ; quality -= 15) {
    execFileSync('img2webp', [
      '-loop',
      '0',
      '-mixed',
      '-d',
      String(SHOWN_MS),
      '-lossy',
      '-q',
      String(quality),
      '-m',
      '6',
      ...pictures,
      '-o',
      out,
    ]);
    const { size } = statSync(out);
    console.log(`${out}: ${pictures.length} pictures, ${vertices} vertices in the end, ${size} bytes at quality ${quality}`);
    if (size <= MOST_BYTES) break;
    if (quality <= 15) throw new Error('it does not become small enough');
  }
} finally {
  await browser.close();
  await server.stop();
  rmSync(scratch, { recursive: true, force: true });
}
