// A slider dragged over a radio link of 5 Mbit/s and 100 ms round trip: no older colours over newer ones, the newest
// setting arrives in full, and what is in flight stays near one bandwidth-delay product.
import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { linkProxy } from "./link_proxy.mjs";
import { identityOfTiles } from "./mesh_identity.mjs";
import { KIND, SpectraClient } from "./spectra_client.mjs";
import { serve } from "./spectra_server.mjs";

const rate_bytes_per_s = 5e6 / 8;
let server;
let proxy;
before(async () => {
  server = await serve(["--demo"]);
  proxy = await linkProxy(server.url, { rate_bytes_per_s, delay_ms: 50 });
});
after(async () => {
  await proxy.close();
  await server.stop();
});

const sleep = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

test("the newest setting overtakes and arrives in full", { timeout: 120_000 }, async () => {
  const client = await SpectraClient.connect(proxy.url);
  await client.request("scene.subscribe", { channels: ["fused"] });
  await client.complete((await client.request("fusion.get")).generation, 60_000);
  const firstFrame = client.frames.length;

  const changes = 30;
  let last;
  for (let i = 1; i <= changes; ++i) {
    last = client.request("fusion.set", { params: { alpha: i / changes } });
    await sleep(33);
  }
  const { generation, fusion } = await last;
  assert.equal(fusion.params.alpha, 1);
  const complete = await client.complete(generation, 60_000);
  assert.deepEqual(client.failures, [], "no colours of an older generation came after newer ones of a tile");
  assert.ok(client.drawnTiles().every((tile) => tile.frame.childMask === 0 && tile.generation === generation));
  assert.equal(complete.generation, generation);

  const frames = client.frames.slice(firstFrame);
  assert.ok(frames.every((frame) => frame.kind === KIND.colours), "colours only");
  const total = frames.reduce((sum, frame) => sum + frame.bytes, 0);
  const whole = frames.filter((frame) => frame.generation === generation).reduce((sum, frame) => sum + frame.bytes, 0);
  assert.ok(total < changes * whole * 0.8, `superseded colours are dropped: ${total} bytes for ${changes} changes of ${whole}`);
  await client.close();
});

test("automatic quality answers sooner with less and ends at full accuracy", { timeout: 120_000 }, async () => {
  const client = await SpectraClient.connect(proxy.url);
  const { quality } = await client.request("quality.set", { mode: "auto", latency_target_ms: 200 });
  assert.equal(quality.mode, "auto");
  await client.request("scene.subscribe", { channels: ["fused"] });
  await client.complete((await client.request("fusion.get")).generation, 60_000);
  const { generation } = await client.request("fusion.set", { method: "thermal_only", params: {} });
  await client.complete(generation, 60_000);
  assert.deepEqual(client.failures, []);
  assert.ok(client.drawnTiles().every((tile) => tile.frame.childMask === 0 && tile.generation === generation));

  const exact = await SpectraClient.connect(server.url);
  await exact.request("fusion.set", { method: "thermal_only", params: {} });
  await exact.request("scene.subscribe", { channels: ["fused"] });
  await exact.complete((await exact.request("fusion.get")).generation, 60_000);
  assert.equal(`${identityOfTiles(client.drawnTiles())}`, `${identityOfTiles(exact.drawnTiles())}`);
  await client.close();
  await exact.close();
});

test("a link that stalls and breaks leaves the server well and a new connection whole", { timeout: 120_000 }, async () => {
  const client = await SpectraClient.connect(proxy.url);
  await client.request("scene.subscribe", { channels: ["fused"] });
  await sleep(200);
  proxy.stall(1500);
  await client.request("fusion.set", { params: { alpha: 0.25 } });
  await sleep(200);
  proxy.cut();
  await client.closed;
  const again = await SpectraClient.connect(server.url);
  await again.request("scene.subscribe", { channels: ["fused"] });
  const complete = await again.complete((await again.request("fusion.get")).generation);
  assert.equal(again.tiles.size, complete.tiles);
  assert.deepEqual(again.failures, []);
  await again.close();
});
