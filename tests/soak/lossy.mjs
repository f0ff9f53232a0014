// A viewer behind a link that loses packets, and cuts of it:
//   python3 tests/soak/radio.py --rate 4 --delay 60 --loss 0.05 -- node tests/soak/lossy.mjs [--minutes 10] [--cuts 1,10,25]     (root)
// One viewer changes a setting every 2 s and waits for the whole picture: the connection has to last and no tile may go back to an older
// setting. Then the link is cut for so many seconds: how soon after its return a viewer has the current picture, who opens a new
// connection as the web client does when nothing has come for 4 s. The status is 1 when a bar is missed.
import { spawn } from "node:child_process";
import { writeFileSync } from "node:fs";
import { parseArgs } from "node:util";
import { binary } from "../integration/node/spectra_server.mjs";
import { SpectraClient } from "../integration/node/spectra_client.mjs";
import { HealthyViewer, percentile } from "./healthy_viewer.mjs";

const { values } = parseArgs({ options: { minutes: { type: "string", default: "10" }, cuts: { type: "string", default: "1,10,25" } } });
const sleep = (ms) => new Promise((resolve) => setTimeout(resolve, ms));
const LONGEST_AFTER_CUT_S = 3;
const url = "http://10.77.0.1:8080";
const server = spawn("ip", ["netns", "exec", process.env.RADIO_ROBOT, binary, "serve", "--demo", "--listen", "10.77.0.1:8080", "--insecure"], {
  stdio: ["ignore", "ignore", "inherit"],
});
for (;;) {
  const ready = await fetch(`${url}/readyz`, { signal: AbortSignal.timeout(3000) }).catch(() => null);
  if (ready?.status === 200) break;
  await sleep(300);
}
const viewer = await HealthyViewer.start(url, { interval_ms: 2000, patience_ms: 60_000 });
await sleep(60_000 * Number(values.minutes));
const times = viewer.latencies_ms;
const { errors, reconnects } = viewer;
await viewer.stop();
console.log(
  `${values.minutes} min: ${times.length} whole pictures after ${percentile(times, 0.5).toFixed(0)} ms (median), ${percentile(times, 0.99).toFixed(0)} ms (99 %); ` +
    `${reconnects} disconnects, ${errors.length} errors ${errors.join("; ")}`,
);
let isMissed = reconnects > 0 || errors.length > 0;

const PATIENCE_MS = 4000; // of the web client
for (const cut_s of values.cuts.split(",").map(Number)) {
  let client = await SpectraClient.connect(url, { hello: "brief" });
  await client.request("scene.subscribe", { channels: ["fused"] });
  await client.complete((await client.request("fusion.get")).generation);
  const earlier = client;
  let heard = performance.now();
  client.socket.on("message", () => (heard = performance.now()));
  client.socket.on("ping", () => (heard = performance.now()));
  const end = performance.now() + 1000 * cut_s;
  writeFileSync(process.env.RADIO_CONTROL, `cut ${cut_s}\n`);
  while (performance.now() < end) await sleep(20);
  // During the cut the client tries again and again; its next attempt begins within a second of the link's return.
  let connections = 0;
  if (performance.now() - heard > PATIENCE_MS + 500) {
    earlier.socket.terminate();
    connections = 1;
    client = await SpectraClient.connect(url, { hello: "brief" });
    await client.resume(earlier);
  }
  const { generation } = await client.request("fusion.set", { method: "thermal_visible_blend", params: { alpha: (cut_s % 10) / 10 } });
  await client.complete(generation);
  const after_s = (performance.now() - end) / 1000;
  isMissed ||= after_s > LONGEST_AFTER_CUT_S;
  console.log(`a cut of ${cut_s} s: the current picture, of a setting made as the link returned, ${after_s.toFixed(2)} s after that (bar ${LONGEST_AFTER_CUT_S} s), ${connections ? "on a new connection" : "on the same connection"}`);
  client.socket.terminate();
}
server.kill("SIGTERM");
process.exit(isMissed ? 1 : 0);
