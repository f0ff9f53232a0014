// Raw layers on the wire: what they say, when they come, what a setting costs a client that fuses by itself, and that the web
// client's module makes of them what the server sends as fused colours.
import assert from "node:assert/strict";
import { existsSync, mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { test } from "node:test";
import { sheet } from "./ply.mjs";
import { celsiusOf, KIND, SpectraClient } from "./spectra_client.mjs";
import { serve } from "./spectra_server.mjs";
import { loadModule, moduleIsThere, Placed, prepare } from "../../module/client_module.mjs";

const castle = `${process.env.SPECTRA_TEST_DATA ?? ""}/arco_castle_1m.ply`;
const RAW = ["temperature", "visible"];
const sleep = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

/** Until all tiles that are drawn in the end have both layers, or nothing has come for a while. */
async function layersOf(client, quiet_ms = 1500) {
  let seen = -1;
  while (client.frames.length !== seen) {
    seen = client.frames.length;
    await sleep(quiet_ms);
  }
  assert.deepEqual(client.failures, []);
  return [...client.tiles.values()].filter((tile) => tile.temperature && tile.visible);
}

/** A connection's facts as the module takes them. */
async function factsOf(client) {
  const { counts: percentiles, hues, min, max, ...rest } = await client.request("fusion.facts", { bins: 4096, hues: true });
  const { counts } = await client.request("fusion.facts", { bins: 64 });
  return { summary: { ...rest, minimum: min, maximum: max }, histograms: { 4096: percentiles, 64: counts }, hues };
}

const changeOf = ({ method, params, palette, range, missing }) => ({ method, params, palette, range, missing });

/** What the module makes of a tile's raw layers under its plan. */
function fusedHere(module, { temperature: { codes, scale, offset }, visible }) {
  const bytes = Buffer.from(codes.buffer, codes.byteOffset, codes.byteLength);
  const placed = new Placed(module, bytes, visible, visible.length);
  module.fuseCodes(placed.addresses[0], scale, offset, placed.addresses[1], placed.addresses[2], codes.length);
  const fused = Buffer.from(module.bytes(placed.addresses[2], visible.length));
  placed.release();
  return fused;
}

test("raw layers follow the picture, and switching channels sends nothing again", async () => {
  const server = await serve(["--demo"]);
  try {
    const client = await SpectraClient.connect(server.url);
    assert.ok(client.hello.capabilities.includes("raw_layers"));
    await client.request("scene.subscribe", { channels: ["fused", ...RAW], colour_transform: "subtract_green" });
    await client.complete(1);
    const tiles = await layersOf(client);
    assert.ok(tiles.length > 4);
    const firstRaw = client.frames.findIndex(({ kind }) => kind === KIND.temperature);
    assert.ok(client.frames.slice(firstRaw).every(({ kind }) => kind === KIND.temperature || kind === KIND.visible_subtract_green));
    for (const { temperature, visible, frame } of tiles) {
      assert.equal(temperature.codes.length, frame.vertexCount);
      assert.equal(visible.length, 3 * frame.vertexCount);
      assert.ok(Math.abs(temperature.scale - 0.01) < 1e-6);
      const degrees = [...temperature.codes].filter((code) => code < 65533).map((code) => celsiusOf(code, temperature));
      assert.ok(degrees.every((value) => value >= frame.lowest - 0.0051 && value <= frame.highest + 0.0051));
    }

    const before = client.frames.length;
    await client.request("scene.subscribe", { channels: RAW, colour_transform: "subtract_green" });
    let generation = 0;
    for (let i = 0; i < 30; ++i) {
      ({ generation } = await client.request("fusion.set", { method: "thermal_visible_blend", params: { alpha: i / 30 } }));
    }
    await layersOf(client, 500);
    assert.equal(client.frames.length, before, "a setting costs no frame");
    const complete = client.notification("stream.complete");
    await client.request("scene.subscribe", { channels: ["fused", ...RAW], colour_transform: "subtract_green" });
    assert.equal((await complete).generation, generation);
    const kinds = new Set(client.frames.slice(before).map(({ kind }) => kind));
    assert.deepEqual([...kinds], [KIND.colours_subtract_green], "only colours of the newest settings");
    assert.ok(client.frames.slice(before).every((frame) => frame.generation === generation));
    await client.close();
  } finally {
    await server.stop();
  }
});

test("the module makes of raw layers what the server fuses, within the step", { skip: moduleIsThere ? false : "no module" }, async () => {
  const server = await serve(["--demo"]);
  try {
    const module = await loadModule();
    const client = await SpectraClient.connect(server.url);
    await client.request("scene.subscribe", { channels: ["fused", ...RAW] });
    await layersOf(client);
    const facts = await factsOf(client);
    for (const method of client.hello.methods.map(({ id }) => id)) {
      const { generation, fusion } = await client.request("fusion.set", { method });
      await client.complete(generation);
      prepare(module, { settings: changeOf(fusion), facts });
      const plan = module.plan();
      assert.deepEqual(plan.params_in_force, fusion.params_in_force, method);
      assert.deepEqual([plan.range_minimum, plan.range_maximum], [fusion.range.min, fusion.range.max], method);
      const { highlighted } = await client.request("scene.histogram", { bins: 16 });
      assert.deepEqual(plan.highlighted, highlighted, method);
      let channels = 0;
      let apart = 0;
      for (const tile of client.tiles.values()) {
        if (tile.generation !== generation || !tile.temperature || !tile.visible) continue;
        const fused = fusedHere(module, tile);
        channels += fused.length;
        for (let i = 0; i < fused.length; ++i) apart += Math.abs(fused[i] - tile.colours[i]) > 3 ? 1 : 0;
      }
      assert.ok(channels > 100_000, `${method}: ${channels} channels`);
      // Half a step is 0.005 degC: what stands on a threshold may go either way.
      assert.ok(apart / channels < 0.002, `${method}: ${apart} of ${channels} channels differ`);
    }
    await client.close();
  } finally {
    await server.stop();
  }
});

const scenes = [
  ["one temperature", () => "25.0", [undefined, 25]],
  ["one odd temperature", () => "25.0037", [undefined, 25.0037]],
  ["half degrees", (x) => (20 + Math.floor(x / 6) / 2).toFixed(1), [22, 22.5, 23, 21.99, 24.5]],
  ["tenths", (x) => (-3 + x / 10).toFixed(1), [-2.9, -0.1, 0, 0.7, 2.3]],
  ["hundredths", (x) => (36.5 + x / 100).toFixed(2), [36.5, 36.61, 36.99, 37]],
];
for (const [name, celsiusAt, thresholds] of scenes) {
  test(`${name}: decoded as they were, and on the server's side of every threshold`, { skip: moduleIsThere ? false : "no module" }, async () => {
    const scratch = mkdtempSync(join(tmpdir(), "spectra-raw-"));
    const file = join(scratch, "sheet.ply");
    writeFileSync(file, sheet(celsiusAt));
    const server = await serve([file]);
    try {
      const module = await loadModule();
      const client = await SpectraClient.connect(server.url);
      await client.request("scene.subscribe", { channels: ["fused", ...RAW] });
      await layersOf(client);
      const facts = await factsOf(client);
      const written = new Set(Array.from({ length: 60 }, (_, x) => Math.fround(Number(celsiusAt(x)))));
      const seen = new Set();
      for (const { temperature } of client.tiles.values()) for (const code of temperature.codes) seen.add(celsiusOf(code, temperature));
      assert.deepEqual([...seen].sort((a, b) => a - b), [...written].sort((a, b) => a - b));
      for (const threshold of thresholds) {
        for (const [method, params] of [
          ["colour_mapped_threshold", { threshold: threshold ?? null }],
          ["monochrome_threshold", { threshold: threshold ?? null, invert: true }],
          ["thermal_highlighting", { low: threshold ?? null, high: threshold ?? null }],
        ]) {
          const { generation, fusion } = await client.request("fusion.set", { method, params });
          await client.complete(generation);
          prepare(module, { settings: changeOf(fusion), facts });
          for (const tile of client.tiles.values())
            assert.ok(fusedHere(module, tile).equals(Buffer.from(tile.colours)), `${method} at ${threshold ?? "its own threshold"}`);
        }
      }
      await client.close();
    } finally {
      await server.stop();
      rmSync(scratch, { recursive: true });
    }
  });
}

test("a server that gives fused colours only says so", async () => {
  const server = await serve(["--demo", "--fused-only"]);
  try {
    const client = await SpectraClient.connect(server.url);
    assert.ok(!client.hello.capabilities.includes("raw_layers"));
    await assert.rejects(client.request("scene.subscribe", { channels: ["fused", "temperature"] }), (error) => {
      assert.equal(error.code, -32002);
      assert.equal(error.data.field, "channels");
      return true;
    });
    await client.request("scene.subscribe", { channels: ["fused"] });
    await client.complete(1);
    await client.close();
  } finally {
    await server.stop();
  }
});

test("castle: raw layers of all leaves take at most 2.1 MB", { skip: existsSync(castle) ? false : "SPECTRA_TEST_DATA has no castle" }, async () => {
  const server = await serve([castle]);
  try {
    const client = await SpectraClient.connect(server.url);
    await client.request("quality.set", { pixel_error: 0.001 });
    await client.request("scene.subscribe", { channels: ["fused", ...RAW], colour_transform: "subtract_green" });
    await client.complete(1, 120_000);
    const tiles = await layersOf(client, 3000);
    const leaves = tiles.filter(({ frame }) => frame.childMask === 0);
    assert.ok(leaves.reduce((sum, { frame }) => sum + frame.vertexCount, 0) >= 990_000);
    // Of the full mesh; the top comes beside it.
    const isLeaf = new Set(leaves.map(({ frame }) => frame.tile));
    const bytesOf = (wanted) =>
      client.frames.filter(({ kind, tile }) => kind === wanted && isLeaf.has(tile)).reduce((sum, { bytes }) => sum + bytes, 0);
    const temperature = bytesOf(KIND.temperature);
    const visible = bytesOf(KIND.visible_subtract_green);
    const colours = bytesOf(KIND.colours_subtract_green);
    console.log(`castle: temperature ${temperature}, visible ${visible}, together ${temperature + visible}; fused colours ${colours} bytes`);
    assert.ok(temperature + visible <= 2_100_000, `${temperature + visible} bytes`);
    await client.close();
  } finally {
    await server.stop();
  }
});
