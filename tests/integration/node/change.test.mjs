// A map that remembers: what was there before is the baseline, "now" can become it, and a viewer sees what has changed and how long ago
// something was seen. It all stands after the server was killed.
import assert from "node:assert/strict";
import { once } from "node:events";
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import path from "node:path";
import { after, test } from "node:test";
import WebSocket from "ws";
import { patch } from "./patch.mjs";
import { readPly } from "./ply.mjs";
import { isColours, SpectraClient } from "./spectra_client.mjs";
import { run, serve } from "./spectra_server.mjs";

const scratch = mkdtempSync(path.join(tmpdir(), "spectra-change-"));
after(() => rmSync(scratch, { recursive: true, force: true }));

const SIDE = 21; // Vertices of a patch, a metre apart.

async function put(server, id, body, observed_at) {
  const query = observed_at === undefined ? "" : `?observed_at=${observed_at}`;
  const reply = await fetch(`${server.url}/api/v1/blocks/${id}${query}`, { method: "PUT", body });
  assert.equal(reply.status, 200, await reply.clone().text());
  return reply.json();
}

const sceneOf = async (server) => (await fetch(`${server.url}/api/v1/scene`)).json();
const room = (column, options) => patch(column, 0, { side: SIDE, ...options });

/** A viewer who shows what is asked for. */
async function viewer(server, fusion) {
  const client = await SpectraClient.connect(server.url);
  const { generation } = await client.request("fusion.set", fusion);
  await client.request("scene.subscribe", { channels: ["fused"] });
  await client.complete(generation);
  return client;
}

async function shows(client, revision) {
  const is = ({ scene_revision }) => scene_revision >= revision;
  const has = client.notifications.some(({ method, params }) => method === "stream.complete" && is(params));
  if (!has) await client.notification("stream.complete", 60_000, is);
  assert.deepEqual(client.failures, []);
}

/** Colours of what is drawn, by place: `visit([x, y, z], [r, g, b])`. */
function eachVertex(client, visit) {
  for (const { frame, geometry, colours } of client.drawnTiles()) {
    for (let v = 0; v < colours.length / 3; v += 1) {
      const place = [0, 1, 2].map((axis) => geometry.positions[3 * v + axis] + frame.origin[axis]);
      visit(place, [...colours.subarray(3 * v, 3 * v + 3)]);
    }
  }
}

/** The places at which the picture is not the visible one, which is of blue 120 and green 90 everywhere. */
function changedPlaces(client) {
  const places = [];
  eachVertex(client, (place, [, green, blue]) => {
    if (Math.abs(green - 90) > 2 || Math.abs(blue - 120) > 2) places.push(place);
  });
  return places;
}

const refusal = async (promise) => {
  try {
    await promise;
  } catch (error) {
    return error;
  }
  assert.fail("it was not refused");
};

test("what becomes warmer is shown where it is, and nowhere else", async () => {
  const server = await serve(["--live"]);
  for (let i = 0; i < 3; i += 1) await put(server, `b${i}`, room(i), 1000 + i);
  assert.deepEqual((await sceneOf(server)).baseline, { marked_at: null });
  const client = await viewer(server, { method: "thermal_change", params: { alpha: 1 }, palette: "blue_red" });
  assert.deepEqual(changedPlaces(client), [], "nothing has changed yet");
  const { fusion } = await client.request("fusion.get");
  assert.deepEqual(fusion.change_scale, { min: -5, max: 5 });

  await put(server, "b1", room(1, { celsius: 22.5 }), 2000);
  await shows(client, (await sceneOf(server)).revision);
  const warm = changedPlaces(client);
  assert.ok(warm.length >= SIDE * SIDE, `${warm.length} places`);
  assert.ok(warm.every(([x]) => x > SIDE - 1.01 && x < 2 * SIDE - 1 + 0.01), "only the block that was put again");
  const { origin } = await sceneOf(server);
  const at = [SIDE + 8.25, 10, 0].map((value, axis) => value - origin[axis]);
  const probe = await client.request("scene.probe", { position: at });
  assert.equal(probe.observed_at, 2000);
  assert.equal(probe.baseline_at, 1001, "what it was when it was first seen");
  assert.ok(Math.abs(probe.temperature - probe.baseline - 2.5) < 1e-3);
  const histogram = await client.request("scene.histogram", { bins: 16 });
  assert.deepEqual(histogram.highlighted, [], "a change is no interval of temperatures");
  assert.ok(Math.abs(histogram.highlighted_share - 1 / 3) < 0.02, `${histogram.highlighted_share} of the surface`);

  // An export is the same picture.
  const file = path.join(scratch, "changed.ply");
  const reply = await fetch(`${server.url}/api/v1/scene.ply?method=thermal_change&alpha=1&palette=blue_red`);
  writeFileSync(file, Buffer.from(await reply.arrayBuffer()));
  const { vertexCount, x, green, blue } = readPly(file);
  assert.equal(vertexCount, 3 * SIDE * SIDE);
  for (let v = 0; v < vertexCount; v += 1) {
    const isChanged = Math.abs(green[v] - 90) > 2 || Math.abs(blue[v] - 120) > 2;
    const isOfThatBlock = Math.floor(v / (SIDE * SIDE)) === 1;
    assert.equal(isChanged, isOfThatBlock, `vertex ${v} at ${x[v]}`);
  }

  // Colours alone are sent when now becomes the baseline, and of the changed tiles alone.
  const before = client.frames.length;
  const marked = await client.request("scene.baseline", { action: "mark" });
  assert.ok(Math.abs(marked.marked_at - Date.now() / 1000) < 30);
  await shows(client, marked.revision);
  assert.deepEqual(changedPlaces(client), []);
  assert.ok(client.frames.slice(before).every(isColours), "no geometry");
  assert.deepEqual((await sceneOf(server)).baseline, { marked_at: marked.marked_at });
  const got = await client.request("scene.baseline", { action: "get" });
  assert.equal(got.marked_at, marked.marked_at);
  const again = await client.request("scene.probe", { position: at });
  assert.equal(again.baseline, again.temperature);
  assert.equal(again.baseline_at, marked.marked_at);
  await client.close();
  await server.stop();
});

test("what is known of before stands after kill -9", async () => {
  const store = path.join(scratch, "map.spectra");
  const server = await serve(["--live", "--store", store]);
  await put(server, "a", room(0), 1000);
  await put(server, "b", room(1), 1001);
  const client = await SpectraClient.connect(server.url);
  await put(server, "a", room(0, { celsius: 30 }), 1500);
  const { marked_at } = await client.request("scene.baseline", { action: "mark" });
  await put(server, "a", room(0, { celsius: 33 }), 3000);
  await put(server, "c", room(2), 3001);
  await put(server, "c", room(2, { celsius: 19 }), 3002);
  const { origin } = await sceneOf(server);
  const places = [10, SIDE + 9, 2 * SIDE + 8].map((x) => [x - origin[0], 10 - origin[1], -origin[2]]);
  const readings = (viewer_) => Promise.all(places.map((position) => viewer_.request("scene.probe", { position })));
  const before = await readings(client);
  server.process.kill("SIGKILL");
  await once(server.process, "exit");

  const risen = await serve(["--live", "--store", store]);
  const other = await SpectraClient.connect(risen.url);
  const now = await readings(other);
  assert.deepEqual(now, before);
  assert.deepEqual(
    now.map(({ temperature, baseline, baseline_at }) => [Math.round(temperature - baseline), baseline_at]),
    [
      [3, marked_at],
      [0, marked_at],
      [-1, 3001],
    ],
  );
  assert.equal((await other.request("scene.baseline", { action: "get" })).marked_at, marked_at);
  await other.close();
  await risen.stop();
  run("store", "check", store);
});

test("what was seen long ago fades, step by step, and only that", async () => {
  const server = await serve(["--live"]);
  const now = Date.now() / 1000;
  await put(server, "old", room(0), now - 100_000);
  await put(server, "new", room(3), now);
  const client = await viewer(server, { method: "visible_only", age: { mode: "fade", half_life_s: 1000 } });
  const greys = (from, to) => {
    const found = [];
    eachVertex(client, ([x], [r, g, b]) => {
      if (x >= from && x <= to) found.push(r === g && g === b);
    });
    assert.ok(found.length > 0);
    return found;
  };
  assert.ok(greys(0, SIDE - 1).every(Boolean), "what is old is grey");
  assert.ok(!greys(3 * (SIDE - 1), 4 * (SIDE - 1)).some(Boolean), "what is new has its colours");

  // Time goes by: within the first step of a half-life of four seconds.
  const frames = client.frames.length;
  const { generation } = await client.request("fusion.set", { age: { half_life_s: 4 } });
  await client.complete(generation);
  await new Promise((resolve) => setTimeout(resolve, 17_000));
  assert.ok(greys(3 * (SIDE - 1), 4 * (SIDE - 1)).every(Boolean), "after four half-lives it is grey, too");
  const steps = client.frames.slice(frames);
  assert.ok(steps.every(isColours));
  assert.ok(steps.length < 40, `${steps.length} frames for eight steps`);
  await client.close();
  await server.stop();
});

test("a file has no baseline, and says so", async () => {
  const file = path.join(scratch, "room.ply");
  writeFileSync(file, room(0));
  const server = await serve([file]);
  assert.equal((await sceneOf(server)).baseline, undefined);
  const client = await SpectraClient.connect(server.url);
  const told = client.notification("status", 30_000, ({ id }) => id === "no_baseline");
  const { generation } = await client.request("fusion.set", { method: "thermal_change", params: { invert: true, threshold: 50 } });
  assert.match((await told).message, /no baseline: Thermal change shows the visible colours/);
  await client.request("scene.subscribe", { channels: ["fused"] });
  await client.complete(generation);
  assert.deepEqual(changedPlaces(client), [], "what is not known did not stay the same");
  const probe = await client.request("scene.probe", { position: [0, 0, 0] });
  assert.deepEqual([probe.observed_at, probe.baseline, probe.baseline_at], [null, null, null]);
  // What is put into it is compared with the file.
  const cleared = client.notification("status", 30_000, ({ id, message }) => id === "no_baseline" && message === null);
  await put(server, "scene", room(0, { celsius: 24 }));
  await cleared;
  const { origin } = await sceneOf(server);
  const warm = await client.request("scene.probe", { position: [10 - origin[0], 10 - origin[1], -origin[2]] });
  assert.ok(Math.abs(warm.temperature - warm.baseline - 4) < 1e-3);
  await client.close();
  await server.stop();
});

test("operators mark the baseline, viewers only ask for it", async () => {
  const file = path.join(scratch, "tokens");
  const tokens = Object.fromEntries(
    ["viewer", "operator", "ingest"].map((role) => [role, run("token", "--file", file, "--role", role).trim()]),
  );
  const server = await serve(["--live", "--tokens", file]);
  const headers = (role) => ({ Authorization: `Bearer ${tokens[role]}` });
  const reply = await fetch(`${server.url}/api/v1/blocks/a`, { method: "PUT", headers: headers("ingest"), body: room(0) });
  assert.equal(reply.status, 200);
  const answers = async (role, action) => {
    const socket = new WebSocket(`${server.url.replace("http", "ws")}/ws`, "spectra.v1", { headers: headers(role) });
    await once(socket, "message");
    socket.send(JSON.stringify({ jsonrpc: "2.0", id: 7, method: "scene.baseline", params: { action } }));
    for (;;) {
      const message = JSON.parse((await once(socket, "message"))[0]);
      if (message.id !== 7) continue;
      socket.close();
      return message;
    }
  };
  const refused = await answers("viewer", "mark");
  assert.equal(refused.error.code, -32002);
  assert.equal(refused.error.data.field, "action");
  assert.equal((await answers("viewer", "get")).result.marked_at, null);
  const { result } = await answers("operator", "mark");
  assert.ok(result.marked_at > 0);
  assert.equal((await answers("viewer", "get")).result.marked_at, result.marked_at);
  await server.stop();
});

test("what cannot be is refused, and changes nothing", async () => {
  const server = await serve(["--live"]);
  await put(server, "a", room(0), 1000);
  const client = await SpectraClient.connect(server.url);
  const before = await client.request("fusion.get");
  for (const half_life_s of [0, -1, 0.5, 1e300, "long", null]) {
    const { code, data } = await refusal(client.request("fusion.set", { age: { mode: "fade", half_life_s } }));
    assert.equal(code, -32602);
    assert.equal(data.field, "age.half_life_s");
  }
  assert.equal((await refusal(client.request("fusion.set", { age: { mode: "shrink" } }))).data.field, "age.mode");
  for (const [name, value] of [
    ["span", 0],
    ["span", -5],
    ["span", 101],
    ["threshold", -0.1],
    ["alpha", 2],
    ["invert", 1],
  ]) {
    const { data } = await refusal(client.request("fusion.set", { method: "thermal_change", params: { [name]: value } }));
    assert.equal(data.field, `params.${name}`);
  }
  assert.deepEqual(await client.request("fusion.get"), before);
  for (const params of [{}, { action: "forget" }, { action: 1 }]) {
    assert.equal((await refusal(client.request("scene.baseline", params))).data.field, "action");
  }
  assert.equal((await client.request("scene.baseline", { action: "get" })).marked_at, null);
  await client.close();
  await server.stop();
});
