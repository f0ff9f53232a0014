// Colours that are made in the browser: by the same library, without a byte for a setting, and without a link.
import assert from 'node:assert/strict';
import { existsSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { sheet } from '../../tests/integration/node/ply.mjs';
import { demoServer, drawn, openClient, screenshot, settled, startServer, test } from './harness.mjs';
import { startLink } from './link.mjs';

const MODULE = new URL('../../build/wasm/bin/fusion.wasm', import.meta.url);

/** Some pixels of the scene's part of the window. */
function sample(image) {
  const pixels = [];
  for (let x = 200; x < 1100; x += 7) for (let y = 40; y < 820; y += 7) pixels.push(image.at(x, y));
  return pixels;
}

/** Share of pixels that differ by more than `levels` in some channel. */
const apart = (a, b, levels = 4) =>
  a.filter((pixel, i) => pixel.some((value, channel) => Math.abs(value - b[i][channel]) > levels)).length / a.length;

const isHere = (page) => page.waitForFunction(() => globalThis.spectra.store.fusingPlace === 'here', null, { timeout: 120_000 });
const isOnRobot = (page) =>
  page.waitForFunction(() => globalThis.spectra.store.fusingPlace === 'robot', null, { timeout: 60_000 });

/** Counts what the page receives from now on: frames, and bytes of messages both ways. */
function counter(page) {
  const counts = { frames: 0, frame_bytes: 0, message_bytes: 0, isOn: false };
  const count = ({ payload }, isFromServer) => {
    if (!counts.isOn) return;
    if (typeof payload === 'string') counts.message_bytes += payload.length;
    else if (isFromServer) {
      counts.frames += 1;
      counts.frame_bytes += payload.length;
    }
  };
  page.on('websocket', (socket) => {
    socket.on('framereceived', (frame) => count(frame, true));
    socket.on('framesent', (frame) => count(frame, false));
  });
  return counts;
}

const setAlpha = (page, alpha) => page.evaluate((value) => globalThis.spectra.settings.setParameter('alpha', value, true), alpha);
const setMethod = (page, method) => page.evaluate((id) => globalThis.spectra.settings.setMethod(id), method);

export function addFusingTests(browser, scratch) {
  if (!existsSync(MODULE)) {
    console.log('skipped: fusing in the browser; deploy/build_module.sh could not make the library');
    return;
  }

  test('Fused here: the pixels of the robot, no frame and few bytes for a hundred settings', async () => {
    const server = await demoServer();
    const { page, problems } = await openClient(browser, 'about:blank', undefined, { fusing: 'here' });
    const counts = counter(page);
    await page.goto(server.url);
    await settled(page, 180_000);
    await isHere(page);
    const robot = await openClient(browser, server.url);
    await settled(robot.page);
    for (const method of ['thermal_visible_blend', 'histogram_distribution', 'monochrome_threshold', 'inverse_intensity_hue']) {
      for (const one of [page, robot.page]) {
        await setMethod(one, method);
        await settled(one);
      }
      const [own, theirs] = [sample(await screenshot(page, 'fused-here')), sample(await screenshot(robot.page, 'fused-there'))];
      // What lies on a threshold may go either way within half a step of the temperature.
      assert.ok(apart(own, theirs) < 0.01, `${method}: ${apart(own, theirs)} of the pixels differ`);
      const inForce = (one) => one.evaluate(() => JSON.stringify(globalThis.spectra.store.fusion));
      assert.equal(await inForce(page), await inForce(robot.page));
    }

    await setMethod(page, 'thermal_visible_blend');
    await setAlpha(page, 0);
    await page.waitForTimeout(1500);
    const before = sample(await screenshot(page, 'alpha-0'));
    counts.isOn = true;
    for (let i = 1; i <= 100; i += 1) {
      await setAlpha(page, i / 100);
      await page.waitForTimeout(30);
    }
    await page.waitForTimeout(2500);
    await drawn(page);
    counts.isOn = false;
    assert.equal(counts.frames, 0, `${counts.frame_bytes} bytes of frames`);
    assert.ok(counts.message_bytes < 20_000, `${counts.message_bytes} bytes of messages`);
    console.log(`        100 settings: ${counts.frame_bytes} bytes of frames, ${counts.message_bytes} of messages`);
    assert.ok(apart(sample(await screenshot(page, 'alpha-1')), before) > 0.2, 'the picture has followed');
    counts.message_bytes = 0;
    counts.isOn = true;
    const methods = ['thermal_only', 'visible_only', 'histogram_distribution', 'intensity_hue'];
    for (let i = 0; i < 100; i += 1) {
      await setMethod(page, methods[i % 4]);
      await page.waitForTimeout(30);
    }
    await page.waitForTimeout(2500);
    counts.isOn = false;
    assert.equal(counts.frames, 0, `${counts.frame_bytes} bytes of frames`);
    assert.ok(counts.message_bytes < 20_000, `${counts.message_bytes} bytes of messages for a hundred methods`);
    console.log(`        100 methods: ${counts.message_bytes} bytes of messages`);
    // The robot knows what is set here.
    const said = await page.evaluate(() => globalThis.spectra.store.generation);
    assert.ok(said >= 2);

    assert.deepEqual(problems, []);
    await robot.page.close();
    await page.close();
  });

  test('Temperatures that stand on a threshold are on its same side here and on the robot', async () => {
    const scene = join(scratch, 'halves.ply');
    writeFileSync(
      scene,
      sheet((x) => (20 + Math.floor(x / 6) / 2).toFixed(1)),
    );
    const server = await startServer([scene]);
    const here = await openClient(browser, server.url, undefined, { fusing: 'here' });
    const robot = await openClient(browser, server.url);
    const pages = [here.page, robot.page];
    for (const page of pages) await settled(page, 180_000);
    await isHere(here.page);
    assert.match(await here.page.locator('footer').innerText(), /colours to 0\.005/, 'steps are not exact');
    assert.match(await robot.page.locator('footer').innerText(), /colours exact/);
    const pictures = [];
    for (const threshold of [22, 22.5, 23]) {
      for (const page of pages) {
        await setMethod(page, 'colour_mapped_threshold');
        await page.evaluate((value) => globalThis.spectra.settings.setParameter('threshold', value, true), threshold);
        await settled(page);
        await drawn(page);
      }
      const [own, theirs] = [
        sample(await screenshot(here.page, 'halves-here')),
        sample(await screenshot(robot.page, 'halves-there')),
      ];
      assert.ok(apart(own, theirs) < 0.002, `${threshold} °C: ${apart(own, theirs)} of the pixels differ`);
      pictures.push(theirs);
    }
    assert.ok(apart(pictures[0], pictures[1]) > 0.02, 'the threshold is seen');
    assert.equal(await here.page.evaluate(() => globalThis.spectra.store.fusingPlace), 'here');
    for (const { page, problems } of [here, robot]) {
      assert.deepEqual(problems, []);
      await page.close();
    }
    await server.stop();
  });

  test('A narrow range gets finer temperatures, alone, and is said to be as exact as they are', async () => {
    const server = await demoServer();
    const here = await openClient(browser, 'about:blank', undefined, { fusing: 'here' });
    const kinds = new Set();
    let isCounting = false;
    here.page.on('websocket', (socket) =>
      socket.on('framereceived', ({ payload }) => {
        if (isCounting && typeof payload !== 'string') kinds.add(payload[4]);
      }),
    );
    await here.page.goto(server.url);
    const robot = await openClient(browser, server.url);
    const pages = [here.page, robot.page];
    for (const page of pages) {
      await settled(page, 180_000);
      await setMethod(page, 'thermal_only');
      await settled(page);
    }
    await isHere(here.page);
    const accuracy = () =>
      here.page.evaluate(() => {
        const { drawnError, fusingPlace } = globalThis.spectra.store;
        return [fusingPlace, drawnError.rounding_celsius];
      });
    assert.deepEqual(await accuracy(), ['here', Math.fround(0.01) / 2]);
    isCounting = true;
    for (const page of pages) {
      await page.evaluate(() => globalThis.spectra.settings.setRange(19.5, 19.7, true));
      await settled(page);
    }
    // A 256th of the range, at most.
    await here.page.waitForFunction(() => globalThis.spectra.store.drawnError.rounding_celsius < 0.2 / 512, null, {
      timeout: 30_000,
    });
    await drawn(here.page);
    assert.equal((await accuracy())[0], 'here');
    assert.deepEqual([...kinds], [4], 'temperatures alone');
    const [own, theirs] = [
      sample(await screenshot(here.page, 'narrow-here')),
      sample(await screenshot(robot.page, 'narrow-there')),
    ];
    assert.ok(apart(own, theirs) < 0.005, `${apart(own, theirs)} of the pixels differ`);
    assert.match(await here.page.locator('footer').innerText(), /colours to 0\.000/);
    for (const { page, problems } of [here, robot]) {
      assert.deepEqual(problems, []);
      await page.close();
    }
  });

  test('One temperature far out: a threshold is left to the robot, however wide the range is', async () => {
    const scene = join(scratch, 'outlier.ply');
    writeFileSync(
      scene,
      sheet((x, y) => (x + y === 0 ? '1e30' : (20 + x / 20).toFixed(2))),
    );
    const server = await startServer([scene]);
    const { page, problems } = await openClient(browser, server.url, undefined, { fusing: 'here' });
    await settled(page, 180_000);
    await setMethod(page, 'thermal_only');
    await page.evaluate(() => {
      const { store, settings } = globalThis.spectra;
      if (store.fusion.range.mode !== 'auto') settings.toggleRangeExtremes();
    });
    await isHere(page);
    await setMethod(page, 'colour_mapped_threshold');
    await page.evaluate(() => globalThis.spectra.settings.setParameter('threshold', 21.5, true));
    await isOnRobot(page);
    await settled(page);
    await page.locator('[data-fusing="robot"]', { hasText: 'too coarse for a threshold' }).waitFor({ timeout: 10_000 });
    const robot = await openClient(browser, server.url);
    await settled(robot.page);
    await robot.page.evaluate(() => {
      const { settings, store } = globalThis.spectra;
      settings.setMethod('colour_mapped_threshold');
      settings.setParameter('threshold', 21.5, true);
      if (store.fusion.range.mode !== 'auto') settings.toggleRangeExtremes();
    });
    await settled(robot.page);
    const [own, theirs] = [sample(await screenshot(page, 'outlier-own')), sample(await screenshot(robot.page, 'outlier-there'))];
    assert.ok(apart(own, theirs) < 0.002, `${apart(own, theirs)} of the pixels differ`);
    assert.deepEqual(problems, []);
    await robot.page.close();
    await page.close();
    await server.stop();
  });

  test('A value that is refused here goes back to what is in force, with the reason beside it', async () => {
    const server = await demoServer();
    const { page, problems } = await openClient(browser, server.url, { width: 1280, height: 900 }, { fusing: 'here' });
    await settled(page, 180_000);
    await isHere(page);
    await setMethod(page, 'thermal_highlighting');
    await settled(page);
    const field = page.locator('[data-parameter="high"]');
    const entry = field.locator('input[type=number]');
    const before = await entry.inputValue();
    await entry.fill('-5');
    await entry.press('Enter');
    await field.getByRole('alert').waitFor();
    assert.equal(await entry.inputValue(), before);
    assert.equal(await page.locator('[data-parameter="low"] [role=alert]').count(), 0);

    // What is said of highlights is never of other settings than those that are set.
    await setMethod(page, 'histogram_distribution');
    const note = page.locator('[data-highlight]');
    await note.filter({ hasText: /% of the surface/ }).waitFor();
    const [share, at_once] = await page.evaluate(async () => {
      const { store, settings } = globalThis.spectra;
      const known = store.histogram.highlighted_share;
      settings.setParameter('k', 5, true);
      await new Promise((resolve) => setTimeout(resolve));
      return [known, document.querySelector('[data-highlight]').textContent];
    });
    assert.equal(at_once, '…');
    await note.filter({ hasText: /surface|Nothing/ }).waitFor();
    assert.notEqual(await page.evaluate(() => globalThis.spectra.store.histogram.highlighted_share), share);
    assert.deepEqual(problems, []);
    await page.close();
  });

  test('How much is highlighted is said where colours are made here, as the robot says it', async () => {
    const server = await demoServer();
    const words = async (fusing) => {
      const { page, problems } = await openClient(browser, server.url, { width: 900, height: 560 }, { fusing });
      await settled(page, 180_000);
      if (fusing === 'here') await isHere(page);
      const said = {};
      const note = page.locator('[data-highlight]');
      const say = async (what, pattern) => {
        await settled(page);
        await note.filter({ hasText: pattern }).waitFor();
        const share = await page.evaluate(() => globalThis.spectra.store.histogram.highlighted_share);
        // Whether it stands out by its colours, which decides about an outline, is judged a moment later.
        await page.waitForTimeout(400);
        const { contrast, isOutlined } = await page.evaluate(() => {
          const { highlightContrast, isOutlined } = globalThis.spectra.store;
          return { contrast: highlightContrast === null ? null : highlightContrast.in_grey, isOutlined };
        });
        said[what] = { text: await note.innerText(), share, contrast, isOutlined };
      };
      await say('first', /% of the surface/);
      await setMethod(page, 'colour_mapped_threshold');
      await page.evaluate(() => globalThis.spectra.settings.setParameter('threshold', 33.3, true));
      await say('threshold', /above 33\.3/);
      await setMethod(page, 'thermal_visible_blend');
      await settled(page);
      await note.waitFor({ state: 'detached' });
      await setMethod(page, 'colour_mapped_threshold');
      await page.evaluate(() => globalThis.spectra.settings.setParameter('threshold', 99, true));
      await say('nothing', /^Nothing is highlighted/);
      assert.deepEqual(problems, []);
      await page.close();
      return said;
    };
    const [robot, here] = [await words('robot'), await words('here')];
    for (const [what, { text, share, contrast, isOutlined }] of Object.entries(robot)) {
      // Borders of tiles and coarse ones make a little difference.
      assert.ok(Math.abs(here[what].share - share) <= 0.02 * share, `${what}: ${here[what].share} here, ${share} by the robot`);
      assert.equal(
        here[what].isOutlined,
        isOutlined,
        `${what}: outlined by a contrast of ${here[what].contrast} here, ${contrast} by the robot`,
      );
      assert.equal(here[what].contrast === null, contrast === null, what);
      assert.equal(here[what].text.replace(/^[\d.]+/, ''), text.replace(/^[\d.]+/, ''));
    }
  });

  test('Switching where colours are made leaves no pixel of the old setting', async () => {
    const server = await demoServer();
    const { page, problems } = await openClient(browser, server.url, undefined, { fusing: 'here' });
    await settled(page, 180_000);
    await isHere(page);
    await setMethod(page, 'visible_only');
    await drawn(page);
    const visible = sample(await screenshot(page, 'switch-visible'));
    await page.evaluate(() => globalThis.spectra.setFusing('robot'));
    await isOnRobot(page);
    await settled(page);
    assert.ok(apart(sample(await screenshot(page, 'switch-robot')), visible) < 0.002);
    await setMethod(page, 'thermal_only');
    await settled(page);
    const thermal = sample(await screenshot(page, 'switch-thermal'));
    assert.ok(apart(thermal, visible) > 0.2, 'the two settings look alike');
    await page.evaluate(() => globalThis.spectra.setFusing('here'));
    await isHere(page);
    await drawn(page);
    assert.ok(apart(sample(await screenshot(page, 'switch-here')), thermal) < 0.01);
    // And a setting in the middle of the switch.
    await setMethod(page, 'visible_only');
    await page.evaluate(() => globalThis.spectra.setFusing('robot'));
    await setMethod(page, 'thermal_only');
    await isOnRobot(page);
    await settled(page);
    assert.ok(apart(sample(await screenshot(page, 'switch-amid')), thermal) < 0.002);
    assert.deepEqual(problems, []);
    await page.close();
  });

  test('What only the robot knows it shows, and nothing of before stays; afterwards it is here again', async () => {
    const server = await demoServer();
    const { page, problems } = await openClient(browser, server.url, undefined, { fusing: 'here' });
    await settled(page, 180_000);
    await isHere(page);
    await setMethod(page, 'thermal_only');
    await drawn(page);
    const here = sample(await screenshot(page, 'robot-only-before'));
    // Without a past nothing has changed: it shows what is visible. Of what was set a moment before, the robot has not heard yet.
    await setMethod(page, 'visible_only');
    await setMethod(page, 'thermal_only');
    await setMethod(page, 'thermal_change');
    await isOnRobot(page);
    await settled(page);
    const change = sample(await screenshot(page, 'robot-only-change'));
    const robot = await openClient(browser, server.url);
    await settled(robot.page);
    await setMethod(robot.page, 'thermal_change');
    await settled(robot.page);
    const theirs = sample(await screenshot(robot.page, 'robot-only-theirs'));
    assert.ok(apart(theirs, here) > 0.2, 'the two settings look alike');
    assert.ok(apart(change, theirs) < 0.002, `${apart(change, theirs)} of the pixels are not the robot's`);
    await page.locator('[data-fusing="robot"]', { hasText: 'temperatures of before' }).waitFor({ timeout: 10_000 });
    await page.waitForFunction(() => globalThis.spectra.store.isShareKnown, null, { timeout: 5000 });
    await setMethod(page, 'thermal_only');
    await isHere(page);
    await drawn(page);
    assert.ok(apart(sample(await screenshot(page, 'robot-only-after')), here) < 0.01);
    assert.deepEqual(problems, []);
    await robot.page.close();
    await page.close();
  });

  test('Without a link the last map is turned, tuned and read, and says how old it is', async () => {
    const server = await demoServer();
    const link = await startLink(server.port);
    const { page } = await openClient(browser, link.url, undefined, { fusing: 'here' });
    await settled(page, 180_000);
    await isHere(page);
    await setMethod(page, 'thermal_only');
    await drawn(page);
    const thermal = sample(await screenshot(page, 'cut-before'));
    link.down();
    await page.waitForFunction(() => !globalThis.spectra.store.connected);
    await setMethod(page, 'visible_only');
    await drawn(page);
    const visible = sample(await screenshot(page, 'cut-visible'));
    assert.ok(apart(visible, thermal) > 0.2, 'the setting has come into the picture');
    const words = await page.locator('[role="alert"]').first().innerText();
    assert.match(words, /This picture is \d/);
    const old = () => page.evaluate(() => globalThis.spectra.store.lostFor_s);
    const age = await old();
    await page.waitForTimeout(1200);
    assert.ok((await old()) > age + 0.8, 'its age counts');
    // What only the robot can do waits, and so does a range after it: it is named as it is in the picture.
    const range = page.locator('[data-range="follow"]');
    assert.match(await page.locator('[role="alert"]').first().innerText(), /Turning, settings and readings work/);
    const named = await range.innerText();
    await setMethod(page, 'thermal_change');
    await page.evaluate(() => globalThis.spectra.settings.toggleRangeExtremes());
    await page.locator('[data-waiting]', { hasText: 'range to the extremes' }).waitFor();
    assert.equal(await range.innerText(), named);
    assert.match(await page.locator('[role="alert"]').first().innerText(), /Turning and readings work/);
    await page.evaluate(() => globalThis.spectra.settings.toggleRangeExtremes());
    await setMethod(page, 'visible_only');
    await page.locator('[data-waiting]').waitFor({ state: 'detached' });
    // A reading, by what is here.
    const reading = await page.evaluate(async () => {
      await globalThis.spectra.pin({ x: 640, y: 450 });
      return globalThis.spectra.store.pinned?.reading.probe ?? null;
    });
    assert.ok(reading !== null && Number.isFinite(reading.temperature) && reading.visible.length === 3, JSON.stringify(reading));
    // What fades by its age only the robot can make: until then it is said whose colours these are.
    await page.evaluate(() => globalThis.spectra.settings.setAge({ mode: 'fade', half_life_s: 60 }, true));
    await page.locator('p[data-fusing]', { hasText: /^Here until the robot has made it: What is old fades/ }).waitFor();
    await page.evaluate(() => globalThis.spectra.settings.setAge({ mode: 'off' }, true));
    await page.locator('p[data-fusing]', { hasText: 'Here: a setting needs no link.' }).waitFor();
    // And turned.
    await page.keyboard.press('ArrowLeft');
    await page.waitForTimeout(500);
    await drawn(page);
    assert.ok(apart(sample(await screenshot(page, 'cut-turned')), visible) > 0.05);
    link.up();
    await settled(page);
    assert.equal(await page.evaluate(() => globalThis.spectra.store.fusion.method), 'visible_only');
    assert.equal(await page.evaluate(() => globalThis.spectra.store.fusingPlace), 'here');
    await page.close();
    await link.stop();
  });

  test('What is made here is said to be behind until it has been drawn', async () => {
    const server = await demoServer();
    const link = await startLink(server.port);
    const { page, problems } = await openClient(browser, link.url, undefined, { fusing: 'here' });
    await settled(page, 180_000);
    await isHere(page);
    await drawn(page);
    // A machine that does not come to draw.
    const drawNothing = () =>
      page.evaluate(() => {
        const { viewport } = globalThis.spectra;
        const { pictures } = viewport;
        Object.defineProperty(viewport, 'pictures', { get: () => pictures, configurable: true });
      });
    await drawNothing();
    await page.keyboard.press('2');
    const sign = page.locator('[data-pending-method]');
    await sign.waitFor({ timeout: 10_000 });
    assert.match(await sign.innerText(), /Visible only: not yet in the picture/);
    const footer = await page.locator('footer').innerText();
    assert.match(footer, /behind/);
    assert.doesNotMatch(footer, /up to date/);
    await page.evaluate(() => delete globalThis.spectra.viewport.pictures);
    await sign.waitFor({ state: 'detached', timeout: 10_000 });
    await page.locator('footer', { hasText: 'up to date' }).waitFor({ timeout: 10_000 });
    assert.deepEqual(problems, []);
    // And without a link.
    link.down();
    await page.waitForFunction(() => !globalThis.spectra.store.connected);
    await drawNothing();
    await page.keyboard.press('1');
    await sign.waitFor({ timeout: 10_000 });
    assert.match(await sign.innerText(), /Thermal only: not yet in the picture/);
    await page.evaluate(() => delete globalThis.spectra.viewport.pictures);
    await sign.waitFor({ state: 'detached', timeout: 10_000 });
    await page.close();
    await link.stop();
  });

  test('After the server was started again: the range in force, keys that work, colours made here, and no reading of before', async () => {
    const bare = join(scratch, 'bare.ply');
    const corners = [0, 1].flatMap((x) => [0, 1].map((y) => `${x} ${y} 0 40 90 200`));
    writeFileSync(
      bare,
      `ply\nformat ascii 1.0\nelement vertex 4\n${['x', 'y', 'z'].map((name) => `property float ${name}\n`).join('')}` +
        `${['red', 'green', 'blue'].map((name) => `property uchar ${name}\n`).join('')}` +
        `element face 2\nproperty list uchar int vertex_indices\nend_header\n${corners.join('\n')}\n3 0 2 1\n3 1 2 3\n`,
    );
    let server = await startServer(['--demo']);
    const { page } = await openClient(browser, server.url, { width: 1000, height: 700 }, { fusing: 'here' });
    await settled(page, 180_000);
    await isHere(page);
    const range = () => page.evaluate(() => globalThis.spectra.store.fusion.range);
    const before = await range();
    /** Another server on the same port, and the page connected to it at once: the scene is still being made. */
    const restart = async (args) => {
      await server.stop();
      await page.waitForFunction(() => !globalThis.spectra.store.connected);
      server = await startServer(args, server.port);
      await page.evaluate(() => {
        const look = setInterval(() => {
          const { store } = globalThis.spectra;
          if (!store.connected) return globalThis.spectra.retryNow();
          if (store.scene === null) globalThis.sawNoScene ??= { cards: document.querySelectorAll('.card').length };
          else clearInterval(look);
        }, 50);
      });
      await page.waitForFunction(() => globalThis.spectra.store.connected && globalThis.spectra.store.scene, null, {
        timeout: 120_000,
      });
      await settled(page, 180_000);
    };
    await page.evaluate(() => globalThis.spectra.pin({ x: 500, y: 350 }));
    await page.locator('.card').waitFor();
    await restart(['--demo']);
    assert.deepEqual(await page.evaluate(() => globalThis.sawNoScene), { cards: 0 }, 'a connection without a scene, and no card');
    assert.deepEqual(await range(), before);
    assert.equal(await page.locator('[data-range="moved"]').count(), 0, 'the range has not moved');
    await page.keyboard.press('e');
    await page.waitForFunction(() => globalThis.spectra.store.range.mode === 'auto');
    await page.keyboard.press('l');
    await page.waitForFunction(() => globalThis.spectra.store.range.mode === 'manual');
    await isHere(page);
    assert.match(await page.locator('p[data-fusing]').textContent(), /^Here/);
    // A thermal view gives what has no temperature a colour; where nothing has one, all is shown in the visible colours.
    await page.keyboard.press('1');
    await page.waitForFunction(() => globalThis.spectra.store.fusion.missing === '#808080');
    await restart([bare]);
    await page.waitForFunction(() => globalThis.spectra.store.fusionInForce.missing === 'visible', null, { timeout: 10_000 });
    await settled(page);
    const place = await page.evaluate(() => globalThis.spectra.viewport.project([0.5, 0.5, 0]));
    assert.deepEqual((await screenshot(page, 'restarted-bare')).at(place.x, place.y), [40, 90, 200]);
    await page.close();
    await server.stop();
  });

  // On the robot: "Hundreds of changes leave nothing behind".
  test('Memory stays flat over 500 settings that are made here', async () => {
    const server = await demoServer();
    const { page, problems } = await openClient(browser, server.url, undefined, { fusing: 'here' });
    await settled(page, 180_000);
    await setMethod(page, 'thermal_visible_blend');
    const heap = async () => {
      const session = await page.context().newCDPSession(page);
      await session.send('HeapProfiler.collectGarbage');
      const { usedSize } = await session.send('Runtime.getHeapUsage');
      await session.detach();
      return usedSize;
    };
    await isHere(page);
    const change = async (count) => {
      for (let i = 0; i < count; i += 1) {
        await setAlpha(page, (i % 100) / 100);
        await page.evaluate(() => new Promise((resolve) => requestAnimationFrame(resolve)));
      }
      await settled(page);
    };
    await change(50);
    const before = await heap();
    await change(500);
    const grown = (await heap()) - before;
    assert.ok(grown < 3e6, `${grown} bytes more after 500 settings`);
    assert.deepEqual(problems, []);
    await page.close();
  });

  test('It is here once what draws is ready, and not before; what fails there is said, and can be tried again', async () => {
    const server = await demoServer();
    const { page } = await openClient(browser, 'about:blank', undefined, { fusing: 'here' });
    const held = [];
    const part = /\/tile_fuser-[^/]*\.js$/;
    await page.context().route(part, (route) => void held.push(route));
    await page.goto(server.url);
    await settled(page, 180_000);
    await page.locator('[data-fusing="coming"]', { hasText: 'until the library' }).waitFor({ timeout: 60_000 });
    const before = sample(await screenshot(page, 'drawer-before'));
    await setMethod(page, 'thermal_only');
    await settled(page);
    await drawn(page);
    assert.ok(apart(sample(await screenshot(page, 'drawer-late')), before) > 0.2, 'a setting comes into the picture meanwhile');
    for (const route of held.splice(0)) await route.fulfill({ status: 404, body: '' });
    await page.locator('[data-fusing="robot"]', { hasText: 'Fusing here has failed' }).waitFor({ timeout: 30_000 });
    await page.context().unroute(part);
    await page.evaluate(() => globalThis.spectra.setFusing('here'));
    await isHere(page);
    const thermal = sample(await screenshot(page, 'drawer-again'));
    await setMethod(page, 'visible_only');
    await drawn(page);
    assert.ok(apart(sample(await screenshot(page, 'drawer-here')), thermal) > 0.2, 'a setting is made here');
    await page.close();
  });

  test('A library that does not load or compile leaves colours to the robot, and the panel says so', async () => {
    const server = await demoServer();
    for (const [what, fulfil] of [
      ['missing', { status: 404, body: '' }],
      ['broken', { status: 200, contentType: 'application/wasm', body: 'not a module' }],
    ]) {
      const { page } = await openClient(browser, 'about:blank', undefined, { fusing: 'here' });
      await page.route('**/fusion-*.wasm', (route) => route.fulfill(fulfil));
      await page.goto(server.url);
      await settled(page, 180_000);
      const words = page.locator('[data-fusing="robot"]', { hasText: 'could not be loaded' });
      await words.waitFor({ timeout: 30_000 });
      await setMethod(page, 'visible_only');
      await settled(page);
      assert.equal(await page.evaluate(() => globalThis.spectra.store.pictureMethod), 'visible_only', what);
      await page.close();
    }
  });
}
