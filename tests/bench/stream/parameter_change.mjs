// A parameter change against sending the whole mesh again, both over loopback and both decoded by Node, taken in turns in
// one run:
//   node tests/bench/stream/parameter_change.mjs [SCENE.ply] [ROUNDS]     (default: a generated scene of 1,000,000 vertices)
// Prints the medians and the ratios of time and bytes, and after how long the first colours of a change, coarse ones, have
// come; then what a change costs with colours as they are and with
// subtract_green, at 8 and 6 bits.
import { spawn } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import net from "node:net";
import { tmpdir } from "node:os";
import path from "node:path";
import { isColours, KIND, readFrame, SpectraClient } from "../../integration/node/spectra_client.mjs";
import { binary, run, serve } from "../../integration/node/spectra_server.mjs";

const folder = mkdtempSync(path.join(tmpdir(), "spectra-bench-"));
const rounds = Number(process.argv[3] ?? 7);
let scene = process.argv[2];
if (!scene) {
  scene = path.join(folder, "million.ply");
  run("demo-scene", scene, "--vertices", "1000000");
}

const median = (values) => [...values].sort((a, b) => a - b)[values.length >> 1];
const alphaOf = (round) => (0.3 + (0.6 * (round + 1)) / (rounds + 1)).toFixed(3);

/** One exchange with the whole-mesh sender: request to decoded mesh and colours. */
class WholeMeshClient {
  static async start(step, draco) {
    const client = new WholeMeshClient();
    client.draco = draco;
    client.process = spawn(path.join(path.dirname(binary), "whole_mesh_sender"), [scene, String(step)]);
    const port = await new Promise((resolve) => client.process.stdout.once("data", (text) => resolve(Number(text))));
    client.socket = net.connect(port, "127.0.0.1");
    client.socket.setNoDelay(true);
    await new Promise((resolve) => client.socket.once("connect", resolve));
    return client;
  }

  async change(alpha) {
    const start = performance.now();
    const received = new Promise((resolve) => {
      const chunks = [];
      let size = 0;
      const onData = (chunk) => {
        chunks.push(chunk);
        size += chunk.length;
        const first = chunks[0];
        if (size >= 4 && first.length >= 4 && size === 4 + first.readUInt32LE(0)) {
          this.socket.off("data", onData);
          resolve(Buffer.concat(chunks).subarray(4));
        }
      };
      this.socket.on("data", onData);
    });
    this.socket.write(`${alpha}\n`);
    const bytes = await received;
    this.draco.colouredMesh(bytes);
    return { ms: performance.now() - start, bytes: bytes.length };
  }

  stop() {
    this.socket.destroy();
    this.process.kill();
  }
}

async function subscribed(colour_transform) {
  const client = await SpectraClient.connect(server.url);
  await client.request("scene.subscribe", { channels: ["fused"], colour_transform });
  await client.complete((await client.request("fusion.get")).generation);
  return client;
}

const server = await serve([scene]);
const client = await subscribed("none");
const step = [...client.tiles.values()][0].frame.step;
const whole = await WholeMeshClient.start(step, client.draco);

const blend = (alpha) => ({ method: "thermal_visible_blend", params: { alpha: Number(alpha) } });

async function tileChange(client, change) {
  const bytesBefore = client.received_bytes;
  const framesBefore = client.frames.length;
  let first = null;
  const onMessage = (data, isBinary) => {
    if (!isBinary || first !== null) return;
    const frame = readFrame(data);
    if (isColours(frame)) first = { ms: performance.now() - start, vertex_count: frame.vertexCount };
  };
  client.socket.on("message", onMessage);
  const start = performance.now();
  const { generation } = await client.request("fusion.set", change);
  await client.complete(generation);
  client.socket.off("message", onMessage);
  const ms = performance.now() - start;
  if (client.failures.length) throw client.failures[0];
  if (client.frames.slice(framesBefore).some((frame) => frame.kind === KIND.geometry)) throw new Error("geometry was sent again");
  const drawn = client.drawnTiles();
  if (drawn.some((tile) => tile.generation !== generation)) throw new Error("a drawn tile is behind");
  if (drawn.some((tile) => tile.frame.childMask !== 0)) throw new Error("a drawn tile is not at full accuracy");
  return { ms, first, bytes: client.received_bytes - bytesBefore };
}

const tile = [];
const mesh = [];
for (let round = -1; round < rounds; ++round) {
  const a = await tileChange(client, blend(alphaOf(round)));
  const b = await whole.change(alphaOf(round));
  if (round < 0) continue; // warm-up
  tile.push(a);
  mesh.push(b);
}
const ratios = tile.map((a, i) => mesh[i].ms / a.ms);
const { vertex_count, triangle_count } = client.hello.scene;
console.log(`${path.basename(scene)}: ${vertex_count} vertices, ${triangle_count} triangles, ${client.tiles.size} tiles, step ${(step * 1000).toFixed(3)} mm, ${rounds} rounds`);
console.log(`colours only     median ${median(tile.map((a) => a.ms)).toFixed(1)} ms, ${median(tile.map((a) => a.bytes))} bytes`);
const first = tile.map((a) => a.first.ms);
console.log(`first colours    median ${median(first).toFixed(1)} ms (${Math.min(...first).toFixed(1)} .. ${Math.max(...first).toFixed(1)}), of ${tile[0].first.vertex_count} vertices`);
console.log(`whole mesh again median ${median(mesh.map((a) => a.ms)).toFixed(1)} ms, ${median(mesh.map((a) => a.bytes))} bytes`);
console.log(`faster by ${median(ratios).toFixed(2)} (min ${Math.min(...ratios).toFixed(2)}), bytes ratio ${(median(tile.map((a) => a.bytes)) / median(mesh.map((a) => a.bytes))).toFixed(3)}`);

whole.stop();

const clients = { none: client, subtract_green: await subscribed("subtract_green") };
let settings = 0;
/** Settings that nobody had before where the method has any, so that nothing comes from the cache. */
const changes = {
  thermal_visible_blend: () => blend(0.3 + 0.0001 * ++settings),
  visible_only: () => ({ method: "visible_only" }),
};
for (const colour_bits of [8, 6]) {
  for (const one of Object.values(clients)) {
    const done = one.notification("stream.complete");
    await one.request("quality.set", { mode: "manual", colour_bits });
    await done;
  }
  for (const [method, change] of Object.entries(changes)) {
    const measured = { none: [], subtract_green: [] };
    for (let round = 0; round < rounds; ++round) {
      for (const [transform, one] of Object.entries(clients)) measured[transform].push(await tileChange(one, change()));
    }
    const bytes = (transform) => median(measured[transform].map((a) => a.bytes));
    const saved = 100 * (1 - bytes("subtract_green") / bytes("none"));
    for (const [transform, results] of Object.entries(measured)) {
      console.log(`${method}, ${colour_bits} bits, ${transform.padEnd(14)} median ${median(results.map((a) => a.ms)).toFixed(1)} ms, ${bytes(transform)} bytes`);
    }
    console.log(`${method}, ${colour_bits} bits: subtract_green saves ${saved.toFixed(1)} %`);
  }
}

for (const one of Object.values(clients)) await one.close();
await server.stop();
rmSync(folder, { recursive: true });
