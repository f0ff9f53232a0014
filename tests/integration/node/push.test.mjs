// `spectra push`: a folder becomes blocks, in order and within the credit; what goes wrong is said; a link that breaks loses nothing. And the
// examples of docs/ingest.md do what they say.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { chmodSync, mkdirSync, mkdtempSync, readFileSync, rmSync, utimesSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import path from "node:path";
import { after, afterEach, test } from "node:test";
import { setTimeout as sleep } from "node:timers/promises";
import { fileURLToPath } from "node:url";
import { WebSocketServer } from "ws";
import { linkProxy } from "./link_proxy.mjs";
import { patch } from "./patch.mjs";
import { readPly } from "./ply.mjs";
import { binary, serve } from "./spectra_server.mjs";

const scratch = mkdtempSync(path.join(tmpdir(), "spectra-push-"));
after(() => rmSync(scratch, { recursive: true, force: true }));

/** A folder with files of small blocks under these names. */
function folder(name, files) {
  const where = path.join(scratch, name);
  mkdirSync(where);
  for (const [i, file] of files.entries()) writeFileSync(path.join(where, file), patch(i, 0, { side: 5 }));
  return where;
}

function start(command, args, options = {}) {
  const child = spawn(command, args, { stdio: ["ignore", "pipe", "pipe"], ...options });
  let output = "";
  let errors = "";
  child.stdout.on("data", (chunk) => (output += chunk));
  child.stderr.on("data", (chunk) => (errors += chunk));
  const ended = new Promise((resolve) => child.once("close", (status, signal) => resolve({ status, signal, output, errors })));
  return { child, ended };
}
const push = (...args) => start(binary, ["push", ...args]).ended;

async function blocksOf(server) {
  return (await (await fetch(`${server.url}/api/v1/blocks`)).json()).blocks;
}

const openServers = new Set();
afterEach(async () => {
  // One that a failed assertion left open would keep the whole run waiting.
  for (const server of [...openServers]) await server.close();
});

/** A server of the test's own: `onBlock(message, say, socket)` decides what becomes of each. */
async function fakeServer(onBlock, credit = { blocks: 1000, bytes: 1 << 30 }) {
  const server = new WebSocketServer({ port: 0, host: "127.0.0.1" });
  await new Promise((resolve) => server.on("listening", resolve));
  const messages = [];
  let connection = 0;
  server.on("connection", (socket, request) => {
    assert.equal(request.url, "/ingest");
    assert.equal(socket.protocol, "spectra.ingest.v1");
    connection += 1;
    const ours = connection;
    const say = (method, params) => socket.send(JSON.stringify({ jsonrpc: "2.0", method: `ingest.${method}`, params: { credit, ...params } }));
    socket.on("message", (data) => {
      const size = data.readUInt16LE(6);
      const message = {
        connection: ours,
        at: performance.now(),
        kind: data.readUInt8(4),
        sequence: Number(data.readBigUInt64LE(8)),
        target: data.toString("utf8", 20, 20 + size),
        body: data.subarray(20 + size),
        bytes: data.length,
      };
      assert.equal(data.readUInt32LE(16), message.body.length);
      messages.push(message);
      onBlock(message, say, socket);
    });
    say("hello", { protocol: "spectra.ingest.v1", limits: { max_block_bytes: 100_000, max_target_bytes: 4096 } });
  });
  const ours = {
    url: `http://127.0.0.1:${server.address().port}`,
    messages,
    close: () => {
      openServers.delete(ours);
      for (const socket of server.clients) socket.terminate();
      return new Promise((resolve) => server.close(resolve));
    },
  };
  openServers.add(ours);
  return ours;
}
const acknowledge = ({ sequence }, say) => say("acknowledged", { sequence, revision: sequence });

test("a folder goes in order of its names, with what is said of it", async () => {
  const server = await fakeServer(acknowledge);
  const where = folder("order", ["b.ply", "a.PLY", "c.ply.gz", "B.ply"]);
  writeFileSync(path.join(where, "notes.txt"), "no block");
  utimesSync(path.join(where, "b.ply"), 1700000000.25, 1700000000.25);
  const options = ["--temperature-unit", "kelvin", "--no-data=-9999", "--no-data", "0", "--scale", "0.001", "--up=-y"];
  const { status, errors, output } = await push(where, "--to", server.url, ...options);
  assert.equal(status, 0, errors);
  assert.match(output, /^4 of 4 blocks are acknowledged in /);
  assert.deepEqual(server.messages.map(({ target }) => target.split("?")[0]), ["B", "a", "b", "c"]);
  assert.equal(
    server.messages[2].target,
    "b?observed_at=1700000000.250&temperature_unit=kelvin&no_data=-9999&no_data=0&scale=0.001&up=-y",
  );
  assert.deepEqual(server.messages[2].body, readFileSync(path.join(where, "b.ply")));
  const before = Date.now() / 1000;
  await push(path.join(where, "b.ply"), "--to", `${server.url}/ingest/`, "--id", "other", "--observed-at", "now", "--temperature-property", "a b&c");
  const url = new URL(server.messages[4].target, "http://x");
  assert.equal(url.pathname, "/other");
  assert.equal(url.searchParams.get("temperature_property"), "a b&c");
  assert.ok(Math.abs(Number(url.searchParams.get("observed_at")) - before) < 60);
  await push(path.join(where, "b.ply"), "--to", server.url, "--observed-at", "17.5");
  assert.equal(server.messages[5].target, "b?observed_at=17.5");
  await server.close();
});

test("no more is sent than the credit, and no faster than the rate", async () => {
  const where = folder("credit", [..."abcdefgh"].map((name) => `${name}.ply`));
  const credit = { blocks: 2, bytes: 1 << 20 };
  let answered = 0;
  let most = 0;
  const server = await fakeServer((message, say) => {
    most = Math.max(most, server.messages.length - answered);
    setTimeout(() => {
      answered += 1;
      credit.blocks += 1;
      acknowledge(message, say);
    }, 30);
  }, credit);
  const { status, errors } = await push(where, "--to", server.url);
  assert.equal(status, 0, errors);
  assert.equal(most, 2);
  await server.close();

  const quick = await fakeServer(acknowledge);
  await push(where, "--to", quick.url, "--rate", "20");
  const [first, last] = [quick.messages[0].at, quick.messages.at(-1).at];
  assert.equal(quick.messages.length, 8);
  assert.ok(last - first > 7 * 50 - 40, `${last - first} ms`);
  await quick.close();
});

test("what was not acknowledged when the link broke is sent again, and what was refused for being busy", async () => {
  const where = folder("again", [..."abcdef"].map((name) => `${name}.ply`));
  const server = await fakeServer((message, say, socket) => {
    const name = message.target[0];
    const times = server.messages.filter(({ target }) => target[0] === name).length;
    if (name === "b" && times === 1) return; // never answered
    if (name === "c" && times === 1) return say("refused", { sequence: message.sequence, code: "busy", field: "", reason: "later" });
    acknowledge(message, say);
    if (name === "f" && times === 1) socket.terminate();
    if (name === "b" && times === 2) socket.close(1001);
  });
  const { status, errors } = await push(where, "--to", server.url);
  assert.equal(status, 0, errors);
  assert.match(errors, /the connection broke/);
  const sent = server.messages.map(({ target }) => target[0]).join("");
  assert.equal([...new Set(sent)].join(""), "abcdef", sent); // What is sent again may come between.
  for (const name of "ade") assert.equal([...sent].filter((one) => one === name).length, 1, sent);
  for (const name of "bc") assert.ok([...sent].filter((one) => one === name).length >= 2, sent);
  for (const connection of new Set(server.messages.map((message) => message.connection))) {
    const sequences = server.messages.filter((message) => message.connection === connection).map(({ sequence }) => sequence);
    assert.deepEqual(sequences, [...sequences].sort((a, b) => a - b));
  }
  await server.close();
});

test("a folder becomes a map; what is refused or cannot be read is named, and the others go on", async () => {
  const server = await serve(["--live"]);
  const where = folder("map", ["a.ply", "b.ply", "c.ply", "d.ply", "e.ply", "f f.ply"]);
  writeFileSync(path.join(where, "b.ply"), "no PLY");
  rmSync(path.join(where, "d.ply"));
  mkdirSync(path.join(where, "d.ply"));
  const isRoot = process.getuid() === 0;
  chmodSync(path.join(where, "e.ply"), 0);
  const { status, errors } = await push(where, "--to", server.url);
  assert.equal(status, 1);
  assert.match(errors, /^spectra: warning: .*b\.ply is refused: not a PLY file.*$/m);
  if (!isRoot) assert.match(errors, /^spectra: warning: .*e\.ply: cannot be read$/m);
  assert.match(errors, /^spectra: warning: .*f f\.ply: "f f" is no name of a block .*$/m);
  const taken = isRoot ? ["a", "c", "e"] : ["a", "c"];
  assert.match(errors, new RegExp(`^spectra: ${taken.length} of 5 blocks are acknowledged\n$`, "m"));
  assert.deepEqual((await blocksOf(server)).map(({ id }) => id), taken);
  await server.stop();
});

test("a link that is cut loses nothing", { timeout: 120_000 }, async (t) => {
  const server = await serve(["--live", "--store", path.join(scratch, "cut.sqlite")]);
  const proxy = await linkProxy(server.url, { rate_bytes_per_s: 150_000 });
  const where = path.join(scratch, "cut");
  mkdirSync(where);
  for (let i = 0; i < 30; i += 1) writeFileSync(path.join(where, `b${String(i).padStart(2, "0")}.ply`), patch(i % 6, Math.floor(i / 6), { side: 21 }));
  const { child, ended } = start(binary, ["push", where, "--to", proxy.url]);
  for (let cuts = 0; cuts < 3; cuts += 1) {
    await sleep(700);
    proxy.cut();
  }
  const { status, errors } = await ended;
  assert.equal(status, 0, errors);
  const broken = errors.match(/connecting again/g)?.length ?? 0;
  t.diagnostic(`broken ${broken} times`);
  assert.ok(broken > 0 && child.exitCode === 0, errors);
  assert.equal((await blocksOf(server)).length, 30);
  await proxy.close();
  await server.stop();
});

test("says what is wrong with an address", async (t) => {
  const where = folder("address", ["a.ply"]);
  const plain = await serve([], { ready: false });
  const notHttp = await import("node:net").then(({ createServer }) => {
    const server = createServer((socket) => socket.end("SSH-2.0-OpenSSH\r\n"));
    return new Promise((resolve) => server.listen(0, "127.0.0.1", () => resolve(server)));
  });
  t.after(() => notHttp.close());
  const cases = [
    [1, "http://127.0.0.1:1", /cannot be reached: Connection refused/],
    [1, "http://nowhere.invalid", /there is no such host/],
    [1, `${plain.url}/folder`, /\/folder\/ingest: there is no such place/],
    [1, `http://127.0.0.1:${notHttp.address().port}`, /\/ingest (is not the \/ingest of a Spectra server|does not answer as a server should)/],
    [2, "127.0.0.1:8080", /--to 127\.0\.0\.1:8080 is not an address such as/],
    [2, "ftp://127.0.0.1", /is not an address such as/],
    [2, "http://127.0.0.1:99999", /is not an address such as/],
    [2, "http://", /is not an address such as/],
    [2, "http://user@127.0.0.1", /is not an address such as/],
    [2, "https://", /is not an address such as/],
    [1, `https://127.0.0.1:${notHttp.address().port}`, /does not speak TLS as it should/],
    [1, plain.url.replace("http", "https"), /does not speak TLS as it should/],
  ];
  for (const [expected, url, words] of cases) {
    const { status, errors } = await push(where, "--to", url);
    assert.equal(status, expected, errors);
    assert.match(errors, words);
    assert.equal(errors.trim().split("\n").length, 1, errors);
  }
  const empty = path.join(scratch, "empty");
  mkdirSync(empty);
  const two = folder("two", ["a.ply", "a.ply.gz"]);
  for (const [expected, words, ...args] of [
    [1, /there is no PLY file in this folder/, empty],
    [1, /there is no such file or folder/, path.join(scratch, "nothing")],
    [1, /a\.ply and a\.ply\.gz would both be block a/, two],
    [1, /--id names the block of one file/, where, "--id", "x"],
    [1, /is no name of a block/, path.join(where, "a.ply"), "--id", "a b"],
    [2, /file, now or Unix seconds/, where, "--observed-at", "yesterday"],
    [2, /--id/, path.join(where, "a.ply"), "--id", ""],
    [2, /rate/, where, "--rate", "0"],
  ]) {
    const { status, errors } = await push(...args, "--to", plain.url);
    assert.equal(status, expected, errors);
    assert.match(errors, words);
  }
  await plain.stop();
});

test("Ctrl-C ends it, and the server goes on", async () => {
  const server = await serve(["--live"]);
  const where = folder("stopped", [..."abcdefgh"].map((name) => `${name}.ply`));
  const { child, ended } = start(binary, ["push", where, "--to", server.url, "--rate", "2"]);
  while ((await blocksOf(server)).length === 0) await sleep(20);
  child.kill("SIGINT");
  assert.equal((await ended).signal, "SIGINT", "as a shell expects");
  const left = await blocksOf(server);
  assert.ok(left.length > 0 && left.length < 8);
  assert.equal((await push(where, "--to", server.url)).status, 0);
  assert.equal((await blocksOf(server)).length, 8);
  await server.stop();
});

test("the examples of the documentation do what they say", async () => {
  const server = await serve(["--live"]);
  const document = readFileSync(fileURLToPath(new URL("../../../docs/ingest.md", import.meta.url)), "utf8");
  const example = (language) => {
    const code = new RegExp(`^\`\`\`${language}\n(.*?)^\`\`\``, "ms").exec(document)[1];
    assert.ok(code.includes("http://127.0.0.1:8080"), language);
    return code.replaceAll("http://127.0.0.1:8080", server.url);
  };
  const where = path.join(scratch, "examples");
  mkdirSync(where);
  writeFileSync(path.join(where, "kitchen.ply"), patch(0, 0, { side: 5 }));

  const python = await start("python3", ["-c", example("python")], { cwd: where }).ended;
  assert.equal(python.status, 0, python.errors);
  assert.match(python.output, /'id': 'floor'/);
  const [floor] = await blocksOf(server);
  assert.deepEqual([floor.id, floor.vertex_count, floor.triangle_count], ["floor", 4, 2]);
  assert.ok(Math.abs(floor.observed_at - Date.now() / 1000) < 60);
  const unreadable = example("python").replace("return header.encode()", 'return b"no PLY"');
  const refused = await start("python3", ["-c", unreadable], { cwd: where }).ended;
  assert.notEqual(refused.status, 0);
  assert.match(refused.errors, /RuntimeError: not a PLY file/);

  const curl = await start("bash", ["-ec", example("sh")], { cwd: where }).ended;
  assert.equal(curl.status, 0, curl.errors);
  const answers = curl.output.trim().split("\n").map((line) => JSON.parse(line));
  assert.equal(answers[0].vertex_count, 25);
  assert.deepEqual(answers[1].blocks.map(({ id, observed_at }) => [id, id === "kitchen" ? observed_at : 0]), [["floor", 0], ["kitchen", 1700000000.5]]);
  assert.equal(readPly(path.join(where, "back.ply")).vertexCount, 25);
  assert.deepEqual((await blocksOf(server)).map(({ id }) => id), ["floor"]);
  await server.stop();
});
