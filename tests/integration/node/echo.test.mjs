// spectra-echo, which public conformance suites are run against: messages whole and in parts, and how it ends what RFC 6455 forbids.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { existsSync } from "node:fs";
import path from "node:path";
import { after, before, test } from "node:test";
import WebSocket from "ws";
import { closeCodeAfter, closeFrame as close, rawFrame as frame } from "./raw_websocket.mjs";
import { binary } from "./spectra_server.mjs";

const program = path.join(path.dirname(binary), "spectra-echo");
let child;
let url;

before(async () => {
  assert.ok(existsSync(program), `${program} is not built`);
  child = spawn(program, ["--listen", "127.0.0.1:0"]);
  url = await new Promise((resolve) =>
    child.stdout.on("data", (chunk) => resolve(/listening on (ws:\S+)/.exec(chunk)[1])),
  );
});
after(() => child.kill());

const opened = () =>
  new Promise((resolve, reject) => {
    const socket = new WebSocket(url, { perMessageDeflate: false });
    socket.on("open", () => resolve(socket));
    socket.on("error", reject);
  });
const answer = (socket) => new Promise((resolve) => socket.once("message", (data, isBinary) => resolve({ data, isBinary })));

test("text and binary messages of every size come back as they were, in parts too", async () => {
  const socket = await opened();
  for (const size of [0, 1, 125, 126, 65_535, 65_536, 1 << 20]) {
    const bytes = Buffer.alloc(size, 7);
    socket.send(bytes);
    const { data, isBinary } = await answer(socket);
    assert.ok(isBinary && data.equals(bytes), `${size}`);
  }
  socket.send("κόσμε", { fin: false });
  socket.ping("between");
  socket.send(" and more", { fin: true });
  const pong = new Promise((resolve) => socket.once("pong", resolve));
  assert.equal(`${(await answer(socket)).data}`, "κόσμε and more");
  assert.equal(`${await pong}`, "between");
  socket.close(3000, "bye");
  assert.equal(await new Promise((resolve) => socket.on("close", resolve)), 3000);
});

test("what the standard forbids ends with its code", async () => {
  const closeCode = (bytes) => closeCodeAfter(url, [bytes]);
  assert.equal(await closeCode(frame(0x81, Buffer.from([0xff, 0xfe]))), 1007);
  assert.equal(await closeCode(frame(0xc1, Buffer.from("x"))), 1002, "a reserved bit");
  assert.equal(await closeCode(frame(0x83)), 1002, "a reserved opcode");
  assert.equal(await closeCode(frame(0x80, Buffer.from("x"))), 1002, "a part of nothing");
  assert.equal(await closeCode(Buffer.from([0x81, 1, 0x78])), 1002, "no mask");
  assert.equal(await closeCode(close(1005)), 1002);
  assert.equal(await closeCode(close(5000)), 1002);
  assert.equal(await closeCode(close(65_535)), 1002);
  assert.equal(await closeCode(close(1000)), 1000);
});
