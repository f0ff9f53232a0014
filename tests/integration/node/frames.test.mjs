// A robot sends frames: they become the map, whatever is wrong with some of them is answered and counted, and the connection lives on.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { existsSync, mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import path from "node:path";
import { after, test } from "node:test";
import { deflateSync, crc32 } from "node:zlib";
import { FrameSender, frameMessage, messagesOf } from "./frames_sender.mjs";
import { closeCodeAfter, closeFrame } from "./raw_websocket.mjs";
import { SpectraClient } from "./spectra_client.mjs";
import { binary, serve } from "./spectra_server.mjs";

const scratch = mkdtempSync(path.join(tmpdir(), "spectra-frames-"));
after(() => rmSync(scratch, { recursive: true, force: true }));

const [WIDTH, HEIGHT, FOCAL] = [80, 60, 70];
const camera = { width: WIDTH, height: HEIGHT, fx: FOCAL, fy: FOCAL, cx: (WIDTH - 1) / 2, cy: (HEIGHT - 1) / 2 };
const IDENTITY = [
  [1, 0, 0, 0],
  [0, 1, 0, 0],
  [0, 0, 1, 0],
  [0, 0, 0, 1],
];
const calibration = (more = {}) =>
  Buffer.from(JSON.stringify({ depth: camera, thermal: { ...camera, unit: "centikelvin", from_depth: IDENTITY }, ...more }));
const raw = (value, width = WIDTH, height = HEIGHT) => {
  const body = Buffer.alloc(2 * width * height);
  for (let i = 0; i < width * height; i += 1) body.writeUInt16LE(typeof value === "function" ? value(i % width) : value, 2 * i);
  return body;
};
const depth = (time, body = raw(1500), more = {}) => [
  { kind: "picture", sensor: "depth", encoding: "raw16", width: WIDTH, height: HEIGHT, time, ...more },
  body,
];
const thermal = (time, i) => [
  { kind: "picture", sensor: "thermal", encoding: "raw16", width: WIDTH, height: HEIGHT, time },
  raw((x) => 29315 + (i % 3) + (x > WIDTH / 2 ? 1000 : 0)),
];
const poses = (...times) => ({ kind: "poses", poses: times.map((time) => [time, 0, 0, 0, 0, 0, 0, 1]) });
const live = (args = [], voxel = "0.02") => serve(["--map", "live", "--voxel", voxel, ...args]);

async function sceneOf(server, is = () => true) {
  for (let i = 0; i < 400; i += 1) {
    const scene = await (await fetch(`${server.url}/api/v1/scene`)).json();
    if (scene?.vertex_count > 0 && is(scene)) return scene;
    await new Promise((resolve) => setTimeout(resolve, 50));
  }
  throw new Error("no map came of it");
}

/** A wall 1.5 m away with a warm half, seen ten times. */
async function sendWall(sender, begin = 0) {
  const asked = [];
  for (let i = 0; i < 10; i += 1) {
    const time = begin + 0.1 * i;
    asked.push(await sender.sendSoon(poses(time, time + 0.05)));
    asked.push(await sender.sendSoon(...depth(time)));
    asked.push(await sender.sendSoon(...thermal(time, i)));
  }
  for (const sequence of asked) assert.equal((await sender.answer(sequence)).method, "frames.taken");
}

test("frames become the map, with their temperatures, how sure they are, and where the robot is", async () => {
  const server = await live();
  const client = await SpectraClient.connect(server.url);
  const sender = await FrameSender.connect(server.url);
  assert.equal(sender.hello.protocol, "spectra.frames.v1");
  assert.equal((await sender.ask({ kind: "calibration" }, calibration())).method, "frames.taken");
  await sendWall(sender, 1.7e9);
  assert.equal((await sender.ask({ kind: "end" })).method, "frames.taken");
  const scene = await sceneOf(server, ({ temperature }) => temperature.max > 29);
  assert.ok(Math.abs(scene.temperature.min - 20) < 0.2 && Math.abs(scene.temperature.max - 30) < 0.2);
  const probe = await client.request("scene.probe", { position: [0, 1, 2].map((axis) => [0.4, 0, 1.5][axis] - scene.origin[axis]) });
  assert.ok(Math.abs(probe.temperature - 30) < 0.2 && probe.temperature_sigma > 0 && probe.temperature_sigma < 1);
  assert.ok(Math.abs(probe.temperature_at - 1.7e9) < 1, `${probe.temperature_at}: the robot's own clock counts from 1970`);
  const robot = client.notifications.findLast(({ method }) => method === "robot.moved").params;
  assert.deepEqual([robot.position, robot.forward], [[0, 0, 0], [0, 0, 1]]);

  // Another robot waits until this one is gone; and the same map goes on, though the clock of the next one is behind.
  await assert.rejects(FrameSender.connect(server.url), /503/);
  await sender.close();
  let next;
  for (let i = 0; next === undefined; i += 1) {
    next = await FrameSender.connect(server.url).catch((error) => assert.ok(i < 100, error.message));
    if (next === undefined) await new Promise((resolve) => setTimeout(resolve, 20));
  }
  const other = await next.ask({ kind: "calibration" }, calibration({ poses: { of: "depth", sense: "world_to_camera" } }));
  assert.deepEqual([other.method, other.code], ["frames.refused", "other_calibration"]);
  assert.equal((await next.ask({ kind: "calibration" }, calibration())).method, "frames.taken");
  await sendWall(next, 5);
  await next.close();
  await client.close();
  await server.stop();
});

test("what is wrong with a message is answered with a reason, said once, and changes nothing", async () => {
  const server = await live();
  const sender = await FrameSender.connect(server.url);
  const refusal = async (head, body) => {
    const { method, code, reason } = await sender.ask(head, body);
    assert.equal(method, "frames.refused", JSON.stringify(head));
    assert.match(reason, /^[^\n]{10,200}$/);
    return code;
  };
  assert.equal(await refusal(...depth(0)), "no_calibration");
  assert.equal(await refusal({ kind: "calibration" }, Buffer.from("{}")), "bad_calibration");
  const skewed = { ...camera, from_depth: IDENTITY.map((row) => row.map((value) => 3 * value)) };
  assert.equal(await refusal({ kind: "calibration" }, calibration({ thermal: skewed })), "bad_calibration");
  await sender.ask({ kind: "calibration" }, calibration());
  await sendWall(sender);
  await sceneOf(server, ({ temperature }) => temperature.max > 29);

  const png = (() => {
    const chunk = (kind, data) => {
      const text = Buffer.concat([Buffer.from(kind, "latin1"), data]);
      const ends = [Buffer.alloc(4), Buffer.alloc(4)];
      ends[0].writeUInt32BE(data.length);
      ends[1].writeUInt32BE(crc32(text));
      return Buffer.concat([ends[0], text, ends[1]]);
    };
    const head = Buffer.alloc(13);
    head.writeUInt32BE(WIDTH, 0);
    head.writeUInt32BE(HEIGHT, 4);
    head.writeUInt8(16, 8);
    const row = Buffer.concat([Buffer.alloc(1), raw(1500, WIDTH, 1).swap16()]);
    const rows = Buffer.concat(Array.from({ length: HEIGHT }, () => row));
    const magic = Buffer.from("\x89PNG\r\n\x1a\n", "latin1");
    return Buffer.concat([magic, chunk("IHDR", head), chunk("IDAT", deflateSync(rows)), chunk("IEND", Buffer.alloc(0))]);
  })();
  let time = 1;
  const now = () => (time += 0.01);
  await sender.ask(poses(1, 1.05, 1.1, 1.15, 1.2, 1.25));
  const at = (body, more) => depth(now(), body, more);
  assert.equal((await sender.ask(...at(png, { encoding: "png" }))).method, "frames.taken");
  assert.equal(await refusal(...at(png.subarray(0, png.length - 30), { encoding: "png" })), "damaged_picture");
  assert.equal(await refusal(...at(Buffer.from("no picture"), { encoding: "png" })), "damaged_picture");
  assert.equal(await refusal(...at(raw(1500, 40, 30), { width: 40, height: 30 })), "wrong_size");
  assert.equal(await refusal(...at(raw(1500, 40, 30))), "damaged_picture");
  assert.equal(await refusal(...at(png, { encoding: "jpeg" })), "damaged_picture");
  assert.equal(await refusal({ ...at()[0], sensor: "color", encoding: "jpeg" }, png), "no_calibration");
  assert.equal(await refusal(...depth(0.5)), "backward_clock");
  assert.equal(await refusal(...depth(1e6)), "no_pose");
  assert.equal(await refusal(poses(0.2)), "backward_pose");
  assert.equal(await refusal({ kind: "poses", poses: [[2, 0, 0, 0, 0, 0, 0, 9]] }), "bad_pose");
  assert.equal(await refusal({ kind: "poses", poses: [[2, 1e39, 1e300, 0, 0, 0, 0, 0]] }), "bad_pose");
  // What is no message at all: the answer has no sequence.
  for (const bad of [
    frameMessage('{"kind":"poses","sequence":1,"poses":[[1,NaN,0,0,0,0,0,1]]}'),
    frameMessage({ kind: "poses", sequence: 1, poses: [[1, null, 0, 0, 0, 0, 0, 1]] }),
    frameMessage({ kind: "picture", sequence: 1, time: 1 }),
    frameMessage({ kind: "film", sequence: 1 }),
    frameMessage("{"),
    Buffer.from("SPF1\xff\xff\xff\x7f{}", "latin1"),
    Buffer.from("GET /"),
    Buffer.alloc(0),
  ]) {
    sender.answers.delete(0);
    sender.send(bad);
    const { method, code } = await sender.answer(0);
    assert.deepEqual([method, code], ["frames.refused", "bad_request"], bad.toString("latin1"));
  }
  // A pose that jumps: what is seen from there would smear the map.
  await sender.ask({ kind: "poses", poses: [[1.3, 0, 0, 0, 0, 0, 0, 1], [1.31, 3, 0, 0, 0, 0, 0, 1], [1.36, 3, 0, 0, 0, 0, 0, 1]] });
  assert.match(await refusal(...depth(1.34)), /^(jumping|unfitting)_pose$/);
  assert.equal(server.errors().match(/are not later|is not later/g)?.length ?? 0, 2, server.errors());
  assert.equal(server.errors().match(/said once/g).length, new Set(server.errors().match(/.*said once/g)).size);

  // The connection lives, and the map is clean.
  await sender.ask(poses(3, 3.05));
  const sequence = await sender.sendSoon(...depth(3.01));
  const last = await sender.answer(sequence);
  assert.equal(last.method, "frames.taken", last.reason);
  const scene = await sceneOf(server);
  const wall = [
    [-1, -0.8, 1.4],
    [1, 0.8, 1.6],
  ];
  scene.bounds.min.forEach((value, axis) => assert.ok(value + scene.origin[axis] > wall[0][axis], `${scene.bounds.min}`));
  scene.bounds.max.forEach((value, axis) => assert.ok(value + scene.origin[axis] < wall[1][axis], `${scene.bounds.max}`));
  await sender.close();
  await server.stop();
});

test("who sends ten times what can be mapped is asked for less, and what is skipped is counted", async () => {
  const server = await live([], "0.01");
  const sender = await FrameSender.connect(server.url);
  const large = { ...camera, width: 640, height: 480, cx: 320, cy: 240, fx: 500, fy: 500 };
  await sender.ask({ kind: "calibration" }, Buffer.from(JSON.stringify({ depth: large })));
  const wall = raw((x) => 1500 + (x % 7), 640, 480);
  const asked = [];
  for (let i = 0; i < 400; i += 1) {
    if (i % 10 === 0) await sender.sendSoon(poses(...Array.from({ length: 10 }, (_, k) => 0.01 * (i + k))));
    asked.push(await sender.sendSoon(...depth(0.01 * i, wall, { width: 640, height: 480 })));
  }
  const answers = await Promise.all(asked.map((sequence) => sender.answer(sequence)));
  assert.ok(answers.every(({ method }) => method === "frames.taken"));
  const skipped = answers.filter((answer) => answer.skipped);
  assert.ok(skipped.length > 50, `${skipped.length} skipped`);
  const wanted = answers.filter(({ pictures_per_s }) => pictures_per_s !== undefined);
  assert.ok(wanted.length > 0 && wanted.every(({ pictures_per_s }) => pictures_per_s > 0.5 && pictures_per_s < 1000));
  await sceneOf(server);

  // Without a look at the credit: 600 messages at once.
  const wild = Array.from({ length: 600 }, (_, i) => sender.send(...depth(10 + 0.01 * i, raw(1500))));
  const all = await Promise.all(wild.map((sequence) => sender.answer(sequence)));
  assert.ok(all.every(({ method, code }) => method === "frames.taken" || ["wrong_size", "no_pose", "credit"].includes(code)));
  assert.equal((await sender.ask(poses(20))).method, "frames.taken", "it lives on");
  await sender.close();
  await server.stop();
});

test("who sends on beyond the credit and takes no answers is not listened to: what waits for him stays little", async () => {
  const server = await live();
  const sender = await FrameSender.connect(server.url);
  sender.socket.pause();
  const garbage = Buffer.alloc(1000);
  const count = 60_000;
  for (let i = 0; i < count; i += 1) sender.socket.send(garbage);
  // What the system holds on the way is a few megabytes; the rest stays here.
  let held = sender.socket.bufferedAmount;
  for (let still = 0; still < 15; ) {
    await new Promise((resolve) => setTimeout(resolve, 100));
    still = sender.socket.bufferedAmount === held ? still + 1 : 0;
    held = sender.socket.bufferedAmount;
  }
  assert.ok(held > (count * garbage.length) / 2, `${held} bytes have not been taken`);
  sender.socket.resume();
  await sender.until(() => sender.credit.messages > count);
  assert.ok(sender.answers.size > 0);
  sender.socket.terminate();
  await server.stop();
});

test("a close with a code that the standard gives to nobody is answered with 1002, by senders' sockets too", async () => {
  const server = await live();
  for (const [target, subprotocol] of [["/frames", "spectra.frames.v1"], ["/ingest", "spectra.ingest.v1"], ["/ws", "spectra.v1"]]) {
    for (const [code, expected] of [[5000, 1002], [65_535, 1002], [1000, 1000]]) {
      const url = new URL(target, server.url);
      assert.equal(await closeCodeAfter(url, [closeFrame(code)], { subprotocol }), expected, `${target} ${code}`);
    }
  }
  await server.stop();
});

test("there are frames for a map that is made of them alone, of one subprotocol, from whoever may change it", async () => {
  const plain = await serve(["--live"]);
  await assert.rejects(FrameSender.connect(plain.url), /404/);
  await plain.stop();
  const server = await live();
  await assert.rejects(FrameSender.connect(server.url, { protocol: "spectra.ingest.v1" }), /400/);
  await server.stop();

  const tokens = path.join(scratch, "tokens");
  const token = (role) => spawnSync(binary, ["token", "--file", tokens, "--role", role], { encoding: "utf8" }).stdout.trim();
  const [viewer, ingest] = [token("viewer"), token("ingest")];
  token("admin");
  const guarded = await live(["--tokens", tokens]);
  const as = (word) => FrameSender.connect(guarded.url, word ? { headers: { Authorization: `Bearer ${word}` } } : {});
  await assert.rejects(as(null), /401/);
  await assert.rejects(as(viewer), /403/);
  const sender = await as(ingest);
  await sender.close();
  await guarded.stop();
});

test("a recorded drive sent as frames is the map that the folder gives", { timeout: 120_000 }, async () => {
  const folder = path.join(scratch, "drive");
  const made = spawnSync(binary, ["demo-frames", folder, "--seconds", "1", "--seed", "3"], { encoding: "utf8" });
  assert.equal(made.status, 0, made.stderr);
  assert.ok(existsSync(path.join(folder, "frames.txt")));
  const ply = path.join(scratch, "map.ply");
  const mapped = spawnSync(binary, ["map", folder, ply, "--voxel", "0.03"], { encoding: "utf8" });
  assert.equal(mapped.status, 0, mapped.stderr);
  const wanted = Number(/mesh\s+(\d+) vertices/.exec(mapped.stdout)[1]);
  const server = await serve(["--map", "live", "--voxel", "0.03"]);
  const sender = await FrameSender.connect(server.url);
  const asked = [];
  for (const { head, body } of messagesOf(folder)) {
    // A folder can wait, as a camera could not.
    if (head.kind === "picture") assert.equal((await sender.ask(head, body)).skipped, undefined);
    else asked.push(await sender.sendSoon(head, body));
  }
  for (const sequence of asked) assert.equal((await sender.answer(sequence)).method, "frames.taken");
  const scene = await sceneOf(server, ({ vertex_count }) => vertex_count > 0.98 * wanted);
  // Units have the vertices of their borders each.
  assert.ok(scene.vertex_count < 1.25 * wanted, `${scene.vertex_count} of ${wanted}`);
  assert.ok(scene.temperature.max > 20);
  await sender.close();
  await server.stop();
});
