// A command that is stopped, or that has no room to write, leaves its folder as it found it: no half of a file, neither
// under the name that was asked for nor under another. A file that was there before stays.
import assert from "node:assert/strict";
import { spawn, spawnSync } from "node:child_process";
import { existsSync, mkdirSync, mkdtempSync, readFileSync, readdirSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import path from "node:path";
import { after, test } from "node:test";
import { setTimeout as sleep } from "node:timers/promises";
import { binary, run } from "./spectra_server.mjs";

const folder = mkdtempSync(path.join(tmpdir(), "spectra-interruption-"));
after(() => rmSync(folder, { recursive: true }));
const scene = path.join(folder, "scene.ply");
run("demo-scene", scene, "--vertices", "300000");
const kOld = "what was there before";

/** Runs a command, sends it `signal` as soon as `moment` resolves, and returns how it ended. */
async function stopped(args, signal, moment) {
  const child = spawn(binary, args, { stdio: ["ignore", "ignore", "pipe"] });
  let errors = "";
  child.stderr.on("data", (chunk) => {
    errors += chunk;
  });
  const ended = new Promise((resolve) => child.once("close", (status, killed_by) => resolve({ status, killed_by })));
  await Promise.race([moment(), ended]);
  child.kill(signal);
  return { ...(await ended), errors };
}

/** Resolves when something beside `known` is in a folder, looked at without rest. */
async function somethingIn(where, known) {
  while (!existsSync(where) || readdirSync(where).length <= known) await new Promise(setImmediate);
}

function emptyFolder(name) {
  const where = path.join(folder, name);
  rmSync(where, { recursive: true, force: true });
  mkdirSync(where);
  return where;
}

for (const ending of ["ply", "glb", "drc"]) {
  test(`fuse to .${ending}, stopped at any moment`, { timeout: 120_000 }, async () => {
    const where = emptyFolder(ending);
    const output = path.join(where, `out.${ending}`);
    const args = ["fuse", scene, output, "--method", "thermal_only"];
    const begin = performance.now();
    run(...args);
    const whole_ms = performance.now() - begin;
    const complete = readFileSync(output);
    writeFileSync(output, kOld);
    let stopped_while_writing = 0;
    for (let i = 0; i < 10; ++i) {
      const signal = ["SIGINT", "SIGTERM", "SIGHUP"][i % 3];
      // Every other time in the midst of writing: while the file of another name is there.
      const moment = i % 2 === 0 ? () => somethingIn(where, 1).then(() => sleep((i * whole_ms) / 40)) : () => sleep((i * whole_ms) / 10);
      const { status, killed_by, errors } = await stopped(args, signal, moment);
      assert.deepEqual(readdirSync(where), [`out.${ending}`], `${signal}: ${errors}`);
      // Whole when it was quicker than the signal, which may come between the renaming and the end.
      const isOld = readFileSync(output).equals(Buffer.from(kOld));
      assert.ok(isOld || readFileSync(output).equals(complete), `${signal}: half a file`);
      if (killed_by === null) {
        assert.equal(status, 0, errors);
        assert.ok(!isOld);
      } else {
        assert.equal(killed_by, signal, "as the shell expects: 128 and the signal's number");
        stopped_while_writing += i % 2 === 0 && isOld ? 1 : 0;
      }
      writeFileSync(output, kOld);
    }
    assert.ok(stopped_while_writing > 0, "some were stopped while they wrote");
  });

  test(`fuse to .${ending} without room to write`, () => {
    const where = emptyFolder(ending);
    const output = path.join(where, `out.${ending}`);
    writeFileSync(output, kOld);
    // A limit on the size of files stands for the full disk: the write fails in the middle.
    const command = 'ulimit -f 64; exec "$0" "$@"';
    const { status, stderr } = spawnSync("bash", ["-c", command, binary, "fuse", scene, output, "--method", "thermal_only"], { encoding: "utf8" });
    assert.equal(status, 1, stderr);
    assert.match(stderr, new RegExp(`^spectra: .*out\\.${ending} cannot be written: .*\n$`));
    assert.deepEqual(readdirSync(where), [`out.${ending}`]);
    assert.equal(readFileSync(output, "utf8"), kOld);
  });
}

test("demo-scene, stopped while it writes", async () => {
  const where = emptyFolder("demo");
  const args = ["demo-scene", path.join(where, "out.ply"), "--vertices", "300000"];
  const { killed_by } = await stopped(args, "SIGINT", () => somethingIn(where, 0));
  const left = readdirSync(where);
  assert.deepEqual(left, left.length === 0 && killed_by === "SIGINT" ? [] : ["out.ply"]);
});

test("tradeoff, stopped at any moment or without room, leaves all tables or none", { timeout: 120_000 }, async () => {
  const small = path.join(folder, "small.ply");
  run("demo-scene", small, "--vertices", "5000");
  const where = path.join(folder, "tradeoff");
  const args = ["tradeoff", small, "--out", where];
  const kFiles = ["colours.csv", "geometry.csv", "grid.csv", "raw.csv", "report.html"];
  run(...args);
  assert.deepEqual(readdirSync(where).sort(), kFiles);
  rmSync(where, { recursive: true });
  for (const moment of [() => sleep(300), () => somethingIn(folder, 2), () => somethingIn(where, 0)]) {
    const { killed_by, status, errors } = await stopped(args, "SIGINT", moment);
    assert.ok(killed_by === "SIGINT" || status === 0, errors);
    const left = existsSync(where) ? readdirSync(where).sort() : [];
    if (left.length > 0) assert.deepEqual(left, kFiles);
    rmSync(where, { recursive: true, force: true });
  }
  const { status } = spawnSync("bash", ["-c", 'ulimit -f 8; exec "$0" "$@"', binary, ...args]);
  assert.equal(status, 1);
  assert.ok(!existsSync(where), "nor the folder that it made");
});

test("an ignored signal stays ignored, as for a command under nohup", async () => {
  const where = emptyFolder("nohup");
  const output = path.join(where, "out.glb");
  const child = spawn("bash", ["-c", 'trap "" HUP INT; exec "$0" "$@"', binary, "fuse", scene, output, "--method", "thermal_only"]);
  const ended = new Promise((resolve) => child.once("close", (status) => resolve(status)));
  await somethingIn(where, 0);
  child.kill("SIGHUP");
  child.kill("SIGINT");
  assert.equal(await ended, 0);
  assert.deepEqual(readdirSync(where), ["out.glb"]);
});
