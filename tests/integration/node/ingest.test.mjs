// Blocks over the WebSocket /ingest: they take effect in order, within a credit, and what is acknowledged is there after kill -9.
import assert from "node:assert/strict";
import { createHash, randomInt } from "node:crypto";
import { once } from "node:events";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import path from "node:path";
import { after, test } from "node:test";
import { setTimeout as sleep } from "node:timers/promises";
import { IngestSender, PUT, REMOVE, message } from "./ingest_sender.mjs";
import { patch } from "./patch.mjs";
import { SpectraClient } from "./spectra_client.mjs";
import { serve } from "./spectra_server.mjs";

const scratch = mkdtempSync(path.join(tmpdir(), "spectra-ingest-"));
after(() => rmSync(scratch, { recursive: true, force: true }));

const sha256 = (bytes) => createHash("sha256").update(bytes).digest("hex");
const small = (i, options = {}) => patch(i, 0, { side: 11, ...options });

async function blocksOf(server) {
  const { blocks } = await (await fetch(`${server.url}/api/v1/blocks`)).json();
  return new Map(blocks.map((block) => [block.id, block]));
}

test("changes of one block take effect in the order of their messages", async () => {
  const server = await serve(["--live"]);
  const sender = await IngestSender.connect(server.url);
  assert.equal(sender.hello.protocol, "spectra.ingest.v1");
  // What takes long to be read is followed at once by what does not.
  const sent = [];
  for (let round = 0; round < 4; round += 1) {
    sent.push(["ingest.acknowledged", await sender.send("a?observed_at=5", patch(0, 0, { side: 150 }))]);
    sent.push(["ingest.acknowledged", await sender.send("a", undefined, REMOVE)]);
    sent.push(["ingest.refused", await sender.send("a", undefined, REMOVE)]);
    sent.push(["ingest.acknowledged", await sender.send("b", small(20 + round))]);
    sent.push(["ingest.acknowledged", await sender.send(`a?observed_at=${round}`, small(round))]);
  }
  for (const [method, sequence] of sent) assert.equal((await sender.answer(sequence)).method, method, `message ${sequence}`);
  const blocks = await blocksOf(server);
  assert.deepEqual([...blocks.keys()], ["a", "b"]);
  assert.equal(blocks.get("a").observed_at, 3);
  assert.equal(blocks.get("a").sha256, sha256(small(3)));
  assert.equal(blocks.get("b").sha256, sha256(small(23)));
  const revisions = sent.filter(([method]) => method === "ingest.acknowledged").map(([, sequence]) => sender.answers.get(sequence).revision);
  const ofA = revisions.filter((_, i) => i % 4 !== 2);
  assert.deepEqual(ofA, [...ofA].sort((x, y) => x - y), "revisions of a block rise");
  assert.equal((await sender.close()).code, 1000);
  await server.stop();
});

test("a refused block is told with its sequence, and the next one is taken", async () => {
  const server = await serve(["--live"]);
  const sender = await IngestSender.connect(server.url);
  await sender.answer(await sender.send("good", small(0)));
  const cases = [
    ["unreadable_block", "body", "x", Buffer.from("no PLY")],
    ["unreadable_block", "body", "x", patch(0, 0).subarray(0, 5000)],
    ["bad_request", "id", "a b", small(1)],
    ["bad_request", "id", "", small(1)],
    ["bad_request", "id", "a/b", small(1)],
    ["bad_request", "observed_at", "x?observed_at=now", small(1)],
    ["bad_request", "colour", "x?colour=red", small(1)],
    ["not_found", "id", "x", undefined, REMOVE],
    ["bad_request", "scale", "good?scale=2", undefined, REMOVE],
    ["bad_request", "kind", "x", undefined, 9],
  ];
  for (const [code, field, ...given] of cases) {
    const answer = await sender.answer(await sender.send(...given));
    assert.deepEqual([answer.method, answer.code, answer.field], ["ingest.refused", code, field], JSON.stringify(answer));
    assert.ok(answer.reason.length > 10);
    assert.doesNotMatch(answer.reason, /\/proc\//);
  }
  assert.equal((await sender.answer(await sender.send("next", small(1)))).method, "ingest.acknowledged");
  assert.deepEqual([...(await blocksOf(server)).keys()], ["good", "next"]);
  await sender.close();
  await server.stop();
});

test("who does not speak the protocol is told so", async () => {
  const server = await serve(["--live"]);
  const status = (options) => IngestSender.connect(server.url, options).then(() => 101, (error) => error.status);
  assert.equal(await status({ subprotocols: [] }), 400);
  assert.equal(await status({ subprotocols: ["spectra.v1"] }), 400);
  assert.equal(await status({ headers: { Origin: "http://elsewhere.example" } }), 403);
  assert.equal(await status({ headers: { Host: "elsewhere.example" } }), 403);
  assert.equal((await fetch(`${server.url}/ingest`)).status, 426);
  const next = message(1, "a", small(0));
  next.write("SPI2", "latin1");
  for (const [code, bytes] of [
    [1002, next],
    [1002, Buffer.from("garbage that is longer than a header")],
    [1002, Buffer.alloc(0)],
    [1003, "a text"],
  ]) {
    const sender = await IngestSender.connect(server.url);
    sender.socket.send(bytes);
    const closed = await sender.closed;
    assert.equal(closed.code, code);
    assert.ok(closed.reason.length > 10, closed.reason);
  }
  const longer = await IngestSender.connect(server.url);
  longer.socket.send(Buffer.concat([message(1, "a", small(0)), Buffer.alloc(1)]));
  const told = await longer.answer(1);
  assert.deepEqual([told.method, told.code, told.field], ["ingest.refused", "bad_request", "body"]);
  longer.socket.send(message(2, "a", small(0)));
  assert.equal((await longer.answer(2)).method, "ingest.acknowledged");
  await longer.close();
  const sender = await IngestSender.connect(server.url);
  // None is answered before the first, which takes long.
  sender.sendAnyway("a", patch(0, 0, { side: 400 }));
  for (let i = 0; i < sender.hello.credit.blocks; i += 1) sender.sendAnyway("a", undefined, REMOVE);
  assert.equal((await sender.closed).code, 4001);
  await server.stop();
});

test("a server that has much to do slows its senders, keeps within its memory and drops nothing", async (t) => {
  const server = await serve(["--live"]);
  const viewer = await SpectraClient.connect(server.url);
  await viewer.request("scene.subscribe", { channels: ["fused"] });
  const resident = async () => Number(/^process_resident_memory_bytes (\S+)/m.exec(await (await fetch(`${server.url}/metrics`)).text())[1]);
  const large = [0, 1].map((i) => patch(i, 0, { side: 260 }));
  const first = await IngestSender.connect(server.url);
  for (const [i, body] of large.entries()) await first.answer(await first.send(`s${i}`, body));
  const before = await resident();
  let most = before;
  const watching = setInterval(async () => (most = Math.max(most, await resident().catch(() => 0))), 50);
  const sender = await IngestSender.connect(server.url);
  const sent = [];
  // 160 x 2.9 MB; most of them end a little too early, so that the map need not be made anew for each.
  const higher = [0, 1].map((i) => patch(i, 0, { side: 260, height: 1 }));
  for (let i = 0; i < 160; i += 1) {
    sent.push(await sender.send(`s${i % 2}`, i < 156 ? large[i % 2].subarray(0, large[0].length - 7) : higher[i % 2]));
  }
  for (const [i, sequence] of sent.entries()) {
    assert.equal((await sender.answer(sequence)).method, i < 156 ? "ingest.refused" : "ingest.acknowledged");
  }
  clearInterval(watching);
  t.diagnostic(`the sender waited ${sender.waits} times; ${((most - before) / 2 ** 20).toFixed(0)} MiB more than before at most`);
  assert.ok(sender.waits > 5, "the sender had to wait");
  assert.ok(most - before < 200 * 2 ** 20, "less than half of what was sent was in memory");
  const { vertex_count, revision } = await (await fetch(`${server.url}/api/v1/scene`)).json();
  assert.equal(vertex_count, 2 * 260 * 260);
  await viewer.notification("stream.complete", 60_000, ({ scene_revision }) => scene_revision >= revision);
  assert.deepEqual(viewer.failures, [], "a viewer is not disturbed");
  await viewer.close();
  await server.stop();
});

test("a server that stops answers what it can and says goodbye", async () => {
  const server = await serve(["--live"]);
  const sender = await IngestSender.connect(server.url);
  const sequence = await sender.send("a", small(0));
  await sender.answer(sequence);
  const last = await sender.send("b", patch(3, 0));
  const status = server.stop();
  assert.equal((await sender.closed).code, 1001);
  assert.equal(await status, 0);
  assert.ok(!sender.answers.has(last) || sender.answers.get(last).method === "ingest.acknowledged");
});

const KILL_ROUNDS = Number(process.env.SPECTRA_KILL_ROUNDS ?? 6);

test("every acknowledged block is there after kill -9, byte for byte", { timeout: 60_000 + 20_000 * KILL_ROUNDS }, async (t) => {
  const store = path.join(scratch, "killed.sqlite");
  const acknowledged = new Map();
  const underWay = new Map();
  let rounds = 0;
  let told = 0;
  for (; rounds < KILL_ROUNDS; rounds += 1) {
    const server = await serve(["--live", "--store", store]);
    const there = await blocksOf(server);
    for (const [id, hash] of acknowledged) {
      const found = there.get(id)?.sha256;
      assert.ok(found === hash || underWay.get(id)?.includes(found), `${id} after kill ${rounds}`);
    }
    for (const [id, { sha256: hash }] of there) {
      assert.ok(hash === acknowledged.get(id) || underWay.get(id)?.includes(hash), `${id} is nothing that was sent`);
      acknowledged.set(id, hash);
    }
    underWay.clear();
    const sender = await IngestSender.connect(server.url);
    const killed = sleep(randomInt(100, 900)).then(() => server.process.kill("SIGKILL"));
    try {
      for (let i = 0; ; i += 1) {
        const id = `b${randomInt(12)}`;
        const body = small(Number(id.slice(1)), { height: rounds + i / 1000 });
        const hash = sha256(body);
        underWay.set(id, [...(underWay.get(id) ?? []), hash]);
        const sequence = await sender.send(id, body, PUT);
        sender.answer(sequence).then(
          () => {
            told += 1;
            acknowledged.set(id, hash);
            const sent = underWay.get(id);
            underWay.set(id, sent.slice(sent.indexOf(hash) + 1));
          },
          () => {},
        );
      }
    } catch (error) {
      assert.match(error.message, /the connection has ended/);
    }
    await killed;
    if (server.process.exitCode === null && server.process.signalCode === null) await once(server.process, "exit");
  }
  t.diagnostic(`${rounds} kills, ${told} blocks acknowledged`);
  assert.ok(told > 20);
});
