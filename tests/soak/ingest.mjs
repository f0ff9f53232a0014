// Puts blocks of 1,681 vertices into the map of a server at a steady rate, the same ones again and again, until it is ended:
//   node tests/soak/ingest.mjs URL RATE [TOKEN]
// Prints on SIGTERM how many were taken and refused.
import { patch } from "../integration/node/patch.mjs";

const [, , url, rate, token] = process.argv;
const BLOCKS = 36;
const counts = { taken: 0, refused: 0, failed: 0 };
const headers = token ? { Authorization: `Bearer ${token}` } : {};
process.once("SIGTERM", () => {
  console.log(JSON.stringify(counts));
  process.exit(0);
});
const begin = performance.now();
for (let n = 0; ; n += 1) {
  const wait_ms = begin + (n * 1000) / Number(rate) - performance.now();
  if (wait_ms > 0) await new Promise((resolve) => setTimeout(resolve, wait_ms));
  const block = n % BLOCKS;
  const body = patch(block % 6, Math.floor(block / 6), { side: 41, celsius: 20 + (n % 7), scale: 0.05 });
  await fetch(`${url}/api/v1/blocks/b${block}?observed_at=${Date.now() / 1000}`, { method: "PUT", body, headers })
    .then(async (response) => {
      await response.text();
      counts[response.ok ? "taken" : "refused"] += 1;
    })
    .catch(() => (counts.failed += 1));
}
