// Files as people of the field have them, and 300 damaged ones, through the built program.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { mkdtempSync, readFileSync, readdirSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import path from "node:path";
import { after, test } from "node:test";
import { fileURLToPath } from "node:url";
import { gunzipSync, gzipSync } from "node:zlib";
import { readPly } from "./ply.mjs";
import { binary, run, serve } from "./spectra_server.mjs";

const field = fileURLToPath(new URL("../../data/field", import.meta.url));
const folder = mkdtempSync(path.join(tmpdir(), "spectra-field-"));
after(() => rmSync(folder, { recursive: true }));
const inField = (name) => path.join(field, name);
const info = (name, ...options) => JSON.parse(run("info", inField(name), "--json", ...options));
const note = (facts, id) => facts.notes.find((candidate) => candidate.id === id);
const isUsual = ({ temperature }) => Math.abs(temperature.min - 18) < 0.2 && Math.abs(temperature.max - 32.517) < 0.01;

/** How many vertices and faces the header of a file promises. */
function promised(name) {
  const bytes = readFileSync(inField(name));
  const header = (name.endsWith(".gz") ? gunzipSync(bytes) : bytes).toString("latin1").split("end_header")[0];
  return ["vertex", "face"].map((element) => Number(new RegExp(`^\\s*element\\s+${element}\\s+(\\d+)`, "m").exec(header)?.[1] ?? 0));
}

test("nothing is left out but what has no position or is no triangle", () => {
  const REFUSED = ["16-comma-decimals.ply", "24b-one-bad-index.ply", "31-cut-short.ply", "32-two-lines-a-vertex.ply"];
  const OTHERS = {
    "01-nan-positions.ply": [142, 0],
    "01b-nan-positions-mesh.ply": [142, 233],
    "22-triangle-strips.ply": [144, 242],
    "24a-broken-faces.ply": [144, 242],
    "42d-thermal-nan-positions.ply": [136, 0],
  };
  const names = readdirSync(field).filter((name) => !REFUSED.includes(name));
  assert.ok(names.length >= 55, `${names.length} files`);
  for (const name of names) {
    const facts = info(name);
    assert.deepEqual([facts.vertex_count, facts.triangle_count], OTHERS[name] ?? promised(name), name);
    assert.equal(note(facts, "hole_vertices"), undefined, name);
  }
});

test("the options of reading are there on the command line", () => {
  assert.ok(isUsual(info("06-kelvin.ply", "--temperature-unit", "kelvin")));
  assert.ok(isUsual(info("07-centikelvin-ushort.ply", "--temperature-unit", "centikelvin")));
  assert.ok(isUsual(info("07-centikelvin-ushort.ply", "--temperature-scale", "0.01", "--temperature-offset", "-273.15")));
  assert.ok(isUsual(info("08d-field-name.ply", "--temperature-property", "quality")));
  const scaled = info("03-colours-16-bit.ply", "--colour-properties", "blue,green,red", "--colour-white", "60000");
  assert.equal(note(scaled, "colour_properties").message, "The colours are taken from the properties blue, green, red");
  assert.match(note(scaled, "converted_colours").message, /taken as 0 to 60000$/);
  const none = info("05-no-data-minus-9999.ply", "--no-data", "-9999", "--no-data", "20");
  assert.equal(note(none, "no_data_temperatures").count, 48);
  assert.ok(Math.abs(info("19-millimetres.ply", "--scale", "0.001").size_m[0] - 3) < 1e-5);
  assert.ok(Math.abs(info("19-millimetres.ply").size_m[0] - 3000) < 1e-2);
  for (const [written, up] of [["Y", "y"], ["+y", "y"], ["-Z", "-z"], ["+X", "x"]]) {
    assert.equal(info("19-millimetres.ply", "--up", written).up, up, written);
  }
  for (const command of ["serve", "fuse", "info", "tradeoff"]) {
    const help = run(command, "--help");
    for (const option of ["colour-properties", "colour-white", "temperature-property", "temperature-unit", "temperature-scale", "temperature-offset", "no-data", "scale"]) {
      assert.match(help, new RegExp(`--${option}`), `${command} --${option}`);
    }
  }
});

test("options that cannot be meant are wrong usage, and name themselves", () => {
  for (const [options, pattern] of [
    [["--temperature-unit", "rankine"], /rankine/],
    [["--temperature-scale", "0"], /temperature-scale/],
    [["--temperature-unit", "kelvin", "--temperature-offset", "1"], /temperature-/],
    [["--no-data", "nan"], /no-data/],
    [["--scale", "-1"], /scale/],
    [["--colour-properties", "a,b"], /colour-properties/],
    [["--colour-white", "0"], /colour-white/],
  ]) {
    const { status, stderr } = spawnSync(binary, ["info", inField("06-kelvin.ply"), ...options], { encoding: "utf8" });
    assert.equal(status, 2, options.join(" "));
    assert.match(stderr, pattern);
  }
  const missing = spawnSync(binary, ["info", inField("06-kelvin.ply"), "--temperature-property", "heat"], { encoding: "utf8" });
  assert.equal(missing.status, 1);
  assert.match(missing.stderr, /'heat'/);
});

test("fuse writes the vertices of the input in their order, those without a position too", async () => {
  const output = path.join(folder, "fused.ply");
  const lines = readFileSync(inField("01b-nan-positions-mesh.ply"), "latin1").split("end_header\n")[1].split("\n").slice(0, 144);
  const input = lines.map((line) => line.split(" ").map(Number));
  run("fuse", inField("01b-nan-positions-mesh.ply"), output, "--method", "thermal_only");
  const fused = readPly(output);
  assert.equal(fused.vertexCount, 144);
  assert.equal(fused.triangles.length, 3 * 233);
  let holes = 0;
  for (let v = 0; v < 144; ++v) {
    assert.ok(Object.is(fused.x[v], Math.fround(input[v][0])), `x of ${v}`);
    if (!Number.isNaN(input[v][0])) continue;
    ++holes;
    assert.deepEqual([fused.red[v], fused.green[v], fused.blue[v]], input[v].slice(3, 6));
    assert.ok(!fused.triangles.includes(v));
  }
  assert.equal(holes, 2);
  const server = await serve([inField("01b-nan-positions-mesh.ply")]);
  try {
    const answer = await fetch(`${server.url}/api/v1/scene.ply?method=thermal_only`);
    assert.ok(Buffer.from(await answer.arrayBuffer()).equals(readFileSync(output)), "the export is the same");
  } finally {
    await server.stop();
  }
});

test("fuse takes the options of reading", () => {
  const celsius = path.join(folder, "celsius.ply");
  const kelvin = path.join(folder, "kelvin.ply");
  run("fuse", inField("06-kelvin.ply"), kelvin, "--method", "thermal_only", "--temperature-unit", "kelvin");
  run("fuse", inField("11-triangle-soup.ply"), celsius, "--method", "thermal_only");
  assert.ok(Math.abs(readPly(kelvin).temperature[0] - 18) < 1e-4);
  assert.ok(Math.abs(readPly(celsius).temperature[0] - 18) < 1e-4);
});

/** Numbers from 0 to 1, the same in every run. */
function generator(seed) {
  return () => {
    seed = (seed + 0x6d2b79f5) | 0;
    let t = Math.imul(seed ^ (seed >>> 15), 1 | seed);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  };
}

const TOKENS = ["nan", "-1", "999999999999", "1e308", "-1e39", "inf", "1.#IND", "0,5", "\n", "\r", "\0", "end_header\n", "element face 4000000000\n",
  "element vertex 99999999\n", "property list uint int64 vertex_indices\n", "property float temperature\n", "4294967295", " ", "\x1f\x8b",
  "comment up -y; units: mm\n", "6 0 1 2 14 13 12\n", "5 0 13 1 12 14\n", "property list uchar int corners\n", "property uchar red\n"];

const VALUES = ["nan", "-nan(ind)", "inf", "-inf", "0", "-1", "1", "7", "143", "255", "65535", "1e39", "-1e39", "1e300", "-273.15", "-9999", "1.5D+01", "0.5", "float"];

function mutated(bytes, others, random) {
  const at = (length) => Math.floor(random() * length);
  let result = Buffer.from(bytes);
  // Some of the changes go into the header, which is a small part of the file.
  const place = () => (random() < 0.2 ? at(Math.min(400, result.length)) : at(result.length));
  for (let change = 1 + at(2); change > 0 && result.length > 0; --change) {
    const from = place();
    const length = Math.min(1 + at(60), result.length - from);
    switch (at(9)) {
      case 0:
        result[from] = at(256);
        break;
      case 1:
        result = Buffer.concat([result.subarray(0, from), result.subarray(from + length)]);
        break;
      case 2:
        result = Buffer.concat([result.subarray(0, from + length), result.subarray(from)]);
        break;
      case 3:
        result = Buffer.concat([result.subarray(0, from), Buffer.from(TOKENS[at(TOKENS.length)], "latin1"), result.subarray(from)]);
        break;
      case 4:
        result = result.subarray(0, from);
        break;
      case 5:
        result = Buffer.concat([result.subarray(0, from), others[at(others.length)].subarray(at(300))]);
        break;
      default: {
        // A value in the place of another.
        const begin = result.indexOf(" ", from) + 1;
        const end = result.indexOf(" ", begin);
        if (begin === 0 || end < 0) break;
        result = Buffer.concat([result.subarray(0, begin), Buffer.from(VALUES[at(VALUES.length)]), result.subarray(end)]);
      }
    }
  }
  return result;
}

test("300 damaged files: exit 0, 1 or 2 within 2 s of the processor and 1 GB", { timeout: 600_000 }, () => {
  const random = generator(20261128);
  const files = readdirSync(field).sort().map((name) => readFileSync(inField(name)));
  assert.ok(files.length >= 70);
  const damaged = path.join(folder, "damaged.ply");
  const outputs = ["out.ply", "out.glb", "out.drc"].map((name) => path.join(folder, name));
  const uses = [
    ["fuse", damaged, outputs[0], "--method", "histogram_bin"],
    ["fuse", damaged, outputs[1], "--method", "thermal_only", "--scale", "1e16", "--up", "auto"],
    ["fuse", damaged, outputs[2], "--method", "thermal_only", "--scale", "1e-16"],
    ["fuse", damaged, outputs[2], "--method", "thermal_only", "--keep-order"],
    ["fuse", damaged, outputs[0], "--method", "thermal_only", "--thermal", inField("42-thermal-other-order.ply")],
    ["fuse", inField("42-visible.ply"), outputs[0], "--method", "thermal_only", "--thermal", damaged],
  ];
  const counts = { 0: 0, 1: 0, 2: 0 };
  for (let i = 0; i < 300; ++i) {
    const bytes = mutated(files[i % files.length], files, random);
    writeFileSync(damaged, i % 10 === 9 ? gzipSync(bytes) : bytes);
    for (const args of [["info", damaged, "--json"], uses[i % uses.length]]) {
      const { status, signal, stderr } = spawnSync("bash", ["-c", 'ulimit -t 2 -v 1048576; exec "$@"', "limited", binary, ...args], { encoding: "utf8" });
      assert.ok(status === 0 || status === 1 || status === 2, `mutation ${i}: ${args[0]}: exit ${status}, signal ${signal}: ${stderr}`);
      if (status !== 0) assert.match(stderr.trim(), /^spectra: .+$/m, `mutation ${i}`);
      ++counts[status];
    }
  }
  assert.ok(counts[0] > 50 && counts[1] > 50, `some are read and some refused: ${JSON.stringify(counts)}`);
});
