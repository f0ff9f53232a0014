// What attacks cost viewers who are well:
//   node tests/soak/attacks.mjs [--seconds 10] [--turns 3] [--viewers 8] [--direct] [--only ATTACK] [--scene FILE.ply]
// Viewers behind an emulated radio link (20 Mbit/s, 60 ms) change a setting once a second each and wait for their whole picture. Turns
// without and with each attack alternate; the growth is that of the median, of all viewers and turns. With --direct there is no link.
// Attackers are processes of their own and come over loopback;
// "--only stalled" has 20 viewers who read nothing. The status is 1 when a growth is over 20 % or somebody was cut.
import { spawn } from "node:child_process";
import { readFileSync } from "node:fs";
import { fileURLToPath } from "node:url";
import { parseArgs } from "node:util";
import { linkProxy } from "../integration/node/link_proxy.mjs";
import { serve } from "../integration/node/spectra_server.mjs";
import { HealthyViewer, percentile } from "./healthy_viewer.mjs";

const { values } = parseArgs({
  options: {
    seconds: { type: "string", default: "10" },
    turns: { type: "string", default: "3" },
    viewers: { type: "string", default: "8" },
    direct: { type: "boolean", default: false },
    only: { type: "string" },
    scene: { type: "string" },
  },
});
const BAR = 1.2;
const FIVE = ["connections", "slow_headers", "upload", "deep_json", "requests"];
const seconds = Number(values.seconds);
const server = await serve([values.scene ?? "--demo", "--limit", "cache-bytes=16MB"]);
const link = values.direct ? null : await linkProxy(server.url, { rate_bytes_per_s: 20e6 / 8, delay_ms: 30, queue_bytes: 65_536 });
const resident_mb = () => Number(/VmRSS:\s+(\d+)/.exec(readFileSync(`/proc/${server.process.pid}/status`, "utf8"))[1]) / 1024;
const sleep = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

const viewers = await Promise.all(Array.from({ length: Number(values.viewers) }, (_, i) => HealthyViewer.start(link?.url ?? server.url, { seed: i })));
await sleep(5000);

/** Completion times of a while, with an attack where one is named, and the most memory meanwhile. */
async function turn(name) {
  const args = [fileURLToPath(new URL("hostile.mjs", import.meta.url)), server.url, name, String(seconds)];
  const attacker = name ? spawn(process.execPath, args, { stdio: ["ignore", "pipe", "inherit"] }) : null;
  let said = "";
  attacker?.stdout.on("data", (chunk) => (said += chunk));
  const gone = attacker ? new Promise((resolve) => attacker.once("exit", resolve)) : null;
  if (attacker) await sleep(1000);
  for (const viewer of viewers) viewer.latencies_ms.length = 0;
  let most_mb = 0;
  const end = performance.now() + 1000 * (seconds - 1);
  while (performance.now() < end) {
    most_mb = Math.max(most_mb, resident_mb());
    await sleep(100);
  }
  const times = viewers.flatMap(({ latencies_ms }) => latencies_ms);
  await gone;
  return { times, most_mb, said: said.trim() };
}

let is_missed = false;
const idle_mb = resident_mb();
for (const name of values.only ? [values.only] : FIVE) {
  const [quiet, beside] = [[], []];
  let [most_mb, said] = [0, ""];
  for (let i = 0; i < Number(values.turns); i += 1) {
    quiet.push(...(await turn()).times);
    const attacked = await turn(name);
    beside.push(...attacked.times);
    most_mb = Math.max(most_mb, attacked.most_mb);
    said = attacked.said;
    await sleep(1000);
  }
  const growth = percentile(beside, 0.5) / percentile(quiet, 0.5);
  const errors = viewers.flatMap((viewer) => viewer.errors);
  is_missed ||= growth > BAR || errors.length > 0;
  console.log(
    `${name.padEnd(13)} median ${percentile(quiet, 0.5).toFixed(0)} -> ${percentile(beside, 0.5).toFixed(0)} ms (x ${growth.toFixed(2)}, bar ${BAR}), ` +
      `99 %: ${percentile(quiet, 0.99).toFixed(0)} -> ${percentile(beside, 0.99).toFixed(0)} ms, memory ${idle_mb.toFixed(0)} -> at most ${most_mb.toFixed(0)} MB, ` +
      `${errors.length} errors; the attacker: ${said}`,
  );
}
await Promise.all(viewers.map((viewer) => viewer.stop()));
await link?.close();
await server.stop();
process.exit(is_missed ? 1 : 0);
