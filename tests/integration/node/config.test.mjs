// The config file of serve: what is in it holds, what cannot be meant is refused with file, line and key, by check-config and by serve alike;
// every line of the sample file is good.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import path from "node:path";
import { after, test } from "node:test";
import { fileURLToPath } from "node:url";
import { binary, run, serve } from "./spectra_server.mjs";

const folder = mkdtempSync(path.join(tmpdir(), "spectra-config-"));
after(() => rmSync(folder, { recursive: true, force: true }));
const at = (name) => path.join(folder, name);
const sample = readFileSync(fileURLToPath(new URL("../../../deploy/spectra.toml", import.meta.url)), "utf8");

function spectra(...args) {
  const { status, stdout, stderr } = spawnSync(binary, args, { encoding: "utf8", timeout: 30_000 });
  return { status, stdout, stderr };
}
function config(text) {
  const file = at("spectra.toml");
  writeFileSync(file, text);
  return file;
}
function oneLine(text) {
  assert.equal(text.trim().split("\n").length, 1, text);
  return text;
}

test("a good file is said in one line, and what it says holds", async () => {
  run("demo-scene", at("demo.ply"), "--vertices", "8000");
  const file = config(`# a comment\n[serve]\nscene = "${at("demo.ply")}"\nlisten = "127.0.0.1:0"\nthreads = 1\nup = "z"\n` +
    'no-data = [-9999, 1e9]\nallow-host = ["a.example"]\ninsecure = false\nquiet = true\n');
  const { status, stdout, stderr } = spectra("check-config", file);
  assert.deepEqual([status, stderr], [0, ""]);
  assert.match(oneLine(stdout), /is good: .*demo\.ply on 127\.0\.0\.1:0/);

  const server = await serve(["--config", file]);
  const scene = await (await fetch(`${server.url}/api/v1/scene`)).json();
  assert.equal(scene.name, "demo.ply");
  // A service is told to read again what may change; without anything to read that is no reason to end.
  server.process.kill("SIGHUP");
  await new Promise((resolve) => setTimeout(resolve, 100));
  assert.equal((await fetch(`${server.url}/readyz`)).status, 200);
  assert.equal(await server.stop(), 0);
});

test("the command line goes before the file", async () => {
  const server = await serve(["--listen", "127.0.0.1:0", "--config", config('[serve]\nlisten = "127.0.0.1:1"\ndemo = true\n')], {
    ready: false,
  });
  assert.doesNotMatch(server.url, /:1$/);
  await server.stop();
});

const wrong = [
  ["an unknown key", 2, /spectra\.toml, line 3: serve has no option "threds"/, "[serve]\nlive = true\nthreds = 3\n"],
  ["a key that is no setting", 2, /line 2: serve has no option "config"/, '[serve]\nconfig = "x"\n'],
  ["an unknown section", 2, /line 1: there is no section \[serv\]/, "[serv]\nlive = true\n"],
  ["a key outside a section", 2, /line 1: "listen" stands outside \[serve\]/, 'listen = "127.0.0.1:0"\n'],
  ["what is no TOML", 2, /line 2: .*expected/, "[serve]\nlisten = 127.0.0.1:8080\n"],
  ["a key twice", 2, /line 3: .*threads/, "[serve]\nthreads = 1\nthreads = 2\n"],
  ["a number out of range", 2, /line 2: --threads: Value 3000/, "[serve]\nthreads = 3000\n"],
  ["a word for a number", 2, /line 2: .*--scale/, '[serve]\nscale = "wide"\n'],
  ["a number for a flag", 2, /line 2: live: true or false is wanted/, "[serve]\nlive = 1\n"],
  ["a flag for a value", 2, /line 2: store: a value is wanted/, "[serve]\nstore = true\n"],
  ["a list for one value", 2, /line 2: listen: one value is wanted/, '[serve]\nlisten = ["a", "b"]\n'],
  ["an unknown direction", 2, /line 2: --up w: x, y, z/, '[serve]\nup = "w"\n'],
  ["a certificate without a key", 2, /--certificate requires --key/, '[serve]\ncertificate = "x.pem"\n'],
  ["live and scene", 2, /scene excludes --live|--live excludes scene/, '[serve]\nscene = "x.ply"\nlive = true\n'],
  ["no address", 2, /--listen 8080: ADDRESS:PORT is wanted/, '[serve]\nlisten = "8080"\n'],
  ["strangers without tokens", 2, /--listen 0\.0\.0\.0:0 lets others in/, '[serve]\nlisten = "0.0.0.0:0"\n'],
  ["a scene that is missing", 1, /missing\.ply: cannot be opened/, `[serve]\nscene = "${at("missing.ply")}"\n`],
  ["tokens that are missing", 1, /no_tokens: No such file/, `[serve]\ntokens = "${at("no_tokens")}"\n`],
  ["a certificate that is missing", 1, /c\.pem: cannot be opened/, `[serve]\ncertificate = "${at("c.pem")}"\nkey = "${at("c.key")}"\n`],
  ["a web client that is missing", 1, /there is no index\.html in it/, `[serve]\nweb = "${folder}"\n`],
  ["a folder that is missing", 1, /map\.store: there is no folder/, `[serve]\nlive = true\nstore = "${at("nowhere/map.store")}"\n`],
];
for (const [what, status, message, text] of wrong) {
  test(`refused: ${what}`, () => {
    const file = config(text);
    for (const args of [["check-config", file], ["serve", "--config", file]]) {
      const result = spectra(...args);
      assert.equal(result.status, status, result.stderr);
      assert.match(oneLine(result.stderr), message);
      assert.equal(result.stdout, "");
    }
  });
}

test("a file that is not there is refused", () => {
  for (const args of [["check-config", at("none.toml")], ["serve", "--config", at("none.toml")]]) {
    const { status, stderr } = spectra(...args);
    assert.equal(status, 1);
    assert.match(oneLine(stderr), /none\.toml/);
  }
});

test("every option of serve is in the sample, and every line of the sample is good", () => {
  const options = new Set(
    [...spectra("serve", "--help").stdout.matchAll(/^ {2}(?:-\w,)?--([a-z-]+)/gm)].map((match) => match[1]));
  options.add("scene");
  for (const own of ["help", "help-all"]) options.delete(own);
  assert.ok(options.size > 20, [...options].join());
  const settings = new Map([...sample.matchAll(/^#?([a-z-]+) = (.*)$/gm)].map((match) => [match[1], match[2]]));
  assert.deepEqual([...settings.keys()].sort(), [...options].sort(), "deploy/spectra.toml and spectra serve --help");

  // What the sample names, here.
  mkdirSync(at("web"));
  writeFileSync(at("web/index.html"), "");
  run("token", "--file", at("tokens"), "--role", "viewer");
  run("certificate", at("certificate.pem"), at("certificate.key"), "--name", "localhost");
  run("demo-scene", at("map.ply"), "--vertices", "8000");
  writeFileSync(at("map_thermal.ply"), "");
  writeFileSync(at("map.store"), "");
  const here = (value) => value.replace(/"\/(?:[\w.]+\/)*([\w.]+)"/, (_, name) => `"${at(name)}"`);
  const ofAScene = ["colour-properties", "colour-white", "temperature-property", "temperature-unit", "temperature-scale", "temperature-offset", "no-data", "scale", "up"];
  const needed = {
    ...Object.fromEntries(ofAScene.map((name) => [name, ["scene"]])), thermal: ["scene"], history: ["store"], at: ["store"], invite: ["tokens"], certificate: ["key"], key: ["certificate"], track: ["map"], submaps: ["map"] };
  for (const key of settings.keys()) {
    const lines = [...(needed[key] ?? []), key].map((name) => `${name} = ${here(settings.get(name))}\n`);
    const { status, stderr } = spectra("check-config", config(`[serve]\n${lines.join("")}`));
    assert.equal(status, 0, `${key}: ${stderr}`);
  }
  const active = sample.replace(/^store = .*$/m, `store = "${at("map.store")}"`);
  assert.match(spectra("check-config", config(active)).stdout, /is good: a live map on 127\.0\.0\.1:8080/);
});
