// What viewers cost who open a connection and then neither read nor write:
//   node tests/bench/stream/silent_viewers.mjs [VIEWERS] [full | brief]     (default: 500 full)
// The status is 1 over 64 kB each.
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import net from "node:net";
import { tmpdir } from "node:os";
import path from "node:path";
import { run, serve } from "../../integration/node/spectra_server.mjs";

const count = Number(process.argv[2] ?? 500);
const form = process.argv[3] ?? "full";
const BAR_BYTES = 64_000;

const folder = mkdtempSync(path.join(tmpdir(), "spectra-bench-"));
const scene = path.join(folder, "small.ply");
run("demo-scene", scene, "--vertices", "5000");
const server = await serve([scene]);
const resident_bytes = () => 1024 * Number(/VmRSS:\s+(\d+)/.exec(readFileSync(`/proc/${server.process.pid}/status`, "utf8"))[1]);

function silentViewer() {
  const { hostname, port, host } = new URL(server.url);
  return new Promise((resolve, reject) => {
    const socket = net.connect({ host: hostname, port: Number(port) }, () => resolve(socket));
    socket.once("error", reject);
    socket.pause();
    socket.write(
      `GET /ws${form === "full" ? "" : `?hello=${form}`} HTTP/1.1\r\nHost: ${host}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n` +
        "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Protocol: spectra.v1\r\n\r\n",
    );
  });
}

const settled = () => new Promise((resolve) => setTimeout(resolve, 1500));
// What the first one makes is shared by all.
const sockets = [await silentViewer()];
await settled();
const before = resident_bytes();
for (let i = 0; i < count; ++i) sockets.push(await silentViewer());
await settled();
const each = (resident_bytes() - before) / count;
for (const socket of sockets) socket.destroy();
await settled();
const left = (resident_bytes() - before) / count;
const kB = (bytes) => (bytes / 1000).toFixed(1);
console.log(`${count} silent viewers, hello ${form}: ${kB(each)} kB of resident memory each (bar ${kB(BAR_BYTES)}), ${kB(left)} kB when they have left`);
await server.stop();
rmSync(folder, { recursive: true, force: true });
process.exit(each > BAR_BYTES ? 1 : 0);
