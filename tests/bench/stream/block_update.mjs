// A block of 10,000 vertices that is put again and again into a scene, while a Node viewer who sees all of it at full detail decodes:
// how long until the changed leaves are decoded and until everything is, what is sent, and what it costs the server.
//   node tests/bench/stream/block_update.mjs [--live | --cut VERTICES] [--raw] [--rounds N] [SCENE.ply ...]
// Without a scene: demo scenes of 100,000 and 1,000,000 vertices. With --live the scene is a block of a map that began empty; with
// --cut it comes in blocks of so many vertices, and one of these is replaced, a tenth of a degree warmer or colder each time. With
// --raw the viewer makes the colours itself, of raw layers.
import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync, statSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import path from "node:path";
import { parseArgs } from "node:util";
import { patch } from "../../integration/node/patch.mjs";
import { readPly } from "../../integration/node/ply.mjs";
import { isColours, KIND, SpectraClient } from "../../integration/node/spectra_client.mjs";
import { binary, serve } from "../../integration/node/spectra_server.mjs";
import { cutScene } from "./cut_scene.mjs";

const { values: options, positionals: scenes } = parseArgs({
  options: { live: { type: "boolean", default: false }, cut: { type: "string", default: "0" }, raw: { type: "boolean", default: false }, rounds: { type: "string", default: "20" } },
  allowPositionals: true,
});
const ROUNDS = Number(options.rounds);
// The block alone, as a file that holds what its two frames hold.
const scratch = mkdtempSync(path.join(tmpdir(), "spectra-update-"));
if (scenes.length === 0) {
  for (const count of [100_000, 1_000_000]) {
    const file = path.join(scratch, `${count}.ply`);
    execFileSync(binary, ["demo-scene", file, "--vertices", `${count}`]);
    scenes.push(file);
  }
}

const median = (values) => values.sort((a, b) => a - b)[values.length >> 1];
/** Seconds of processor time of a process, its children apart. */
function cpuSeconds(pid) {
  const fields = readFileSync(`/proc/${pid}/stat`, "latin1").split(") ")[1].split(" ");
  return (Number(fields[11]) + Number(fields[12])) / 100;
}

for (const scene of scenes) {
  const most = Number(options.cut);
  const server = await serve(options.live || most > 0 ? ["--live"] : [scene]);
  const put = async (id, body) => {
    const response = await fetch(`${server.url}/api/v1/blocks/${id}`, { method: "PUT", body });
    if (!response.ok) throw new Error(await response.text());
  };
  if (options.live) await put("scene", readFileSync(scene));
  const blocks = most > 0 ? cutScene(readPly(scene), most) : [];
  for (const [place, block] of blocks.entries()) await put(`b${place}`, block.warmer(0));
  for (let before = null, now = 0; before !== now; await new Promise((resolve) => setTimeout(resolve, 1000))) {
    before = now;
    now = (await (await fetch(`${server.url}/api/v1/scene`)).json()).revision;
  }
  const client = await SpectraClient.connect(server.url);
  await client.request("scene.subscribe", { channels: options.raw ? ["temperature", "visible"] : ["fused"], colour_transform: "subtract_green" });
  await client.notification("stream.complete", 120_000, ({ vertices }) => vertices > 0);
  const { bounds, origin } = client.hello.scene;
  const middle = bounds.min.map((low, axis) => (low + bounds.max[axis]) / 2);
  const extent = Math.max(...bounds.min.map((low, axis) => bounds.max[axis] - low));
  const times = { leaf_ms: [], all_ms: [], cpu_ms: [], bytes: [], tiles: [] };
  let body;
  for (let round = 0; round < ROUNDS; round += 1) {
    const place = (7 * round) % Math.max(1, blocks.length);
    body =
      blocks.length > 0
        ? blocks[place].warmer(round % 2 === 0 ? 0.1 : -0.1)
        : patch(0, 0, {
            side: 101,
            height: round / 10,
            scale: extent / 2000,
            at: middle.map((value, axis) => value + origin[axis]),
          });
    const first = client.frames.length;
    const before_s = cpuSeconds(server.process.pid);
    const begin = performance.now();
    const { revision } = client.notifications.findLast(({ method }) => method === "scene.changed")?.params.scene ?? client.hello.scene;
    const complete = client.notification("stream.complete", 60_000, ({ scene_revision }) => scene_revision > revision);
    const answered = put(blocks.length > 0 ? `b${place}` : "patch", body);
    let leaf_ms = null;
    while (leaf_ms === null) {
      await new Promise((resolve) => setTimeout(resolve, 1));
      if (client.frames.slice(first).some((frame) => isColours(frame) || frame.kind === KIND.visible_subtract_green)) leaf_ms = performance.now() - begin;
    }
    await Promise.all([answered, complete]);
    times.all_ms.push(performance.now() - begin);
    // Coarse tiles that follow count, too.
    if (blocks.length > 0) await new Promise((resolve) => setTimeout(resolve, 1500));
    times.leaf_ms.push(leaf_ms);
    times.cpu_ms.push((cpuSeconds(server.process.pid) - before_s) * 1000);
    const frames = client.frames.slice(first);
    times.bytes.push(frames.reduce((sum, { bytes }) => sum + bytes, 0));
    times.tiles.push(new Set(frames.map(({ tile }) => tile)).size);
  }
  const [alone, alone_file] = ["alone.ply", "alone.drc"].map((name) => path.join(scratch, name));
  writeFileSync(alone, body);
  execFileSync(binary, ["fuse", alone, alone_file, "--method", "histogram_distribution"], { stdio: "ignore" });
  console.log(
    `${path.basename(scene)}: ${client.hello.scene.vertex_count} vertices, ${client.hello.scene.tile_count} tiles; medians of ${ROUNDS}: ` +
      Object.entries(times)
        .map(([name, values]) => `${name} ${median(values).toFixed(0)}`)
        .join(", ") +
      `; the block alone ${statSync(alone_file).size} bytes`,
  );
  await client.close();
  await server.stop();
}
rmSync(scratch, { recursive: true, force: true });
