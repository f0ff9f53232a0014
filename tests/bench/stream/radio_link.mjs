// A slider dragged over a radio link (5 Mbit/s, 100 ms round trip by default) against the built program, over real sockets:
//   node tests/bench/stream/radio_link.mjs [SCENE.ply] [MBIT_PER_S] [ROUND_TRIP_MS] [transform]     (default: the demo scene)
// 30 changes a second for 3 seconds. Prints how far the coarse picture was behind the newest setting at worst, and how long after the
// release full accuracy was there, beside 1.25 times the bytes over the rate and one round trip. The status is 1 when a bar is missed or
// an older generation came after a newer one.
import { once } from "node:events";
import path from "node:path";
import { Worker } from "node:worker_threads";
import { isColours, readFrame, SpectraClient } from "../../integration/node/spectra_client.mjs";
import { serve } from "../../integration/node/spectra_server.mjs";

const [scene, mbit_per_s = "5", round_trip_ms = "100", colour_transform = "none"] = process.argv.slice(2);
const rate_bytes_per_s = (Number(mbit_per_s) * 1e6) / 8;
const changes = 90;
const interval_ms = 1000 / 30;
const sleep = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

/** The link has a thread of its own, so that decoding here does not hold it up. */
async function linkOfItsOwn(target_url) {
  const worker = new Worker(
    `const { parentPort, workerData } = require("node:worker_threads");
     import(workerData.module).then(async ({ linkProxy }) => {
       const { url } = await linkProxy(workerData.target_url, workerData.options);
       parentPort.postMessage(url);
     });`,
    {
      eval: true,
      workerData: {
        module: new URL("../../integration/node/link_proxy.mjs", import.meta.url).href,
        target_url,
        options: { rate_bytes_per_s, delay_ms: Number(round_trip_ms) / 2 },
      },
    },
  );
  const [url] = await once(worker, "message");
  return { url, close: () => worker.terminate() };
}

const server = await serve(scene ? [scene] : ["--demo"]);
const link = await linkOfItsOwn(server.url);
const client = await SpectraClient.connect(link.url);
const arrivals = []; // of colours, decoded
client.socket.on("message", (data, isBinary) => {
  if (!isBinary) return;
  const { kind, tile, generation, level } = readFrame(data);
  if (isColours({ kind })) arrivals.push({ tile, generation, level, bytes: data.byteLength, at: performance.now() });
});
await client.request("scene.subscribe", { channels: ["fused"], colour_transform });
await client.complete((await client.request("fusion.get")).generation, 300_000);
await sleep(500);
arrivals.length = 0;

const made = new Map(); // generation -> when its setting was made
const asked = [];
const start = performance.now();
for (let i = 0; i < changes; ++i) {
  await sleep(start + i * interval_ms - performance.now());
  const at = performance.now();
  const alpha = Math.round(1000 * (0.05 + (0.9 * (i + 1)) / changes)) / 1000;
  asked.push(client.request("fusion.set", { method: "thermal_visible_blend", params: { alpha } }).then(({ generation }) => made.set(generation, at)));
}
await Promise.all(asked);
const last = Math.max(...made.keys());
const released = made.get(last);
await client.complete(last, 300_000);

const generations = [...made.keys()].sort((a, b) => a - b);
const coarsest = Math.min(...arrivals.map(({ level }) => level));
const coarse = arrivals.filter(({ level }) => level === coarsest);
let shown = generations[0] - 1;
let worst_lag_ms = 0;
for (const { generation, at } of coarse) {
  // Just before this arrival the picture lacked every setting after `shown`.
  const first_lacking = generations.find((other) => other > shown);
  if (first_lacking !== undefined) worst_lag_ms = Math.max(worst_lag_ms, at - made.get(first_lacking));
  shown = generation;
}
let failed = client.failures.length > 0 || shown !== last;
for (const failure of client.failures) console.log(failure.message);
const final = arrivals.filter(({ generation }) => generation === last);
const bytes = final.reduce((sum, frame) => sum + frame.bytes, 0);
const settled_ms = Math.max(...final.map(({ at }) => at)) - released;
const bar_ms = 1250 * (bytes / rate_bytes_per_s) + Number(round_trip_ms);
failed ||= worst_lag_ms > 400 || settled_ms > bar_ms;

const { vertex_count } = client.hello.scene;
console.log(`${scene ? path.basename(scene) : "demo scene"}: ${vertex_count} vertices, ${mbit_per_s} Mbit/s, ${round_trip_ms} ms, colours ${colour_transform}`);
console.log(`coarse picture at worst ${worst_lag_ms.toFixed(0)} ms behind (bar 400), ${coarse.length} coarse pictures for ${changes} changes`);
console.log(`full accuracy ${settled_ms.toFixed(0)} ms after release (bar ${bar_ms.toFixed(0)}), ${bytes} bytes`);
await client.close();
await link.close();
await server.stop();
process.exit(failed ? 1 : 0);
