// The controls on every screen that people bring: nothing is cut, nothing lies over something else, a finger finds its targets, and
// the keyboard and other aids reach everything.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { demoServer, drawn, openClient, PROGRAM, screenshot, settled, smallDemoServer, startServer, test } from './harness.mjs';
import { startLink } from './link.mjs';

/** Width and height in CSS pixels; `touch` screens have no mouse. */
const SCREENS = [
  { width: 360, height: 740, touch: true },
  { width: 390, height: 844, touch: true },
  // What is left of 1280 x 720 at a zoom of 200 %.
  { width: 640, height: 360 },
  { width: 820, height: 1180, touch: true },
  { width: 1280, height: 720 },
  { width: 1440, height: 900 },
  { width: 2560, height: 1440 },
  { width: 3840, height: 2160 },
];

/** Sizes at which one page is looked at with all that it may have to say; `touch` as above. */
const CROWDED = [
  { width: 360, height: 740, touch: true },
  { width: 320, height: 568, touch: true },
  { width: 740, height: 360, touch: true },
  { width: 1180, height: 820, touch: true },
  { width: 320, height: 256 },
  { width: 640, height: 360 },
  { width: 1000, height: 700 },
];

/** A picture that comes slowly, of a map that grows: everything that can be long is. */
function crowd(page) {
  return page.evaluate(() => {
    const { store, tiles } = globalThis.spectra;
    tiles.drawnError = () => ({
      position_m: 0.1234,
      colour_levels: 43.2,
      rounding_levels: 0.5,
      temperature_celsius: 0.406,
      rounding_celsius: 0,
    });
    tiles.counts = () => ({ ...store.shown, vertices: 20_100 });
    store.shown = { ...store.shown, vertices: 20_100 };
    setInterval(() => {
      store.behindSince = performance.now() - 13_900;
      store.heardAt = performance.now();
    }, 20);
    store.scene = { ...store.scene, live: true, vertex_count: 28_300, triangle_count: 56_000 };
    const up = { min: [0, 0, 0], max: [1, 1, 1] };
    store.robot = { position: up.min, forward: [1, 0, 0], up: [0, 0, 1], isLost: true, path: [up.min, up.max] };
    store.statuses = [
      {
        id: 'scene.no_temperature',
        level: 'info',
        message:
          'block unit_1_1_1: 1256 vertices without a temperature, which have the colour of what was not measured until something measures them (and 21 more blocks)',
      },
      { id: 'map', level: 'info', message: 'Frames are late.' },
    ];
  });
}

/** What the page shows, as boxes: controls and texts with what cuts them, and the parts that must not lie over each other. */
function boxes(page) {
  return page.evaluate(() => {
    const seen = (element) => {
      const style = getComputedStyle(element);
      const { width, height } = element.getBoundingClientRect();
      return style.visibility !== 'hidden' && style.display !== 'none' && width > 0 && height > 0;
    };
    const name = (element) =>
      `${element.tagName.toLowerCase()}${element.getAttribute('class') ? `.${element.getAttribute('class')}` : ''} "${(element.getAttribute('aria-label') ?? element.textContent ?? '').trim().slice(0, 40)}"`;
    const plain = (box) => ({ left: box.left, top: box.top, right: box.right, bottom: box.bottom });
    // What lies beyond the edge of a scrolling part can be reached: only what is in view is looked at.
    const scrolls = (element) => {
      for (let parent = element.parentElement; parent !== null; parent = parent.parentElement)
        if (/auto|scroll/.test(getComputedStyle(parent).overflowY)) return true;
      return false;
    };
    const problems = [];
    const texts = [...document.querySelectorAll('main *')].filter(
      (element) => seen(element) && [...element.childNodes].some((node) => node.nodeType === 3 && node.textContent.trim() !== ''),
    );
    for (const element of texts) {
      if (element.closest('.hidden-text')) continue;
      const box = element.getBoundingClientRect();
      const isBeside = box.left < -0.5 || box.right > innerWidth + 0.5;
      const isAbove = !scrolls(element) && (box.top < -0.5 || box.bottom > innerHeight + 0.5);
      if (isBeside || isAbove) problems.push(`${name(element)} reaches beyond the window: ${JSON.stringify(plain(box))}`);
      const { overflowX } = getComputedStyle(element);
      if (overflowX === 'hidden' && element.scrollWidth > element.clientWidth + 1 && !element.matches('.summary'))
        problems.push(`${name(element)} is cut: ${element.scrollWidth} px in ${element.clientWidth}`);
    }
    const footer = document.querySelector('footer');
    if (footer !== null) {
      const bar = footer.getBoundingClientRect();
      for (const item of footer.querySelectorAll('.item')) {
        if (!seen(item)) continue;
        const box = item.getBoundingClientRect();
        const room = item.parentElement.getBoundingClientRect();
        const isIn = box.top < room.bottom - 1 && box.bottom > room.top + 1;
        if (isIn && (box.left < room.left - 0.5 || box.right > room.right + 0.5 || box.bottom > bar.bottom + 0.5))
          problems.push(`the status bar cuts ${name(item)}`);
      }
    }
    // Texts of the axis: a digit that the edge swallows makes 27.4 a 7.4, and two over each other are none.
    const axis = document.querySelector('.axis');
    const labels = texts
      .filter((element) => axis?.contains(element))
      .map((element) => {
        const range = document.createRange();
        range.selectNodeContents(element);
        return { of: name(element), box: range.getBoundingClientRect(), room: element.closest('svg, button, .axis') };
      });
    for (const { of, box, room } of labels) {
      const edge = room.getBoundingClientRect();
      if (
        box.left < edge.left - 0.5 ||
        box.right > edge.right + 0.5 ||
        box.top < edge.top - 0.5 ||
        box.bottom > edge.bottom + 0.5
      )
        problems.push(`${of} is cut by the axis: ${JSON.stringify(plain(box))} of ${JSON.stringify(plain(edge))}`);
    }
    // The box of a text is a line high; two of its pixels at either end are empty under digits.
    const emptyAbove = 2;
    for (const [i, a] of labels.entries())
      for (const b of labels.slice(i + 1)) {
        const width = Math.min(a.box.right, b.box.right) - Math.max(a.box.left, b.box.left);
        const height = Math.min(a.box.bottom, b.box.bottom) - Math.max(a.box.top, b.box.top);
        if (width > 0.5 && height > emptyAbove)
          problems.push(`${a.of} and ${b.of} of the axis lie over each other: ${width.toFixed(1)} x ${height.toFixed(1)}`);
      }
    for (const line of axis?.querySelectorAll('line.level') ?? []) {
      const { left, right, top } = line.getBoundingClientRect();
      for (const { of, box } of labels)
        if (left < box.right - 1 && right > box.left + 1 && top > box.top + 2 && top < box.bottom - 2)
          problems.push(`a line runs through ${of} of the axis`);
    }
    const inFront = document.querySelector('.card')?.getBoundingClientRect();
    for (const label of inFront === undefined ? [] : document.querySelectorAll('main > .label')) {
      const { left, right, top, bottom } = label.getBoundingClientRect();
      if (seen(label) && left < inFront.right && right > inFront.left && top < inFront.bottom && bottom > inFront.top)
        problems.push(`the card covers ${name(label)}`);
    }
    const parts = [
      ...document.querySelectorAll(
        '.axis, .panel, footer, [aria-label="Orientation"], .list > .banner, .strong, .card, .show, [title^="Go along"]',
      ),
    ].filter(seen);
    for (const [i, a] of parts.entries())
      for (const b of parts.slice(i + 1)) {
        const [p, q] = [a.getBoundingClientRect(), b.getBoundingClientRect()];
        const width = Math.min(p.right, q.right) - Math.max(p.left, q.left);
        const height = Math.min(p.bottom, q.bottom) - Math.max(p.top, q.top);
        if (width > 1 && height > 1) problems.push(`${name(a)} lies over ${name(b)}`);
      }
    const card = document.querySelector('.card');
    const inner = card?.getBoundingClientRect();
    for (const part of card?.children ?? []) {
      const box = part.getBoundingClientRect();
      if (box.left < inner.left - 0.5 || box.right > inner.right + 0.5 || box.bottom > inner.bottom + 0.5)
        problems.push(`${name(part)} bursts out of the card`);
    }
    // The frame of a lost link is drawn over the scene, and over no number beside it.
    const frame = document.querySelector('.stale')?.getBoundingClientRect();
    for (const part of frame === undefined ? [] : document.querySelectorAll('.axis, .panel, footer')) {
      const box = part.getBoundingClientRect();
      const width = Math.min(frame.right, box.right) - Math.max(frame.left, box.left);
      const height = Math.min(frame.bottom, box.bottom) - Math.max(frame.top, box.top);
      if (seen(part) && width > 1 && height > 1) problems.push(`the frame of a lost link lies over ${name(part)}`);
    }
    const targets = [
      ...document.querySelectorAll(
        'button, summary, label:has(> input), input:not(label > input), [role="button"], [role="slider"]',
      ),
    ]
      .filter((element) => seen(element) && !element.disabled)
      .map((element) => ({ name: name(element), box: element.getBoundingClientRect() }))
      .map(({ name: of, box }) => ({ name: of, width: box.width, height: box.height }));
    return { problems, targets };
  });
}

export function addLayoutTests(browser, scratch) {
  for (const { width, height, touch } of SCREENS) {
    test(`Nothing is cut and nothing lies over something else at ${width} x ${height}`, async () => {
      const link = await startLink((await smallDemoServer(scratch)).port);
      const context = await browser.newContext({
        viewport: { width, height },
        hasTouch: touch === true,
        isMobile: touch === true,
      });
      const { page, problems } = await openClient(context, link.url, null);
      await settled(page, 180_000);
      const look = async (what) => {
        const { problems: found, targets } = await boxes(page);
        assert.deepEqual(found, [], what);
        if (touch) {
          const small = targets.filter((target) => target.width < 43.5 || target.height < 43.5);
          assert.deepEqual(small, [], `${what}: smaller than a finger`);
        }
      };
      await look('as it opens');
      // A reading where a card has least room: at the leftmost and at the rightmost place that shows something.
      for (const side of ['left', 'right']) {
        const place = await page.evaluate(async (from) => {
          const { width, height } = document.querySelector('canvas').getBoundingClientRect();
          const columns = Array.from({ length: 40 }, (_, i) => ((i + 0.5) / 40) * width);
          for (const x of from === 'left' ? columns : columns.reverse())
            for (let y = height * 0.1; y < height; y += height / 16)
              if (document.elementFromPoint(x, y)?.tagName === 'CANVAS' && (await globalThis.spectra.viewport.pick(x, y)))
                return { x, y };
          return null;
        }, side);
        assert.notEqual(place, null, 'nothing of the scene can be read');
        await page.evaluate((at) => globalThis.spectra.pin(at), place);
        await page.locator('.card').waitFor();
        // Its size is known once it has been laid out.
        await drawn(page);
        await look(`with a reading at the ${side}`);
      }
      for (const method of ['colour_mapped_threshold', 'thermal_highlighting', 'histogram_bin', 'thermal_change']) {
        await page.evaluate((id) => globalThis.spectra.settings.setMethod(id), method);
        await settled(page, 180_000);
        await look(method);
      }
      await screenshot(page, `layout-${width}x${height}`);
      await page.evaluate(() => (globalThis.spectra.store.helpOpen = true));
      await page.locator('dialog[open]').waitFor();
      await look('with the help sheet');
      await page.keyboard.press('Escape');
      await page.getByLabel('Hide the controls').click();
      await look('without controls');
      await page.getByLabel('Show the controls').click();
      await page.locator('aside.panel').waitFor();
      assert.deepEqual(problems, []);
      await link.stop();
      await page.getByText('Reconnecting').waitFor();
      // The panel has just come back and the banner with it: their places are known a frame later.
      await drawn(page);
      await look('without a link');
      // With all that a banner may have to say, and a reading beside it.
      await page.evaluate(() => {
        const { settings } = globalThis.spectra;
        settings.setMethod('intensity_hue');
        settings.setParameter('k', 0.7, true);
        settings.setRange(15, 30, true);
      });
      await page.locator('[data-waiting]').waitFor();
      assert.equal(await page.locator('.card').count(), 1);
      await drawn(page);
      await look('without a link, with wishes that wait');
      const share = await page.evaluate(() => {
        const heightOf = (selector) => document.querySelector(selector).getBoundingClientRect().height;
        return heightOf('.banner.strong') / heightOf('canvas');
      });
      assert.ok(share < (height < 400 ? 0.35 : 0.25), `the banner covers ${share.toFixed(2)} of the height of the scene`);
      await context.close();
    });
  }

  for (const touch of [true, false]) {
    test(`A slow picture of a growing map: its words are whole and beside each other, ${touch ? 'under a finger' : 'with a mouse'}`, async () => {
      const file = join(scratch, 'few.ply');
      execFileSync(PROGRAM, ['demo-scene', file, '--vertices', '5000']);
      const server = await startServer([file]);
      const context = await browser.newContext({ viewport: { width: 1280, height: 720 }, hasTouch: touch, isMobile: touch });
      const { page, problems } = await openClient(context, server.url, null);
      await settled(page);
      await page.locator('aside.panel').waitFor();
      await crowd(page);
      await page.getByText('Robot lost its place').waitFor();
      const faults = [];
      const set = async (change) => {
        await page.evaluate((values) => Object.assign(globalThis.spectra.store, values), change);
        for (let i = 0; i < 4; i += 1) await page.evaluate(() => new Promise((resolve) => requestAnimationFrame(resolve)));
      };
      for (const size of CROWDED.filter((one) => (one.touch === true) === touch)) {
        const name = `${size.width}x${size.height}`;
        await page.setViewportSize({ width: size.width, height: size.height });
        await page.waitForFunction((wide) => globalThis.spectra.viewport.size[0] === wide, size.width);
        const look = async (what) => {
          const { problems: found, targets } = await boxes(page);
          if (what === 'note') await screenshot(page, `crowded-${name}`);
          faults.push(...found.map((fault) => `${name}, ${what}: ${fault}`));
          const small = targets.filter((target) => target.width < 43.5 || target.height < 43.5);
          if (touch) faults.push(...small.map((one) => `${name}, ${what}: smaller than a finger: ${JSON.stringify(one)}`));
        };
        await set({ closedNotes: [] });
        await look('note');
        const bar = (await page.locator('footer').innerText()).replace(/\s+/g, ' ');
        assert.match(bar, /coarse: within [\d.]+ (cm|units), 44 levels, 0\.41 °C/, name);
        assert.match(bar, /13\.\d s behind/, name);
        // Where there is no room for both, notes give way to the robot's button.
        const robot = await page.evaluateHandle(() => globalThis.spectra.store.robot);
        if ((await page.locator('[data-notice]').count()) === 0) await set({ robot: null });
        // Where one thing at a time is said, notes and signs come before the range.
        const isQuiet = () => {
          const { store } = globalThis.spectra;
          return (
            !store.methodIsPending && store.complete !== null && store.notes.every(({ key }) => store.closedNotes.includes(key))
          );
        };
        for (let i = 0; i < 100 && !(await page.evaluate(isQuiet)); i += 1) {
          const close = page.getByLabel('Close this note').first();
          if ((await close.count()) > 0) await close.click();
          else await page.waitForTimeout(50);
        }
        await page.evaluate(() => {
          const { store } = globalThis.spectra;
          const range = { ...store.fusionInForce.range, mode: 'percentile' };
          store.fusionInForce = { ...store.fusionInForce, range: { ...range, max: (range.max ?? 30) + 0.1 } };
        });
        await page.locator('[data-range="moved"]').waitFor({ timeout: 2000 });
        await set({});
        await look('range');
        await page.evaluate((value) => (globalThis.spectra.store.robot = value), robot);
        // Closed notes stay closed whatever they count by now, and can be had again.
        await page.evaluate(() => {
          const { store } = globalThis.spectra;
          store.statuses = store.statuses.map((one) => ({ ...one, message: one.message.replaceAll('1', '2') }));
        });
        await set({});
        assert.equal(await page.locator('[data-notice]').count(), 0, `${name}: a note has come back`);
        await page.locator('footer .notes').click({ timeout: 5000 });
        await set({});
        await look('notes');
        await set({ notesOpen: false });
        const complete = await page.evaluateHandle(() => globalThis.spectra.store.complete);
        await set({ complete: null });
        await look('loading');
        await page.evaluate((value) => (globalThis.spectra.store.complete = value), complete);
        await page.evaluate(() => {
          const { store, tiles } = globalThis.spectra;
          globalThis.drawnGenerations ??= tiles.drawnGenerations;
          tiles.drawnGenerations = () => [null];
          store.pictureMethod = 'visible_only';
          store.shownMethods = ['visible_only'];
          store.closedNotes = [];
        });
        await page.locator('[data-pending-method]').waitFor();
        await set({});
        await look('sign');
        await page.evaluate(async () => {
          const { width, height } = document.querySelector('canvas').getBoundingClientRect();
          for (let i = 399; i >= 0; i -= 1) {
            const at = { x: ((i % 20) + 0.5) * (width / 20), y: (Math.floor(i / 20) + 0.5) * (height / 20) };
            if (await globalThis.spectra.viewport.pick(at.x, at.y)) return globalThis.spectra.pin(at);
          }
        });
        await page.locator('.card').waitFor();
        await set({});
        await look('sign and reading');
        await page.evaluate(() => {
          const { store, tiles } = globalThis.spectra;
          globalThis.spectra.unpin();
          tiles.drawnGenerations = globalThis.drawnGenerations;
          store.shownMethods = [store.fusion.method];
          store.pictureMethod = store.fusion.method;
        });
      }
      assert.deepEqual(faults, []);
      assert.deepEqual(problems, []);
      await context.close();
      await server.stop();
    });
  }

  test('A scene of one temperature has one number for both ends of its range', async () => {
    const file = join(scratch, 'one-temperature.ply');
    const head =
      'ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n' +
      'property uchar green\nproperty uchar blue\nproperty float temperature\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n';
    const corners = ['0 0 0', '1 0 0', '1 1 0', '0 1 0'].map((place) => `${place} 40 90 200 21\n`).join('');
    writeFileSync(file, `${head}${corners}3 0 1 2\n3 0 2 3\n`);
    const server = await startServer([file]);
    const { page } = await openClient(browser, server.url);
    await settled(page);
    await page.locator('.handle.range').first().waitFor();
    for (const { width, height } of CROWDED.filter(({ width }) => width < 1000)) {
      await page.setViewportSize({ width, height });
      await page.waitForFunction((wide) => globalThis.spectra.viewport.size[0] === wide, width);
      for (let i = 0; i < 2; i += 1) await page.evaluate(() => new Promise((resolve) => requestAnimationFrame(resolve)));
      assert.deepEqual((await boxes(page)).problems, [], `${width} x ${height}`);
      assert.deepEqual(await page.locator('.handle.range text').allTextContents(), ['21.0'], `${width} x ${height}`);
    }
    await page.close();
    await server.stop();
  });

  test('Long temperatures are whole, told apart and beside each other, and a reading leaves open notes readable', async () => {
    const head = (vertices, faces) =>
      `ply\nformat ascii 1.0\nelement vertex ${vertices}\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n` +
      `property uchar green\nproperty uchar blue\nproperty float temperature\nelement face ${faces}\n` +
      'property list uchar int vertex_indices\nend_header\n';
    const sheet = (temperature) => {
      const [vertices, faces] = [[], []];
      for (let i = 0; i < 400; i += 1) {
        const [x, y] = [i % 20, Math.floor(i / 20)];
        vertices.push(
          `${x / 10} ${y / 10} 0 ${90 + 5 * x} 120 ${90 + 5 * y} ${temperature(Math.exp(-((x - 9) ** 2 + (y - 9) ** 2)))}`,
        );
        if (x < 19 && y < 19) faces.push(`3 ${i} ${i + 1} ${i + 21}`, `3 ${i} ${i + 21} ${i + 20}`);
      }
      return `${head(vertices.length, faces.length)}${vertices.join('\n')}\n${faces.join('\n')}\n`;
    };
    const scenes = {
      'far below zero': { at: (spot) => -200 + 30 * spot, bar: /low −200\.0.*high −170\.\d/ },
      'to a million': { at: (spot) => 20 + 993_742.6 * spot, bar: /low 20\.0.*high 993\d{3}\.\d/ },
      'about a million': { at: (spot) => 1e6 + 20 * spot, bar: /low 1000000 .*high 10000(19|20) / },
    };
    for (const [name, { at, bar }] of Object.entries(scenes)) {
      const file = join(scratch, 'long.ply');
      writeFileSync(file, sheet(at));
      const server = await startServer([file]);
      const { page } = await openClient(browser, server.url, { width: 1280, height: 720 });
      await settled(page);
      await page.locator('aside.panel').waitFor();
      assert.match((await page.locator('footer').innerText()).replace(/\s+/g, ' '), bar, name);
      for (const method of ['histogram_distribution', 'colour_mapped_threshold']) {
        await page.evaluate((id) => globalThis.spectra.settings.setMethod(id), method);
        await settled(page);
        for (const [width, height] of [
          [360, 740],
          [740, 360],
          [1280, 720],
        ]) {
          await page.setViewportSize({ width, height });
          await page.waitForFunction((wide) => globalThis.spectra.viewport.size[0] === wide, width);
          await drawn(page);
          await page.evaluate(async () => {
            const { width, height } = document.querySelector('canvas').getBoundingClientRect();
            for (let i = 0; i < 400; i += 1) {
              const at = { x: ((i % 20) + 0.5) * (width / 20), y: (Math.floor(i / 20) + 0.5) * (height / 20) };
              if (await globalThis.spectra.viewport.pick(at.x, at.y)) return globalThis.spectra.pin(at);
            }
          });
          await page.locator('.card').waitFor();
          await drawn(page);
          assert.deepEqual((await boxes(page)).problems, [], `${name}, ${method}, ${width} x ${height}`);
          await page.locator('footer .notes').click();
          await drawn(page);
          assert.deepEqual((await boxes(page)).problems, [], `${name}, ${method}, ${width} x ${height}, notes`);
          await page.locator('footer .notes').click();
          await page.locator('.card').waitFor();
        }
      }
      await screenshot(page, `long-${name.replaceAll(' ', '-')}`);
      await page.close();
      await server.stop();
    }
  });

  test('On a phone too, the marks tell the hottest of all that is seen', async () => {
    const server = await smallDemoServer(scratch);
    const context = await browser.newContext({ viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true });
    const { page } = await openClient(context, server.url, null);
    await settled(page, 180_000);
    // The hottest place is beside the orientation, and nothing stands in front of it.
    await page.locator('[data-mark="hottest"][data-of="scene"]:not(.hidden)').waitFor();
    // Marks of what is in view come once the camera has rested.
    await page.waitForTimeout(1000);
    assert.equal(await page.locator('[data-mark="hottest"]').count(), 1);

    // What is found, how hot it is, and the scene beside the balls of the orientation: all without scrolling, on the smallest phone.
    await page.setViewportSize({ width: 360, height: 740 });
    await page.waitForFunction(() => globalThis.spectra.viewport.size[0] === 360);
    await drawn(page);
    const { max } = await page.evaluate(() => globalThis.spectra.store.scene.temperature);
    assert.ok((await page.locator('.axis svg text').allTextContents()).includes(max.toFixed(1)), 'the axis says how hot it is');
    const facts = await page.locator('footer .facts').boundingBox();
    const high = page.locator('footer .item', { hasText: `high ${max.toFixed(1)}` });
    const item = await high.boundingBox();
    assert.ok(item.y >= facts.y - 1 && item.y + item.height <= facts.y + facts.height + 1, 'and the bar');
    for (const place of [page.locator('.found b'), page.locator('[data-highlight]')]) {
      assert.ok(
        await place.evaluate((one) => {
          const { left, top, right, bottom } = one.getBoundingClientRect();
          return document.elementFromPoint((left + right) / 2, (top + bottom) / 2)?.closest('.found') !== null && bottom > top;
        }),
        'what is found is out of sight',
      );
    }
    const hit = await page.locator('[aria-label="Orientation"]').evaluate((gizmo) => {
      const { left, top, right, bottom } = gizmo.getBoundingClientRect();
      const counts = { CANVAS: 0, circle: 0, text: 0, all: 0 };
      for (let y = top + 2; y < bottom; y += 4)
        for (let x = left + 2; x < right; x += 4) {
          const { tagName } = document.elementFromPoint(x, y);
          counts.all += 1;
          counts[tagName] = (counts[tagName] ?? 0) + 1;
        }
      return counts;
    });
    assert.ok(hit.CANVAS > hit.all / 3 && hit.CANVAS + hit.circle + hit.text === hit.all, JSON.stringify(hit));

    // A card takes the place of the label: it goes beside, or away.
    const mark = await page.evaluate(() => globalThis.spectra.store.marks.find(({ kind }) => kind === 'coldest'));
    for (const [x, y] of [
      [12, 36],
      [60, 60],
      [-12, 20],
    ]) {
      await page.touchscreen.tap(mark.x + x, mark.y + y);
      await page.locator('.card').waitFor();
      await drawn(page);
      assert.deepEqual((await boxes(page)).problems, [], `a card at ${x}, ${y}`);
    }
    await screenshot(page, 'phone-card');
    await context.close();
  });

  test('Nothing is cut and nothing lies over something else with two device pixels a pixel', async () => {
    const server = await smallDemoServer(scratch);
    const context = await browser.newContext({ viewport: SCREENS[0], deviceScaleFactor: 2 });
    const { page, problems } = await openClient(context, server.url, null);
    await settled(page, 180_000);
    for (const { width, height } of SCREENS) {
      // One page that changes its size, and no wait for the scene: that many pixels take long without a GPU.
      await page.setViewportSize({ width, height });
      await page.waitForFunction((wide) => globalThis.spectra.viewport.size[0] === wide, width);
      for (let i = 0; i < 2; i += 1) await page.evaluate(() => new Promise((resolve) => requestAnimationFrame(resolve)));
      assert.equal(await page.evaluate(() => devicePixelRatio), 2);
      assert.deepEqual((await boxes(page)).problems, [], `${width} x ${height}`);
    }
    assert.deepEqual(problems, []);
    await context.close();
  });

  test('One tab stop a group, arrow keys inside', async () => {
    const server = await demoServer();
    const { page } = await openClient(browser, server.url);
    await settled(page, 180_000);
    const stops = [];
    await page.locator('canvas').focus();
    for (let i = 0; i < 80; i += 1) {
      await page.keyboard.press('Tab');
      const stop = await page.evaluate(() => {
        const element = document.activeElement;
        if (element === document.body || element.tagName === 'CANVAS') return null;
        const group = element.closest('[role="radiogroup"], [role="toolbar"]');
        element.dataset.reached = '';
        // The mark of focus is around the element, its label or what is drawn in it.
        const isMarked = [element, element.closest('label'), ...element.querySelectorAll('rect, path, circle')].some((part) => {
          if (part === null) return false;
          const { outlineStyle, stroke, strokeWidth } = getComputedStyle(part);
          const isStroked = element instanceof SVGElement && stroke !== 'none' && parseFloat(strokeWidth) >= 1;
          return outlineStyle !== 'none' || isStroked;
        });
        const box = (element.closest('label') ?? element).getBoundingClientRect();
        const isInView = box.top > -1 && box.left > -1 && box.bottom < innerHeight + 1 && box.right < innerWidth + 1;
        const name = element.getAttribute('aria-label') ?? element.labels?.[0]?.textContent ?? element.textContent;
        const fault = !isMarked ? 'no mark of focus' : !isInView ? 'out of view' : name.trim() === '' ? 'no name' : null;
        return {
          fault: fault === null ? null : `${fault}: ${element.outerHTML.slice(0, 120)}`,
          in: group?.getAttribute('aria-label') ?? group?.getAttribute('aria-labelledby') ?? null,
        };
      });
      if (stop === null) break;
      assert.equal(stop.fault, null);
      stops.push(stop.in);
    }
    // Whatever can be pressed or set has been reached, or is in a group that has.
    const missed = await page.evaluate(() =>
      [...document.querySelectorAll('main button, main a, main input, main summary, main [tabindex="0"]')]
        .filter((element) => element.tagName !== 'CANVAS' && !element.disabled && element.checkVisibility())
        .filter((element) => !('reached' in element.dataset))
        .filter((element) => !element.closest('[role="radiogroup"], [role="toolbar"]')?.querySelector('[data-reached]'))
        .map((element) => element.outerHTML.slice(0, 120)),
    );
    assert.deepEqual(missed, []);
    const groups = stops.filter((group) => group !== null);
    assert.equal(new Set(groups).size, groups.length, `a group has several tab stops: ${groups}`);
    assert.ok(stops.length <= 32, `${stops.length} tab stops`);

    const method = () => page.evaluate(() => globalThis.spectra.store.fusion.method);
    const before = await method();
    await page.locator(`[data-method="${before}"] input`).focus();
    await page.keyboard.press('ArrowDown');
    await page.waitForFunction((earlier) => globalThis.spectra.store.fusion.method !== earlier, before);
    await page.locator('[data-end="+X"]').focus();
    await page.keyboard.press('ArrowRight');
    assert.equal(await page.evaluate(() => document.activeElement.dataset.end), '−X');
    await page.close();
  });

  test('Single keys can be switched off, and act on the scene even then', async () => {
    const server = await smallDemoServer(scratch);
    const { page } = await openClient(browser, server.url);
    await settled(page, 180_000);
    const method = () => page.evaluate(() => globalThis.spectra.store.fusion.method);
    await page.keyboard.press('?');
    await page.locator('dialog[open]').waitFor();
    assert.equal(await page.evaluate(() => document.querySelector('dialog').matches(':modal')), true);
    const licences = await page.getByRole('link', { name: 'Licences' }).evaluate((link) => link.href);
    assert.match(await (await fetch(licences)).text(), /In the client: three/);
    await page.getByText('Single keys act').click();
    await page.keyboard.press('Escape');
    await page.locator('dialog').waitFor({ state: 'detached' });
    await page.getByLabel('Collapse the panel').focus();
    const before = await method();
    await page.keyboard.press('1');
    await page.waitForTimeout(200);
    assert.equal(await method(), before);
    await page.locator('canvas').focus();
    await page.keyboard.press('1');
    await page.waitForFunction(() => globalThis.spectra.store.fusion.method === 'thermal_only');
    assert.equal(await page.locator('.aim').evaluate((mark) => getComputedStyle(mark).visibility), 'visible');
    await page.keyboard.press('p');
    await page.locator('.card').waitFor();
    await page.close();
  });

  test('Forced colours leave every number and every slider readable', async () => {
    const server = await smallDemoServer(scratch);
    const context = await browser.newContext({
      viewport: { width: 1280, height: 720 },
      forcedColors: 'active',
      colorScheme: 'light',
    });
    const { page } = await openClient(context, server.url, null);
    await settled(page, 180_000);
    const faults = await page.evaluate(() => {
      const luminance = (colour) => {
        const [r, g, b] = colour.match(/[\d.]+/g).map(Number);
        const linear = (value) => (value / 255 <= 0.04045 ? value / 255 / 12.92 : ((value / 255 + 0.055) / 1.055) ** 2.4);
        return 0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b);
      };
      const contrast = (a, b) => {
        const [low, high] = [luminance(a), luminance(b)].sort((x, y) => x - y);
        return (high + 0.05) / (low + 0.05);
      };
      const ground = getComputedStyle(document.querySelector('.axis')).backgroundColor;
      const found = [];
      for (const text of document.querySelectorAll('.axis svg text')) {
        const { fill } = getComputedStyle(text);
        if (contrast(fill, ground) < 4.5) found.push(`${text.textContent}: ${fill} on ${ground}`);
      }
      return found;
    });
    assert.deepEqual(faults, []);
    const fills = await page.evaluate(() =>
      ['.silhouette:not(.bright)', '.silhouette.bright'].map((part) => getComputedStyle(document.querySelector(part)).fill),
    );
    assert.notEqual(fills[0], fills[1], 'what is highlighted of the histogram is seen');
    const image = await screenshot(page, 'forced-colours');
    const slider = await page.locator('.panel input[type=range]').first().boundingBox();
    const column = [];
    for (let y = slider.y; y < slider.y + slider.height; y += 1) column.push(image.at(slider.x + slider.width * 0.9, y).join());
    assert.ok(new Set(column).size > 1, 'the track of a slider cannot be seen');
    await page.evaluate(() => globalThis.spectra.settings.setMethod('colour_mapped_threshold'));
    // Switches, and the marks of palettes, are painted.
    for (const selector of ['.toggle input[role=switch]', '.legend .safe', '.legend .sided']) {
      const part = page.locator(selector).first();
      await part.waitFor();
      await part.scrollIntoViewIfNeeded();
      const box = await part.boundingBox();
      const lower = await screenshot(page, 'forced-colours-lower');
      const seen = new Set();
      for (let y = 0; y < box.height; y += 1) seen.add(lower.at(box.x + box.width / 2, box.y + y).join());
      for (let x = 0; x < box.width; x += 1) seen.add(lower.at(box.x + x, box.y + box.height / 2).join());
      const beside = lower.at(box.x - 3, box.y + box.height / 2).join();
      assert.ok(
        [...seen].some((colour) => colour !== beside),
        `${selector} cannot be seen`,
      );
    }
    await context.close();
  });
}
