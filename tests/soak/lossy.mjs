// A viewer behind a link that loses packets, and cuts of it:
//   python3 tests/soak/radio.py --rate 4 --delay 60 --loss 0.05 -- node tests/soak/lossy.mjs [--minutes 10] [--cuts 1,10,25]     (root)
// One viewer changes a setting every 2 s and waits for the whole picture: the connection has to last and no tile may go back to an older
// setting. Then the link is cut for so many seconds: how soon after its return a viewer has the current picture whose connections are those
// of the web client (web/src/transport/connection.ts). The status is 1 when a bar is missed.
import { spawn } from "node:child_process";
import { writeFileSync } from "node:fs";
import { parseArgs } from "node:util";
import { binary } from "../integration/node/spectra_server.mjs";
import { HealthyViewer, percentile } from "./healthy_viewer.mjs";
import { WebViewer } from "./web_viewer.mjs";

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

for (const cut_s of values.cuts.split(",").map(Number)) {
  const viewer = new WebViewer(url);
  await viewer.show(0.95);
  const end = performance.now() + 1000 * cut_s;
  writeFileSync(process.env.RADIO_CONTROL, `cut ${cut_s}\n`);
  await sleep(end - performance.now());
  await viewer.show((cut_s % 10) / 10);
  const after_s = (performance.now() - end) / 1000;
  isMissed ||= after_s > LONGEST_AFTER_CUT_S;
  const { greeted_at, attempts } = viewer;
  const how = attempts > 1 ? `on a new connection, the ${attempts}th, ${((greeted_at - end) / 1000).toFixed(2)} s after it` : "on the same connection";
  console.log(`a cut of ${cut_s} s: the current picture, of a setting made as the link returned, ${after_s.toFixed(2)} s after that (bar ${LONGEST_AFTER_CUT_S} s), ${how}`);
  viewer.stop();
}
server.kill("SIGTERM");
process.exit(isMissed ? 1 : 0);
