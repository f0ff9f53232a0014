// Many viewers on one server, over loopback sockets, frames acknowledged but not decoded:
//   node tests/bench/stream/viewers.mjs [SCENE.ply] [VIEWERS]     (default: a generated scene of 1,000,000 vertices, 64 viewers)
// - the same settings: processor time of the server for one change, against that of a single viewer; time in the kernel (copying
//   into sockets) stands apart;
// - settings of their own: slowest against fastest completion, and the memory it took;
// - one viewer who stops reading: what the others' completions lose, in turns with and without him, the memory he holds, and when
//   he is cut.
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import path from "node:path";
import { SpectraClient } from "../../integration/node/spectra_client.mjs";
import { run, serve } from "../../integration/node/spectra_server.mjs";

const folder = mkdtempSync(path.join(tmpdir(), "spectra-bench-"));
let scene = process.argv[2];
const count = Number(process.argv[3] ?? 64);
if (!scene) {
  scene = path.join(folder, "million.ply");
  run("demo-scene", scene, "--vertices", "1000000");
}
const sleep = (ms) => new Promise((resolve) => setTimeout(resolve, ms));
const median = (values) => [...values].sort((a, b) => a - b)[values.length >> 1];

const server = await serve([scene]);
const pid = server.process.pid;
/** Seconds of the server's processors, in its own code and in the kernel. */
function processorTime() {
  const fields = readFileSync(`/proc/${pid}/stat`, "utf8").split(") ")[1].split(" ");
  return { user: Number(fields[11]) / 100, kernel: Number(fields[12]) / 100 };
}
const residentMB = () => Number(/VmRSS:\s+(\d+)/.exec(readFileSync(`/proc/${pid}/status`, "utf8"))[1]) / 1024;

async function viewer() {
  const client = await SpectraClient.connect(server.url, { decode: false });
  await client.request("scene.subscribe", { channels: ["fused"] });
  await client.complete((await client.request("fusion.get")).generation);
  return client;
}
/** A change of one viewer; resolves with the milliseconds until all of it has arrived. */
async function change(client, alpha) {
  const start = performance.now();
  const { generation } = await client.request("fusion.set", { method: "thermal_visible_blend", params: { alpha } });
  await client.complete(generation);
  return performance.now() - start;
}
let step = 0;
const newAlpha = () => ((++step * 617) % 9973) / 9973;

async function costOfChanges(clients, rounds) {
  const before = processorTime();
  for (let round = 0; round < rounds; ++round) {
    const alpha = newAlpha();
    await Promise.all(clients.map((client) => change(client, alpha)));
  }
  const after = processorTime();
  return { user: (after.user - before.user) / rounds, kernel: (after.kernel - before.kernel) / rounds };
}

const viewers = [await viewer()];
const { vertex_count } = viewers[0].hello.scene;
console.log(`${vertex_count} vertices, ${count} viewers`);
await costOfChanges(viewers, 2); // warm-up
const single = await costOfChanges(viewers, 15);
while (viewers.length < count) viewers.push(await viewer());
await costOfChanges(viewers, 1);
const all = await costOfChanges(viewers, 8);
console.log(`same settings: own code ${(single.user * 1e3).toFixed(0)} ms a change for one, ${(all.user * 1e3).toFixed(0)} ms for all (ratio ${(all.user / single.user).toFixed(2)}, bar 2); kernel ${(single.kernel * 1e3).toFixed(0)} and ${(all.kernel * 1e3).toFixed(0)} ms`);

const memory = residentMB();
const times = await Promise.all(viewers.map((client) => change(client, newAlpha())));
const spread = Math.max(...times) / Math.min(...times);
console.log(`settings of their own: completed after ${Math.min(...times).toFixed(0)} .. ${Math.max(...times).toFixed(0)} ms (ratio ${spread.toFixed(2)}, bar 2); resident ${memory.toFixed(0)} -> ${residentMB().toFixed(0)} MB (the cache of encodings holds at most 256)`);
await Promise.all(viewers.splice(4).map((client) => client.close()));

// Everybody who is well changes to settings that were not seen before, so that all of it is encoded anew.
const round = () => Promise.all(viewers.map((client) => change(client, newAlpha()))).then(median);
const [alone, beside] = [[], []];
let held = 0;
for (let turn = 0; turn < 7; ++turn) {
  await round();
  alone.push(median([await round(), await round()]));
  const stalled = await viewer();
  const before = residentMB();
  stalled.socket.pause();
  for (let i = 0; i < 5; ++i) {
    stalled.notify("camera.set", { eye: [0, 0, 50 + i], target: [0, 0, 0], up: [0, 1, 0], fov_y_deg: 50, viewport: [1280, 720] });
    stalled.socket.send(JSON.stringify({ jsonrpc: "2.0", id: 1000 + i, method: "fusion.set", params: { params: { alpha: newAlpha() } } }));
    await sleep(50);
  }
  await sleep(200);
  held = Math.max(held, residentMB() - before);
  beside.push(median([await round(), await round()]));
  stalled.socket.terminate();
}
console.log(`beside one who stops reading: median ${median(alone).toFixed(1)} -> ${median(beside).toFixed(1)} ms (ratio ${median(beside.map((ms, i) => ms / alone[i])).toFixed(3)}, bar 1.1); the server grew by at most ${held.toFixed(1)} MB meanwhile, its cache included`);

const stalled = await viewer();
stalled.socket.pause();
const start = performance.now();
// He goes on talking, so that no idle timer ends it.
const talking = setInterval(() => stalled.socket.send(JSON.stringify({ jsonrpc: "2.0", id: ++step, method: "fusion.set", params: { params: { alpha: newAlpha() } } })), 200);
const metric = async () => Number(/^spectra_viewers\S* (\d+)/m.exec(await (await fetch(`${server.url}/metrics`)).text())?.[1] ?? NaN);
const before = await metric();
while ((await metric()) >= before && performance.now() - start < 60_000) await sleep(200);
clearInterval(talking);
console.log(`one who talks but never reads is cut after ${((performance.now() - start) / 1000).toFixed(1)} s`);
stalled.socket.terminate();
for (const client of viewers) await client.close();
await server.stop();
rmSync(folder, { recursive: true, force: true });
