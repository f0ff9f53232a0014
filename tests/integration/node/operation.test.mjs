// What whoever runs a server is told: its log as text and as JSON, on standard error and in a file; what it counts, and the dashboard of it.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import path from "node:path";
import { after, test } from "node:test";
import { SpectraClient } from "./spectra_client.mjs";
import { binary, serve } from "./spectra_server.mjs";

const scratch = mkdtempSync(path.join(tmpdir(), "spectra-operation-"));
after(() => rmSync(scratch, { recursive: true, force: true }));
const lines = (text) => text.split("\n").filter((line) => line !== "");

test("each line of a JSON log is an object, whatever is in it", async () => {
  const server = await serve(["--live", "--log-format", "json", "--log-level", "debug"]);
  const refused = await fetch(`${server.url}/api/v1/session`, { method: "POST", body: '{"token":"x"}' });
  assert.equal(refused.status, 409);
  assert.equal(await server.stop(), 0);
  const said = lines(server.errors()).map((line) => JSON.parse(line));
  assert.ok(said.length >= 2);
  for (const { time, level, message, ...rest } of said) {
    assert.match(time, /^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z$/);
    assert.ok(Math.abs(Date.parse(time) - Date.now()) < 120_000, time);
    assert.ok(["debug", "info", "warning", "error"].includes(level), level);
    assert.ok(message.length > 0);
    assert.deepEqual(rest, {});
  }
  assert.ok(said.some(({ level, message }) => level === "info" && message.includes("serving the live map")));
  assert.ok(said.some(({ message }) => message.includes("is not let in: 409")));
});

test("what is less than asked for is left out", async () => {
  const server = await serve(["--live", "--log-level", "error"]);
  assert.equal(await server.stop(), 0);
  assert.equal(server.errors(), "");
});

test("whoever reads the log may go: the server stays, and ends when it is told to", async () => {
  const server = await serve(["--live", "--log-level", "debug"]);
  server.process.stderr.destroy();
  server.process.stdout.destroy();
  for (let i = 0; i < 3; i += 1) {
    const refused = await fetch(`${server.url}/api/v1/session`, { method: "POST", body: '{"token":"x"}' }); // Says so in the log.
    assert.equal(refused.status, 409);
  }
  assert.equal((await fetch(`${server.url}/healthz`)).status, 200);
  await server.stop();
  assert.equal(server.process.signalCode, null);
});

test("a file takes the log, and goes on where it ended", async () => {
  const file = path.join(scratch, "spectra.log");
  for (let run = 1; run <= 2; run += 1) {
    const server = await serve(["--live", "--log-file", file]);
    assert.equal(await server.stop(), 0);
    assert.equal(server.errors(), "");
    const said = lines(readFileSync(file, "utf8")).filter((line) => line.includes("serving the live map"));
    assert.equal(said.length, run);
    assert.match(said[0], /^\d{4}-\d\d-\d\d \d\d:\d\d:\d\d\.\d{3} info serving the live map/);
  }
});

test("the dashboard asks for what the server counts, and viewers are counted by role", async () => {
  const server = await serve(["--demo"]);
  const viewer = await SpectraClient.connect(server.url);
  const complete = viewer.notification("stream.complete", 30_000);
  await viewer.request("scene.subscribe", { channels: ["fused"] });
  await complete;
  const text = await (await fetch(`${server.url}/metrics`)).text();
  const value = (line) => Number(new RegExp(`^${line.replace(/[{}+]/g, "\\$&")} (\\S+)$`, "m").exec(text)?.[1]);
  // On loopback without tokens everybody is an admin.
  assert.equal(value('spectra_role_viewers{role="admin"}'), 1);
  assert.equal(value('spectra_role_viewers{role="viewer"}'), 0);
  assert.equal(value('spectra_role_frames_sent_total{role="admin"}'), value("spectra_frames_sent_total"));
  assert.ok(value('spectra_role_frame_bytes_sent_total{role="admin"}') > 100_000);
  for (const what of ["geometry", "fusing", "colours"]) {
    const count = value(`spectra_encoding_seconds_count{what="${what}"}`);
    assert.ok(count > 0, `${what}: ${count}`);
    assert.equal(value(`spectra_encoding_seconds_bucket{what="${what}",le="+Inf"}`), count);
    assert.ok(value(`spectra_encoding_seconds_sum{what="${what}"}`) > 0);
  }
  const dashboard = readFileSync(new URL("../../../deploy/grafana/spectra.json", import.meta.url), "utf8");
  const names = new Set(dashboard.match(/\b(spectra|process)_[a-z_]+/g));
  assert.ok(names.size > 20);
  for (const name of names) assert.match(text, new RegExp(`^${name}[ {]`, "m"), name);
  viewer.close();
  await viewer.closed;
  const after = () => fetch(`${server.url}/metrics`).then((response) => response.text());
  while (!/^spectra_role_viewers\{role="admin"\} 0$/m.test(await after())) await new Promise((resolve) => setTimeout(resolve, 20));
  assert.match(await after(), /^spectra_role_queued_bytes\{role="admin"\} 0$/m);
  assert.equal(await server.stop(), 0);
});

test("a log that cannot be is said before anything is served", () => {
  const start = (...args) => spawnSync(binary, ["serve", "--live", "--listen", "127.0.0.1:0", ...args], { encoding: "utf8", timeout: 10_000 });
  const nowhere = start("--log-file", "/proc/none/x.log");
  assert.equal(nowhere.status, 1);
  assert.match(nowhere.stderr, /x\.log cannot be written: /);
  assert.equal(start("--log-format", "xml").status, 2);
  assert.equal(start("--log-level", "loud").status, 2);
});
