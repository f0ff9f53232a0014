// Many viewers with the same settings who change them together, ten times a second, so that each gets about 100 kB each time, over
// loopback sockets; frames are acknowledged, not decoded. Colours are fused and encoded once for all.
//   node tests/bench/stream/broadcast.mjs [--viewers 50] [--rate 10] [--seconds 30] [--vertices 60000]
// How long each waits for a change, from its request to its last frame; the same of one viewer alone; and the server's memory.
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import path from "node:path";
import { parseArgs } from "node:util";
import { SpectraClient } from "../../integration/node/spectra_client.mjs";
import { run, serve } from "../../integration/node/spectra_server.mjs";

const { values: options } = parseArgs({
  options: {
    viewers: { type: "string", default: "50" },
    rate: { type: "string", default: "10" },
    seconds: { type: "string", default: "30" },
    vertices: { type: "string", default: "60000" },
  },
});
const folder = mkdtempSync(path.join(tmpdir(), "spectra-broadcast-"));
const scene = path.join(folder, "scene.ply");
run("demo-scene", scene, "--vertices", options.vertices);
const server = await serve([scene]);
const residentMB = () => Number(/VmRSS:\s+(\d+)/.exec(readFileSync(`/proc/${server.process.pid}/status`, "utf8"))[1]) / 1024;
const percentile = (values, share) => values[Math.min(values.length - 1, Math.floor(share * values.length))];

async function viewer() {
  const client = await SpectraClient.connect(server.url, { decode: false });
  await client.request("scene.subscribe", { channels: ["fused"] });
  await client.complete((await client.request("fusion.get")).generation);
  return client;
}
let step = 0;
async function measure(clients, seconds) {
  const waits_ms = [];
  const change = async (client, alpha) => {
    const begin = performance.now();
    const { generation } = await client.request("fusion.set", { method: "thermal_visible_blend", params: { alpha } });
    await client.complete(generation);
    waits_ms.push(performance.now() - begin);
  };
  const received = () => clients.reduce((sum, client) => sum + client.received_bytes, 0);
  const before_bytes = received();
  const under_way = [];
  const begin = performance.now();
  let rounds = 0;
  for (; performance.now() - begin < seconds * 1000; rounds += 1) {
    const alpha = ((++step * 617) % 9973) / 9973;
    under_way.push(...clients.map((client) => change(client, alpha)));
    await new Promise((resolve) => setTimeout(resolve, begin + ((rounds + 1) * 1000) / Number(options.rate) - performance.now()));
  }
  await Promise.all(under_way);
  waits_ms.sort((a, b) => a - b);
  const each_kB = (received() - before_bytes) / rounds / clients.length / 1000;
  const waits = [0.5, 0.95, 0.99].map((share) => `p${100 * share} ${percentile(waits_ms, share).toFixed(0)}`).join(", ");
  return `${clients.length} viewers, ${rounds} changes of ${each_kB.toFixed(0)} kB each: ${waits} ms`;
}

const idle_MB = residentMB();
const clients = [await viewer()];
console.log(await measure(clients, Math.min(10, Number(options.seconds))));
while (clients.length < Number(options.viewers)) clients.push(await viewer());
console.log(await measure(clients, Number(options.seconds)));
console.log(`memory of the server: ${idle_MB.toFixed(0)} MB without viewers, ${residentMB().toFixed(0)} MB at the end`);
await Promise.all(clients.map((client) => client.close()));
await server.stop();
rmSync(folder, { recursive: true, force: true });
