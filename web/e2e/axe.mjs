// axe-core over the controls: what a checker of accessibility finds without a person.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { demoServer, openClient, settled, test } from './harness.mjs';
import { startLink } from './link.mjs';

const AXE = readFileSync(createRequire(import.meta.url).resolve('axe-core/axe.min.js'), 'utf8');

/**
 * Nothing that axe-core finds on the page as it is now; rules of WCAG 2.2 AA and its good practice. Not in forced colours: axe takes
 * -webkit-text-fill-color for the colour of a text, which Chromium does not force in what it tells of styles, only in what it paints.
 */
export async function assertAccessible(page, what) {
  // Evaluated by the debugger: the content policy of the page stands.
  await page.evaluate(AXE);
  const found = await page.evaluate(async () => {
    const { violations } = await globalThis.axe.run(document, { resultTypes: ['violations'] });
    return violations.flatMap(({ id, nodes }) =>
      nodes.map(({ target, failureSummary }) => `${id}: ${target}: ${failureSummary}`),
    );
  });
  assert.deepEqual(found, [], what);
}

export function addAxeTests(browser) {
  test('axe finds nothing in the controls, dark and light, with a reading, the help and colours made here', async () => {
    const link = await startLink((await demoServer()).port);
    const { page } = await openClient(browser, link.url, { width: 1280, height: 720 }, { fusing: 'here' });
    await settled(page);
    await page.waitForFunction(() => globalThis.spectra.store.fusingPlace === 'here');
    await page.evaluate(() => globalThis.spectra.pin({ x: 500, y: 400 }));
    await page.locator('.card').waitFor();
    for (const scheme of ['dark', 'light']) {
      await page.getByRole('radio', { name: scheme, exact: true }).check({ force: true });
      await assertAccessible(page, scheme);
      // axe does not look at drawings: numbers of the axis stand on the histogram.
      const contrast = await page.evaluate(() => {
        const lightOf = (selector) => {
          const channels = getComputedStyle(document.querySelector(selector))
            .fill.match(/[\d.]+/g)
            .map(Number);
          const [r, g, b] = channels.map((value) => (value <= 10 ? value / 3294.6 : ((value / 255 + 0.055) / 1.055) ** 2.4));
          return 0.2126 * r + 0.7152 * g + 0.0722 * b + 0.05;
        };
        const [text, bright, plain] = ['.axis text.flag.mark', '.silhouette.bright', '.silhouette:not(.bright)'].map(lightOf);
        const ratio = (a, b) => Math.max(a, b) / Math.min(a, b);
        return { onBright: ratio(text, bright), onPlain: ratio(text, plain), brightOnPlain: ratio(bright, plain) };
      });
      assert.ok(
        contrast.onBright > 3 && contrast.onPlain > 4.5 && contrast.brightOnPlain > 1.6,
        `${scheme}: ${JSON.stringify(contrast)}`,
      );
    }
    // A note: there is no past to compare with.
    await page.evaluate(() => globalThis.spectra.settings.setMethod('thermal_change'));
    await page.locator('[data-notice]').waitFor();
    await assertAccessible(page, 'a note on light controls');
    await page.locator('canvas').press('?');
    await page.locator('dialog[open]').waitFor();
    await assertAccessible(page, 'help');
    await page.keyboard.press('Escape');
    await page.getByText('Details', { exact: true }).click();
    await page.setViewportSize({ width: 390, height: 844 });
    await assertAccessible(page, 'a phone');
    await link.stop();
    await page.getByText('Reconnecting').waitFor();
    await assertAccessible(page, 'without a link');
    await page.close();
  });

  test('axe finds nothing in any state of the page: connecting, hidden, tiny, notes, errors, lost graphics, lost link', async () => {
    const link = await startLink((await demoServer()).port);
    const { page } = await openClient(browser, link.url, { width: 1280, height: 720 });
    await settled(page, 180_000);
    const store = (change) => page.evaluate((values) => Object.assign(globalThis.spectra.store, values), change);
    await page.locator('.panel').waitFor();
    await store({ panelsHidden: true });
    await page.locator('.panel').waitFor({ state: 'detached' });
    await assertAccessible(page, 'without controls');
    await store({ panelsHidden: false });
    await store({ statuses: ['warning', 'error'].map((level) => ({ id: `test.${level}`, level, message: `A ${level}.` })) });
    await page.locator('[data-notice]').waitFor();
    await page.getByRole('button', { name: 'All 2 notes' }).click();
    await assertAccessible(page, 'all notes');
    await page.getByRole('button', { name: 'Close the notes' }).click();
    await store({ failure: 'Something went wrong.', graphicsLostAt: 0, helpOpen: false });
    await page.getByText('The graphics do not come back').waitFor();
    await assertAccessible(page, 'lost graphics, and an error');
    await page.setViewportSize({ width: 200, height: 150 });
    await page.locator('.panel').waitFor({ state: 'detached' });
    await assertAccessible(page, 'a tiny window');
    await page.setViewportSize({ width: 360, height: 740 });
    await page.locator('.panel').waitFor();
    await page.evaluate(() => globalThis.spectra.settings.setMethod('intensity_hue'));
    await settled(page);
    await link.stop();
    await page.getByText('Reconnecting').waitFor();
    await page.evaluate(() => {
      globalThis.spectra.settings.setMethod('thermal_only');
      globalThis.spectra.settings.setRange(15, 30, true);
    });
    await page.getByText(/^\d changes wait$/).waitFor();
    await assertAccessible(page, 'on a phone, lost graphics, a lost link, changes that wait, and an error');
    // As it opens where nothing answers.
    await store({ scene: undefined, failure: null, graphicsLostAt: null });
    await page.getByText('Connecting', { exact: true }).waitFor();
    await assertAccessible(page, 'connecting');
    await page.close();
  });
}
