// The program as a script sees it: exit status 0, 1 for a failed job, 2 for wrong usage, one clear line on standard error.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { closeSync, copyFileSync, existsSync, mkdirSync, mkdtempSync, openSync, readFileSync, readdirSync, rmSync, writeFileSync } from "node:fs";
import net from "node:net";
import { tmpdir } from "node:os";
import path from "node:path";
import { after, test } from "node:test";
import { readPly } from "./ply.mjs";
import { binary, run, serve } from "./spectra_server.mjs";

const folder = mkdtempSync(path.join(tmpdir(), "spectra-cli-"));
after(() => rmSync(folder, { recursive: true }));
const inFolder = (name) => path.join(folder, name);
const demo = inFolder("demo.ply");
run("demo-scene", demo, "--vertices", "8000");

function fails(status, pattern, ...args) {
  const result = spawnSync(binary, args, { encoding: "utf8", timeout: 60_000 });
  assert.equal(result.status, status, `${args.join(" ")}: ${result.stderr}`);
  const lines = result.stderr.trim().split("\n");
  assert.equal(lines.length, 1, `one line: ${result.stderr}`);
  assert.match(lines[0], pattern);
}

test("wrong usage is 2 and names what is wrong", () => {
  fails(2, /frobnicate/, "frobnicate");
  fails(2, /IN|file|required/i, "fuse");
  fails(2, /no_such/, "fuse", demo, inFolder("o.ply"), "--method", "no_such");
  fails(2, /gamma/, "fuse", demo, inFolder("o.ply"), "--method", "thermal_visible_blend", "--set", "gamma=1");
  fails(2, /alpha.*1/, "fuse", demo, inFolder("o.ply"), "--method", "thermal_visible_blend", "--set", "alpha=2");
  fails(2, /alpha/, "fuse", demo, inFolder("o.ply"), "--method", "thermal_visible_blend", "--set", "alpha=nan");
  fails(2, /alpha/, "fuse", demo, inFolder("o.ply"), "--method", "thermal_visible_blend", "--set", "alpha");
  fails(2, /palette/, "fuse", demo, inFolder("o.ply"), "--method", "thermal_only", "--palette", "mauve");
  fails(2, /range/, "fuse", demo, inFolder("o.ply"), "--method", "thermal_only", "--range", "30:20");
  fails(2, /xyz|format|ply/i, "fuse", demo, inFolder("o.xyz"), "--method", "thermal_only");
  fails(2, /listen|address|port/i, "serve", "--listen", "127.0.0.1:99999");
  for (const option of ["--scale", "--colour-properties", "--colour-white", "--temperature-property", "--temperature-scale", "--temperature-offset", "--no-data"]) {
    fails(2, new RegExp(`${option}: it is empty`), "info", demo, option, "");
    if (option.includes("propert")) continue;
    fails(2, new RegExp(`${option}: 1,5 is no number; write it with a decimal point`), "info", demo, option, "1,5");
  }
});

test("a failed job is 1 and names the file", () => {
  fails(1, /missing\.ply/, "info", inFolder("missing.ply"));
  fails(1, /missing\.ply/, "serve", inFolder("missing.ply"), "--listen", "127.0.0.1:0");
  writeFileSync(inFolder("empty.ply"), "");
  fails(1, /empty\.ply/, "info", inFolder("empty.ply"));
  writeFileSync(inFolder("text.ply"), "this is no mesh\n");
  fails(1, /text\.ply/, "info", inFolder("text.ply"));
  writeFileSync(inFolder("cut.ply"), readFileSync(demo).subarray(0, 50_000));
  fails(1, /cut\.ply.*/, "info", inFolder("cut.ply"));
  writeFileSync(inFolder("huge.ply"), "ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\nproperty float y\nproperty float z\nend_header\n");
  fails(1, /huge\.ply/, "info", inFolder("huge.ply"));
  fails(1, /nowhere.*there is no folder/, "fuse", demo, inFolder("nowhere/out.ply"), "--method", "thermal_only");
  // Before any work is done: ten million vertices take a minute.
  const begun = Date.now();
  fails(1, /is a folder: name the file/, "demo-scene", folder, "--vertices", "10000000");
  fails(1, /there is no folder/, "demo-scene", inFolder("nowhere/demo.ply"), "--vertices", "10000000");
  fails(1, /is a folder: name the file/, "map", inFolder("frames"), (mkdirSync(inFolder("folder.ply")), inFolder("folder.ply")));
  assert.ok(Date.now() - begun < 30_000);
});

test("what would be lost is not overwritten, and what could not be written is said", () => {
  const before = readFileSync(demo);
  fails(2, /demo\.ply: the output is the input/, "fuse", demo, demo, "--method", "thermal_only");
  for (const option of [["--up", "y"], ["--scale", "0.001"], ["--temperature-unit", "kelvin"], ["--no-data", "0"], ["--colour-properties", "a"], ["--colour-white", "255"]]) {
    for (const source of [["--live"], ["--demo"], ["--demo-drive"], []]) {
      fails(2, new RegExp(`${option[0]}: it says something of a scene file, and there is none`), "serve", ...source, ...option);
    }
  }
  fails(2, /demo\.ply: the output is the input/, "fuse", inFolder("cut.ply"), demo, "--method", "thermal_only", "--thermal", demo);
  assert.ok(readFileSync(demo).equals(before));
  const full = openSync("/dev/full", "w");
  for (const args of [["info", demo], ["methods"], ["--help"]]) {
    const { status, stderr } = spawnSync(binary, args, { stdio: ["ignore", full, "pipe"], encoding: "utf8" });
    assert.equal(status, 1, args[0]);
    assert.match(stderr, /standard output/);
  }
  closeSync(full);
});

test("a file without temperatures is said to have none, and only such a one", () => {
  const points = (...celsius) => {
    const file = inFolder("celsius.ply");
    writeFileSync(file, `ply\nformat ascii 1.0\nelement vertex ${celsius.length}\nproperty float x\nproperty float y\nproperty float z\nproperty float temperature\nend_header\n${celsius.map((value, i) => `${i} 0 0 ${value}\n`).join("")}`);
    return file;
  };
  const said = (file, ...more) => {
    const { status, stderr } = spawnSync(binary, ["fuse", file, inFolder("o.ply"), "--method", "thermal_only", ...more], { encoding: "utf8" });
    assert.equal(status, 0, stderr);
    return stderr;
  };
  assert.doesNotMatch(said(points("inf", "inf")), /no temperatures/);
  assert.match(said(points("nan", "nan")), /no temperatures: the visible colours are written/);
  assert.match(said(points("nan", "nan"), "--missing", "#ff00ff"), /no temperatures: all is written in the colour for missing/);
});

test("a file may have any name", async () => {
  const name = Buffer.concat([Buffer.from(`${folder}/Geb`), Buffer.from([0xe4]), Buffer.from("ude.ply")]);
  copyFileSync(demo, name);
  // Node's own arguments are UTF-8; a shell passes the bytes on.
  const command = `exec "$0" "$@" "$(printf '%s/Geb\\344ude.ply' "${folder}")"`;
  const info = spawnSync("/bin/sh", ["-c", command, binary, "info", "--json"], { encoding: "utf8" });
  assert.equal(JSON.parse(info.stdout).name, "Geb\ufffdude.ply", info.stderr);
  const glb = spawnSync("/bin/sh", ["-c", `exec "$0" fuse "$(printf '%s/Geb\\344ude.ply' "${folder}")" "${folder}/named.glb" --method visible_only`, binary], { encoding: "utf8" });
  assert.equal(glb.status, 0, glb.stderr);
});

test("a port in use is 1 and names it", async () => {
  const taken = net.createServer();
  await new Promise((resolve) => taken.listen(0, "127.0.0.1", resolve));
  const { port } = taken.address();
  fails(1, new RegExp(`${port}`), "serve", "--demo", "--listen", `127.0.0.1:${port}`);
  taken.close();
});

test("fuse keeps order and number of the vertices, their positions, temperatures and faces", () => {
  const output = inFolder("fused.ply");
  run("fuse", demo, output, "--method", "thermal_only");
  const before = readPly(demo);
  const after_ = readPly(output);
  for (const column of ["x", "y", "z", "temperature", "triangles"]) assert.deepEqual(after_[column], before[column], column);
  assert.notDeepEqual(after_.red, before.red);
  run("fuse", demo, output, "--method", "visible_only");
  const visible = readPly(output);
  for (const column of ["red", "green", "blue"]) assert.deepEqual(visible[column], before[column], column);
});

test("fuse says that an option for Draco files has no effect on others", () => {
  for (const [ending, option, isSaid] of [["glb", "--lossless", true], ["ply", "--keep-order", true], ["ply", "--quiet", false]]) {
    const args = ["fuse", demo, inFolder(`option.${ending}`), "--method", "thermal_only", option];
    const { status, stderr } = spawnSync(binary, args, { encoding: "utf8" });
    assert.equal(status, 0, stderr);
    assert.equal(/no effect on .*option\./.test(stderr), isSaid, stderr);
  }
});

test("the exports of the server are the command line's", async () => {
  const server = await serve([demo]);
  try {
    for (const format of ["ply", "glb", "drc"]) {
      const output = inFolder(`export.${format}`);
      run("fuse", demo, output, "--method", "colour_mapped_threshold", "--set", "alpha=0.8", "--palette", "magma", "--range", "15:40");
      const answer = await fetch(`${server.url}/api/v1/scene.${format}?method=colour_mapped_threshold&alpha=0.8&palette=magma&range=15:40`);
      assert.equal(answer.status, 200);
      assert.ok(Buffer.from(await answer.arrayBuffer()).equals(readFileSync(output)), format);
    }
    for (const [option, query] of [["--keep-order", "keep_order=true"], ["--lossless", "lossless=true"]]) {
      const output = inFolder("kept.drc");
      run("fuse", demo, output, "--method", "thermal_only", option);
      const answer = await fetch(`${server.url}/api/v1/scene.drc?method=thermal_only&${query}`);
      assert.ok(Buffer.from(await answer.arrayBuffer()).equals(readFileSync(output)), query);
      assert.equal(answer.headers.get("spectra-note") === null, query === "lossless=true", "what was lost is said");
    }
    assert.match((await fetch(`${server.url}/api/v1/scene.drc?method=thermal_only`)).headers.get("spectra-note"), /rounded.*mm.*degC.*order/);
    const unclear = await fetch(`${server.url}/api/v1/scene.drc?method=thermal_only&lossless=1`);
    assert.equal(unclear.status, 400);
    assert.match(await unclear.text(), /lossless.*true or false/);
    const bad = await fetch(`${server.url}/api/v1/scene.ply?method=colour_mapped_threshold&alpha=7`);
    assert.equal(bad.status, 400);
    assert.match(await bad.text(), /alpha/);
  } finally {
    assert.equal(await server.stop(), 0, "SIGTERM ends with 0");
  }
});

const data = process.env.SPECTRA_TEST_DATA ?? "";
const scenes = existsSync(data) ? readdirSync(data).filter((name) => name.endsWith(".ply")) : [];
test("fuse runs every method on every real scene", { skip: scenes.length === 0 && "SPECTRA_TEST_DATA names no folder with scenes", timeout: 600_000 }, () => {
  const methods = JSON.parse(run("methods", "--json")).map(({ id }) => id);
  for (const name of scenes) {
    const facts = JSON.parse(run("info", path.join(data, name), "--json"));
    for (const method of methods) {
      const output = inFolder("real.ply");
      run("fuse", path.join(data, name), output, "--method", method);
      assert.match(readFileSync(output).subarray(0, 400).toString("latin1"), new RegExp(`element vertex ${facts.vertex_count}\n`), `${name} ${method}`);
    }
  }
});
