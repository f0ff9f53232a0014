// What the demo scene shows in one browser that stays open, from the first picture to a server that was away.
import assert from 'node:assert/strict';
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { readPly } from '../../tests/integration/node/ply.mjs';
import { SpectraClient } from '../../tests/integration/node/spectra_client.mjs';
import {
  assertGpuObjects,
  decodePng,
  drawn,
  gpuObjects,
  openClient,
  screenshot,
  settled,
  startServer,
  test,
} from './harness.mjs';

export async function addDemoTests(browser, scratch) {
  let server = await startServer(['--demo']);
  const { page, problems } = await openClient(browser, server.url);

  const state = () =>
    page.evaluate(() => {
      const { store } = globalThis.spectra;
      return JSON.parse(
        JSON.stringify({
          fusion: store.fusionInForce,
          scene: store.scene,
          shown: store.shown,
          extremes: store.extremes,
          histogram: store.histogram,
          refusals: store.refusals,
          quality: store.quality,
          generation: store.generation,
          palette: store.palette,
          complete: store.complete,
        }),
      );
    });

  /** Where the vertex of a position is drawn: each has a step of its own, which only the tiles on the wire tell. */
  async function drawnPlaceOf(position) {
    const client = await SpectraClient.connect(server.url);
    await client.request('scene.subscribe', { channels: ['fused'] });
    await client.complete(1);
    assert.deepEqual(client.failures, []);
    let nearest = null;
    let least = Infinity;
    for (const { frame, geometry } of client.tiles.values()) {
      if (frame.childMask !== 0) continue;
      for (let i = 0; i < geometry.positions.length; i += 3) {
        const place = frame.origin.map((value, axis) => Math.fround(value + geometry.positions[i + axis]));
        const away = Math.hypot(...place.map((value, axis) => value - position[axis]));
        if (away < least) [nearest, least] = [place, away];
      }
    }
    const largest_step_m = client.hello.quality.position_step_mm / 1000;
    await client.close();
    assert.ok(least <= (largest_step_m / 2) * Math.sqrt(3), `the nearest vertex is drawn ${least} m from ${position}`);
    return nearest;
  }

  /**
   * Puts the camera close before a vertex as it is drawn, on a side from which it can be seen, and says where it is on the screen. Not
   * where a pixel beside it shows what is behind: there the pixel itself is of both.
   */
  async function lookAt(vertex) {
    const place = await page.evaluate(async (target) => {
      const session = globalThis.spectra;
      const { viewport, store } = session;
      const { min, max } = store.scene.bounds;
      const distance = Math.hypot(max[0] - min[0], max[1] - min[1], max[2] - min[2]) / 400;
      const away = async (x, y) => {
        const hit = await viewport.pick(x, y);
        return hit === null ? Infinity : Math.hypot(hit[0] - target[0], hit[1] - target[1], hit[2] - target[2]);
      };
      for (let i = 0; i < 100; i += 1) {
        const z = 1 - (2 * i + 1) / 100;
        const angle = i * 2.39996;
        const ring = Math.sqrt(1 - z * z);
        const eye = [ring * Math.cos(angle), z, ring * Math.sin(angle)].map((value, axis) => target[axis] + value * distance);
        session.setView({ eye, target });
        // The camera goes there with the next picture, which waits for those before it.
        const toGo = () => Math.hypot(...viewport.pose.eye.map((value, axis) => value - eye[axis]));
        while (toGo() > distance / 1000) await new Promise((resolve) => requestAnimationFrame(resolve));
        const place = viewport.project(target);
        if ((await away(place.x, place.y)) > distance / 200) continue;
        const around = [-3, 0, 3].flatMap((x) => [-3, 0, 3].map((y) => away(place.x + x, place.y + y)));
        if (Math.max(...(await Promise.all(around))) < distance / 50) return place;
      }
      return null;
    }, vertex);
    // The camera is there before the picture is.
    await drawn(page);
    return place;
  }

  function assertColour(actual, expected, tolerance, what) {
    const worst = Math.max(...expected.map((value, channel) => Math.abs(value - actual[channel])));
    assert.ok(worst <= tolerance, `${what}: ${actual} is not ${expected} (tolerance ${tolerance})`);
  }

  /** What stands behind the name of a method in the panel. */
  const signBeside = (method) =>
    page.locator(`[data-method="${method}"] .name`).evaluate((name) => getComputedStyle(name, '::after').content);

  const number = (selector) => page.locator(selector).inputValue().then(Number);

  test('The whole demo scene stands in the browser', async () => {
    await settled(page);
    const { scene, shown, complete } = await state();
    assert.ok(scene.vertex_count > 200_000, `${scene.vertex_count} vertices`);
    assert.equal(shown.triangles, scene.triangle_count);
    assert.equal(complete.tiles, scene.tile_count);
    // While others begin on the same machine the robot may be silent for a moment, which is said instead.
    const bar = page.locator('footer', { hasText: 'up to date' });
    await bar.waitFor({ timeout: 10_000 });
    assert.match(await bar.innerText(), /low/);
    const image = await screenshot(page, 'demo');
    const seen = new Set();
    for (let x = 200; x < 1100; x += 10) for (let y = 50; y < 850; y += 10) seen.add(image.at(x, y).join());
    assert.ok(seen.size > 500, `${seen.size} colours`);
    assert.deepEqual(problems, []);
  });

  let hottest;
  test('The hottest place has the hot colour of the palette on the screen', async () => {
    await settled(page);
    await page.keyboard.press('1');
    await settled(page);
    const { fusion, extremes, palette } = await state();
    assert.equal(fusion.method, 'thermal_only');
    hottest = await drawnPlaceOf(extremes.hottest.position);
    const place = await lookAt(hottest);
    assert.notEqual(place, null, 'the hottest vertex can be seen from nowhere');
    const image = await screenshot(page, 'hottest-thermal');
    assertColour(image.at(place.x, place.y), palette.colours[255].map(Math.round), 3, 'hottest vertex');
  });

  test('Visible and fused are one key away', async () => {
    await page.keyboard.press('2');
    await settled(page);
    assert.equal((await state()).fusion.method, 'visible_only');
    await page.keyboard.press('3');
    await settled(page);
    assert.equal((await state()).fusion.method, 'histogram_distribution', 'the first view shows what is unusual');
  });

  test('What has no temperature is seen as such in the thermal view, and keeps its visible colour in fused ones', async () => {
    await settled(page);
    await page.keyboard.press('f');
    await page.keyboard.press('1');
    await settled(page);
    const { fusion, scene, palette } = await state();
    assert.ok(scene.temperature.missing_count > 0);
    const wanted = [1, 3, 5].map((at) => parseInt(fusion.missing.slice(at, at + 2), 16));
    const nearest = Math.min(...palette.colours.map((colour) => Math.hypot(...colour.map((level, i) => level - wanted[i]))));
    assert.ok(nearest > 40, `${fusion.missing} is ${nearest} from the palette`);
    const image = await screenshot(page, 'unmeasured');
    let count = 0;
    for (let x = 200; x < 1100; x += 3)
      for (let y = 50; y < 850; y += 3) count += image.at(x, y).every((level, i) => level === wanted[i]) ? 1 : 0;
    assert.ok(count > 100, `${count} places are grey`);
    assert.equal(await page.locator('[data-unmeasured]').innerText(), 'no temperature');
    await page.keyboard.press('3');
    await settled(page);
    assert.equal((await state()).fusion.missing, 'visible');
    assert.equal(await page.locator('[data-unmeasured]').count(), 0);
  });

  test('A threshold handle on the axis turns the hot place from palette to visible colour', async () => {
    await page.keyboard.press('3');
    await settled(page);
    await page.locator('[data-method="colour_mapped_threshold"]').click();
    await settled(page);
    const handle = page.locator('[data-handle="params.threshold"]');
    const { scene, fusion } = await state();
    const { min, max, mean, sigma } = scene.temperature;
    const automatic = Math.min(max, mean + 1.5 * sigma);
    assert.ok(Math.abs(Number(await handle.getAttribute('aria-valuenow')) - automatic) < 0.01, 'automatic threshold');
    assert.equal(fusion.params.threshold, null);

    const place = await lookAt(hottest);
    assert.notEqual(place, null, 'the hottest vertex can be seen from nowhere');

    // Down to the coldest: everything is highlighted.
    const box = await handle.boundingBox();
    const axis = await page.locator('section.axis svg[role="group"]').boundingBox();
    await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
    await page.mouse.down();
    await page.mouse.move(box.x + box.width / 2, axis.y + axis.height * 0.8, { steps: 12 });
    await page.mouse.up();
    await settled(page);
    const low = await state();
    assert.ok(low.fusion.params.threshold < min + 0.3 * (max - min), `threshold ${low.fusion.params.threshold}`);
    assert.ok(Math.abs((await number('[data-parameter="threshold"] input[type=number]')) - low.fusion.params.threshold) < 0.051);
    assert.ok(
      Math.abs(low.histogram.highlighted[0][0] - low.fusion.params.threshold) < 0.01,
      'the axis highlights what the method does',
    );
    const says = (words) => page.locator('[data-highlight]', { hasText: words }).waitFor({ timeout: 5000 });
    await says(/% of the surface, above/);
    const hot = (await screenshot(page, 'threshold-low')).at(place.x, place.y);

    for (const [key, celsius] of [
      ['End', scene.temperature.max],
      ['Home', scene.temperature.min],
    ]) {
      await handle.press(key);
      await settled(page);
      assert.equal(Math.fround((await state()).fusion.params.threshold), Math.fround(celsius), key);
    }

    // Beyond the data the handle stays at the end of the axis, with its value and the focus, and comes back.
    await handle.press('End');
    await settled(page);
    for (const [key, isBeyond] of [
      ['Shift+ArrowUp', true],
      ['PageUp', true],
      ['ArrowDown', false],
    ]) {
      await page.keyboard.press(key);
      await settled(page);
      const { threshold } = (await state()).fusion.params;
      const [focused, said, value, lowest, highest] = await page.evaluate(() =>
        ['data-handle', 'aria-valuetext', 'aria-valuenow', 'aria-valuemin', 'aria-valuemax'].map((name) =>
          document.activeElement.getAttribute(name),
        ),
      );
      assert.equal(focused, 'params.threshold', key);
      assert.match(said, new RegExp(`^${threshold.toFixed(1)}`), key);
      assert.ok(Number(lowest) <= Number(value) && Number(value) <= Number(highest), `${value} of ${lowest} to ${highest}`);
      assert.equal(threshold > scene.temperature.max + 4, isBeyond, `${key}: ${threshold}`);
      const { top, bottom, ends } = await page.evaluate(() => {
        const [at, axis] = [document.activeElement, document.querySelector('.axis .scale')].map((one) =>
          one.getBoundingClientRect(),
        );
        return { top: at.top, bottom: at.bottom, ends: [axis.top, axis.bottom] };
      });
      assert.ok(bottom > ends[0] && top < ends[1], `${key}: the handle is out of sight`);
    }

    // By keyboard to the very top: nothing is.
    await page.locator('[data-parameter="threshold"] input[type=number]').fill(String(scene.temperature.max + 1));
    await page.keyboard.press('Enter');
    await settled(page);
    await says(/^Nothing is highlighted\. Threshold .* is above the hottest/);
    await page.locator('canvas').first().focus();
    const plain = (await screenshot(page, 'threshold-high')).at(place.x, place.y);

    await page.keyboard.press('2');
    await settled(page);
    const visible = (await screenshot(page, 'visible')).at(place.x, place.y);
    assertColour(plain, visible, 0, 'above every temperature the visible colour shows');
    const { alpha } = low.fusion.params;
    const mixed = low.palette.colours[255].map((value, channel) => alpha * value + (1 - alpha) * visible[channel]);
    assertColour(hot, mixed, 4, 'above the threshold the palette shows');
    assert.notDeepEqual(hot, plain);
    await page.keyboard.press('3');
    await settled(page);
    assert.equal(
      (await state()).fusion.params.threshold,
      scene.temperature.max + 1,
      'the fused method comes back as it was left',
    );
  });

  test('A dragged slider answers at once and its last value always arrives', async () => {
    await page.locator('[data-method="thermal_visible_blend"]').click();
    await settled(page);
    const before = await state();
    const gpuBefore = await gpuObjects(page);
    const slider = page.locator('[data-parameter="alpha"] input[type=range]');
    const box = await slider.boundingBox();
    await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
    await page.mouse.down();
    for (let i = 0; i <= 60; i += 1)
      await page.mouse.move(box.x + box.width * (0.5 + 0.35 * Math.sin(i / 5)), box.y + box.height / 2);
    await page.mouse.move(box.x + box.width * 0.9, box.y + box.height / 2);
    await page.mouse.up();
    await settled(page);
    const after = await state();
    assert.ok(Math.abs(after.fusion.params.alpha - 0.9) < 0.06, `alpha ${after.fusion.params.alpha}`);
    assert.equal(await number('[data-parameter="alpha"] input[type=number]'), after.fusion.params.alpha);
    assert.ok(after.generation > before.generation);
    assertGpuObjects(gpuBefore, await gpuObjects(page));
  });

  test('A refused value snaps back and says why', async () => {
    const field = page.locator('[data-parameter="alpha"] input[type=number]');
    const before = (await state()).fusion.params.alpha;
    await field.fill('7');
    await field.press('Enter');
    await page.locator('[data-parameter="alpha"] [role=alert]').waitFor();
    assert.equal((await state()).fusion.params.alpha, before);
    assert.equal(Number(await field.inputValue()), before);
  });

  test('Palette and range move the axis with them', async () => {
    await page.locator('[data-palette="viridis"]').click();
    await settled(page);
    const first = await state();
    assert.equal(first.fusion.range.mode, 'percentile', 'the outermost temperatures are left out at first');
    assert.ok(first.fusion.range.max < first.scene.temperature.max);
    assert.match(await page.locator('section.axis text.flag.beyond').first().textContent(), /% above/);
    await page.locator('canvas').first().focus();
    await page.keyboard.press('e');
    await settled(page);
    const extremes = await state();
    assert.equal(extremes.fusion.range.mode, 'auto', 'one key to the extremes');
    assert.equal(extremes.fusion.range.max, extremes.scene.temperature.max);
    assert.equal(await page.locator('section.axis text.flag.beyond').count(), 0);
    const { palette, fusion } = await state();
    assert.equal(palette.id, 'viridis');
    const strip = await page.locator('section.axis .strip').boundingBox();
    const image = await screenshot(page, 'viridis');
    const y = Number(await page.locator('[data-handle="range.max"] line').getAttribute('y1')) + strip.y;
    assertColour(image.at(strip.x + 7, y + 4), palette.colours[253].map(Math.round), 6, 'top of the strip');

    await page.locator('canvas').first().focus();
    await page.keyboard.press('l');
    await settled(page);
    assert.equal((await state()).fusion.range.mode, 'manual');
    const handle = await page.locator('[data-handle="range.max"]').boundingBox();
    await page.mouse.move(handle.x + 30, handle.y + 26);
    await page.mouse.down();
    await page.mouse.move(handle.x + 30, strip.y + strip.height * 0.4, { steps: 8 });
    await page.mouse.up();
    await settled(page);
    const narrowed = (await state()).fusion.range;
    assert.ok(narrowed.max < fusion.range.max - 0.2 * (fusion.range.max - fusion.range.min), `top ${narrowed.max}`);
    await page.locator('canvas').first().focus();
    await page.keyboard.press('l');
    await settled(page);
    assert.deepEqual((await state()).fusion.range, fusion.range);
    await page.keyboard.press('e');
    await settled(page);
    assert.deepEqual((await state()).fusion.range, first.fusion.range, 'and back');
  });

  test('The background has exactly the colour that was chosen', async () => {
    await page.evaluate(() => {
      globalThis.firstSession = globalThis.spectra;
    });
    await page.evaluate(() => globalThis.spectra.setView({ eye: [0, 1e4, 0], target: [0, 2e4, 1] }));
    for (const colour of ['#6b6d70', '#1c1d1f']) {
      await page.locator(`[aria-label="Background ${colour}"]`).click();
      await drawn(page);
      const image = await screenshot(page, 'background');
      const expected = [1, 3, 5].map((at) => Number.parseInt(colour.slice(at, at + 2), 16));
      assert.deepEqual(image.at(700, 500), expected);
    }
    assert.equal(await page.evaluate(() => globalThis.spectra === globalThis.firstSession), true, 'the same session goes on');
    await page.locator('canvas').first().focus();
    await page.keyboard.press('r');
  });

  test('A click reads the temperature', async () => {
    await settled(page);
    const place = await page.evaluate(async () => {
      const { viewport } = globalThis.spectra;
      for (let y = 300; y < 700; y += 20) {
        for (let x = 300; x < 1000; x += 20) if ((await viewport.pick(x, y)) !== null) return { x, y };
      }
      return null;
    });
    // Under the pointer the value stands beside what is read, and goes where the card says the same.
    await page.mouse.move(place.x, place.y, { steps: 3 });
    const label = page.locator('.hover');
    await label.waitFor();
    const box = await label.boundingBox();
    const away = [box.x - place.x, place.x - box.x - box.width, box.y - place.y, place.y - box.y - box.height];
    assert.ok(Math.max(...away) >= 8, `the label ${JSON.stringify(box)} lies on ${JSON.stringify(place)}`);
    await page.mouse.click(place.x, place.y);
    const card = page.locator('.card');
    await card.waitFor();
    assert.match(await card.innerText(), /°C|no temperature/);
    await label.waitFor({ state: 'detached' });
    // Nothing of the picture shows through, and no label lies over it.
    const look = await card.evaluate((element) => {
      const { backgroundColor, zIndex } = getComputedStyle(element);
      const labels = [...document.querySelectorAll('[data-mark], [data-mark] + .label')].map((other) =>
        Number(getComputedStyle(other).zIndex),
      );
      return { backgroundColor, isAbove: labels.every((other) => other < Number(zIndex)) };
    });
    assert.match(look.backgroundColor, /^rgb\(/, 'opaque');
    assert.ok(look.isAbove);
    await card.getByRole('button').press('Enter');
    await card.waitFor({ state: 'detached' });
    assert.equal(await page.evaluate(() => document.activeElement.tagName), 'CANVAS', 'where the keys are');
    await page.mouse.click(place.x, place.y);
    await card.waitFor();
    await page.keyboard.press('Escape');
    await card.waitFor({ state: 'detached' });
  });

  test('The axis leads to the hottest and to the coldest place, from where they are seen', async () => {
    await settled(page);
    const { extremes, scene: served } = await state();
    const { origin } = served;
    const file = join(scratch, 'served.ply');
    writeFileSync(file, Buffer.from(await (await fetch(`${server.url}api/v1/scene.ply`)).arrayBuffer()));
    const scene = readPly(file);
    const step_m = (await page.evaluate(() => globalThis.spectra.store.quality.position_step_mm)) / 1000;
    for (const kind of ['hottest', 'coldest']) {
      await page.getByRole('button', { name: `Go to the ${kind} place` }).click();
      await page.waitForFunction(
        ([x, y, z]) => {
          const { eye, target } = globalThis.spectra.viewport.pose;
          return Math.hypot(target[0] - x, target[1] - y, target[2] - z) < 1e-3 * Math.hypot(eye[0] - x, eye[1] - y, eye[2] - z);
        },
        extremes[kind].position,
        { timeout: 30_000 },
      );
      await settled(page);
      const seen = await page.evaluate(async (position) => {
        const { viewport } = globalThis.spectra;
        const place = viewport.project(position);
        const hit = await viewport.pick(place.x, place.y);
        return { place, away: hit === null ? null : Math.hypot(...hit.map((value, axis) => value - position[axis])) };
      }, extremes[kind].position);
      assert.ok(
        seen.away !== null && seen.away < Math.min(0.01, 4 * step_m + 0.002),
        `${kind}: what is seen there is ${seen.away} m away`,
      );
      const mark = page.locator(`[data-mark="${kind}"][data-of="scene"]`);
      await page.waitForFunction(
        (of) => document.querySelector(`[data-mark="${of}"][data-of="scene"]:not(.hidden)`) !== null,
        kind,
      );
      assert.match(await mark.getAttribute('aria-label'), /^(hottest|coldest) [−\d.]+\s°C$/);
      // The other one is nowhere here: what is on the screen has its own, and it is what is read there.
      const other = kind === 'hottest' ? 'coldest' : 'hottest';
      await page.locator(`[data-mark="${other}"][data-of="view"]`).waitFor();
      const mark_in_view = await page.evaluate((of) => {
        const { kind, temperature, x, y } = globalThis.spectra.store.marks.find((one) => one.kind === of && one.of === 'view');
        return { kind, temperature, x, y };
      }, other);
      const marked = mark_in_view.temperature;
      // It stands on a vertex of that temperature, which is what is seen there.
      const places = scene.temperature.reduce(
        (all, t, v) => (t === marked ? [...all, [scene.x[v], scene.y[v], scene.z[v]].map((c, axis) => c - origin[axis])] : all),
        [],
      );
      const nearest = await page.evaluate(
        async ({ places, x, y }) => {
          const { viewport } = globalThis.spectra;
          // On the very edge of something a pixel further there is another thing.
          const hits = [];
          for (let i = 0; i < 49; i += 1) hits.push(await viewport.pick(x + (i % 7) - 3, y + Math.floor(i / 7) - 3));
          const found = places.map((place) => {
            const at = viewport.project(place);
            const away = (hit) => Math.hypot(...hit.map((value, axis) => value - place[axis]));
            return {
              off_px: at === null ? Infinity : Math.hypot(at.x - x, at.y - y),
              away_m: Math.min(...hits.filter((hit) => hit !== null).map(away)),
            };
          });
          return found.reduce((a, b) => (b.off_px < a.off_px ? b : a));
        },
        { places, ...mark_in_view },
      );
      assert.ok(
        nearest.off_px < 1 && nearest.away_m < Math.min(0.01, 4 * step_m + 0.002),
        `the ${other} in view, ${marked}: ${JSON.stringify(nearest)}`,
      );
      const { temperature } = extremes[other];
      assert.ok(other === 'coldest' ? marked > temperature : marked < temperature);
      await screenshot(page, `fly-${kind}`);
    }
    await page.locator('canvas').first().focus();
    await page.keyboard.press('r');
    await drawn(page);
  });

  test('S saves a picture', async () => {
    const [download] = await Promise.all([page.waitForEvent('download'), page.keyboard.press('s')]);
    assert.match(download.suggestedFilename(), /^spectra-.*\.png$/);
    const image = decodePng(readFileSync(await download.path()));
    assert.equal(image.width, 1440);
  });

  test('Coarser quality is in force and said in words', async () => {
    await page.locator('#accuracy').fill('2');
    await settled(page);
    await page.waitForFunction(() => globalThis.spectra.store.stats?.accuracy.colour_levels === 64, null, { timeout: 20_000 });
    const { quality, shown, scene } = await state();
    assert.equal(quality.colour_bits, 6);
    const words = page.getByText('On the screen:');
    assert.match(await words.innerText(), /, 2\slevels/);
    await settled(page);
    assert.equal(shown.triangles > 0.9 * scene.triangle_count, true);
    // Coarser still: what is there stays, the next change is answered with less.
    await page.locator('#accuracy').fill('0');
    await settled(page);
    assert.equal((await state()).shown.triangles, shown.triangles);
    await page.locator('[data-method="intensity_hue"]').click();
    await settled(page);
    const coarse = await state();
    assert.deepEqual([coarse.quality.colour_bits, coarse.quality.pixel_error], [6, 16]);
    assert.ok(coarse.shown.triangles < shown.triangles, `${coarse.shown.triangles} of ${shown.triangles} triangles`);
    await page.locator('#accuracy').fill('4');
    await settled(page);
    assert.equal((await state()).shown.triangles, shown.triangles);
  });

  test('Automatic quality and its latency target are set in the panel', async () => {
    await page.getByText('Details', { exact: true }).click();
    await page.getByText('Coarser at first').click();
    await page.waitForFunction(() => globalThis.spectra.store.quality.mode === 'auto');
    await page.locator('#latency-target').fill('50');
    await page.locator('#colour-bits').fill('7');
    await settled(page);
    const { quality } = await state();
    assert.deepEqual([quality.mode, quality.latency_target_ms, quality.colour_bits], ['auto', 50, 7]);
    await page.locator('#colour-bits').fill('8');
    await page.getByText('Coarser at first').click();
    await page.waitForFunction(() => globalThis.spectra.store.quality.mode === 'manual');
    await page.getByText('Details', { exact: true }).click();
    await settled(page);
  });

  test('It reconnects by itself and keeps its settings', async () => {
    await page.locator('[data-method="thermal_highlighting"]').click();
    await settled(page);
    await page.locator('[data-parameter="k"] input[type=number]').fill('2.5');
    await page.keyboard.press('Enter');
    await settled(page);
    const before = await state();
    await server.stop();
    await page.getByText('Reconnecting').waitFor();
    assert.equal(await page.locator('.stale').count(), 1);
    await page.waitForTimeout(1200);
    // The picture keeps its colours; what is known of it, and of who looks at it, is not.
    assert.equal(await page.locator('canvas').evaluate((canvas) => getComputedStyle(canvas).filter), 'none');
    assert.doesNotMatch(await page.locator('main').innerText(), /\d viewer|within .* mm|colours exact/);
    await page.locator('[data-method="intensity_hue"]').click();
    assert.match(await page.locator('[data-waiting]').innerText(), /Waits to be sent: Intensity-hue/);
    assert.match(await signBeside('intensity_hue'), /not yet in the picture/);
    await page.locator('[data-method="thermal_highlighting"]').click();
    await page.locator('[data-parameter="k"] input[type=number]').fill('2.5');
    await page.keyboard.press('Enter');
    await screenshot(page, 'reconnecting');
    assert.match(await page.locator('footer').innerText(), /not connected, \d+\su?s? ?old|not connected/);
    server = await startServer(['--demo'], server.port);
    await page.waitForFunction(() => globalThis.spectra.store.connected, null, { timeout: 20_000 });
    await settled(page);
    const after = await state();
    assert.deepEqual(after.fusion, before.fusion);
    assert.equal(after.shown.triangles, after.scene.triangle_count);
    assert.equal(await page.locator('.stale').count(), 0);
  });

  test('A page in a narrow window has axis and sheet beside each other', async () => {
    const { page: phone, problems: phoneProblems } = await openClient(browser, server.url, { width: 390, height: 844 });
    await settled(phone);
    await screenshot(phone, 'narrow');
    const axis = await phone.locator('section.axis').boundingBox();
    for (const other of ['aside.panel', 'footer']) {
      const box = await phone.locator(other).boundingBox();
      assert.ok(box.y >= axis.y + axis.height - 1, `${other} overlaps the axis`);
    }
    assert.ok(axis.height > 250, `axis of ${axis.height} px`);
    assert.deepEqual(phoneProblems, []);
    await phone.close();
  });

  test('A scene without thermal data says so and shows the visible colours', async () => {
    const file = join(scratch, 'visible.ply');
    writeFileSync(
      file,
      'ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\nproperty uchar green\n' +
        'property uchar blue\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n' +
        '0 0 0 40 90 200\n1 0 0 40 90 200\n1 1 0 40 90 200\n0 1 0 40 90 200\n3 0 1 2\n3 0 2 3\n',
    );
    const other = await startServer([file]);
    const { page: tab, problems: tabProblems } = await openClient(browser, other.url);
    await settled(tab);
    const image = await screenshot(tab, 'no-thermal');
    const place = await tab.evaluate(() => globalThis.spectra.viewport.project([0.5, 0.5, 0]));
    assert.deepEqual(image.at(place.x, place.y), [40, 90, 200]);
    assert.equal(await tab.locator('section.axis').count(), 0);
    assert.ok(await tab.getByRole('radio', { name: 'Thermal' }).isDisabled());
    const notice = tab.locator('[data-no-thermal]');
    assert.match(await notice.innerText(), /no thermal data/);
    await notice.getByRole('button', { name: 'Close this note' }).click();
    await notice.waitFor({ state: 'detached' });
    assert.match(await tab.locator('footer').innerText(), /no thermal data/);
    assert.deepEqual(tabProblems, []);
    await tab.close();
    await other.stop();
  });

  test('Nothing broke the content policy', () => {
    // While the server was away the browser could not connect; that alone may be complained about.
    assert.deepEqual(
      problems.filter((text) => !/ERR_CONNECTION_REFUSED|WebSocket connection/.test(text)),
      [],
    );
  });
  return () => server.stop();
}
