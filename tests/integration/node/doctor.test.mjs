// What `spectra doctor` says of set-ups that are in order and of broken ones: exit status 0 or 1, and a line that names the fault and what to do.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { once } from "node:events";
import { chmodSync, copyFileSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import net from "node:net";
import { tmpdir } from "node:os";
import path from "node:path";
import { after, before, test } from "node:test";
import { binary, run, serve } from "./spectra_server.mjs";

const folder = mkdtempSync(path.join(tmpdir(), "spectra-doctor-"));
after(() => rmSync(folder, { recursive: true, force: true }));
const at = (name) => path.join(folder, name);

before(() => {
  writeFileSync(at("index.html"), "");
  run("token", "--file", at("tokens"), "--role", "viewer");
  run("certificate", at("c.pem"), at("c.key"), "--name", "robot.example", "--days", "100");
  run("certificate", at("short.pem"), at("short.key"), "--name", "robot.example", "--days", "10");
});

/** Not spawnSync: a server in this process must be able to answer. */
async function doctor(text) {
  writeFileSync(at("spectra.toml"), `[serve]\nweb = "${folder}"\n${text}`);
  const process_ = spawn(binary, ["doctor", "--config", at("spectra.toml")], { stdio: ["ignore", "pipe", "pipe"] });
  let page = "";
  process_.stdout.on("data", (chunk) => (page += chunk));
  const [status] = await once(process_, "close");
  for (const line of page.trim().split("\n")) assert.match(line, /^(ok|note|wrong) +[a-z ]+: ./);
  assert.equal(status, /^wrong/m.test(page) ? 1 : 0, page);
  return page;
}
const listen = 'listen = "127.0.0.1:0"\n';

test("all is well", async () => {
  const page = await doctor(`${listen}live = true\nstore = "${at("new.store")}"\ntokens = "${at("tokens")}"\n` +
    `certificate = "${at("c.pem")}"\nkey = "${at("c.key")}"\n`);
  assert.doesNotMatch(page, /^wrong/m);
  for (const part of [/^ok +config: /m, /processors: \d/, /memory: \d+ MiB of \d+ MiB/, /descriptors: \d/, /^ok +clock: 20/m, /^ok +tokens: 1$/m,
    /^ok +address: 127\.0\.0\.1:0 is free/m, /^ok +certificate: .* is good until 20.* for robot\.example/m, /^ok +store: .* will be made/m,
    /^ok +web client: /m, /^note +browsers: /m]) assert.match(page, part);
});

const broken = [
  ["a config file with a fault", 'threds = 1\n', /^wrong +config: .*line 3: serve has no option "threds"/m],
  ["an address that is none", 'listen = "8080"\n', /^wrong +address: 8080 is none/m],
  ["an address of another machine", 'listen = "192.0.2.1:8080"\ninsecure = true\n', /^wrong +address: 192\.0\.2\.1:8080 is no address of this machine/m],
  ["strangers without tokens", 'listen = "0.0.0.0:0"\n', /^wrong +access: .*spectra token --file/m],
  ["no tokens file", () => `${listen}tokens = "${at("none")}"\n`, /^wrong +tokens: .*none: No such file/m],
  ["a tokens file that everybody can read", () => {
    copyFileSync(at("tokens"), at("open"));
    chmodSync(at("open"), 0o644);
    return `${listen}tokens = "${at("open")}"\n`;
  }, /^wrong +tokens: .*chmod 600/m],
  ["a tokens file with a broken line", () => {
    writeFileSync(at("broken"), "viewer\n", { mode: 0o600 });
    return `${listen}tokens = "${at("broken")}"\n`;
  }, /^wrong +tokens: .*line 1/m],
  ["a key of another certificate", () => `${listen}certificate = "${at("c.pem")}"\nkey = "${at("short.key")}"\n`,
    /^wrong +certificate: .*is not the key of/m],
  ["no certificate", () => `${listen}certificate = "${at("none")}"\nkey = "${at("c.key")}"\n`, /^wrong +certificate: .*cannot be opened/m],
  ["no scene", () => `${listen}scene = "${at("none.ply")}"\n`, /^wrong +scene: .*none\.ply/m],
  ["no folder for the store", () => `${listen}live = true\nstore = "${at("no/map.store")}"\n`, /^wrong +store: .*there is no folder/m],
  ["a store that is none", () => {
    writeFileSync(at("text.store"), "this is no store, however long it is".repeat(100));
    return `${listen}live = true\nstore = "${at("text.store")}"\n`;
  }, /^wrong +store: .*text\.store/m],
];
for (const [what, config, line] of broken) {
  test(`wrong: ${what}`, async () => {
    assert.match(await doctor(typeof config === "string" ? config : config()), line);
  });
}

test("wrong: no web client", async () => {
  rmSync(at("index.html"));
  try {
    assert.match(await doctor(listen), /^wrong +web client: there is no index\.html/m);
  } finally {
    writeFileSync(at("index.html"), "");
  }
});

test("a certificate that soon ends is noted", async () => {
  const page = await doctor(`${listen}certificate = "${at("short.pem")}"\nkey = "${at("short.key")}"\n`);
  assert.match(page, /^note +certificate: .* only; spectra certificate --replace/m);
});

test("a port that another program has is wrong, one that Spectra has is not", async () => {
  const other = net.createServer((socket) => socket.end("220 mail\r\n")).listen(0, "127.0.0.1");
  await once(other, "listening");
  assert.match(await doctor(`listen = "127.0.0.1:${other.address().port}"\n`), /^wrong +address: .*taken by another program: ss -ltnp/m);
  other.close();

  const store = at("used.store");
  const server = await serve(["--live", "--store", store]);
  const { port } = new URL(server.url);
  const block = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n";
  assert.equal((await fetch(`${server.url}/api/v1/blocks/a`, { method: "PUT", body: block })).status, 200);
  const page = await doctor(`listen = "127.0.0.1:${port}"\nlive = true\nstore = "${store}"\n`);
  assert.match(page, /^note +address: .*taken by Spectra itself/m);
  assert.match(page, /^note +store: .*in use/m);
  assert.doesNotMatch(page, /^wrong/m);
  await server.stop();

  const encrypted = await serve(["--certificate", at("c.pem"), "--key", at("c.key")], { ready: false });
  assert.match(await doctor(`listen = "127.0.0.1:${new URL(encrypted.url).port}"\n`), /^note +address: .*taken by Spectra itself/m);
  await encrypted.stop();

  assert.match(await doctor(`${listen}live = true\nstore = "${store}"\n`), /^ok +store: .*is whole: 1 blocks/m);
  writeFileSync(store, readFileSync(store).fill(0x55, 4096));
  assert.match(await doctor(`${listen}live = true\nstore = "${store}"\n`), /^wrong +store: /m);
});
