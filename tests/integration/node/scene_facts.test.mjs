// What is known of a scene, from the file to the person: strays, up, size, notes, and how a thermal file was joined.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import os from "node:os";
import http from "node:http";
import path from "node:path";
import { after, test } from "node:test";
import { fileURLToPath } from "node:url";
import { readPly } from "./ply.mjs";
import { binary, run, serve } from "./spectra_server.mjs";

const folder = mkdtempSync(path.join(os.tmpdir(), "spectra-facts-"));
after(() => rmSync(folder, { recursive: true }));
const inField = (name) => fileURLToPath(new URL(`../../data/field/${name}`, import.meta.url));
const info = (file, ...options) => JSON.parse(run("info", file, "--json", ...options));
const note = (facts, id) => facts.notes.find((candidate) => candidate.id === id);

/** Serves a scene; `look` gets SCENE and the statuses that a viewer is told first. */
async function served(args, look) {
  const server = await serve(args);
  try {
    const scene = await (await fetch(`${server.url}/api/v1/scene`)).json();
    await look(scene, server);
  } finally {
    await server.stop();
  }
}

test("the size says that the file names no unit only where it names none", () => {
  const written = (comment) => {
    const file = path.join(folder, "unit.ply");
    const header = ["ply", "format ascii 1.0", ...comment, "element vertex 3", "property float x", "property float y", "property float z"];
    writeFileSync(file, [...header, "end_header", "0 0 0", "1000 0 0", "0 1000 1", ""].join("\n"));
    return run("info", file);
  };
  assert.match(written([]), /^size .*names no unit/m);
  assert.match(written(["comment units: mm"]), /^size .*names another \(see the note\)$/m);
  assert.match(written(["comment units: metres"]), /^size .* m$/m);
});

test("strays are counted, and the box of the rest is told", async () => {
  for (const name of ["10-stray-point.ply", "10b-stray-point-mesh.ply", "10c-stray-points-in-cloud.ply"]) {
    const facts = info(inField(name));
    assert.equal(note(facts, "stray_points").count, 1, name);
    assert.deepEqual(facts.core_bounds.max.slice(0, 2), [3, 3], name);
    assert.ok(facts.size_m.every((size) => size <= 3), name);
    await served([inField(name)], (scene) => {
      assert.deepEqual(scene.core_bounds, facts.core_bounds);
      assert.equal(scene.bounds.max[0], 31000);
      assert.deepEqual(note(scene, "stray_points"), note(facts, "stray_points"));
    });
  }
  const forms = [
    ["17a-one-vertex.ply", 1, 0],
    ["17b-two-vertices.ply", 2, 0],
    ["17c-line.ply", 144, 0],
    ["17e-one-place.ply", 144, 0],
    ["39-low-poly-room.ply", 24, 36, [8, 6, 3]],
    ["40-long-pipe.ply", 24, 24, [60, 0.2, 0.2]],
  ];
  for (const [name, vertices, triangles, size] of forms) {
    const facts = info(inField(name));
    assert.deepEqual(facts.notes, [], name);
    assert.deepEqual([facts.vertex_count, facts.triangle_count], [vertices, triangles], name);
    assert.deepEqual(facts.core_bounds, facts.bounds, name);
    if (size) size.forEach((metres, axis) => assert.ok(Math.abs(facts.size_m[axis] - metres) < 1e-5, `${name}: ${facts.size_m}`));
  }
});

test("up is z unless the file, its shape or a person says otherwise", async () => {
  const room = inField("39-low-poly-room.ply");
  assert.equal(info(room).up, "z");
  for (const up of ["x", "y", "z", "-x", "-y", "-z"]) assert.equal(info(room, "--up", up).up, up);
  const told = path.join(folder, "told.ply");
  writeFileSync(told, readFileSync(room, "latin1").replace("element vertex", "comment Y-up\nelement vertex"), "latin1");
  assert.equal(info(told).up, "y");
  assert.ok(note(info(told), "up_found"));
  assert.equal(info(told, "--up", "z").up, "z");
  assert.equal(info(told, "--up", "auto").up, "y");
  await served([room, "--up", "-y"], (scene) => assert.equal(scene.up, "-y"));
  const demo = path.join(folder, "demo.ply");
  run("demo-scene", demo, "--vertices", "5000");
  assert.equal(info(demo).up, "y");
  const { status, stderr } = spawnSync(binary, ["info", room, "--up", "w"], { encoding: "utf8" });
  assert.equal(status, 2);
  assert.match(stderr, /--up w.*auto/);
  for (const command of ["serve", "fuse", "info", "tradeoff"]) assert.match(run(command, "--help"), /--up/, command);
});

test("sizes and roundings that look wrong are said, with what mends them", async () => {
  const millimetres = inField("19-millimetres.ply");
  assert.match(note(info(millimetres), "may_be_millimetres").message, /--scale 0\.001/);
  assert.equal(note(info(millimetres, "--scale", "0.001"), "may_be_millimetres"), undefined);
  assert.match(run("info", millimetres), /^size +3000 x 3000/m);
  assert.match(note(info(inField("18b-utm-float.ply")), "rounded_positions").message, /0\.5 m/);
  assert.equal(note(info(inField("18a-utm-double.ply")), "rounded_positions"), undefined);
  for (const name of ["17e-one-place.ply", "17f-one-place-mesh.ply"]) assert.ok(!info(inField(name)).notes.some(({ id }) => /positions|millimetres|stray/.test(id)), name);
  await served([millimetres], (scene) => assert.ok(note(scene, "may_be_millimetres")));
});

test("a thermal file is joined by place where its order differs", () => {
  const visible = inField("42-visible.ply");
  const facts = info(visible, "--thermal", inField("42-thermal-other-order.ply"));
  assert.equal(note(facts, "thermal_joined_nearest").count, 144);
  const fused = path.join(folder, "fused.ply");
  run("fuse", visible, fused, "--method", "thermal_only", "--thermal", inField("42-thermal-other-order.ply"));
  const { x, y, temperature } = readPly(fused);
  const thermal = readFileSync(inField("42-thermal-other-order.ply"), "latin1").split("end_header\n")[1].trim().split("\n")
    .map((line) => line.split(/\s+/).map(Number));
  for (let i = 0; i < 144; ++i) {
    const own = thermal.find(([u, v]) => Math.abs(u - x[i]) < 1e-4 && Math.abs(v - y[i]) < 1e-4);
    assert.ok(Math.abs(temperature[i] - own[3]) < 1e-3, `vertex ${i}`);
  }
  assert.ok(note(info(visible, "--thermal", inField("42d-thermal-nan-positions.ply")), "thermal_joined_nearest").count >= 140);
});

test("a thermal file in another unit or place is refused with what mends it", () => {
  const [visible, thermal] = [inField("42-visible.ply"), inField("42-thermal-other-order.ply")];
  const written = (name, change) => {
    const [header, body] = readFileSync(thermal, "latin1").split("end_header\n");
    const lines = body.trim().split("\n").map((line) => change(line.split(/\s+/).map(Number)).join(" "));
    const file = path.join(folder, name);
    writeFileSync(file, `${header}end_header\n${lines.join("\n")}\n`);
    return file;
  };
  const millimetres = written("mm.ply", ([x, y, z, t]) => [x * 1000, y * 1000, z * 1000, t]);
  const elsewhere = written("elsewhere.ply", ([x, y, z, t]) => [x + 500, y, z, t]);
  for (const [file, pattern] of [[millimetres, /1000 times.*--scale 0\.001/], [elsewhere, /apart.*--scale/]]) {
    for (const command of [["info", visible], ["fuse", visible, path.join(folder, "o.ply"), "--method", "thermal_only"]]) {
      const { status, stderr } = spawnSync(binary, [...command, "--thermal", file], { encoding: "utf8" });
      assert.equal(status, 1, stderr);
      assert.match(stderr.trim(), pattern);
      assert.equal(stderr.trim().split("\n").length, 1, stderr);
    }
  }
  const mended = info(visible, "--thermal", millimetres, "--scale", "0.001");
  assert.equal(note(mended, "thermal_joined_nearest").count, 144);
  assert.ok(Math.abs(mended.size_m[0] - 3) < 1e-5, "the scene keeps its size");
});

test("the machine's own name is answered without an option", async () => {
  const name = os.hostname().split(".")[0].toLowerCase();
  await served(["--demo"], async (scene, server) => {
    assert.equal(scene.up, "y");
    const { port } = new URL(server.url);
    const status = (host) =>
      new Promise((resolve, reject) => {
        http.get({ host: "127.0.0.1", port, path: "/healthz", headers: { host } }, (answer) => {
          answer.resume();
          resolve(answer.statusCode);
        }).on("error", reject);
      });
    for (const host of [name, `${name.toUpperCase()}:${port}`, `${name}.local`, `${name}.local.`]) assert.equal(await status(host), 200, host);
    for (const host of [`${name}.local.evil.example`, "evil.example", "x.local"]) assert.equal(await status(host), 403, host);
  });
});
