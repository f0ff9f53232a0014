// Bad input over the wire: the JSON-RPC error of docs/protocol.md that names the field; nothing changes, the connection and
// everybody else's picture live on.
import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { SpectraClient } from "./spectra_client.mjs";
import { serve } from "./spectra_server.mjs";

let server;
let client;
let bystander;
before(async () => {
  server = await serve(["--demo"]);
  client = await SpectraClient.connect(server.url, { decode: false });
  bystander = await SpectraClient.connect(server.url);
  await bystander.request("scene.subscribe", { channels: ["fused"] });
});
after(async () => {
  await client.close();
  await bystander.close();
  await server.stop();
});

async function refusal(method, params) {
  const earlier = await client.request("fusion.get");
  const error = await client.request(method, params).then(
    () => assert.fail(`${method} ${JSON.stringify(params)} was accepted`),
    (refused) => refused,
  );
  assert.deepEqual(await client.request("fusion.get"), earlier, "a refused request changes nothing");
  assert.ok(error.data?.reason?.length > 0, "a reason is given");
  return error;
}

const cases = [
  ["fusion.set", { method: "no_such_method" }, -32602, "method"],
  ["fusion.set", { palette: "no_such_palette" }, -32602, "palette"],
  ["fusion.set", { params: { no_such: 1 } }, -32602, "no_such"],
  ["fusion.set", { params: { alpha: 1.5 } }, -32602, "alpha"],
  ["fusion.set", { params: { alpha: -1e-9 } }, -32602, "alpha"],
  ["fusion.set", { params: { alpha: "half" } }, -32602, "alpha"],
  ["fusion.set", { params: { alpha: null } }, -32602, "alpha"],
  ["fusion.set", { params: [] }, -32602, "params"],
  ["fusion.set", { range: { mode: "manual", min: 5, max: 1 } }, -32602, "range"],
  ["fusion.set", { range: { mode: "sideways" } }, -32602, "range"],
  ["fusion.set", { range: { mode: "manual", min: "cold", max: 30 } }, -32602, "range"],
  ["fusion.set", { missing: "purple-ish" }, -32602, "missing"],
  ["fusion.set", { method: "thermal_highlighting", params: { low: 30, high: 20 } }, -32602, "low"],
  ["fusion.set", { method: "histogram_bin", params: { bins: 0 } }, -32602, "bins"],
  ["fusion.set", { method: "histogram_bin", params: { bins: 4097 } }, -32602, "bins"],
  ["fusion.set", { method: "histogram_bin", params: { bins: 2.5 } }, -32602, "bins"],
  ["fusion.set", { method: "inverse_intensity_hue", params: { k: 0 } }, -32602, "k"],
  ["fusion.set", { method: "inverse_intensity_hue", params: { mode: "other" } }, -32602, "mode"],
  ["scene.histogram", {}, -32602, "bins"],
  ["scene.histogram", { bins: 0 }, -32602, "bins"],
  ["scene.histogram", { bins: 1e9 }, -32602, "bins"],
  ["scene.probe", { position: [1, 2] }, -32602, "position"],
  ["scene.probe", { position: [1, 2, "three"] }, -32602, "position"],
  ["scene.subscribe", { channels: ["sound"] }, -32602, "channels"],
  ["scene.subscribe", { channels: ["fused"], colour_transform: "ycocg" }, -32602, "colour_transform"],
  ["scene.subscribe", { channels: ["fused"], colour_transform: 6 }, -32602, "colour_transform"],
  ["scene.subscribe", { channels: ["fused"], resume: [] }, -32602, "resume"],
  ["scene.subscribe", { channels: ["fused"], resume: { tiles: [] } }, -32602, "resume.session_id"],
  ["scene.subscribe", { channels: ["fused"], resume: { session_id: "a" } }, -32602, "resume.tiles"],
  ["scene.subscribe", { channels: ["fused"], resume: { session_id: "a", tiles: [[0, 0, 0, 1]] } }, -32602, "resume.tiles[0]"],
  ["scene.subscribe", { channels: ["fused"], resume: { session_id: "a", tiles: [[0, 0, 0, 0, -1]] } }, -32602, "resume.tiles[0][4]"],
  ["scene.subscribe", { channels: ["fused"], resume: { session_id: "a", tiles: [[256, 0, 0, 0, 1]] } }, -32602, "resume.tiles"],
  ["quality.set", { mode: "manual", colour_bits: 3 }, -32602, "colour_bits"],
  ["quality.set", { mode: "manual", encoder_speed: 11 }, -32602, "encoder_speed"],
  ["quality.set", { mode: "manual", position_step_mm: -1 }, -32602, "position_step_mm"],
  ["quality.set", { mode: "whatever" }, -32602, "mode"],
];
for (const [method, params, code, field] of cases) {
  test(`${method} ${JSON.stringify(params)}`, async () => {
    const error = await refusal(method, params);
    assert.equal(error.code, code);
    assert.ok(error.data.field.includes(field), `${error.data.field} names ${field}`);
  });
}

test("an unknown request is -32601", async () => {
  assert.equal((await refusal("fusion.reset", {})).code, -32601);
});

async function answerTo(text) {
  const count = client.notifications.length;
  client.socket.send(text);
  for (let i = 0; i < 200 && client.notifications.length === count; ++i) await new Promise((r) => setTimeout(r, 10));
  const answer = client.notifications.slice(count).find((message) => message.method === "(error)");
  assert.ok(answer, "answered with an error");
  return answer.params.code;
}

test("text that is no JSON, nested bombs, batches and binary messages are answered", async () => {
  assert.equal(await answerTo("hello"), -32700);
  assert.equal(await answerTo("[".repeat(50_000)), -32700);
  assert.equal(await answerTo('[{"jsonrpc":"2.0","id":1,"method":"fusion.get"}]'), -32600);
  assert.equal(await answerTo('{"jsonrpc":"1.0","id":1e2,"method":7}'), -32600);
  assert.equal(await answerTo(Buffer.from([1, 2, 3])), -32600);
  await client.request("fusion.get");
});

test("a message over the limit closes with 1009, others stay", async () => {
  const big = await SpectraClient.connect(server.url, { decode: false });
  big.socket.send(`{"jsonrpc":"2.0","id":1,"method":"${"x".repeat(big.hello.limits.max_message_bytes)}"}`);
  assert.equal(await big.closed, 1009);
  await client.request("fusion.get");
});

test("a flood is refused with -32003 and the connection lives on", async () => {
  const flood = await SpectraClient.connect(server.url, { decode: false });
  const count = 20 * flood.hello.limits.max_requests_per_s;
  const answers = await Promise.allSettled(Array.from({ length: count }, () => flood.request("fusion.get")));
  const codes = new Set(answers.filter((a) => a.status === "rejected").map((a) => a.reason.code));
  assert.deepEqual([...codes], [-32003]);
  await new Promise((resolve) => setTimeout(resolve, 1500));
  await flood.request("fusion.get");
  await flood.close();
});

test("the bystander's picture is whole", async () => {
  const { generation } = await bystander.request("fusion.set", { method: "thermal_only" });
  await bystander.complete(generation);
  assert.deepEqual(bystander.failures, []);
  const drawn = bystander.drawnTiles();
  assert.ok(drawn.length > 0);
  assert.ok(drawn.every((tile) => tile.frame.childMask === 0 && tile.generation === generation));
});
