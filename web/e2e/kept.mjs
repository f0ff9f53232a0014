// The client that a browser keeps for when the robot does not answer.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { cpSync, readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { PROGRAM, settled, smallDemoScene, startServer, test } from './harness.mjs';
import { linkProxy } from '../../tests/integration/node/link_proxy.mjs';

const DIST = process.env.SPECTRA_WEB ?? fileURLToPath(new URL('../dist', import.meta.url));

/** Paths of everything that is kept. */
const kept = (page) =>
  page.evaluate(async () => {
    const all = [];
    for (const name of await caches.keys()) {
      for (const { url } of await (await caches.open(name)).keys()) all.push(new URL(url).pathname);
    }
    return all;
  });

/** Waits until the page and the program are kept. */
async function untilKept(page) {
  for (let i = 0; i < 300; i += 1) {
    const paths = await kept(page);
    if (paths.includes('/') && paths.some((path) => path.startsWith('/assets/program-'))) return paths;
    await new Promise((resolve) => setTimeout(resolve, 100));
  }
  throw new Error(`not kept within 30 s, only ${(await kept(page)).join(' ')}`);
}

const build = (page) => page.evaluate(() => document.querySelector('meta[name=build]')?.content ?? 'first');

/** A client that is told from the one of `DIST`, as the next version is. */
function nextClient(scratch, name) {
  const folder = join(scratch, name);
  cpSync(DIST, folder, { recursive: true });
  const index = join(folder, 'index.html');
  writeFileSync(index, readFileSync(index, 'utf8').replace('<head>', `<head><meta name="build" content="${name}" />`));
  return folder;
}

export function addKeptTests(browser, scratch) {
  test('A tablet keeps the client, never the scene, and no old client is there after an upgrade', async () => {
    let server = await startServer([smallDemoScene(scratch)]);
    const { port } = server;
    const proxy = await linkProxy(server.url);
    const context = await browser.newContext();
    const page = await context.newPage();
    await page.goto(proxy.url);
    await settled(page);
    const paths = await untilKept(page);
    assert.deepEqual(
      paths.filter((path) => path !== '/' && !path.startsWith('/assets/')),
      [],
    );

    // The robot is gone: the client is there and says so, and has nothing of the scene.
    await server.stop();
    await page.reload();
    await page.waitForFunction(() => globalThis.spectra?.store && !globalThis.spectra.store.connected);
    assert.deepEqual(await page.evaluate(() => [!globalThis.spectra.store.scene, globalThis.spectra.tiles.size]), [true, 0]);
    await page.locator('[data-state-notice], .notice, [role=alert], [role=status]').first().waitFor();

    // It comes back upgraded: the next page is the new one, at once.
    server = await startServer([smallDemoScene(scratch), '--web', nextClient(scratch, 'second')], port);
    await page.reload();
    assert.equal(await build(page), 'second');
    await settled(page);

    // Upgraded again, behind a link on which nothing comes for longer than anybody waits: the kept one is there first, and gives way.
    await server.stop();
    server = await startServer([smallDemoScene(scratch), '--web', nextClient(scratch, 'third')], port);
    proxy.stall(8000);
    await page.reload();
    assert.equal(await build(page), 'second', 'what is kept, as long as nothing else comes');
    await page.waitForFunction(() => document.querySelector('meta[name=build]')?.content === 'third', null, { timeout: 60_000 });
    await settled(page);
    assert.ok((await untilKept(page)).length > 2);

    // Now it lets nobody in without a token: what was kept is given to nobody, and is gone.
    await server.stop();
    const tokens = join(scratch, 'kept.tokens');
    execFileSync(PROGRAM, ['token', '--file', tokens, '--role', 'viewer']);
    server = await startServer([smallDemoScene(scratch), '--tokens', tokens], port);
    await page.reload();
    assert.equal(new URL(page.url()).pathname, '/login');
    assert.deepEqual(await kept(page), []);
    await context.close();
    await proxy.close();
    await server.stop();
  });
}
