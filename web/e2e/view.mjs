// What the viewport shows of scenes as people have them: near and far, strays, which way is up, notes, and a GPU that is taken away.
import assert from 'node:assert/strict';
import { writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { demoServer, drawn, openClient, screenshot, settled, startServer, test } from './harness.mjs';
import { startLink } from './link.mjs';

/** A PLY file of vertices [x, y, z, red, green, blue] and triangles. */
function writePly(file, vertices, triangles) {
  const header =
    `ply\nformat ascii 1.0\nelement vertex ${vertices.length}\nproperty double x\nproperty double y\nproperty double z\n` +
    `property uchar red\nproperty uchar green\nproperty uchar blue\nelement face ${triangles.length}\n` +
    'property list uchar int vertex_indices\nend_header\n';
  writeFileSync(
    file,
    `${header}${vertices.map((vertex) => vertex.join(' ')).join('\n')}\n${triangles.map((face) => `3 ${face.join(' ')}`).join('\n')}\n`,
  );
}

/** Adds a grid of `cells` by `cells` squares; `at` gives place and colour for two numbers of 0 to 1. */
function addGrid({ vertices, triangles }, cells, at) {
  const first = vertices.length;
  for (let i = 0; i <= cells; i += 1) for (let j = 0; j <= cells; j += 1) vertices.push(at(i / cells, j / cells));
  for (let i = 0; i < cells; i += 1) {
    for (let j = 0; j < cells; j += 1) {
      const corner = first + i * (cells + 1) + j;
      triangles.push([corner, corner + 1, corner + cells + 1], [corner + 1, corner + cells + 2, corner + cells + 1]);
    }
  }
}

const LABEL_M = 0.05;
const LABEL_AT = [12.5, -7.25, 1.5];
/** The label's squares, one black, one white. */
const isBlack = (u, v) => (Math.floor(u * 5) + Math.floor(v * 5)) % 2 === 0;
const onLabel = (u, v) => [LABEL_AT[0], LABEL_AT[1] + (u - 0.5) * LABEL_M, LABEL_AT[2] + (v - 0.5) * LABEL_M];

/** A map of 4 km with a label of 5 cm on a board, and behind it, 1.5 km away, a red sheet two metres before a blue one. */
function writeMap(file) {
  const mesh = { vertices: [], triangles: [] };
  addGrid(mesh, 40, (u, v) => [u * 4000 - 2000, v * 4000 - 2000, 0, 110, 120, 100]);
  for (const [x, ...colour] of [
    [1500, 200, 30, 30],
    [1502, 30, 30, 200],
  ]) {
    addGrid(mesh, 10, (u, v) => [x, (u - 0.5) * 1200, v * 900, ...colour]);
  }
  addGrid(mesh, 20, (u, v) => [LABEL_AT[0] + 0.003, LABEL_AT[1] + (u - 0.5) * 0.06, LABEL_AT[2] + (v - 0.5) * 0.06, 40, 160, 60]);
  // Of very many small triangles, so that they set the lattice of the scene.
  addGrid(mesh, 80, (u, v) => [
    ...onLabel(u, v),
    ...(isBlack(Math.min(u, 0.999), Math.min(v, 0.999)) ? [15, 15, 15] : [240, 240, 240]),
  ]);
  writePly(file, mesh.vertices, mesh.triangles);
}

const frames = (page, count) =>
  page.evaluate(async (wanted) => {
    for (let i = 0; i < wanted; i += 1) await new Promise((resolve) => requestAnimationFrame(resolve));
  }, count);

/** Turns the wheel over a point of the scene until the camera is as near to it as asked for, or comes no nearer. */
async function wheelTo(page, point, distance_m) {
  for (let i = 0; i < 400; i += 1) {
    const place = await page.evaluate((at) => globalThis.spectra.viewport.project(at), point);
    assert.ok(place !== null, 'the point has gone behind the camera');
    if (place.depth < distance_m) return place;
    await page.mouse.move(place.x, place.y);
    await page.mouse.wheel(0, -240);
    await frames(page, 4);
    // The page knows what is under the pointer before the wheel turns on: questions are answered in turn.
    await page.evaluate(({ x, y }) => globalThis.spectra.viewport.pick(x, y), place);
  }
  return null;
}

export function addViewTests(browser, scratch) {
  test('A label of 5 cm in a map of 4 km can be gone to with the wheel and read', async () => {
    const file = join(scratch, 'map.ply');
    writeMap(file);
    const server = await startServer([file]);
    const { page, problems } = await openClient(browser, server.url, { width: 900, height: 640 });
    await settled(page);
    await page.evaluate(() => {
      globalThis.spectra.store.panelsHidden = true;
      globalThis.spectra.setView({ eye: [-1400, -300, 500], target: [12.5, -7.25, 1.5] });
    });
    await drawn(page);
    // Relative to the scene's origin, as the page has it.
    const { origin } = await page.evaluate(() => globalThis.spectra.store.scene);
    const local = (point) => point.map((value, axis) => value - origin[axis]);
    const centre = local(LABEL_AT);
    assert.ok(await wheelTo(page, centre, 0.5), 'the wheel does not come near the label');
    await page.evaluate(([x, y, z]) => globalThis.spectra.setView({ eye: [x - 0.2, y, z], target: [x, y, z] }), centre);
    await settled(page);
    const image = await screenshot(page, 'label-in-a-map');
    const at = async (point) => {
      const { x, y } = await page.evaluate((wanted) => globalThis.spectra.viewport.project(wanted), local(point));
      return image.at(x, y);
    };
    for (let i = 0; i < 5; i += 1) {
      for (let j = 0; j < 5; j += 1) {
        const [u, v] = [(i + 0.5) / 5, (j + 0.5) / 5];
        const [level] = await at(onLabel(u, v));
        assert.ok(isBlack(u, v) ? level < 60 : level > 195, `square ${i}, ${j} of the label has level ${level}`);
      }
    }
    const [red, , blue] = await at([1500, 250, 300]);
    assert.ok(red > 150 && blue < 80, `the sheet two metres before another one, 1.5 km away, is (${red}, ${blue})`);
    assert.deepEqual(problems, []);
    await page.close();
    await server.stop();
  });

  test('Stray points do not push the scene away, and one can go near them', async () => {
    const file = join(scratch, 'strays.ply');
    const mesh = { vertices: [], triangles: [] };
    addGrid(mesh, 40, (u, v) => [u * 3, v * 3, 0.2 * Math.sin(u * 9), 200, 180, 60]);
    const stray = [2500, 1200, 300];
    writePly(file, [...mesh.vertices, [...stray, 255, 0, 0]], []);
    const server = await startServer([file]);
    const { page, problems } = await openClient(browser, server.url, { width: 900, height: 640 });
    await settled(page);
    const width = () =>
      page.evaluate(() => {
        const { viewport, store } = globalThis.spectra;
        const places = [0, 3].flatMap((x) =>
          [0, 3].map((y) => viewport.project([x - store.scene.origin[0], y - store.scene.origin[1], 0])),
        );
        const across = places.map(({ x }) => x);
        return Math.max(...across) - Math.min(...across);
      });
    assert.ok((await width()) > 250, `the scene is ${await width()} px wide at first`);
    await page.evaluate(() => {
      globalThis.spectra.store.panelsHidden = true;
      globalThis.spectra.setView({ eye: [-3000, -3000, 2000], target: [0, 0, 0] });
    });
    await page.evaluate(() => globalThis.spectra.fitView('fit'));
    await frames(page, 30);
    assert.ok((await width()) > 300, `the scene is ${await width()} px wide after F`);
    // Far away and looking at the stray: the wheel goes to it.
    const { origin } = await page.evaluate(() => globalThis.spectra.store.scene);
    const place = stray.map((value, axis) => value - origin[axis]);
    await page.evaluate(
      ([x, y, z]) => globalThis.spectra.setView({ eye: [x - 900, y - 900, z + 400], target: [x + 30, y, z] }),
      place,
    );
    await drawn(page);
    assert.ok(await wheelTo(page, place, 0.5), 'the wheel does not come near the stray');
    assert.deepEqual(problems, []);
    await page.close();
    await server.stop();
  });

  test('Which way is up is remembered for a scene, and its size is said', async () => {
    const server = await demoServer();
    const { page } = await openClient(browser, server.url);
    await settled(page);
    const up = () => page.evaluate(() => [globalThis.spectra.store.upAxis, globalThis.spectra.viewport.pose.up]);
    const { scene } = await page.evaluate(() => ({ scene: globalThis.spectra.store.scene }));
    assert.equal((await up())[0], scene.up);
    assert.match(await page.locator('[data-status="size"]').innerText(), /^[\d.]+ × [\d.]+ × [\d.]+\sm$/);
    await page.getByRole('radio', { name: '−X' }).click();
    await page.reload();
    await settled(page);
    assert.deepEqual(await up(), ['-x', [-1, 0, 0]]);
    await page.getByRole('radio', { name: scene.up.toUpperCase().replace('-', '−'), exact: true }).click();
    assert.equal((await up())[0], scene.up);
    await page.close();
  });

  test('Notes are shown, closed one by one and read again', async () => {
    const server = await demoServer();
    const { page } = await openClient(browser, server.url);
    await settled(page);
    await page.evaluate(() => {
      const { store } = globalThis.spectra;
      const notes = [
        { id: 'stray_points', count: 2, message: '2 stray vertices lie far from everything else.' },
        { id: 'kelvin', count: 1, message: 'The temperatures look like kelvin; --temperature-unit kelvin reads them so.' },
      ];
      store.scene = { ...store.scene, notes };
    });
    const notice = page.locator('[data-notice]');
    assert.match(await notice.innerText(), /2 stray vertices/);
    assert.match(await page.locator('[data-status="strays"]').innerText(), /2\s*strays/);
    await notice.getByRole('button', { name: 'Close this note' }).click();
    assert.match(await notice.innerText(), /kelvin/);
    await notice.getByRole('button', { name: 'Close this note' }).click();
    assert.equal(await notice.count(), 0);
    await page.getByRole('button', { name: '2 notes' }).click();
    const all = page.getByRole('region', { name: 'Notes' });
    assert.match(await all.innerText(), /2 stray vertices[^]*kelvin/);
    await screenshot(page, 'notes');
    await all.getByRole('button', { name: 'Close the notes' }).click();
    assert.equal(await all.count(), 0);
    await page.close();
  });

  test('Odd scenes and a tiny window show a clear state each', async () => {
    const header = (vertices, faces) =>
      `ply\nformat ascii 1.0\nelement vertex ${vertices}\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n` +
      `property uchar green\nproperty uchar blue\nproperty float temperature\nelement face ${faces}\n` +
      'property list uchar int vertex_indices\nend_header\n';
    const sheet = (temperatures) =>
      `${header(4, 2)}${temperatures.map((t, i) => `${i % 2} ${i >> 1} 0 200 180 140 ${t}`).join('\n')}\n3 0 1 2\n3 1 3 2\n`;
    const scenes = {
      'one temperature': { text: sheet([21.5, 21.5, 21.5, 21.5]), says: /low 21\.5.*high 21\.5/, axis: /all 21\.5/ },
      'a hundredth of a degree': {
        text: sheet([20, 20.004, 20.006, 20.01]),
        says: /low 20\.000.*high 20\.010/,
        axis: /hottest 20\.010/,
        threshold: /^20\.0\d\d$/,
      },
      'all missing': { text: sheet(['nan', 'nan', 'nan', 'nan']), says: /no thermal data/, views: ['visible', 'visible'] },
      'all over range': { text: sheet(['inf', 'inf', 'inf', 'inf']), says: /4 over range/, views: ['thermal', 'fused'] },
      'fill values': { text: sheet([20, '1e36', 'inf', 25]), says: /low 20\.0.*high 1e36/, axis: /hottest 1e36.*1 over/ },
      'some missing': { text: sheet([20, 'nan', 30, 'nan']), says: /low 20\.0.*high 30\.0/, axis: /hottest 30\.0/, isGrey: true },
      'one vertex': { text: `${header(1, 0)}1 2 3 200 180 140 25\n`, says: /1 of 1 vertices/, axis: /all 25\.0/ },
      'two vertices': {
        text: `${header(2, 0)}1 2 3 200 180 140 25\n2 2 3 20 180 140 30\n`,
        says: /2 of 2 vertices/,
        axis: /coldest 25\.0/,
      },
    };
    const context = await browser.newContext({ viewport: { width: 1440, height: 720 } });
    for (const [name, { text, says, axis, isGrey, threshold, views }] of Object.entries(scenes)) {
      const file = join(scratch, 'odd.ply');
      writeFileSync(file, text);
      const server = await startServer([file]);
      const { page, problems } = await openClient(context, server.url, null);
      await settled(page);
      const look = async (where) => {
        const html = await page.locator('main').evaluate((main) => main.outerHTML);
        assert.doesNotMatch(html, /NaN|undefined|Infinity|∞|\[object/, `${name} ${where}`);
        assert.deepEqual(problems, [], `${name} ${where}`);
        const cut = await page.evaluate(() =>
          [...document.querySelectorAll('.axis svg text')]
            .filter((text) => {
              const [box, edge] = [text, text.ownerSVGElement].map((element) => element.getBoundingClientRect());
              const isBeside = box.left < edge.left - 0.5 || box.right > edge.right + 0.5;
              return isBeside || box.top < edge.top - 0.5 || box.bottom > edge.bottom + 0.5;
            })
            .map(({ textContent }) => textContent),
        );
        assert.deepEqual(cut, [], `${name} ${where}: cut by the axis`);
      };
      assert.match((await page.locator('footer').innerText()).replaceAll(/\s+/g, ' '), says, name);
      if (axis === undefined) assert.equal(await page.locator('.axis').count(), 0, name);
      else assert.match((await page.locator('.axis').innerText()).replaceAll(/\s+/g, ' '), axis, name);
      await look('as it opens');
      // Keys do what the panel offers, and no more.
      for (const [i, key] of views === undefined ? [] : ['1', '3'].entries()) {
        await page.locator('canvas').press(key);
        await settled(page);
        const { method, checked } = await page.evaluate(() => ({
          method: globalThis.spectra.store.fusionInForce.method,
          checked: document.querySelector('[data-view]:has(:checked:enabled)').dataset.view,
        }));
        const shown = { thermal_only: 'thermal', visible_only: 'visible' }[method] ?? 'fused';
        assert.deepEqual([shown, checked], [views[i], views[i]], `${name}, ${key}`);
        await look(`after ${key}`);
      }
      if (axis !== undefined) {
        // Every method, every view, and the ways there.
        for (const key of ['1', '2', '3', 'f', 'e', 'l', 'p', 'r']) {
          await page.locator('canvas').press(key);
          await settled(page);
          if (key === '1' && isGrey) {
            assert.match(await page.locator('[data-unmeasured]').innerText(), /no temperature/);
            const place = await page.evaluate(() => globalThis.spectra.viewport.project([0.98, 0.5, 0]));
            const [red, green, blue] = (await screenshot(page, 'unmeasured')).at(place.x, place.y);
            assert.ok(Math.max(red, green, blue) - Math.min(red, green, blue) < 9, `${red} ${green} ${blue} is no grey`);
          }
        }
        for (const method of isGrey ? [] : await page.evaluate(() => globalThis.spectra.store.methods.map(({ id }) => id))) {
          await page.evaluate((id) => globalThis.spectra.settings.setMethod(id), method);
          await settled(page);
          await look(method);
        }
      }
      if (threshold !== undefined) {
        await page.evaluate(() => globalThis.spectra.settings.setMethod('colour_mapped_threshold'));
        await settled(page);
        assert.match(await page.locator('[data-parameter="threshold"] input[type=number]').inputValue(), threshold);
      }
      await page.setViewportSize({ width: 200, height: 150 });
      await page.getByText('The controls need a larger window.').waitFor();
      await page.waitForFunction(() => globalThis.spectra.viewport.size[0] === 200);
      await drawn(page);
      assert.equal(await page.locator('.axis, .panel, [aria-label="Orientation"]').count(), 0);
      for (const part of ['footer', 'p.tiny']) {
        const box = await page.locator(part).boundingBox();
        assert.ok(box.x >= 0 && box.x + box.width <= 200 && box.y + box.height <= 150, `${part}: ${JSON.stringify(box)}`);
      }
      await page.locator('footer').getByText('up to date', { exact: true }).waitFor({ timeout: 10_000 });
      assert.equal((await page.locator('footer').innerText()).trim(), 'up to date');
      await look('in a tiny window');
      if (name === 'two vertices') {
        // What a banner says there is room for: its heading, whole and over nothing.
        await page.evaluate(() => {
          const { store, tiles } = globalThis.spectra;
          tiles.drawnGenerations = () => [null];
          Object.assign(store, { pictureMethod: 'visible_only', behindSince: performance.now() - 3000 });
        });
        const heading = page.locator('[data-pending-method] strong');
        await heading.waitFor();
        const box = await page.locator('[data-pending-method]').boundingBox();
        assert.ok(box.x >= 0 && box.x + box.width <= 200 && box.y >= 0 && box.y + box.height <= 120, JSON.stringify(box));
        assert.match(await heading.innerText(), /not yet in the picture/);
        await screenshot(page, 'tiny-pending');
        await page.evaluate(() => (globalThis.spectra.store.behindSince = null));
      }
      await page.setViewportSize({ width: 1440, height: 720 });
      await page.locator('.panel').waitFor();
      await page.close();
      await server.stop();
    }
    await context.close();
  });

  test('A lost graphics context is said, counted, and restored with everything', async () => {
    const server = await demoServer();
    const { page } = await openClient(browser, server.url);
    await settled(page);
    await page.evaluate(() => globalThis.spectra.setBackground('#6b6d70'));
    await drawn(page);
    const before = await screenshot(page, 'context-before');
    const worker = page.workers().find((one) => one.url().includes('render_worker'));
    assert.ok(worker, 'the picture is drawn in a worker');
    await worker.evaluate(() => {
      self.losing = self.spectra.context.getExtension('WEBGL_lose_context');
      self.losing.loseContext();
    });
    await page.getByText('Graphics restarting', { exact: true }).waitFor();
    assert.match(await page.locator('footer').innerText(), /graphics restarting, \d+\s*s/);
    assert.equal(await page.locator('canvas.dead').evaluate((canvas) => getComputedStyle(canvas).visibility), 'hidden');
    // What comes while there is no picture is in it afterwards.
    await page.evaluate(() => globalThis.spectra.settings.setViewMode('visible'));
    await settled(page);
    await page.evaluate(() => globalThis.spectra.settings.setViewMode('fused'));
    await settled(page);
    await screenshot(page, 'context-lost');
    await page.evaluate(() => {
      globalThis.spectra.store.graphicsLostAt -= 60_000;
    });
    await page.getByText('The graphics do not come back').waitFor();
    // A picture that cannot be saved says why, and does so without a link, too.
    await page.keyboard.press('s');
    await page.getByText('Nothing was saved. There is no picture while the graphics restart.').waitFor();
    await page.locator('[data-failure]').getByRole('button', { name: 'Close' }).click();
    await page.evaluate(() => {
      globalThis.link = globalThis.spectra.store.link;
      globalThis.spectra.store.link = { phase: 'waiting', attempt: 1, retry_at: performance.now() + 60_000 };
    });
    await page.keyboard.press('s');
    await page.getByText('Nothing was saved. There is no picture while the graphics restart.').waitFor();
    await page.locator('[data-failure]').getByRole('button', { name: 'Close' }).click();
    await page.evaluate(() => {
      globalThis.spectra.store.link = globalThis.link;
    });
    assert.equal(await page.getByRole('button', { name: 'Load the page again' }).count(), 1);
    await worker.evaluate(() => self.losing.restoreContext());
    await page.waitForFunction(() => globalThis.spectra.store.graphicsLostAt === null);
    await drawn(page);
    // The browser shows a worker's picture when it gets to it: a page under load a little later.
    let after = await screenshot(page, 'context-restored');
    for (let i = 0; i < 20 && after.at(200, 60).join() !== before.at(200, 60).join(); i += 1) {
      await page.waitForTimeout(100);
      after = await screenshot(page, 'context-restored');
    }
    for (let x = 200; x < 1100; x += 25) {
      for (let y = 60; y < 840; y += 25) assert.deepEqual(after.at(x, y), before.at(x, y), `pixel ${x}, ${y}`);
    }
    await page.close();
  });

  test('A threshold goes along to the other method, also beyond the data, and the scale and the palette say what they show', async () => {
    const link = await startLink((await demoServer()).port);
    const { page } = await openClient(browser, link.url);
    await settled(page);
    const { max } = await page.evaluate(() => globalThis.spectra.store.scene.temperature);
    await page.locator('[data-method="monochrome_threshold"]').click();
    await settled(page);
    const field = page.locator('[data-parameter="threshold"] input[type=number]');
    await field.fill('31.5');
    await field.press('Enter');
    await settled(page);
    await page.locator('[data-method="colour_mapped_threshold"]').click();
    await settled(page);
    assert.equal(await field.inputValue(), '31.5');
    assert.match(await page.locator('.axis').innerText(), /colours before blending/);
    await page.locator('[data-parameter="alpha"] input[type=number]').fill('1');
    await page.keyboard.press('Enter');
    await settled(page);
    assert.doesNotMatch(await page.locator('.axis').innerText(), /blending/, 'an opacity of 1 mixes nothing');
    assert.match(await page.locator('[data-fares]').innerText(), /^With all colours: .+\nRed-green blind: .+\nIn grey: .+$/);
    await field.fill('99');
    await field.press('Enter');
    await settled(page);
    const inForce = await page.evaluate(() => globalThis.spectra.store.fusionInForce.params_in_force.threshold);
    assert.equal(inForce, 99);
    assert.match(
      await page.locator('[data-highlight]').innerText(),
      new RegExp(`^Nothing is highlighted\\. .*99\\.0.*above the hottest, ${max.toFixed(1)}`),
    );
    await page.evaluate(() => globalThis.spectra.settings.setViewMode('thermal'));
    await settled(page);
    assert.doesNotMatch(await page.locator('.axis').innerText(), /blending/);

    // A wish that is not in force yet is marked at its control.
    await page.evaluate(() => globalThis.spectra.settings.setMethod('colour_mapped_threshold'));
    await settled(page);
    await link.stop();
    await page.getByText('Reconnecting', { exact: true }).waitFor();
    await field.fill('25');
    await field.press('Enter');
    await page.locator('[data-parameter="threshold"] .waits').waitFor();
    assert.equal(await page.locator('.waits').count(), 1);
    await screenshot(page, 'pending-control');
    await page.close();
  });

  test('The person is outlined where colours alone do not show it to everybody, and nothing is where that is off', async () => {
    const server = await demoServer();
    const { page, problems } = await openClient(browser, server.url);
    await settled(page);
    const state = () =>
      page.evaluate(() => {
        const { quality, isOutlined, highlightContrast } = globalThis.spectra.store;
        return { marks: quality.marks, isOutlined, contrast: highlightContrast };
      });
    const picture = async (name) => {
      await settled(page);
      // Marks of the hottest and the coldest place are drawn on the picture and may come a moment later.
      await page.evaluate(() => (globalThis.spectra.store.marksShown = false));
      return screenshot(page, name);
    };
    const choose = (wish) => page.locator(`[data-outline="${wish}"]`).click();
    /** Pixels of the square about the person's head that are another in `one` than in `other`, by whether they are light or dark there. */
    const head = await page.evaluate(() => globalThis.spectra.viewport.project([0.3, 0.25, 1.2]));
    const lines = (one, other) => {
      const found = { light: 0, dark: 0 };
      for (let x = Math.round(head.x) - 60; x < head.x + 60; x += 1) {
        for (let y = Math.round(head.y) - 60; y < head.y + 60; y += 1) {
          const [pixel, before] = [one.at(x, y), other.at(x, y)];
          if (Math.max(...pixel.map((value, channel) => Math.abs(value - before[channel]))) < 40) continue;
          if (Math.min(...pixel) > 180) found.light += 1;
          else if (Math.max(...pixel) < 75) found.dark += 1;
        }
      }
      return found;
    };

    // Automatic: in grey the demo scene's warm places are as light as others.
    const automatic = await state();
    assert.equal(automatic.marks, true);
    assert.ok(automatic.contrast.in_grey < 10, JSON.stringify(automatic));
    assert.equal(automatic.isOutlined, true);
    assert.match(
      await page.locator('[data-outline-note]').innerText(),
      /^Outlined: .*in grey, many highlights look like the rest/,
    );
    const outlined = await picture('outline-automatic');

    await choose('off');
    const plain = await picture('outline-off');
    assert.equal((await state()).marks, false);
    assert.equal(await page.locator('[data-outline-note]').count(), 0);
    const found = lines(outlined, plain);
    assert.ok(
      found.light > 60 && found.dark > 60,
      `the outline of the head has ${found.light} light and ${found.dark} dark pixels`,
    );
    await choose('on');
    const again = await picture('outline-on');
    assert.deepEqual(lines(again, outlined), { light: 0, dark: 0 }, 'on is what automatic has drawn');

    // Nothing highlighted: nothing outlined, whatever is asked for.
    const field = page.locator('[data-parameter="threshold"] input[type=number]');
    await page.locator('[data-method="colour_mapped_threshold"]').click();
    await settled(page);
    await field.fill('99');
    await field.press('Enter');
    const nothing = await picture('outline-nothing');
    await page.locator('canvas').first().focus();
    await page.keyboard.press('2');
    assert.deepEqual(lines(nothing, await picture('outline-visible')), { light: 0, dark: 0 });
    assert.equal(await page.locator('[data-outline]').count(), 0, 'there is nothing to outline in the visible view');

    // It is remembered, and the server is told.
    await page.keyboard.press('3');
    await choose('off');
    await settled(page);
    await page.reload();
    await settled(page);
    assert.deepEqual([(await state()).marks, (await state()).isOutlined], [false, false]);
    assert.deepEqual(problems, []);
    await page.close();
  });

  test('In a point cloud, highlights are outlined, marks are seen where they are, and points have a size of their own', async () => {
    const points = [];
    for (let i = 0; i < 160; i += 1) {
      for (let j = 0; j < 160; j += 1) {
        const [x, y] = [i / 40, j / 40];
        const isWarm = Math.hypot(x - 2, y - 2) < 0.5;
        points.push(`${x} ${y} 0 110 100 90 ${isWarm ? 36 : 20 + Math.sin(i * 7 + j * 3)}`);
      }
    }
    const file = join(scratch, 'cloud.ply');
    writeFileSync(
      file,
      `ply\nformat ascii 1.0\nelement vertex ${points.length}\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n` +
        `property uchar green\nproperty uchar blue\nproperty float temperature\nend_header\n${points.join('\n')}\n`,
    );
    const server = await startServer([file]);
    const { page, problems } = await openClient(browser, server.url);
    await settled(page);
    assert.match(await page.locator('[data-highlight]').innerText(), /of the points/);
    // Once the camera rests it is known what is in front of the marked places.
    await page.locator('[data-mark="hottest"][data-of="scene"]:not(.hidden)').waitFor();
    await page.locator('[data-mark="coldest"][data-of="scene"]:not(.hidden)').waitFor();
    await page.evaluate(() => (globalThis.spectra.store.marksShown = false));
    const picture = async (outline) => {
      await page.locator(`[data-outline="${outline}"]`).click();
      await settled(page);
      return screenshot(page, `cloud-outline-${outline}`);
    };
    const [outlined, plain] = [await picture('on'), await picture('off')];
    const found = { light: 0, dark: 0 };
    for (let x = 200; x < 1100; x += 1) {
      for (let y = 40; y < 860; y += 1) {
        const [pixel, before] = [outlined.at(x, y), plain.at(x, y)];
        if (Math.max(...pixel.map((value, channel) => Math.abs(value - before[channel]))) < 40) continue;
        if (Math.min(...pixel) > 180) found.light += 1;
        else if (Math.max(...pixel) < 75) found.dark += 1;
      }
    }
    assert.ok(found.light > 100 && found.dark > 100, `the outline has ${found.light} light and ${found.dark} dark pixels`);
    // Small points let the background through.
    const ground = (image) => {
      let count = 0;
      for (let x = 500; x < 800; x += 1) for (let y = 430; y < 470; y += 1) count += Math.max(...image.at(x, y)) < 40 ? 1 : 0;
      return count;
    };
    await page.locator('#point-diameter').fill('0.002');
    await page.keyboard.press('Enter');
    await settled(page);
    const small = await screenshot(page, 'cloud-small-points');
    assert.ok(ground(small) > ground(plain) + 1000, `${ground(small)} pixels of ground, ${ground(plain)} before`);
    assert.match(await page.locator('label[for="point-diameter"] ~ *').last().innerText(), /units/);
    assert.deepEqual(problems, []);
    await page.close();
    await server.stop();
  });
}
