// A third party's client rebuilds the scene from the frames and finds what `spectra fuse` writes: every triangle once,
// every colour equal, every position within half a step of its tile along each axis.
import assert from "node:assert/strict";
import { existsSync, mkdtempSync, readdirSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import path from "node:path";
import { after, test } from "node:test";
import { colourIdentityOfPly, colourIdentityOfTiles, misplacedVertices } from "./mesh_identity.mjs";
import { readPly } from "./ply.mjs";
import { isColours, KIND, SpectraClient } from "./spectra_client.mjs";
import { run, serve } from "./spectra_server.mjs";

const folder = mkdtempSync(path.join(tmpdir(), "spectra-rebuild-"));
after(() => rmSync(folder, { recursive: true }));

/** What a viewer has who sets no range. */
const FIRST_RANGE = "percentile:0.5:99.5";
const settingsOf = (method, params = {}) => ({ method, params });

function fused(scene, { method, params, palette, range }) {
  const output = path.join(folder, "fused.ply");
  const set = Object.entries(params).flatMap(([name, value]) => ["--set", `${name}=${value}`]);
  run(
    "fuse", scene, output, "--method", method, ...set,
    ...(palette ? ["--palette", palette] : []),
    "--range", range ? `${range.min}:${range.max}` : FIRST_RANGE,
  );
  return readPly(output);
}

/** What is drawn after a change. */
async function pictureAfter(client, change) {
  const { generation, fusion } = await client.request("fusion.set", change);
  await client.complete(generation);
  assert.deepEqual(client.failures, []);
  assert.equal(fusion.method, change.method);
  const tiles = client.drawnTiles().map((tile) => ({ ...tile }));
  assert.ok(tiles.every((tile) => tile.generation === generation), "every tile shows the newest generation");
  return { tiles, scene: client.hello.scene };
}

/** That picture against the file's, with `shown` applied to its colours. */
function checkPicture({ tiles, scene }, change, expected, shown = (value) => value) {
  const { origin, vertex_count, triangle_count, position_step_m } = scene;
  for (const { frame } of tiles) assert.ok(frame.step <= position_step_m, `step of ${frame.tile}`);
  assert.equal(vertex_count, expected.vertexCount);
  assert.equal(triangle_count, expected.triangles.length / 3);
  const picture = { ...expected };
  for (const channel of ["red", "green", "blue"]) picture[channel] = expected[channel].map(shown);
  assert.equal(`${colourIdentityOfTiles(tiles)}`, `${colourIdentityOfPly(picture)}`, JSON.stringify(change));
  assert.deepEqual(misplacedVertices(tiles, picture, origin).slice(0, 5), [], JSON.stringify(change));
}

/** The pictures of all clients: the first against the file's, the others against the first, bit by bit. */
function checkPictures([one, ...others], change, expected, shown) {
  checkPicture(one, change, expected, shown);
  const bytesOf = ({ buffer, byteOffset, byteLength }) => Buffer.from(buffer, byteOffset, byteLength);
  const content = ({ tiles }) =>
    new Map(tiles.map(({ frame, geometry, colours }) => [frame.tile, [geometry.positions, geometry.indices, colours].map(bytesOf)]));
  const wanted = content(one);
  for (const other of others) {
    const held = content(other);
    assert.deepEqual([...held.keys()].sort(), [...wanted.keys()].sort());
    for (const [tile, parts] of held) parts.forEach((part, i) => assert.ok(part.equals(wanted.get(tile)[i]), `${tile}, ${i}`));
  }
}

/** The same scene for two clients, one for each way to write colours. */
async function checkScene(scene, changes) {
  const pictures = []; // By change, then by client. Compared once nobody is connected: a client that is busy for long is cut.
  const coarse = [];
  const server = await serve([scene]);
  try {
    const clients = [];
    for (const colour_transform of ["none", "subtract_green"]) {
      const client = await SpectraClient.connect(server.url);
      await client.request("scene.subscribe", { channels: ["fused"], colour_transform });
      clients.push(client);
    }
    const geometryFrames = () => clients.map(({ frames }) => frames.filter(({ kind }) => kind === KIND.geometry).length);
    let before;
    for (const change of changes) {
      const drawn = [];
      for (const client of clients) drawn.push(await pictureAfter(client, change));
      pictures.push(drawn);
      before ??= geometryFrames();
      assert.deepEqual(geometryFrames(), before, "fusion.set sends no geometry");
    }
    for (const client of clients) {
      await client.request("quality.set", { mode: "manual", colour_bits: 6 });
      coarse.push(await pictureAfter(client, changes.at(-1)));
    }
    const kinds = clients.map(({ frames }) => [...new Set(frames.filter(isColours).map(({ kind }) => kind))]);
    assert.deepEqual(kinds, [[KIND.colours], [KIND.colours_subtract_green]], "each got the frames it asked for");
    for (const client of clients) await client.close();
  } finally {
    await server.stop();
  }
  let expected;
  changes.forEach((change, i) => {
    expected = fused(scene, change);
    checkPictures(pictures[i], change, expected);
  });
  const rounded = (value) => Math.min(255, (value + 2) & ~3);
  checkPictures(coarse, changes.at(-1), expected, rounded);
}

test("every method on a generated scene", { timeout: 300_000 }, async () => {
  const scene = path.join(folder, "demo.ply");
  run("demo-scene", scene, "--vertices", "60000", "--seed", "7");
  const methods = JSON.parse(run("methods", "--json"));
  assert.ok(methods.length >= 10);
  const changes = methods.map(({ id }) => settingsOf(id));
  changes.push(
    { ...settingsOf("thermal_visible_blend", { alpha: 0.3 }), palette: "viridis" },
    { ...settingsOf("thermal_only"), palette: "inferno", range: { mode: "manual", min: 18, max: 31.5 } },
  );
  await checkScene(scene, changes);
});

const realScenes = process.env.SPECTRA_TEST_DATA ?? "";
const scenes = existsSync(realScenes) ? readdirSync(realScenes).filter((name) => name.endsWith(".ply")) : [];
if (scenes.length === 0) test("real scenes", { skip: "SPECTRA_TEST_DATA names no folder with scenes" }, () => {});
for (const name of scenes) {
  test(`real scene ${name}`, { timeout: 300_000 }, async () => {
    await checkScene(path.join(realScenes, name), [
      settingsOf("visible_only"),
      settingsOf("thermal_visible_blend", { alpha: 0.5 }),
      settingsOf("histogram_distribution", { k: 1.5 }),
    ]);
  });
}
