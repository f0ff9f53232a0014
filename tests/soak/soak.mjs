// A server for a long time among clients of every kind:
//   node tests/soak/soak.mjs [--minutes 30] [--rate 2] [--cut 10]
// - a live map with a store and tokens, into which a mapper puts blocks (ingest.mjs);
// - 8 viewers who are well behind an emulated radio link of 20 Mbit/s and 60 ms with 10 ms of jitter, shared by all, that is cut for
//   10 s in the middle of the time; each changes a setting every 2 s and waits for the whole picture of it;
// - 2 viewers who stop reading, and begin anew as they are cut;
// - 1 hostile client (hostile.mjs), every attack in turn, half of them with a viewer's token.
// Prints a line every minute, and at the end memory, percentiles of latency, how soon pictures are current after the cut, and every error. The
// status is 1 when memory has grown by more than 1 % from the second sixth of the time to the last, or a viewer had an error beside the cut.
import { spawn } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import net from "node:net";
import { tmpdir } from "node:os";
import path from "node:path";
import { fileURLToPath } from "node:url";
import { parseArgs } from "node:util";
import { linkProxy } from "../integration/node/link_proxy.mjs";
import { run, serve } from "../integration/node/spectra_server.mjs";
import { HealthyViewer, percentile } from "./healthy_viewer.mjs";

const { values } = parseArgs({
  options: {
    minutes: { type: "string", default: "30" },
    rate: { type: "string", default: "2" },
    cut: { type: "string", default: "10" },
  },
});
const seconds = 60 * Number(values.minutes);
const sleep = (ms) => new Promise((resolve) => setTimeout(resolve, ms));
const folder = mkdtempSync(path.join(tmpdir(), "spectra-soak-"));
const tokens = path.join(folder, "tokens");
const token = (role) => run("token", "--file", tokens, "--role", role).trim().split(/\s+/).pop();
const [operator, viewer, ingest] = ["operator", "viewer", "ingest"].map(token);
const server = await serve(["--live", "--store", path.join(folder, "map.store"), "--history", "16MB", "--tokens", tokens, "--limit", "cache-bytes=32MB"], {
  ready: false,
});
const resident_mb = () => Number(/VmRSS:\s+(\d+)/.exec(readFileSync(`/proc/${server.process.pid}/status`, "utf8"))[1]) / 1024;
const descriptors = async () => (await metrics()).process_open_fds;
async function metrics() {
  const text = await (await fetch(`${server.url}/metrics`, { headers: { Authorization: `Bearer ${operator}` } })).text();
  return Object.fromEntries([...text.matchAll(/^(\w+) ([\d.e+-]+)$/gm)].map(([, name, value]) => [name, Number(value)]));
}

const here = (name) => fileURLToPath(new URL(name, import.meta.url));
function helper(...args) {
  const child = spawn(process.execPath, args, { stdio: ["ignore", "pipe", "inherit"] });
  const one = { said: "", stop: () => child.kill("SIGTERM"), gone: null };
  child.stdout.on("data", (chunk) => (one.said += chunk));
  one.gone = new Promise((resolve) => child.once("exit", resolve));
  return one;
}
const mapper = helper(here("ingest.mjs"), server.url, values.rate, ingest);
while ((await fetch(`${server.url}/readyz`)).status !== 200) await sleep(200);
await sleep(3000);

const link = await linkProxy(server.url, { rate_bytes_per_s: 20e6 / 8, delay_ms: 30, jitter_ms: 10, queue_bytes: 65_536 });
const viewers = await Promise.all(
  Array.from({ length: 8 }, (_, i) => HealthyViewer.start(link.url, { seed: i, interval_ms: 2000, token: operator })),
);

let isOver = false;
let stalls = 0;
/** Reads nothing from the beginning of the picture on; comes back when it is cut. */
async function stalledViewer() {
  const { hostname, port, host } = new URL(server.url);
  const frame = Buffer.from(JSON.stringify({ jsonrpc: "2.0", id: 1, method: "scene.subscribe", params: { channels: ["fused"] } }));
  while (!isOver) {
    const socket = net.connect({ host: hostname, port: Number(port) });
    const ended = new Promise((resolve) => socket.once("close", resolve));
    socket.on("error", () => {});
    socket.write(
      `GET /ws HTTP/1.1\r\nHost: ${host}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n` +
        `Authorization: Bearer ${viewer}\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Protocol: spectra.v1\r\n\r\n`,
    );
    await sleep(500);
    socket.write(Buffer.concat([Buffer.from([0x81, 0x80 | frame.length, 0, 0, 0, 0]), frame]));
    socket.pause();
    // Paused it does not see its end.
    for (let i = 0; i < 40 && !isOver; i += 1) await sleep(500);
    stalls += 1;
    socket.destroy();
    await ended;
  }
}
const stalled = [stalledViewer(), stalledViewer()];
const hostile = helper(here("hostile.mjs"), server.url, "all", String(seconds - 5), viewer);

const begin = performance.now();
const passed_s = () => (performance.now() - begin) / 1000;
const samples = []; // [seconds, MB]
const cutAt_s = Number(values.cut) > 0 ? seconds / 2 : Infinity;
let cut = null;
let expected = 0; // errors that the cut explains
let nextLine_s = 60;
while (passed_s() < seconds) {
  samples.push([passed_s(), resident_mb()]);
  if (passed_s() >= cutAt_s && cut === null) {
    const before = viewers.map(({ errors }) => errors.length);
    link.stall(1000 * Number(values.cut));
    cut = sleep(1000 * Number(values.cut)).then(async () => {
      const back = performance.now();
      const pictures = viewers.map(({ latencies_ms }) => latencies_ms.length);
      while (viewers.some(({ latencies_ms }, i) => latencies_ms.length === pictures[i]) && performance.now() - back < 60_000) await sleep(20);
      expected = viewers.reduce((sum, { errors }, i) => sum + errors.length - before[i], 0);
      return (performance.now() - back) / 1000;
    });
  }
  if (passed_s() >= nextLine_s) {
    nextLine_s += 60;
    const times = viewers.flatMap(({ latencies_ms }) => latencies_ms.slice(-30));
    console.log(
      `${(passed_s() / 60).toFixed(0)} min: ${resident_mb().toFixed(1)} MB, ${await descriptors()} descriptors, latest pictures after ${percentile(times, 0.5).toFixed(0)} ms (median), ` +
        `${percentile(times, 0.99).toFixed(0)} ms (99 %), ${viewers.flatMap(({ errors }) => errors).length} errors`,
    );
  }
  await sleep(1000);
}
const current_s = await cut;
isOver = true;
mapper.stop();
await Promise.all([mapper.gone, hostile.gone, ...stalled]);
const [all, errors, reconnects] = [viewers.flatMap(({ latencies_ms }) => latencies_ms), viewers.flatMap((v) => v.errors), viewers.reduce((sum, v) => sum + v.reconnects, 0)];
const last = await metrics();
await Promise.all(viewers.map((one) => one.stop()));
await link.close();
const stopping = performance.now();
const status = await server.stop();
const stop_s = (performance.now() - stopping) / 1000;

const sixth = (n) => percentile(samples.filter(([at]) => at >= (seconds * n) / 6 && at < (seconds * (n + 1)) / 6).map(([, mb]) => mb), 0.5);
const growth = sixth(5) / sixth(1) - 1;
console.log(`memory: median ${sixth(1).toFixed(1)} MB in the second sixth, ${sixth(5).toFixed(1)} MB in the last (${(100 * growth).toFixed(1)} %, bar 1 %), at most ${Math.max(...samples.map(([, mb]) => mb)).toFixed(1)} MB`);
console.log(`${all.length} pictures of 8 viewers: ${[0.5, 0.9, 0.99, 0.999, 1].map((share) => `${(100 * share).toFixed(1)} % ${percentile(all, share).toFixed(0)} ms`).join(", ")}`);
if (current_s !== null) console.log(`after a cut of ${values.cut} s all pictures were current ${current_s.toFixed(1)} s after the link's return, ${expected} connections given up`);
console.log(`errors of viewers beside the cut: ${errors.length - expected}${errors.length ? ` (${[...new Set(errors)].join("; ")})` : ""}; reconnects: ${reconnects}; stalled ones began anew: ${stalls}; the mapper: ${mapper.said.trim()}`);
console.log(`the hostile one: ${hostile.said.trim()}`);
console.log(`the server: ${Object.entries(last).filter(([name]) => /cut_total|refused_total|delayed_total|connections_total|accept_failures|requests_total/.test(name)).map(([name, value]) => `${name} ${value}`).join(", ")}; SIGTERM took ${stop_s.toFixed(2)} s, status ${status}`);
rmSync(folder, { recursive: true, force: true });
process.exit(growth > 0.01 || errors.length > expected || status !== 0 ? 1 : 0);
