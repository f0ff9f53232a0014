// Who is not let in: logs in without a mouse, comes by a link, is put out again.
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import { mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { assertAccessible } from './axe.mjs';
import { openClient, PROGRAM, screenshot, settled, smallDemoScene, startServer, test } from './harness.mjs';

export function addAccessTests(browser) {
  test('Somebody without a token gets a page to log in, and nothing else; with one, by keyboard alone, the scene', async () => {
    const scratch = mkdtempSync(join(tmpdir(), 'spectra-e2e-access-'));
    const file = join(scratch, 'tokens');
    const token = (...args) => spawnSync(PROGRAM, ['token', '--file', file, ...args], { encoding: 'utf8' }).stdout.trim();
    const operator = token('--role', 'operator', '--name', 'bridge');
    token('--role', 'admin');
    const server = await startServer([smallDemoScene(scratch), '--tokens', file, '--invite', 'viewer']);
    const { page, problems } = await openClient(browser, server.url);
    assert.equal(new URL(page.url()).pathname, '/login');
    const requests = [];
    page.on('request', (request) => requests.push(new URL(request.url()).pathname));
    await screenshot(page, 'login');
    await assertAccessible(page, 'the page to log in');
    await page.keyboard.type('wrong');
    await page.keyboard.press('Enter');
    await page.getByText('That is not known').waitFor();
    await assertAccessible(page, 'a token that is not known');
    const others = requests.filter((path) => path !== '/icon.svg' && path !== '/api/v1/session');
    assert.deepEqual(others, [], 'nothing of the program comes before');
    problems.length = 0; // The browser notes every 401.
    await page.keyboard.type(operator);
    await page.keyboard.press('Enter');
    await settled(page);
    assert.equal(await page.evaluate(() => globalThis.spectra.store.server.role), 'operator');
    assert.deepEqual(problems, []);

    // In forced colours what is painted is black and white, whatever the page's own colours are.
    const forced = await browser.newContext({
      forcedColors: 'active',
      colorScheme: 'dark',
      viewport: { width: 600, height: 500 },
    });
    const { page: contrasting } = await openClient(forced, server.url, null);
    const button = await contrasting.getByRole('button', { name: 'Log in' }).boundingBox();
    const image = await screenshot(contrasting, 'login-forced-colours');
    const lights = [];
    for (let x = button.x + 4; x < button.x + button.width - 4; x += 1)
      for (let y = button.y + 4; y < button.y + button.height - 4; y += 1) lights.push(Math.max(...image.at(x, y)));
    assert.ok(Math.min(...lights) < 16 && Math.max(...lights) > 240, `from ${Math.min(...lights)} to ${Math.max(...lights)}`);
    await forced.close();

    // A link with a code, on another device.
    const tablet = await browser.newContext({ viewport: { width: 820, height: 1180 } });
    const link = /within 15 minutes: (\S+)/.exec(server.output())[1];
    const { page: other } = await openClient(tablet, link, null);
    await settled(other);
    assert.equal(await other.evaluate(() => globalThis.spectra.store.server.role), 'viewer');
    assert.ok(!other.url().includes('#'), other.url());
    await tablet.close();

    // Out, and in again.
    await page.keyboard.press('?');
    await page.getByRole('link', { name: 'Log out' }).click();
    await page.getByRole('button', { name: 'Log out' }).waitFor();
    await assertAccessible(page, 'logged in');
    await page.getByRole('button', { name: 'Log out' }).click();
    await page.locator('#token').waitFor();
    await page.goto(server.url);
    assert.equal(new URL(page.url()).pathname, '/login');
    await page.locator('#token').fill(operator);
    await page.keyboard.press('Enter');
    await settled(page);

    // The token is taken back: the page does not go on looking alive.
    token('--remove', 'bridge');
    server.signal('SIGHUP');
    await page.waitForURL('**/login');
    await page.close();
    await server.stop();
    rmSync(scratch, { recursive: true });
  });
}
