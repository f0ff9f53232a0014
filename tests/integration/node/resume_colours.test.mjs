// Viewers of a live map are away for ten seconds. Who comes back and says what he holds is sent what has changed meanwhile, and nothing
// else: no colours, no raw layers, and not how sure temperatures are.
import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { linkProxy } from "./link_proxy.mjs";
import { identityOfTiles } from "./mesh_identity.mjs";
import { patch } from "./patch.mjs";
import { KIND, SpectraClient } from "./spectra_client.mjs";
import { serve } from "./spectra_server.mjs";

const AWAY_MS = 10_000;
const EVERYTHING = {
  channels: ["fused", "temperature", "visible", "temperature_sigma"],
  colour_transform: "subtract_green",
};
const SIDE = 61;

let server;
let proxy;
/** One stays; the others are cut off, all at once. */
let constant;
let away;
before(async () => {
  server = await serve(["--live"]);
  for (let i = 0; i < 16; i += 1) await put(i);
  await still();
  proxy = await linkProxy(server.url);
  [constant, ...away] = await Promise.all([server, proxy, proxy, proxy, proxy].map(({ url }) => watching(url)));
  proxy.cut();
  await Promise.all(away.map(({ closed }) => closed));
  await sleep(AWAY_MS);
});
after(async () => {
  await constant?.close();
  await proxy?.close();
  await server.stop();
});

const sleep = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

async function put(block, height = 0) {
  const body = patch(block % 4, Math.floor(block / 4), { side: SIDE, height, sigma: 0.5 });
  const reply = await fetch(`${server.url}/api/v1/blocks/b${block}`, { method: "PUT", body });
  assert.equal(reply.status, 200, await reply.text());
}

/** Coarse tiles have followed what was put. */
async function still() {
  for (let before = null, unchanged = 0; unchanged < 4; ) {
    const { revision } = await (await fetch(`${server.url}/api/v1/scene`)).json();
    unchanged = revision === before ? unchanged + 1 : 0;
    before = revision;
    await sleep(400);
  }
}

/** Nothing has come for a while. */
async function settled(client) {
  for (let count = -1; client.frames.length !== count; ) {
    count = client.frames.length;
    await sleep(400);
  }
  assert.deepEqual(client.failures, []);
}

async function watching(url) {
  const client = await SpectraClient.connect(url);
  const { revision } = await (await fetch(`${server.url}/api/v1/scene`)).json();
  const complete = client.notification("stream.complete", 60_000, ({ scene_revision }) => scene_revision >= revision);
  await client.request("scene.subscribe", EVERYTHING);
  await complete;
  await settled(client);
  return client;
}

async function cameBack(earlier, options = {}) {
  const client = await SpectraClient.connect(server.url);
  const complete = client.notification("stream.complete");
  await client.resume(earlier, { ...EVERYTHING, layers: true, ...options });
  await complete;
  await settled(client);
  return client;
}

const picture = (client) => `${identityOfTiles(client.drawnTiles())}`;
const total = (frames) => frames.reduce((sum, { bytes }) => sum + bytes, 0);

test("where nothing has changed no byte of frames is sent, through any number of cuts", async (t) => {
  const client = await cameBack(away[0]);
  assert.deepEqual(client.frames, []);
  assert.equal(picture(client), picture(constant));
  assert.ok(client.drawnTiles().every(({ generation }) => generation > 0), "in colours of this connection");
  await client.close();
  const again = await cameBack(client);
  assert.deepEqual(again.frames, []);
  assert.equal(picture(again), picture(constant));
  await again.close();

  const silent = await cameBack(away[0], { layers: false });
  t.diagnostic(`who does not say what he holds is sent ${silent.received_bytes} bytes, all there is takes ${constant.received_bytes}`);
  assert.ok(silent.frames.some(({ kind }) => kind === KIND.colours_subtract_green));
  await silent.close();
});

test("another setting, chosen before it comes back, is what it is shown", async () => {
  const client = await SpectraClient.connect(server.url);
  const { generation } = await client.request("fusion.set", { method: "thermal_only" });
  await client.resume(away[1], { ...EVERYTHING, layers: true });
  await client.complete(generation);
  await settled(client);
  assert.ok(client.frames.every(({ kind }) => kind === KIND.colours_subtract_green), "colours alone");
  const fresh = await SpectraClient.connect(server.url);
  const other = await fresh.request("fusion.set", { method: "thermal_only" });
  await fresh.request("scene.subscribe", EVERYTHING);
  await fresh.complete(other.generation);
  assert.equal(picture(client), picture(fresh));
  await client.close();
  await fresh.close();
});

test("of a block that has changed its own tiles are sent", async (t) => {
  const first = constant.frames.length;
  await put(5, 0.5);
  await settled(constant);
  const changed = constant.frames.slice(first);
  const geometry = new Set(changed.filter(({ kind }) => kind === KIND.geometry).map(({ tile }) => tile));
  assert.ok(geometry.size > 0 && geometry.size <= constant.tiles.size / 2, `${geometry.size} of ${constant.tiles.size} tiles`);

  const client = await cameBack(away[2]);
  t.diagnostic(`who stayed was sent ${total(changed)} bytes, who came back ${client.received_bytes}`);
  const own = new Set(client.frames.map(({ tile }) => tile));
  for (const tile of own) assert.ok(geometry.has(tile), `${tile} has not changed`);
  assert.ok(client.received_bytes < 1.1 * total(changed));
  assert.equal(picture(client), picture(constant));
  const fresh = await watching(server.url);
  assert.equal(picture(client), picture(fresh));
  await client.close();
  await fresh.close();
});

test("a frame that it never saw is not taken for granted", async () => {
  const claims = away[3].claims();
  const layers = away[3].layersOf(claims);
  const place = layers.colours.at(-1)[0];
  const session_id = away[3].hello.session_id;
  for (const sequence of [0, 1, 4294967295]) {
    const colours = layers.colours.map((pair) => (pair[0] === place ? [place, sequence] : pair));
    const client = await SpectraClient.connect(server.url);
    const answer = await client.request("scene.subscribe", { ...EVERYTHING, resume: { session_id, tiles: claims, ...layers, colours } });
    assert.ok(!answer.current_colours.includes(place), `${sequence}`);
    await client.close();
  }
  const client = await SpectraClient.connect(server.url);
  const refused = { session_id, tiles: claims, colours: [[claims.length, 1]] };
  await assert.rejects(client.request("scene.subscribe", { channels: ["fused"], resume: refused }), (error) => {
    assert.equal(error.data.field, "resume.colours");
    return true;
  });
  await client.close();
});
