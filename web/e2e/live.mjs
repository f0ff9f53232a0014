// A second program puts blocks into a live map while the browser watches.
import assert from 'node:assert/strict';
import { patch } from '../../tests/integration/node/patch.mjs';
import { assertAccessible } from './axe.mjs';
import { decodePng, drawn, openClient, screenshot, settled, startServer, test } from './harness.mjs';
import { startLink } from './link.mjs';

const SIDE = 41;
const SCALE = 0.1;
const STEP_M = (SIDE - 1) * SCALE;

/** Puts a block of a grid of 4 by 4 into the map, as any mapper would. Returns the revision of the map that has it. */
async function put(server, column, row, { celsius = 20, height = 0, age_s = 0, sigma } = {}) {
  const observed_at = Date.now() / 1000 - age_s;
  const send = () =>
    fetch(`${server.url}api/v1/blocks/b${column}.${row}?observed_at=${observed_at}`, {
      method: 'PUT',
      body: patch(column, row, { side: SIDE, scale: SCALE, celsius, height, sigma }),
    });
  let reply = await send();
  // As the robot begins the map is not open yet: to be tried again, says docs/protocol.md.
  for (const end = Date.now() + 10_000; reply.status === 503 && Date.now() < end; reply = await send())
    await new Promise((resolve) => setTimeout(resolve, 50));
  assert.equal(reply.status, 200, await reply.text());
  return (await (await fetch(`${server.url}api/v1/scene`)).json()).revision;
}

/** Waits until all of this revision of the map, or of a later one, is on the screen. */
async function shows(page, revision) {
  await page.waitForFunction((wanted) => (globalThis.spectra?.store.complete?.scene_revision ?? 0) >= wanted, revision, {
    timeout: 60_000,
  });
  await settled(page);
}

/** Where the middle of a block is on the screen; the origin of the scene's positions is that of its first block. */
const placeOf = (page, column, row, height = 0) =>
  page.evaluate(
    ([x, y, z]) => {
      const { store, viewport } = globalThis.spectra;
      const { origin } = store.scene;
      const at = viewport.project([x - origin[0], y - origin[1], z - origin[2]]);
      return at === null ? null : [at.x, at.y];
    },
    [(column + 0.5) * STEP_M, (row + 0.5) * STEP_M, height * SCALE],
  );

const near = (a, b, levels) => a.every((value, channel) => Math.abs(value - b[channel]) <= levels);

export function addLiveTests(browser) {
  test('What has changed while the link was cut is in the picture afterwards, and nothing else is sent', async () => {
    const server = await startServer(['--live']);
    const link = await startLink(server.port);
    let revision = 0;
    for (let i = 0; i < 16; i += 1) revision = await put(server, i % 4, i >> 2);
    const { page, problems } = await openClient(browser, 'about:blank', { width: 1280, height: 800 });
    let frames = [];
    page.on('websocket', (socket) =>
      socket.on('framereceived', ({ payload }) => {
        if (typeof payload !== 'string') frames.push({ kind: payload[4], tile: payload.subarray(16, 32).toString('hex') });
      }),
    );
    await page.goto(link.url);
    await shows(page, revision);
    const look = (on) =>
      on.evaluate((size) => {
        const { viewport, store } = globalThis.spectra;
        const { origin } = store.scene;
        const target = [2 * size - origin[0], 2 * size - origin[1], -origin[2]];
        viewport.lookAlong([0, 0, 1]);
        globalThis.spectra.setView({ eye: [target[0], target[1] - 0.01, target[2] + 5 * size], target });
      }, STEP_M);
    await look(page);
    await settled(page);
    await drawn(page);
    const pixels = async (on, name) => {
      const image = await screenshot(on, name);
      const all = [];
      for (let x = 400; x < 1000; x += 7) for (let y = 60; y < 740; y += 7) all.push(image.at(x, y).join());
      return all;
    };
    const differing = (a, b) => a.filter((pixel, index) => pixel !== b[index]).length / a.length;
    const before = await pixels(page, 'cut-live-before');

    frames = [];
    link.down();
    await page.getByText('Reconnecting').waitFor();
    // As warm as before, so that the range stays where it is.
    revision = await put(server, 1, 1, { height: 8 });
    link.up();
    await shows(page, revision);
    await drawn(page);
    const after = await pixels(page, 'cut-live-after');
    const fresh = await openClient(browser, server.url, { width: 1280, height: 800 });
    await shows(fresh.page, revision);
    await look(fresh.page);
    await settled(fresh.page);
    await drawn(fresh.page);
    const expected = await pixels(fresh.page, 'cut-live-fresh');
    assert.ok(differing(after, expected) < 0.002, `${differing(after, expected)} of the pixels are not those of a new page`);
    assert.ok(differing(before, after) > 0.02 && differing(before, after) < 0.2, `${differing(before, after)} have changed`);
    const renewed = new Set(frames.filter(({ kind }) => kind === 1).map(({ tile }) => tile));
    assert.ok(renewed.size > 0 && renewed.size <= 9, `${renewed.size} tiles came anew`);
    assert.ok(
      frames.every(({ tile }) => renewed.has(tile)),
      'colours of what had not changed were sent',
    );
    assert.deepEqual(
      problems.filter((text) => !/WebSocket connection|ERR_/.test(text)),
      [],
    );
    await fresh.page.close();
    await page.close();
    await link.stop();
    await server.stop();
  });

  test('What is read of a place is read again when the map changes, and goes with what was there', async () => {
    const server = await startServer(['--live']);
    const { page, problems } = await openClient(browser, server.url, { width: 1000, height: 700 });
    await shows(page, await put(server, 0, 0));
    const [x, y] = await placeOf(page, 0, 0);
    await page.mouse.click(x, y);
    const card = page.locator('.card');
    const bothSay = async (words) => {
      for (const label of ['.card [data-probe]', '.hover'])
        await page.locator(label).filter({ hasText: words }).waitFor({ timeout: 10_000 });
    };
    await card.waitFor();
    await page.mouse.move(x + 60, y, { steps: 3 });
    await bothSay(/^\s*(19|20|21)\.\d/);
    await put(server, 0, 0, { celsius: 80 });
    await bothSay(/^\s*(79|80|81)\.\d/);
    await put(server, 0, 0, { celsius: -10 });
    await bothSay(/^\s*\u2212(9|10|11)\.\d/);
    // While the camera is dragged nothing is read under the pointer, whatever comes meanwhile.
    await page.mouse.down();
    await page.mouse.move(x + 66, y, { steps: 3 });
    await page.locator('.hover').waitFor({ state: 'detached' });
    await put(server, 0, 0, { celsius: 40 });
    await card.filter({ hasText: /\b(39|40|41)\.\d/ }).waitFor({ timeout: 10_000 });
    await page.waitForTimeout(1500);
    assert.equal(await page.locator('.hover').count(), 0);
    await page.mouse.up();
    await page.mouse.move(x + 60, y, { steps: 3 });
    await page.locator('.hover').waitFor();
    await fetch(`${server.url}api/v1/blocks/b0.0`, { method: 'DELETE' });
    await page.getByText('The map is empty yet').waitFor();
    await card.waitFor({ state: 'detached', timeout: 10_000 });
    await page.locator('.hover').waitFor({ state: 'detached', timeout: 10_000 });
    assert.equal(await page.getByText('has no temperatures').count(), 0, 'what is not there has nothing');
    assert.deepEqual(problems, []);
    await page.close();
    await server.stop();
  });

  test('How exact the picture is, is not said while the map is another one by now', async () => {
    const server = await startServer(['--live']);
    const link = await startLink(server.port);
    let revision = 0;
    for (let i = 0; i < 4; i += 1) revision = await put(server, i % 2, i >> 1);
    const { page } = await openClient(browser, link.url, { width: 1280, height: 800 });
    await shows(page, revision);
    const said = page.locator('[data-status="accuracy"]');
    assert.match(await said.innerText(), /^within .*colours exact$/);
    link.rate = 1_500;
    revision = await put(server, 0, 0, { celsius: 35, height: 3 });
    await page.waitForFunction((wanted) => globalThis.spectra.store.scene.revision >= wanted, revision);
    await said.waitFor({ state: 'detached', timeout: 1000 });
    await page.locator('[data-status="age"]').filter({ hasText: 'behind' }).waitFor();
    link.rate = Infinity;
    await shows(page, revision);
    await said.filter({ hasText: /^within .*colours exact$/ }).waitFor();
    await page.close();
    await link.stop();
    await server.stop();
  });

  test('What has become warmer since the baseline was marked is shown where it is; a probe says how long ago and since when; what is old fades', async () => {
    const server = await startServer(['--live']);
    let revision = 0;
    for (let i = 0; i < 4; i += 1) revision = await put(server, i, 0, { age_s: 400 });
    const { page, problems } = await openClient(browser, server.url, { width: 1280, height: 800 });
    await shows(page, revision);
    await page.getByRole('radio', { name: 'Thermal change' }).click();
    await settled(page);
    const scale = page.locator('[data-change-scale]');
    const plain = async (locator) => (await locator.innerText()).replaceAll('\u202f', ' ').replaceAll(/\s+/g, ' ').trim();
    assert.equal(await plain(scale), 'change, K \u22125.0 0 +5.0');
    assert.equal(await page.locator('[data-handle="range.max"]').count(), 0, 'the range is no part of this picture');
    await page.getByText('has no neutral middle').waitFor();
    await page.getByRole('radio', { name: /^Blue to red/ }).click();
    await page.getByText('has no neutral middle').waitFor({ state: 'detached' });

    // Where it was first seen is where it is compared with, until somebody marks now.
    const since = page.locator('[data-baseline]');
    assert.equal(await plain(since), 'Changes are since a place was first seen');
    await page.getByRole('button', { name: 'Mark baseline' }).press('Enter');
    await page.waitForFunction(() => globalThis.spectra.store.scene.baseline.marked_at !== null);
    assert.match(await plain(since), /^Changes are since \d\d:\d\d$/);
    const marked = (await plain(since)).slice(-5);
    // The camera is the viewer's, from above.
    await page.evaluate((size) => {
      const { viewport, store } = globalThis.spectra;
      const { origin } = store.scene;
      const target = [2 * size - origin[0], size / 2 - origin[1], -origin[2]];
      viewport.lookAlong([0, 0, 1]);
      globalThis.spectra.setView({ eye: [target[0], target[1] - 0.01, target[2] + 5 * size], target });
    }, STEP_M);
    await settled(page);
    const places = [];
    for (let i = 0; i < 4; i += 1) places.push(await placeOf(page, i, 0));
    const before = await screenshot(page, 'change-before');
    await shows(page, await put(server, 2, 0, { celsius: 24, age_s: 250 }));
    const after = await screenshot(page, 'change-after');
    const at = (image, [x, y]) => image.at(Math.round(x), Math.round(y));
    for (let i = 0; i < 4; i += 1) {
      const isSame = near(at(before, places[i]), at(after, places[i]), 3);
      assert.equal(isSame, i !== 2, `block ${i}: ${at(before, places[i])} to ${at(after, places[i])}`);
    }
    const [red, , blue] = at(after, places[2]);
    assert.ok(red > blue + 40, `warmer is red: ${at(after, places[2])}`);
    assert.match(await plain(page.locator('[data-highlight]')), /^2\d % of the surface\.$/);

    await page.mouse.click(...places[2]);
    const probe = page.locator('[data-probe]');
    await probe.waitFor();
    assert.match(await plain(probe), new RegExp(`^2[345]\\.\\d °C, 4 min ago, \\+4\\.0 since ${marked}$`));
    await page.keyboard.press('Escape');
    await screenshot(page, 'change-panel');

    // In the visible view only age is shown: what is older than four half-lives is grey, and what is new is not.
    await shows(page, await put(server, 3, 0, { celsius: 20, age_s: 0 }));
    await page.keyboard.press('2');
    await settled(page);
    const coloured = await screenshot(page, 'age-off');
    await page.getByRole('radio', { name: 'fades' }).click();
    const half_life = page.getByRole('spinbutton', { name: 'Half-life' });
    await half_life.fill('60');
    await half_life.press('Enter');
    await settled(page);
    const faded = await screenshot(page, 'age-fade');
    const spread = (colour) => Math.max(...colour.slice(0, 3)) - Math.min(...colour.slice(0, 3));
    for (let i = 0; i < 4; i += 1) assert.ok(spread(at(coloured, places[i])) > 20, `block ${i} has colours`);
    assert.deepEqual(
      places.map((place) => spread(at(faded, place)) < 8),
      [true, true, true, false],
    );
    await assertAccessible(page, 'age and change');
    // A step of it comes by itself.
    await half_life.fill('3');
    await half_life.press('Enter');
    await settled(page);
    await page.waitForTimeout(14_000);
    await settled(page);
    assert.ok(spread(at(await screenshot(page, 'age-later'), places[3])) < 8, 'after four half-lives all is grey');
    await half_life.fill('0');
    await half_life.press('Enter');
    await page.getByText('must be of at least 1').waitFor();
    assert.deepEqual(problems, []);
    await page.close();
    await server.stop();
  });

  test('A live map grows on the screen: it is said how new it is, all of it stays in view, and a range that moves is announced and can be held', async () => {
    const server = await startServer(['--live']);
    const { page, problems } = await openClient(browser, server.url, { width: 1280, height: 800 });
    await page.getByText('The map is empty yet').waitFor();
    const live = page.locator('[data-status="live"]');
    assert.equal(await live.innerText(), 'live, empty');

    await shows(page, await put(server, 0, 0, { age_s: 250 }));
    assert.equal(await page.getByText('The map is empty yet').count(), 0);
    const isNamed = () => String(globalThis.spectra.store.shownMethods) === globalThis.spectra.store.fusion.method;
    assert.ok(await page.evaluate(isNamed), 'with the first temperatures the picture shows another method, by itself');
    assert.match((await live.innerText()).replaceAll('\u202f', ' '), /^live, newest 4 min$/);
    const small = await page.evaluate(() => globalThis.spectra.viewport.pose.eye);

    let revision = 0;
    for (let i = 1; i < 16; i += 1) revision = await put(server, i % 4, Math.floor(i / 4));
    await shows(page, revision);
    assert.match((await live.innerText()).replaceAll('\u202f', ' '), /^live, newest \d+(\.\d)? s$/);
    assert.match(await page.locator('footer').innerText(), /1 viewer/);
    await screenshot(page, 'live-whole');
    // On a phone it takes the place of "up to date", and nothing is cut.
    await page.setViewportSize({ width: 360, height: 740 });
    await page.waitForFunction(() => /^live, \d/.test(document.querySelector('[data-status="age"]').textContent.trim()));
    const ends = await page
      .locator('footer > .item')
      .evaluateAll((items) => items.map((item) => item.getBoundingClientRect().right));
    assert.ok(Math.max(...ends) <= 360, `the status ends at ${Math.max(...ends)} of 360`);
    await page.setViewportSize({ width: 1280, height: 800 });
    await settled(page);
    // Nobody has moved the camera: all of it is in the picture, between the controls, as the first view of any scene is (it cuts the tips
    // of corners).
    assert.notDeepEqual(await page.evaluate(() => globalThis.spectra.viewport.pose.eye), small);
    for (const [column, row] of [
      [-0.5, -0.5],
      [3.5, -0.5],
      [-0.5, 3.5],
      [3.5, 3.5],
    ]) {
      const [x, y] = await placeOf(page, column, row);
      assert.ok(x > 100 && x < 1060 && y > 0 && y < 780, `a corner of the map is at ${x}, ${y}`);
    }

    const range = () => page.evaluate(() => globalThis.spectra.store.fusionInForce.range);
    const announced = page.locator('[data-range="moved"]');
    const before = await range();
    assert.notEqual(before.mode, 'manual');
    await shows(page, await put(server, 1, 1, { celsius: 60 }));
    await announced.waitFor();
    assert.match((await announced.innerText()).replaceAll('\u202f', ' '), /^Range now [\d.]+ to [\d.]+ °C\. L locks it$/);
    await screenshot(page, 'live-range-moved');
    const moved = await range();
    assert.ok(moved.max > before.max + 20, `${before.max} to ${moved.max}`);
    await announced.waitFor({ state: 'detached' });

    // Held by one key; then whatever comes is shown in the same colours.
    await page.keyboard.press('l');
    await page.locator('[data-range="lock"][aria-pressed="true"]').waitFor();
    await settled(page);
    await shows(page, await put(server, 2, 2, { celsius: 90 }));
    const held = await range();
    assert.deepEqual([held.mode, held.min, held.max], ['manual', moved.min, moved.max]);
    assert.equal(await announced.count(), 0);
    assert.deepEqual(problems, []);
    await page.close();
    await server.stop();
  });

  test('A block that is replaced changes its place on the screen and no other, and the old one stays until the new one is complete', async () => {
    const server = await startServer(['--live']);
    let revision = 0;
    const CHANGED = 0;
    const update = (celsius) => put(server, CHANGED % 4, Math.floor(CHANGED / 4), { celsius, height: celsius / 10 });
    for (let i = 1; i < 16; i += 1) await put(server, i % 4, Math.floor(i / 4));
    revision = await update(40);
    const { page, problems } = await openClient(browser, server.url, { width: 1280, height: 800 });
    await shows(page, revision);
    await page.keyboard.press('1');
    await page.keyboard.press('h');
    await settled(page);
    // The colours of what stays are to stay, too.
    await page.keyboard.press('l');
    await settled(page);
    // From above, and from now on the camera is the viewer's.
    await page.evaluate((size) => {
      const { viewport, store } = globalThis.spectra;
      const { origin } = store.scene;
      const target = [size / 2 - origin[0], size / 2 - origin[1], -origin[2]];
      viewport.lookAlong([0, 0, 1]);
      globalThis.spectra.setView({ eye: [target[0], target[1] - 0.01, target[2] + 2.2 * size], target });
    }, 4 * STEP_M);
    await settled(page);
    const places = [];
    for (let i = 0; i < 16; i += 1) places.push(await placeOf(page, i % 4, Math.floor(i / 4)));
    // Not those beside it: a tile may reach across the border.
    const others = places.map((_, i) => i).filter((i) => i % 4 > 1 || i > 7);

    const background = await page.evaluate(() => {
      const colour = Number.parseInt(globalThis.spectra.store.background.slice(1), 16);
      return [colour >> 16, (colour >> 8) & 255, colour & 255];
    });
    const at = (image, [x, y]) => image.at(Math.round(x), Math.round(y));
    const first = await screenshot(page, 'live-before');
    for (const place of places) assert.ok(!near(at(first, place), background, 24), `no surface at ${place}`);

    const session = await page.context().newCDPSession(page);
    const frames = [];
    session.on('Page.screencastFrame', ({ data, sessionId }) => {
      frames.push(Buffer.from(data, 'base64'));
      void session.send('Page.screencastFrameAck', { sessionId });
    });
    await session.send('Page.startScreencast', { format: 'png', everyNthFrame: 1 });
    let last = first;
    for (let round = 1; round <= 4; round += 1) {
      revision = await update(round % 2 === 1 ? 20 : 40);
      await shows(page, revision);
      const next = await screenshot(page, `live-after-${round}`);
      assert.ok(!near(at(next, places[CHANGED]), at(last, places[CHANGED]), 24), 'the place that has changed looks as before');
      for (const i of others) assert.deepEqual(at(next, places[i]), at(last, places[i]), `block ${i} looks otherwise`);
      last = next;
    }
    await session.send('Page.stopScreencast');
    console.log(`        ${frames.length} frames while it was replaced 4 times`);
    assert.ok(frames.length >= 8, `${frames.length} frames`);
    frames.forEach((data, n) => {
      const image = decodePng(data);
      assert.equal(image.width, first.width);
      for (const [i, place] of places.entries()) {
        const pixel = at(image, place);
        assert.ok(!near(pixel, background, 24), `frame ${n} has a hole at block ${i}`);
        if (others.includes(i)) assert.deepEqual(pixel, at(first, place), `block ${i} flickers in frame ${n}`);
      }
    });
    await drawn(page);
    assert.deepEqual(problems, []);
    await page.close();
    await server.stop();
  });

  test('What is less sure than a limit, or of which nobody knows, is hatched, wherever colours are made', async () => {
    const server = await startServer(['--live']);
    let revision = 0;
    for (const [i, sigma] of [0.2, 1.5, undefined].entries()) revision = await put(server, i, 0, { celsius: 20 + 4 * i, sigma });
    for (const fusing of ['robot', 'here']) {
      const { page, problems } = await openClient(browser, server.url, { width: 1280, height: 800 }, { fusing });
      await shows(page, revision);
      if (fusing === 'here') await page.waitForFunction(() => globalThis.spectra.store.fusingPlace === 'here');
      // The first view follows what the window leaves free.
      await page.evaluate(() => {
        const { viewport } = globalThis.spectra;
        globalThis.spectra.setView({ eye: viewport.pose.eye, target: viewport.pose.target });
      });
      await drawn(page);
      const places = [];
      for (let i = 0; i < 3; i += 1) places.push((await placeOf(page, i, 0)).map(Math.round));
      const plain = await screenshot(page, `unhatched-${fusing}`);
      // Of a place, how many of so many pixels are other ones than before.
      const hatched = async (name) => {
        await drawn(page);
        const image = await screenshot(page, name);
        return places.map(([x, y]) => {
          let count = 0;
          for (let dy = -8; dy < 8; dy += 1)
            for (let dx = -8; dx < 8; dx += 1) if (!near(image.at(x + dx, y + dy), plain.at(x + dx, y + dy), 8)) count += 1;
          return count / 256;
        });
      };
      const limit = page.getByRole('spinbutton', { name: 'Hatch if less sure than' });
      const setLimit = async (text) => {
        await limit.fill(text);
        await limit.press('Enter');
      };
      await setLimit('0.5');
      const isHatched = (share) => share > 0.25 && share < 0.75;
      let shares = [];
      // Until it has come how sure they are, nobody knows.
      for (let i = 0; i < 40 && !(shares[0] === 0 && isHatched(shares[1])); i += 1) {
        await page.waitForTimeout(100);
        shares = await hatched(`hatched-${fusing}`);
      }
      assert.ok(shares[0] === 0 && isHatched(shares[1]) && isHatched(shares[2]), `${fusing}: ${shares}`);
      const bytes = await page.evaluate(() => globalThis.spectra.store.received_bytes);
      await setLimit('2');
      shares = await hatched(`hatched-unknown-${fusing}`);
      assert.ok(shares[0] === 0 && shares[1] === 0 && isHatched(shares[2]), `${fusing}: ${shares}`);
      await setLimit('0.1');
      assert.ok((await hatched(`hatched-all-${fusing}`)).every(isHatched));
      assert.equal(await page.evaluate(() => globalThis.spectra.store.received_bytes), bytes, 'a limit costs nothing');
      await setLimit('');
      assert.deepEqual(await hatched(`hatched-none-${fusing}`), [0, 0, 0]);
      await assertAccessible(page, 'a limit of sigma');
      assert.deepEqual(problems, []);
      await page.close();
    }
    await server.stop();
  });

  test('The robot that maps and its way stand in the scene; the camera goes along with it by key and by touch, until somebody moves it; a reading says how sure it is', async () => {
    const server = await startServer(['--demo-drive']);
    const { page, problems } = await openClient(browser, server.url, { width: 1280, height: 800 });
    const store = (path) => page.evaluate((key) => globalThis.spectra.store[key], path);
    await page.waitForFunction(() => (globalThis.spectra?.store.robot?.path.length ?? 0) > 3, null, { timeout: 60_000 });
    const follow = page.getByRole('button', { name: 'Follow robot' });
    await follow.waitFor();
    assert.equal(await follow.getAttribute('aria-pressed'), 'false');

    await page.keyboard.press('g');
    assert.equal(await follow.getAttribute('aria-pressed'), 'true');
    const marker = page.locator('[data-robot=marker]');
    await marker.waitFor();
    const away = () =>
      page.evaluate(() => {
        const { camera, robot, scene } = globalThis.spectra.store;
        return Math.hypot(...camera.eye.map((value, axis) => value - (robot.position[axis] - scene.origin[axis])));
      });
    // It goes on, and the camera with it.
    const before = await store('camera');
    await page.waitForFunction(
      ([eye]) => Math.hypot(...globalThis.spectra.store.camera.eye.map((value, axis) => value - eye[axis])) > 0.1,
      [before.eye],
    );
    assert.ok((await away()) < 4, `${await away()} m from the robot`);
    const x = Number(await marker.getAttribute('data-x'));
    assert.ok(x > 200 && x < 1100, `the robot is at ${x}`);
    assert.ok((await page.locator('[data-robot=path]').last().getAttribute('d')).includes('L'));
    await screenshot(page, 'robot-followed');

    // Whoever moves the camera has it.
    await page.mouse.move(600, 400);
    await page.mouse.down();
    await page.mouse.move(640, 410, { steps: 3 });
    await page.mouse.up();
    assert.equal(await follow.getAttribute('aria-pressed'), 'false');
    await follow.click();
    assert.equal(await store('followsRobot'), true);
    await page.keyboard.press('f');
    assert.equal(await store('followsRobot'), false);

    await page.getByRole('checkbox', { name: 'Robot and its way' }).uncheck();
    await marker.waitFor({ state: 'detached' });

    await page.waitForFunction(() => globalThis.spectra.store.extremes?.hottest != null);
    // The map grows: where the hottest place is may not be drawn yet, or lie behind or beside what has just come and has no temperature.
    const reading = page.locator('[data-probe]').filter({ hasText: /^\s*\d+\.\d ± \d+\.\d\u202f°C, \d+\u202fs ago/ });
    for (let attempt = 0; attempt < 40 && (await reading.count()) === 0; attempt += 1) {
      await page.evaluate(async () => {
        const { viewport, store, pin } = globalThis.spectra;
        const at = viewport.project(store.extremes.hottest.position);
        if (at !== null) await pin.call(globalThis.spectra, at);
      });
      await page.waitForTimeout(500);
    }
    await reading.waitFor();
    await assertAccessible(page, 'a robot');
    assert.deepEqual(problems, []);
    await page.close();
    await server.stop();
  });
}
