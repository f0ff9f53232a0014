// A third party's client rebuilds the scene from the frames and finds what `spectra fuse` writes: every triangle once,
// every position on the nearest lattice point (so within step / 2 per axis), every colour equal.
import assert from "node:assert/strict";
import { existsSync, mkdtempSync, readdirSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import path from "node:path";
import { after, test } from "node:test";
import { identityOfPly, identityOfTiles } from "./mesh_identity.mjs";
import { readPly } from "./ply.mjs";
import { KIND, SpectraClient } from "./spectra_client.mjs";
import { run, serve } from "./spectra_server.mjs";

const folder = mkdtempSync(path.join(tmpdir(), "spectra-rebuild-"));
after(() => rmSync(folder, { recursive: true }));

const settingsOf = (method, params = {}) => ({ method, params });

function fused(scene, { method, params, palette, range }) {
  const output = path.join(folder, "fused.ply");
  const set = Object.entries(params).flatMap(([name, value]) => ["--set", `${name}=${value}`]);
  run(
    "fuse", scene, output, "--method", method, ...set,
    ...(palette ? ["--palette", palette] : []),
    ...(range ? ["--range", `${range.min}:${range.max}`] : []),
  );
  return readPly(output);
}

async function checkScene(scene, changes) {
  const server = await serve([scene]);
  try {
    const client = await SpectraClient.connect(server.url);
    await client.request("scene.subscribe", { channels: ["fused"] });
    let geometryFrames = 0;
    for (const change of changes) {
      const { generation, fusion } = await client.request("fusion.set", change);
      await client.complete(generation);
      assert.deepEqual(client.failures, []);
      assert.equal(fusion.method, change.method);
      const tiles = client.drawnTiles();
      assert.ok(tiles.every((tile) => tile.generation === generation), "every tile shows the newest generation");
      const steps = new Set(tiles.map((tile) => tile.frame.step));
      assert.equal(steps.size, 1, "one lattice");
      const [step] = steps;
      const expected = fused(scene, change);
      const { origin, vertex_count, triangle_count } = client.hello.scene;
      assert.equal(vertex_count, expected.vertexCount);
      assert.equal(triangle_count, expected.triangles.length / 3);
      assert.equal(`${identityOfTiles(tiles)}`, `${identityOfPly(expected, origin, step)}`, JSON.stringify(change));
      const geometryNow = client.frames.filter((frame) => frame.kind === KIND.geometry).length;
      if (geometryFrames) assert.equal(geometryNow, geometryFrames, "fusion.set sends no geometry");
      geometryFrames = geometryNow;
    }
    await client.close();
  } finally {
    await server.stop();
  }
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
