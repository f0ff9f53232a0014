// A connection breaks and the client comes back with the tiles it still has: no geometry is sent again, the picture is the
// same, and claims that are false spoil nobody's picture but the claimant's.
import assert from "node:assert/strict";
import { existsSync } from "node:fs";
import path from "node:path";
import { after, before, test } from "node:test";
import { linkProxy } from "./link_proxy.mjs";
import { identityOfTiles } from "./mesh_identity.mjs";
import { isColours, KIND, SpectraClient } from "./spectra_client.mjs";
import { serve } from "./spectra_server.mjs";

const castle = path.join(process.env.SPECTRA_TEST_DATA ?? "", "arco_castle_1m.ply");
const scene = existsSync(castle) ? [castle] : ["--demo"];

let server;
let proxy;
let earlier;
before(async () => {
  server = await serve(scene);
  proxy = await linkProxy(server.url, { rate_bytes_per_s: 1e9, delay_ms: 1 });
  earlier = await SpectraClient.connect(proxy.url);
  await earlier.request("scene.subscribe", { channels: ["fused"] });
  await completed(earlier);
  proxy.cut();
  await earlier.closed;
});
after(async () => {
  await proxy.close();
  await server.stop();
});

async function completed(client) {
  const { generation } = await client.request("fusion.get");
  await client.complete(generation);
  assert.deepEqual(client.failures, []);
}

const count = (client, kind) => client.frames.filter((frame) => frame.kind === kind).length;
const picture = (client) => `${identityOfTiles(client.drawnTiles())}`;

async function expectEverythingAnew(client) {
  await completed(client);
  assert.equal(count(client, KIND.geometry), earlier.tiles.size);
  assert.equal(picture(client), picture(earlier));
  await client.close();
}

test("a client that comes back is sent colours alone and shows the same picture", async (t) => {
  const fresh = await SpectraClient.connect(server.url);
  await fresh.request("scene.subscribe", { channels: ["fused"] });
  await completed(fresh);
  await fresh.close();

  const client = await SpectraClient.connect(proxy.url);
  assert.notEqual(client.hello.session_id, earlier.hello.session_id);
  assert.equal(await client.resume(earlier), earlier.tiles.size);
  await completed(client);
  assert.ok(client.frames.length > 0 && client.frames.every(isColours), "colours alone");
  assert.equal(picture(client), picture(earlier));
  assert.ok(client.drawnTiles().every((tile) => tile.generation > 0), "in colours of this connection");
  t.diagnostic(`a fresh connection takes ${fresh.received_bytes} bytes of frames, a resumed one ${client.received_bytes}`);
  await client.close();

  const smaller = await SpectraClient.connect(server.url);
  await smaller.resume(client, { colour_transform: "subtract_green" });
  await completed(smaller);
  assert.ok(smaller.frames.every(({ kind }) => kind === KIND.colours_subtract_green));
  assert.equal(picture(smaller), picture(earlier));
  t.diagnostic(`with subtract_green the resumed one takes ${smaller.received_bytes}`);
  await smaller.close();
});

test("settings chosen before it resumes are what it is shown", async () => {
  const client = await SpectraClient.connect(server.url);
  const { generation } = await client.request("fusion.set", { method: "thermal_only" });
  await client.resume(earlier);
  await client.complete(generation);
  assert.ok(client.frames.every(isColours));
  const fresh = await SpectraClient.connect(server.url);
  await fresh.request("fusion.set", { method: "thermal_only" });
  await fresh.request("scene.subscribe", { channels: ["fused"] });
  await completed(fresh);
  assert.equal(picture(client), picture(fresh));
  await client.close();
  await fresh.close();
});

test("a session that this server never had is worth nothing", async () => {
  for (const session_id of ["", "0", "0123456789abcdef0123456789abcdef", `${earlier.hello.session_id}0`, "x".repeat(5000)]) {
    const client = await SpectraClient.connect(server.url);
    assert.equal(await client.resume(earlier, { session_id }), 0);
    await expectEverythingAnew(client);
  }
});

test("neither is one of an earlier run of the server, whatever its revisions", async () => {
  const restarted = await serve(scene);
  const client = await SpectraClient.connect(restarted.url);
  assert.equal(await client.resume(earlier), 0);
  await expectEverythingAnew(client);
  await restarted.stop();
});

test("another position step makes every claim outdated", async () => {
  const client = await SpectraClient.connect(server.url);
  const step = [...earlier.tiles.values()][0].frame.step;
  await client.request("quality.set", { position_step_mm: 2000 * step });
  assert.equal(await client.resume(earlier), 0);
  await completed(client);
  assert.equal(count(client, KIND.geometry), earlier.tiles.size);
  await client.close();
});

test("outdated, unknown and forged claims are replaced or removed", async () => {
  const client = await SpectraClient.connect(server.url);
  const claims = earlier.claims();
  const [first, second, third] = claims;
  const tiles = [
    ...claims.slice(3),
    [...first.slice(0, 4), 4294967295],
    [...second.slice(0, 4), third[4]],
    [...third.slice(0, 4), 1],
    [200, 1, 2, 3, 77],
    claims[3],
  ];
  assert.equal(await client.resume(earlier, { tiles }), claims.length - 3);
  await completed(client);
  const sentAnew = new Set(client.frames.filter(({ kind }) => kind === KIND.geometry).map(({ tile }) => tile));
  assert.deepEqual(sentAnew, new Set([first, second, third].map((claim) => claim.slice(0, 4).join("/"))));
  assert.ok(client.frames.some(({ kind, tile }) => kind === KIND.remove && tile === "200/1/2/3"));
  assert.equal(picture(client), picture(earlier));
  await client.close();
});

test("whoever claims what he does not have spoils his own picture only", async () => {
  const forger = await SpectraClient.connect(server.url, { decode: false });
  const bystander = await SpectraClient.connect(server.url);
  const nothing = { hello: earlier.hello, tiles: new Map(), claims: () => earlier.claims() };
  assert.equal(await forger.resume(nothing), earlier.tiles.size);
  await bystander.request("scene.subscribe", { channels: ["fused"] });
  await completed(bystander);
  assert.equal(picture(bystander), picture(earlier));
  await forger.complete((await forger.request("fusion.get")).generation);
  assert.equal(count(forger, KIND.geometry), 0, "he gets colours for what he does not have");
  await forger.close();
  await bystander.close();
});

test("claims while frames flow are refused, after scene.unsubscribe they hold", async () => {
  const client = await SpectraClient.connect(server.url);
  await client.request("scene.subscribe", { channels: ["fused"] });
  await completed(client);
  const again = client.request("scene.subscribe", { channels: ["fused"], resume: { session_id: "", tiles: [] } });
  await assert.rejects(again, (error) => error.code === -32602 && error.data.field === "resume");
  await client.request("scene.unsubscribe");
  const framesBefore = client.frames.length;
  const { generation } = await client.request("fusion.set", { params: { alpha: 0.125 } });
  assert.equal(await client.resume(client), earlier.tiles.size);
  await client.complete(generation);
  assert.deepEqual(client.failures, []);
  assert.ok(client.frames.slice(framesBefore).every(isColours));
  await client.close();
});

test("as many claims as are allowed are taken, one more is refused", async () => {
  const largest = [21, 2097151, 2097151, 2097151, 4294967295];
  const session_id = earlier.hello.session_id;
  const client = await SpectraClient.connect(server.url);
  const subscribe = (tiles) => client.request("scene.subscribe", { channels: ["fused"], resume: { session_id, tiles } });
  await assert.rejects(subscribe(Array(1501).fill(largest)), (error) => {
    assert.equal(error.code, -32602);
    assert.equal(error.data.field, "resume.tiles");
    assert.match(error.message, /at most 1500/);
    return true;
  });
  assert.deepEqual(await subscribe(Array(1500).fill(largest)), { resumed_tiles: 0 });
  await expectEverythingAnew(client);
});
