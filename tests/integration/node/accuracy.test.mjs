// What is said of a picture is true at every moment: on a link of 1 Mbit/s, errors of colours and temperatures as the tiles
// state them against those measured between what is drawn and the full mesh.
import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { linkProxy } from "./link_proxy.mjs";
import { SpectraClient } from "./spectra_client.mjs";
import { serve } from "./spectra_server.mjs";

const sample_count = 1500;
const moment_count = 50;
const range = { mode: "manual", min: 5, max: 60 };
const settings = [
  { method: "visible_only", params: {} },
  { method: "thermal_only", params: {}, palette: "white_hot", range, missing: "#ff00ff" },
];
let server;
let proxy;
before(async () => {
  server = await serve(["--demo"]);
  proxy = await linkProxy(server.url, { rate_bytes_per_s: 1e6 / 8, delay_ms: 50 });
});
after(async () => {
  await proxy.close();
  await server.stop();
});

const sleep = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

/** The same numbers in every run. */
function randomNumbers(seed) {
  let state = seed;
  return () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return state / 2 ** 32;
  };
}

const corner = (tile, index) => [0, 1, 2].map((axis) => tile.geometry.positions[3 * index + axis] + tile.frame.origin[axis]);
const colour = (tile, index) => [0, 1, 2].map((channel) => tile.colours[3 * index + channel]);
const mixed = (values, weights) => [0, 1, 2].map((i) => weights.reduce((sum, weight, k) => sum + weight * values[k][i], 0));
const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

/** What the corners of a triangle count for at its point nearest to `p`. */
function nearestWeights(p, a, b, c) {
  const [ab, ac, ap] = [minus(b, a), minus(c, a), minus(p, a)];
  const normal = cross(ab, ac);
  const area = dot(normal, normal);
  if (area > 0) {
    const ofC = dot(cross(ab, ap), normal) / area;
    const ofB = dot(cross(ap, ac), normal) / area;
    if (ofB >= 0 && ofC >= 0 && ofB + ofC <= 1) return [1 - ofB - ofC, ofB, ofC];
  }
  let best = [1, 0, 0];
  let least = Infinity;
  const corners = [a, b, c];
  for (let i = 0; i < 3; ++i) {
    const j = (i + 1) % 3;
    const edge = minus(corners[j], corners[i]);
    const s = Math.min(1, Math.max(0, dot(minus(p, corners[i]), edge) / (dot(edge, edge) || 1)));
    const weights = [0, 0, 0];
    weights[i] = 1 - s;
    weights[j] = s;
    const away = minus(p, mixed(corners, weights));
    if (dot(away, away) >= least) continue;
    least = dot(away, away);
    best = weights;
  }
  return best;
}

/** Points spread over the full mesh by area, with the leaf they are on. */
function samplesOf(leaves) {
  const random = randomNumbers(7);
  const triangles = [];
  let total = 0;
  for (const leaf of leaves) {
    for (let t = 0; t < leaf.geometry.indices.length; t += 3) {
      const vertices = [...leaf.geometry.indices.subarray(t, t + 3)];
      const [a, b, c] = vertices.map((index) => corner(leaf, index));
      total += Math.hypot(...cross(minus(b, a), minus(c, a)));
      triangles.push({ leaf, vertices, total });
    }
  }
  return Array.from({ length: sample_count }, () => {
    const wanted = random() * total;
    let [low, high] = [0, triangles.length - 1];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (triangles[middle].total < wanted) low = middle + 1;
      else high = middle;
    }
    const { leaf, vertices } = triangles[low];
    let [u, v] = [random(), random()];
    if (u + v > 1) [u, v] = [1 - u, 1 - v];
    const weights = [1 - u - v, u, v];
    return { tile: leaf.frame.tile, vertices, weights, p: mixed(vertices.map((index) => corner(leaf, index)), weights) };
  });
}

/** For every sample the nearest triangle of a tile; found once for each geometry. */
const nearest = new WeakMap();
function nearestOf(tile, samples) {
  const known = nearest.get(tile.geometry);
  if (known) return known;
  const { positions, indices } = tile.geometry;
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  for (let i = 0; i < positions.length; ++i) {
    const axis = i % 3;
    low[axis] = Math.min(low[axis], positions[i] + tile.frame.origin[axis]);
    high[axis] = Math.max(high[axis], positions[i] + tile.frame.origin[axis]);
  }
  const triangles = [];
  for (let t = 0; t < indices.length; t += 3) {
    const corners = [0, 1, 2].map((k) => corner(tile, indices[t + k]));
    const centre = mixed(corners, [1 / 3, 1 / 3, 1 / 3]);
    triangles.push({ vertices: [...indices.subarray(t, t + 3)], corners, centre, radius: Math.max(...corners.map((c) => Math.hypot(...minus(c, centre)))) });
  }
  const found = samples.map(({ p }) => {
    const reach = tile.frame.geometricError + 0.02;
    if ([0, 1, 2].some((axis) => p[axis] < low[axis] - reach || p[axis] > high[axis] + reach)) return null;
    let best = null;
    for (const { vertices, corners, centre, radius } of triangles) {
      const [x, y, z] = [p[0] - centre[0], p[1] - centre[1], p[2] - centre[2]];
      const limit = radius + (best ? best.distance : reach);
      if (x * x + y * y + z * z > limit * limit) continue;
      const weights = nearestWeights(p, ...corners);
      const distance = Math.hypot(...minus(p, mixed(corners, weights)));
      if (best === null || distance < best.distance) best = { distance, vertices, weights };
    }
    return best;
  });
  nearest.set(tile.geometry, found);
  return found;
}

/** Half of the step to which colours have been rounded. */
function roundingOf(colours) {
  let bits = 16;
  for (const channel of colours) if (channel !== 255) bits |= channel;
  return (bits & 1) !== 0 ? 0 : (bits & -bits) / 2;
}

const percentile95 = (values) => values.sort((a, b) => a - b)[Math.floor(values.length * 0.95)];

async function exactTiles(change) {
  const client = await SpectraClient.connect(server.url);
  const { generation } = await client.request("fusion.set", change);
  await client.request("scene.subscribe", { channels: ["fused"] });
  await client.complete(generation);
  const tiles = new Map(client.drawnTiles().map((tile) => [tile.frame.tile, tile]));
  await client.close();
  return tiles;
}

test("stated errors are never below measured ones", { timeout: 300_000 }, async () => {
  const exact = [];
  for (const change of settings) exact.push(await exactTiles(change));
  for (const tile of exact[0].values()) {
    assert.equal(tile.frame.childMask, 0);
    assert.equal(tile.frame.colourError, 0, "0 at leaves");
    assert.ok(tile.frame.temperatureError === 0 || Number.isNaN(tile.frame.lowest));
  }
  const samples = samplesOf([...exact[0].values()]);
  const truth = exact.map((tiles) =>
    samples.map(({ tile, vertices, weights }) => mixed(vertices.map((index) => colour(tiles.get(tile), index)), weights)),
  );
  const temperatures = exact[1];
  const isThermal = samples.map(({ tile, vertices }) =>
    vertices.every((index) => {
      const [r, g, b] = colour(temperatures.get(tile), index);
      return r === g && g === b;
    }),
  );

  const client = await SpectraClient.connect(proxy.url);
  const methodOf = new Map();
  const setTo = async (which) => {
    const { generation } = await client.request("fusion.set", settings[which]);
    methodOf.set(generation, which);
  };
  await setTo(0);
  await client.request("scene.subscribe", { channels: ["fused"] });
  const random = randomNumbers(3);
  const moments = [];
  for (let i = 0; i < moment_count; ++i) {
    await sleep(50 + 700 * random());
    if (i % 12 === 11) await setTo(((i + 1) / 12) % 2);
    moments.push(client.drawnTiles().map((tile) => ({ ...tile })));
  }
  await client.close();
  assert.deepEqual(client.failures, []);

  let coarseMoments = 0;
  for (const [index, tiles] of moments.entries()) {
    const errors = [[], []];
    const stated = [0, 0];
    for (const tile of tiles) {
      stated[0] = Math.max(stated[0], tile.frame.colourError + roundingOf(tile.colours));
      if (!Number.isNaN(tile.frame.temperatureError)) stated[1] = Math.max(stated[1], tile.frame.temperatureError);
    }
    const found = tiles.map((tile) => nearestOf(tile, samples));
    for (let s = 0; s < samples.length; ++s) {
      let best = -1;
      for (let t = 0; t < tiles.length; ++t) {
        if (found[t][s] !== null && (best < 0 || found[t][s].distance < found[best][s].distance)) best = t;
      }
      if (best < 0) continue;
      const which = methodOf.get(tiles[best].generation);
      const { vertices, weights } = found[best][s];
      const shown = mixed(vertices.map((v) => colour(tiles[best], v)), weights);
      const off = minus(shown, truth[which][s]).map(Math.abs);
      if (which === 0) errors[0].push(Math.max(...off));
      else if (isThermal[s] && Math.abs(shown[0] - shown[1]) < 1e-6) errors[1].push((off[0] / 255) * (range.max - range.min));
    }
    if (tiles.length > 0 && stated[0] > 0) ++coarseMoments;
    // Positions, colours and the grey of temperatures are rounded.
    if (errors[0].length > 300) assert.ok(percentile95(errors[0]) <= stated[0] + 1, `moment ${index}: ${percentile95(errors[0])} levels, stated ${stated[0]}`);
    const step = (range.max - range.min) / 255;
    const rounding = Math.max(...tiles.map((tile) => roundingOf(tile.colours)), 0) * step;
    if (errors[1].length > 300) assert.ok(percentile95(errors[1]) <= stated[1] + step + rounding, `moment ${index}: ${percentile95(errors[1])} degC, stated ${stated[1]}`);
  }
  assert.ok(coarseMoments >= 5, `${coarseMoments} moments with a coarse picture`);
});
