// A map that lives: blocks of 5,041 vertices are replaced at a steady rate while viewers watch all of it.
//   node tests/bench/stream/live_map.mjs [--rate 30] [--seconds 60] [--viewers 8] [--blocks 100] [--store]
// For every block and viewer: how long from its being sent until the viewer has everything of a version that holds it. Frames are
// acknowledged and not decoded; server, senders and viewers share the machine.
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import path from "node:path";
import { parseArgs } from "node:util";
import { patch } from "../../integration/node/patch.mjs";
import { SpectraClient } from "../../integration/node/spectra_client.mjs";
import { serve } from "../../integration/node/spectra_server.mjs";

const { values } = parseArgs({
  options: {
    rate: { type: "string", default: "30" },
    seconds: { type: "string", default: "60" },
    viewers: { type: "string", default: "8" },
    blocks: { type: "string", default: "100" },
    store: { type: "boolean", default: false },
  },
});
const [rate, seconds, viewer_count, block_count] = ["rate", "seconds", "viewers", "blocks"].map((name) => Number(values[name]));
const columns = Math.ceil(Math.sqrt(block_count));
const SIDE = 71;
const scratch = mkdtempSync(path.join(tmpdir(), "spectra-live-"));
const server = await serve(["--live", ...(values.store ? ["--store", path.join(scratch, "map.db")] : [])]);
const process_file = (name) => readFileSync(`/proc/${server.process.pid}/${name}`, "latin1");
const resident_mb = () => Number(/VmRSS:\s+(\d+)/.exec(process_file("status"))[1]) / 1024;
function cpu_s() {
  const fields = process_file("stat").split(") ")[1].split(" ");
  return (Number(fields[11]) + Number(fields[12])) / 100;
}

/** The n-th putting of a block: its temperatures tell. */
function body(block, round) {
  return patch(block % columns, Math.floor(block / columns), { side: SIDE, celsius: 20 + (round % 7), scale: 0.02 });
}
async function put(block, round) {
  const observed_at = Date.now() / 1000;
  const response = await fetch(`${server.url}/api/v1/blocks/b${block}?observed_at=${observed_at}`, { method: "PUT", body: body(block, round) });
  if (!response.ok) throw new Error(await response.text());
  return observed_at;
}

for (let block = 0; block < block_count; block += 1) await put(block, 0);

const viewers = await Promise.all(
  Array.from({ length: viewer_count }, async () => {
    const client = await SpectraClient.connect(server.url, { decode: false });
    const viewer = { client, newest: new Map(), seen: [], bytes: 0 };
    client.socket.on("message", (data, is_binary) => {
      if (is_binary) return;
      const { method, params } = JSON.parse(data);
      if (method === "scene.changed") viewer.newest.set(params.scene.revision, params.scene.observed.newest);
      if (method !== "stream.complete") return;
      const newest = viewer.newest.get(params.scene_revision);
      if (newest === undefined) return;
      viewer.seen.push({ at: Date.now() / 1000, newest });
      for (const revision of viewer.newest.keys()) if (revision <= params.scene_revision) viewer.newest.delete(revision);
    });
    await client.request("scene.subscribe", { channels: ["fused"] });
    await client.notification("stream.complete", 120_000, ({ vertices }) => vertices > 0);
    return viewer;
  }),
);
const first_mb = resident_mb();
const before_s = cpu_s();
const sent = [];
const pending = new Set();
let failed = 0;
const begin = performance.now();
for (let n = 0; n < rate * seconds; n += 1) {
  const wait_ms = begin + (n * 1000) / rate - performance.now();
  if (wait_ms > 0) await new Promise((resolve) => setTimeout(resolve, wait_ms));
  const putting = put((n * 37) % block_count, n)
    .then((observed_at) => sent.push(observed_at))
    .catch(() => (failed += 1))
    .finally(() => pending.delete(putting));
  pending.add(putting);
}
const sending_s = (performance.now() - begin) / 1000;
await Promise.all(pending);
const used_s = cpu_s() - before_s;
await new Promise((resolve) => setTimeout(resolve, 5000));
const last_mb = resident_mb();

const times = [];
for (const { seen } of viewers) {
  let next = 0;
  for (const observed_at of sent.toSorted((a, b) => a - b)) {
    while (next < seen.length && seen[next].newest < observed_at) next += 1;
    times.push(next < seen.length ? seen[next].at - observed_at : Infinity);
  }
}
times.sort((a, b) => a - b);
const at = (share) => times[Math.min(times.length - 1, Math.floor(share * times.length))].toFixed(3);
const within = times.filter((time) => time <= 1).length / times.length;
console.log(
  `${sent.length} blocks of ${SIDE * SIDE} vertices in ${sending_s.toFixed(1)} s (${failed} failed) into ${block_count}, ${viewer_count} viewers: ` +
    `seen after ${at(0.5)} s (median), ${at(0.9)} s (90 %), ${at(0.99)} s (99 %); within 1 s ${(100 * within).toFixed(1)} %; ` +
    `processor ${(used_s / sending_s).toFixed(2)} of the server; memory ${first_mb.toFixed(0)} -> ${last_mb.toFixed(0)} MB`,
);
for (const { client } of viewers) await client.close();
await server.stop();
rmSync(scratch, { recursive: true, force: true });
