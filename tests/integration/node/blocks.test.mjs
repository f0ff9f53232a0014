// A mapper puts blocks into the map with plain HTTP while a viewer watches: what has changed is sent, nothing else; what cannot be
// taken is refused with a reason and changes nothing; and with a store the map is there again after the server was killed.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { once } from "node:events";
import { mkdtempSync, rmSync, statSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import path from "node:path";
import { after, test } from "node:test";
import { patch } from "./patch.mjs";
import { readPly } from "./ply.mjs";
import { KIND, SpectraClient } from "./spectra_client.mjs";
import { serve } from "./spectra_server.mjs";

const scratch = mkdtempSync(path.join(tmpdir(), "spectra-blocks-"));
after(() => rmSync(scratch, { recursive: true, force: true }));

async function ask(server, method, id, { body, query = "" } = {}) {
  const reply = await fetch(`${server.url}/api/v1/blocks/${id}${query}`, { method, body });
  const text = await reply.text();
  return { status: reply.status, answer: reply.headers.get("content-type")?.includes("json") ? JSON.parse(text) : text };
}

async function put(server, id, body, query) {
  const { status, answer } = await ask(server, "PUT", id, { body, query });
  assert.equal(status, 200, JSON.stringify(answer));
  return answer;
}

async function list(server, query = "") {
  return (await fetch(`${server.url}/api/v1/blocks${query}`)).json();
}

const sceneOf = async (server) => (await fetch(`${server.url}/api/v1/scene`)).json();

/** The picture of a revision of the scene is complete. */
async function shows(client, revision) {
  await client.notification("stream.complete", 60_000, ({ scene_revision }) => scene_revision >= revision);
  assert.deepEqual(client.failures, []);
}

test("a viewer is sent what has changed, and nothing else", async (t) => {
  const server = await serve(["--live"]);
  for (let i = 0; i < 16; i += 1) await put(server, `b${i}`, patch(i % 4, Math.floor(i / 4), { celsius: i === 5 ? 30 : 20 }));
  const before = await sceneOf(server);
  assert.equal(before.vertex_count, 16 * 101 * 101);
  const client = await SpectraClient.connect(server.url);
  await client.request("scene.subscribe", { channels: ["fused"] });
  await shows(client, before.revision);
  const held = new Map(client.tiles);
  const first = client.frames.length;

  await put(server, "b3", patch(3, 0, { height: 0.5 }));
  const changed = await sceneOf(server);
  assert.equal(changed.vertex_count, before.vertex_count);
  await shows(client, changed.revision);
  const frames = client.frames.slice(first);
  const geometry = frames.filter(({ kind }) => kind === KIND.geometry);
  t.diagnostic(`${held.size} tiles, ${frames.length} frames after the change, ${geometry.length} of them geometry`);
  assert.ok(geometry.length > 0 && geometry.length <= held.size / 2, `${geometry.length} of ${held.size} tiles`);
  const sent = new Set(geometry.map(({ tile }) => tile));
  assert.ok(
    frames.filter(({ kind }) => kind !== KIND.remove).every(({ tile }) => sent.has(tile)),
    "colours of tiles that have not changed were sent",
  );

  // The same as a viewer who comes now.
  const fresh = await SpectraClient.connect(server.url);
  await fresh.request("scene.subscribe", { channels: ["fused"] });
  await shows(fresh, changed.revision);
  const keys = (viewer) => viewer.drawnTiles().map(({ frame }) => frame.tile).sort();
  assert.deepEqual(keys(client), keys(fresh));

  assert.equal((await ask(server, "DELETE", "b3")).status, 200);
  const less = await sceneOf(server);
  assert.equal(less.vertex_count, before.vertex_count - 101 * 101);
  await shows(client, less.revision);
  await client.close();
  await fresh.close();
  await server.stop();
});

test("blocks are listed in pages and given back as they came", async () => {
  const server = await serve(["--live"]);
  assert.deepEqual(await list(server), { blocks: [], next: null });
  const ids = ["a", "b.1", "c-2", "d_3"];
  for (const [i, id] of ids.entries()) await put(server, id, patch(i, 0, { side: 11 }), `?observed_at=${1000 + i}.5`);
  const { blocks, next } = await list(server, "?limit=3");
  assert.deepEqual(
    blocks.map(({ id, observed_at, vertex_count, triangle_count }) => [id, observed_at, vertex_count, triangle_count]),
    ids.slice(0, 3).map((id, i) => [id, 1000.5 + i, 121, 200]),
  );
  assert.equal(next, "c-2");
  assert.match(blocks[0].sha256, /^[0-9a-f]{64}$/);
  assert.deepEqual([blocks[1].bounds.min.slice(0, 2), blocks[1].bounds.max.slice(0, 2)], [[10, 0], [20, 10]]);
  const rest = await list(server, `?after=${next}`);
  assert.deepEqual([rest.blocks.map(({ id }) => id), rest.next], [["d_3"], null]);

  const reply = await fetch(`${server.url}/api/v1/blocks/b.1`);
  const file = path.join(scratch, "back.ply");
  writeFileSync(file, Buffer.from(await reply.arrayBuffer()));
  const sent = path.join(scratch, "sent.ply");
  writeFileSync(sent, patch(1, 0, { side: 11 }));
  assert.deepEqual(readPly(file), readPly(sent));
  await server.stop();
});

const sleep = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

test("how sure a temperature is reaches whoever asks, and every file", async () => {
  const store = path.join(scratch, "sure.spectra");
  const begin = () => serve(["--live", "--store", store]);
  let server = await begin();
  await put(server, "sure", patch(0, 0, { side: 11, sigma: 0.25, seen: 1700000123.5 }), "?observed_at=1700000200");
  await put(server, "plain", patch(1, 0, { side: 11 }));
  const { notes } = await put(server, "ms", patch(20, 0, { side: 11, sigma: 0.25, seen: 1700000123500 }));
  assert.deepEqual(notes.map(({ id, count }) => [id, count]), [["absurd_times", 121]]);
  assert.equal((await ask(server, "DELETE", "ms")).status, 200);
  const check = async () => {
    const { origin } = await sceneOf(server);
    const client = await SpectraClient.connect(server.url);
    const probe = (x, y) => client.request("scene.probe", { position: [x - origin[0], y - origin[1], -origin[2]] });
    const sure = await probe(3, 4);
    assert.deepEqual([sure.temperature_sigma, sure.temperature_at, sure.observed_at], [0.25, 1700000123.5, 1700000200]);
    const plain = await probe(15, 4);
    assert.deepEqual([plain.temperature_sigma, plain.temperature_at], [undefined, undefined]);
    assert.ok(client.hello.capabilities.includes("temperature_sigma"));
    assert.equal(client.hello.scene.has_temperature_sigma, true);
    await client.request("scene.subscribe", { channels: ["fused", "temperature_sigma"] });
    await client.complete(1);
    const tiles = () => [...client.tiles.values()];
    for (let i = 0; i < 100 && !(tiles().length > 0 && tiles().every(({ sigma }) => sigma)); ++i) await sleep(50);
    const kelvin = tiles().flatMap(({ sigma: { codes, scale, offset } }) =>
      [...codes].map((code) => (code === 65535 ? null : Math.round((code * scale + offset) * 1000) / 1000)),
    );
    assert.deepEqual([...new Set(kelvin)].sort(), [0.25, null]);
    assert.equal(kelvin.filter((value) => value === 0.25).length, 11 * 11, "of every vertex of the block, and no other");
    await client.close();
    for (const [at, sigmas] of [
      ["blocks/sure", [0.25]],
      ["blocks/plain", null],
      ["scene.ply", [0.25, NaN]],
    ]) {
      const file = path.join(scratch, "got.ply");
      writeFileSync(file, Buffer.from(await (await fetch(`${server.url}/api/v1/${at}`)).arrayBuffer()));
      const ply = readPly(file);
      assert.deepEqual(ply.sigma && [...new Set(ply.sigma)].sort(), sigmas, at);
      if (ply.sigma) assert.ok(ply.seen.some((time) => time === 1700000123.5), at);
    }
  };
  await check();
  server.process.kill("SIGKILL");
  await once(server.process, "exit");
  server = await begin();
  await check();
  await server.stop();
});

test("what cannot be taken is refused with a reason, and the map stays as it was", async () => {
  const server = await serve(["--live"]);
  await put(server, "good", patch(0, 0, { side: 11 }));
  const before = await sceneOf(server);
  const points = patch(5, 0, { side: 5 });
  const cloud = Buffer.concat([
    Buffer.from(points.toString("latin1", 0, 400).split("element face")[0] + "end_header\n", "latin1"),
    points.subarray(points.indexOf("end_header\n") + 11, points.indexOf("end_header\n") + 11 + 25 * 19),
  ]);
  const cases = [
    [422, "body", await ask(server, "PUT", "x", { body: "no PLY" })],
    [422, "body", await ask(server, "PUT", "x", { body: patch(0, 0).subarray(0, 5000) })],
    [422, "body", await ask(server, "PUT", "x", { body: "" })],
    [409, "body", await ask(server, "PUT", "x", { body: cloud })],
    [400, "id", await ask(server, "PUT", "a%20b", { body: patch(0, 0, { side: 3 }) })],
    [400, "id", await ask(server, "PUT", "x".repeat(65), { body: patch(0, 0, { side: 3 }) })],
    [400, "observed_at", await ask(server, "PUT", "x", { body: patch(0, 0, { side: 3 }), query: "?observed_at=now" })],
    ...(await Promise.all(
      ["1e300", "-5", String(Date.now())].map(async (time) => [
        400,
        "observed_at",
        await ask(server, "PUT", "x", { body: patch(0, 0, { side: 3 }), query: `?observed_at=${time}` }),
      ]),
    )),
    [422, "body", await ask(server, "PUT", "x", { body: patch(0, 0, { side: 3, scale: 4e29 }) })],
    [422, "body", await ask(server, "PUT", "x", { body: patch(0, 0, { side: 3, at: [691000, 5334000, 0] }) })],
    [400, "sensor", await ask(server, "PUT", "x", { body: patch(0, 0, { side: 3 }), query: "?sensor=1,2" })],
    [400, "colour", await ask(server, "PUT", "x", { body: patch(0, 0, { side: 3 }), query: "?colour=red" })],
    [400, "temperature_unit", await ask(server, "PUT", "x", { body: "", query: "?temperature_unit=reaumur" })],
    [400, "scale", await ask(server, "PUT", "x", { body: patch(0, 0, { side: 3 }), query: "?scale=1&scale=2" })],
    [400, "at", await ask(server, "GET", "good", { query: "?at=1&at=2" })],
    [400, "scale", await ask(server, "DELETE", "good", { query: "?scale=1" })],
    [404, "id", await ask(server, "DELETE", "x")],
    [404, "id", await ask(server, "GET", "x")],
  ];
  for (const [status, field, got] of cases) {
    assert.equal(got.status, status, JSON.stringify(got));
    assert.equal(got.answer.error.field, field, JSON.stringify(got));
    assert.ok(got.answer.error.code.length > 0 && got.answer.error.reason.length > 10, JSON.stringify(got));
    assert.doesNotMatch(got.answer.error.reason, /\/proc\//);
  }
  const unknown = await ask(server, "POST", "x", { body: "x" });
  assert.equal(unknown.status, 405);
  assert.equal(unknown.answer.error.code, "method_not_allowed");
  const cut = await ask(server, "GET", "a%");
  assert.equal(cut.status, 400);
  assert.equal(cut.answer.error.field, "target");
  const foreign = await fetch(`${server.url}/api/v1/blocks/x`, {
    method: "PUT",
    body: patch(0, 0, { side: 3 }),
    headers: { Origin: "http://elsewhere.example" },
  });
  assert.equal(foreign.status, 403);
  assert.deepEqual(await sceneOf(server), before);
  await server.stop();
});

test("with a store the map is there again after the server was killed", async () => {
  const store = path.join(scratch, "map.sqlite");
  let server = await serve(["--live", "--store", store]);
  for (let i = 0; i < 6; i += 1) await put(server, `b${i}`, patch(i, 0, { side: 21 }), `?observed_at=${i}`);
  await put(server, "b2", patch(2, 0, { side: 21, height: 2 }), "?temperature_unit=kelvin");
  await ask(server, "DELETE", "b4");
  // The name that a served file has is a name like others.
  await put(server, "scene", patch(7, 0, { side: 21 }));
  assert.equal((await ask(server, "DELETE", "scene")).status, 200);
  const before = { scene: await sceneOf(server), blocks: await list(server) };
  server.process.kill("SIGKILL");
  await once(server.process, "exit");
  server = await serve(["--live", "--store", store], { ready: false });
  // Until the map is open nothing is said of it.
  for (const deadline = Date.now() + 60_000; ; ) {
    assert.ok(Date.now() < deadline, "the map opens");
    const reply = await fetch(`${server.url}/api/v1/blocks`);
    const block = await fetch(`${server.url}/api/v1/blocks/b1`);
    assert.ok([200, 503].includes(block.status), `${block.status}`);
    if (reply.status === 200) {
      assert.deepEqual(await reply.json(), before.blocks);
      break;
    }
    assert.deepEqual([reply.status, reply.headers.get("retry-after")], [503, "1"]);
  }
  while ((await fetch(`${server.url}/readyz`)).status !== 200) await sleep(20);
  const scene = await sceneOf(server);
  for (const name of ["vertex_count", "triangle_count", "bounds", "origin", "position_step_m", "temperature", "tile_count"]) {
    assert.deepEqual(scene[name], before.scene[name], name);
  }
  assert.deepEqual(await list(server), before.blocks);
  const { revision } = await put(server, "b9", patch(9, 0, { side: 21 }));
  assert.ok(revision > Math.max(...before.blocks.blocks.map((block) => block.revision)), "revisions rise");
  await server.stop();
});

test("on a disk that is full the picture goes on, operators are told, mappers are refused, and what was taken is there", async () => {
  const store = path.join(scratch, "full.sqlite");
  let server = await serve(["--live", "--store", store]);
  const counted = async () => Number(/^spectra_store_failures_total (\d+)/m.exec(await (await fetch(`${server.url}/metrics`)).text())[1]);
  await put(server, "a", patch(0, 0));
  const client = await SpectraClient.connect(server.url);
  await client.request("scene.subscribe", { channels: ["fused"] });
  await client.complete((await client.request("fusion.get")).generation);

  // No file of the server may grow beyond what the store has now.
  const limit = (bytes) => assert.equal(spawnSync("prlimit", ["--pid", `${server.process.pid}`, `--fsize=${bytes}:`]).status, 0);
  limit(Math.max(statSync(store).size, statSync(`${store}-wal`).size));
  const told = client.notification("status", 60_000, ({ id, message }) => id === "map_not_stored" && message);
  const taken = ["a"];
  for (let i = 0; i < 4; i += 1) {
    const { status, answer } = await ask(server, "PUT", `b${i}`, { body: patch(1 + i, 0) });
    if (status === 200) taken.push(`b${i}`); // The log may begin anew in the room that it has.
    else assert.deepEqual([status, answer.error.code], [507, "not_stored"]);
  }
  assert.ok(taken.length < 5);
  const { level, message } = await told;
  assert.equal(level, "error");
  assert.match(message, /no room to grow/);
  assert.equal(await counted(), 5 - taken.length);
  const { generation } = await client.request("fusion.set", { method: "thermal_visible_blend", params: { alpha: 0.31 } });
  await client.complete(generation);
  assert.equal((await fetch(`${server.url}/readyz`)).status, 200);

  const cleared = client.notification("status", 60_000, (status) => status.id === "map_not_stored" && status.message === null);
  limit("unlimited");
  await put(server, "c", patch(0, 1));
  taken.push("c");
  await cleared;
  server.process.kill("SIGKILL");
  await once(server.process, "exit");
  server = await serve(["--live", "--store", store]);
  assert.deepEqual((await list(server)).blocks.map(({ id }) => id), taken);
  await server.stop();
});

test("with a store the map can be asked for and served as it was", async () => {
  const store = path.join(scratch, "past.sqlite");
  let server = await serve(["--live", "--store", store]);
  const moments = [];
  const wait = () => new Promise((resolve) => setTimeout(resolve, 20));
  const moment = async () => {
    await wait();
    moments.push(Date.now() / 1000);
    await wait();
  };
  await moment(); // 0: nothing
  const cold = patch(0, 0, { celsius: 20 });
  await put(server, "a", cold, "?observed_at=1000");
  await moment(); // 1: a, cold
  await put(server, "a", patch(0, 0, { celsius: 30 }), "?observed_at=2000");
  await put(server, "b", patch(1, 0));
  await moment(); // 2: a, warm, and b
  await ask(server, "DELETE", "a");
  await moment(); // 3: b

  const names = async (at) => (await list(server, `?at=${at}`)).blocks.map(({ id, observed_at }) => [id, observed_at]);
  const [nothing, first, both, last] = moments;
  assert.deepEqual(await names(nothing), []);
  assert.deepEqual(await names(first), [["a", 1000]]);
  assert.deepEqual(await names(both), [["a", 2000], ["b", null]]);
  assert.deepEqual(await names(last), [["b", null]]);
  assert.deepEqual(await names(new Date(first * 1000).toISOString()), [["a", 1000]]);
  const page = await list(server, `?at=${both}&limit=1`);
  assert.equal(page.next, "a");
  const rest = await list(server, `?at=${both}&limit=1&after=a`);
  assert.deepEqual([rest.blocks.map(({ id }) => id), rest.next], [["b"], null]);

  const block_at = async (id, at) => {
    const reply = await fetch(`${server.url}/api/v1/blocks/${id}?at=${at}`);
    if (!reply.ok) return { status: reply.status, ...(await reply.json()).error };
    const file = path.join(scratch, "past.ply");
    writeFileSync(file, Buffer.from(await reply.arrayBuffer()));
    return readPly(file);
  };
  assert.ok(Math.max(...(await block_at("a", first)).temperature) < 25);
  assert.ok(Math.min(...(await block_at("a", both)).temperature) > 25);
  const { x, y } = await block_at("a", first);
  writeFileSync(path.join(scratch, "cold.ply"), cold);
  const given = readPly(path.join(scratch, "cold.ply"));
  assert.deepEqual([x, y], [given.x, given.y]);
  for (const [id, at, status, code, field] of [
    ["b", first, 404, "not_found", "id"],
    ["a", last, 404, "not_found", "id"],
    ["a", "yesterday", 400, "bad_request", "at"],
  ]) {
    const refusal = await block_at(id, at);
    assert.deepEqual([refusal.status, refusal.code, refusal.field], [status, code, field], `${id} at ${at}`);
  }
  assert.equal((await ask(server, "GET", "b", { query: "?when=1" })).answer.error.field, "when");
  await server.stop();

  server = await serve(["--store", store, "--at", String(first)]);
  const scene = await sceneOf(server);
  assert.deepEqual([scene.live, scene.vertex_count, scene.observed], [false, 101 * 101, { oldest: 1000, newest: 1000 }]);
  assert.match(scene.name, /^map of 20/);
  const client = await SpectraClient.connect(server.url);
  await client.request("scene.subscribe", { channels: ["fused"] });
  await shows(client, scene.revision);
  assert.equal(client.drawnTiles().reduce((sum, { frame }) => sum + frame.vertexCount, 0) >= 101 * 101, true);
  await client.close();
  for (const [method, body] of [["PUT", cold], ["DELETE", undefined]]) {
    const { status, answer } = await ask(server, method, "a", { body });
    assert.deepEqual([status, answer.error.code], [409, "as_it_was"]);
    assert.match(answer.error.reason, /without --at/);
  }
  assert.deepEqual((await list(server)).blocks.map(({ id }) => id), ["a"]);
  assert.deepEqual(await names(both), [["a", 2000], ["b", null]], "it still knows what came later");
  await server.stop();

  // The map of now is what it was, and a small history forgets.
  server = await serve(["--store", store, "--history", "1KB"]);
  assert.deepEqual((await list(server)).blocks.map(({ id }) => id), ["b"]);
  await put(server, "b", patch(1, 0, { celsius: 25 }));
  const gone = await fetch(`${server.url}/api/v1/blocks?at=${first}`);
  const { error } = await gone.json();
  assert.deepEqual([gone.status, error.code, error.field], [410, "history_gone", "at"]);
  assert.match(error.reason, /reaches back to .*--history/);
  await server.stop();

  server = await serve(["--live"]);
  const without = await fetch(`${server.url}/api/v1/blocks?at=${first}`);
  assert.deepEqual([without.status, (await without.json()).error.code], [409, "no_history"]);
  await server.stop();
});
