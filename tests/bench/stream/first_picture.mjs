// From scene.subscribe to the first picture (root geometry and colours, decoded by Node), over loopback:
//   node tests/bench/stream/first_picture.mjs [SCENE.ply | VERTICES] [ROUNDS]     (default: a generated scene of 10,000,000 vertices)
// Every round is a viewer of his own who has not been there before; what was encoded for an earlier one is shared. Prints the first
// round, for which the server has encoded nothing yet, the median of the others, and the bytes. The status is 1 over 160 kB.
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import path from "node:path";
import { isColours, readFrame, SpectraClient } from "../../integration/node/spectra_client.mjs";
import { run, serve } from "../../integration/node/spectra_server.mjs";

const folder = mkdtempSync(path.join(tmpdir(), "spectra-bench-"));
let scene = process.argv[2] ?? "10000000";
const rounds = Number(process.argv[3] ?? 5);
if (/^\d+$/.test(scene)) {
  const vertices = scene;
  scene = path.join(folder, `${vertices}.ply`);
  run("demo-scene", scene, "--vertices", vertices);
}

/** Lets Node compile the decoder, which takes longer than the picture. */
function warmUp(draco) {
  const golden = readFrame(readFileSync(new URL("../../../protocol/golden/frames/geometry.bin", import.meta.url)));
  for (let i = 0; i < 500; ++i) draco.geometry(golden.payload);
}

async function firstPicture() {
  const client = await SpectraClient.connect(server.url);
  warmUp(client.draco);
  client.notify("camera.set", { eye: [0, 0, 1e6], target: [0, 0, 0], up: [0, 1, 0], fov_y_deg: 50, viewport: [1280, 720] });
  let received;
  client.socket.prependListener("message", (data, isBinary) => {
    if (isBinary && received === undefined && isColours(readFrame(data))) received = performance.now();
  });
  const picture = new Promise((resolve) => {
    client.socket.on("message", (data, isBinary) => {
      if (isBinary && client.tiles.get("0/0/0/0")?.colours) resolve(performance.now());
    });
  });
  const start = performance.now();
  await client.request("scene.subscribe", { channels: ["fused"] });
  const decoded_ms = (await picture) - start;
  const received_ms = received - start;
  if (client.failures.length) throw client.failures[0];
  const bytes = client.frames.filter(({ tile }) => tile === "0/0/0/0").reduce((sum, frame) => sum + frame.bytes, 0);
  const { vertex_count } = client.hello.scene;
  await client.close();
  return { received_ms, decoded_ms, bytes, vertex_count };
}

const started = performance.now();
const server = await serve([scene]);
const ready_s = (performance.now() - started) / 1000;
const pictures = [];
for (let round = 0; round <= rounds; ++round) pictures.push(await firstPicture());
const [fresh, ...shared] = pictures;
const median = (values) => [...values].sort((a, b) => a - b)[values.length >> 1];
const later = (name) => median(shared.map((picture) => picture[name])).toFixed(1);
console.log(`${fresh.vertex_count} vertices, ready after ${ready_s.toFixed(1)} s: first picture ${fresh.bytes} bytes (bar 160000)`);
console.log(`after scene.subscribe (bar 50): received ${fresh.received_ms.toFixed(1)} ms, decoded ${fresh.decoded_ms.toFixed(1)} ms for the first viewer; ${later("received_ms")} and ${later("decoded_ms")} ms for later ones`);
await server.stop();
rmSync(folder, { recursive: true, force: true });
process.exit(fresh.bytes > 160_000 ? 1 : 0);
