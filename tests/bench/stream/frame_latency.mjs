// From a depth picture to a viewer's screen: a folder of frames is sent to `serve --map live` at its own pace, and a viewer in another
// process decodes every tile. For each depth picture: how long from its being sent until the server says that it is mapped, until the
// viewer has decoded the first tile after he was told of a version with what was handed over after that, and until he has all of it.
//   node tests/bench/stream/frame_latency.mjs FRAMES [--voxel 0.01] [--seconds 12] [--from 2]
// All share the machine. Pictures of the first --from seconds are not counted.
import { fork } from "node:child_process";
import { readFileSync } from "node:fs";
import { fileURLToPath } from "node:url";
import { parseArgs } from "node:util";
import { FrameSender, messagesOf } from "../../integration/node/frames_sender.mjs";
import { KIND, SpectraClient } from "../../integration/node/spectra_client.mjs";
import { serve } from "../../integration/node/spectra_server.mjs";

const now_s = () => (performance.timeOrigin + performance.now()) / 1000;

/** The viewer: {changes: [{revision, newest, at}], tiles: [at], complete: [{revision, at}]}. */
async function view(url) {
  const client = await SpectraClient.connect(url);
  const seen = { changes: [], tiles: [], complete: [] };
  let count = 0;
  client.socket.on("message", (data, is_binary) => {
    if (is_binary) {
      for (; count < client.frames.length; count += 1) if (client.frames[count].kind === KIND.geometry) seen.tiles.push(now_s());
      return;
    }
    const { method, params } = JSON.parse(data);
    if (method === "scene.changed") seen.changes.push({ revision: params.scene.revision, newest: params.scene.observed?.newest ?? 0, at: now_s() });
    if (method === "stream.complete") seen.complete.push({ revision: params.scene_revision, at: now_s() });
  });
  await client.request("scene.subscribe", { channels: ["fused"] });
  process.send("ready");
  process.on("message", async () => {
    process.send(seen);
    await client.close();
    process.disconnect();
  });
}

if (process.argv[2] === "--viewer") {
  await view(process.argv[3]);
} else {
  const { values, positionals } = parseArgs({
    allowPositionals: true,
    options: {
      voxel: { type: "string", default: "0.01" },
      seconds: { type: "string", default: "12" },
      from: { type: "string", default: "2" },
    },
  });
  const [seconds, from] = [Number(values.seconds), Number(values.from)];
  const messages = [...messagesOf(positionals[0])].filter(({ head }) => head.time === undefined || head.time <= seconds);
  const server = await serve(["--map", "live", "--voxel", values.voxel]);
  const status = (name) => Number(new RegExp(`${name}:\\s+(\\d+)`).exec(readFileSync(`/proc/${server.process.pid}/status`, "latin1"))[1]);
  const viewer = fork(fileURLToPath(import.meta.url), ["--viewer", server.url]);
  await new Promise((resolve) => viewer.once("message", resolve));
  const sender = await FrameSender.connect(server.url);
  const sent = [];
  let skipped = 0;
  let begin;
  for (const { head, body } of messages) {
    if (head.kind === "picture") {
      begin ??= now_s() - head.time;
      const wait_ms = 1000 * (begin + head.time - now_s());
      if (wait_ms > 0) await new Promise((resolve) => setTimeout(resolve, wait_ms));
    }
    const at = now_s();
    const sequence = await sender.sendSoon(head, body);
    if (head.kind !== "picture") continue;
    const picture = { sensor: head.sensor, time: head.time, at };
    sent.push(picture);
    sender.answer(sequence).then(
      ({ skipped: is_skipped }) => {
        picture.mapped = now_s();
        picture.skipped = is_skipped === true;
        if (is_skipped) skipped += 1;
      },
      () => {},
    );
  }
  await new Promise((resolve) => setTimeout(resolve, 3000));
  const seen = await new Promise((resolve) => {
    viewer.once("message", resolve);
    viewer.send("end");
  });
  const depth = sent.filter(({ sensor, time, mapped, skipped: is_skipped }) => sensor === "depth" && time >= from && mapped && !is_skipped);
  const figures = { mapped: [], handed: [], tile: [], complete: [] };
  for (const { at, mapped } of depth) {
    const change = seen.changes.find(({ newest }) => newest >= mapped);
    if (!change) continue;
    figures.mapped.push(mapped - at);
    figures.handed.push(change.newest - at);
    figures.tile.push((seen.tiles.find((when) => when > change.at) ?? Infinity) - at);
    figures.complete.push((seen.complete.find(({ revision }) => revision >= change.revision)?.at ?? Infinity) - at);
  }
  const line = (name, list) => {
    const sorted = list.toSorted((a, b) => a - b);
    const share = (part) => (1000 * sorted[Math.min(sorted.length - 1, Math.floor(part * sorted.length))]).toFixed(0).padStart(7);
    console.log(`${name.padEnd(34)} ${share(0.5)} ${share(0.95)}`);
  };
  console.log(`${sent.length} pictures in ${seconds} s, ${skipped} skipped; ${seen.changes.length} versions, ${seen.tiles.length} tiles; server ${(status("VmHWM") / 1024).toFixed(0)} MB`);
  console.log(`${"ms from the sending of a depth picture".padEnd(34)} median   p95`);
  line("until it is mapped", figures.mapped);
  line("until what it changed is handed over", figures.handed);
  line("until a tile of that is decoded", figures.tile);
  line("until all of that is", figures.complete);
  await sender.close();
  await server.stop();
}
