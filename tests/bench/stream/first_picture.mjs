// From scene.subscribe to the first picture (root geometry and colours), over loopback:
//   node tests/bench/stream/first_picture.mjs [SCENE.ply | VERTICES] [ROUNDS]     (default: a generated scene of 10,000,000 vertices)
// Every round is a viewer of his own. The first finds no colours encoded yet and decodes nothing; the others share his and decode. The
// status is 1 over 160 kB.
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

async function firstPicture(decode) {
  const client = await SpectraClient.connect(server.url, { decode });
  warmUp(client.draco);
  client.notify("camera.set", { eye: [0, 0, 1e6], target: [0, 0, 0], up: [0, 1, 0], fov_y_deg: 50, viewport: [1280, 720] });
  const picture = new Promise((resolve) => {
    client.socket.on("message", (data, isBinary) => {
      if (isBinary && isColours(readFrame(data))) resolve(performance.now());
    });
  });
  const start = performance.now();
  await client.request("scene.subscribe", { channels: ["fused"] });
  const ms = (await picture) - start;
  if (client.failures.length) throw client.failures[0];
  const bytes = client.frames.slice(0, 2).reduce((sum, frame) => sum + frame.bytes, 0);
  const { vertex_count } = client.hello.scene;
  await client.close();
  return { ms, bytes, vertex_count };
}

const started = performance.now();
const server = await serve([scene]);
const ready_s = (performance.now() - started) / 1000;
const fresh = await firstPicture(false);
const later = [];
for (let round = 0; round < rounds; ++round) later.push((await firstPicture(true)).ms);
const median = later.sort((a, b) => a - b)[rounds >> 1];
console.log(`${fresh.vertex_count} vertices, ready after ${ready_s.toFixed(1)} s: first picture ${fresh.bytes} bytes (bar 160000)`);
console.log(`after scene.subscribe (bar 50): ${fresh.ms.toFixed(1)} ms on the wire for the first viewer, ${median.toFixed(1)} ms decoded for later ones`);
await server.stop();
rmSync(folder, { recursive: true, force: true });
process.exit(fresh.bytes > 160_000 ? 1 : 0);
