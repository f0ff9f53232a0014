// A WebSocket client that may break the rules: bytes behind a good upgrade.

import net from "node:net";

/** A masked frame of a client, at most 125 bytes long; the mask is zero. */
export const rawFrame = (first, payload = Buffer.alloc(0)) =>
  Buffer.concat([Buffer.from([first, 0x80 | payload.length, 0, 0, 0, 0]), payload]);
export const closeFrame = (code) => rawFrame(0x88, Buffer.from([code >> 8, code & 255]));

/** What is left of the bytes behind whole frames that are no close frames. */
function behindMessages(bytes) {
  while (bytes.length >= 2 && bytes[0] !== 0x88) {
    const short = bytes[1] & 0x7f;
    if (bytes.length < 10 && bytes.length < 2 + short) break;
    const size = short < 126 ? 2 + short : short === 126 ? 4 + bytes.readUInt16BE(2) : 10 + Number(bytes.readBigUInt64BE(2));
    if (bytes.length < size) break;
    bytes = bytes.subarray(size);
  }
  return bytes;
}

/**
 * Sends bytes behind a good upgrade: the code of the close frame that comes back, messages before it passed over; null when the
 * connection ends without one. An upgrade that is refused for now (503: one robot at a time) is asked for again.
 */
export async function closeCodeAfter(url, frames, options = {}) {
  for (let tries = 0; ; tries += 1) {
    const answer = await answerTo(url, frames, options);
    if (answer !== 503 || tries === 500) return answer;
    await new Promise((resolve) => setTimeout(resolve, 20));
  }
}

/** The close code; the status of a refused upgrade. */
function answerTo(url, frames, { subprotocol }) {
  const { hostname, port, pathname, host } = new URL(url);
  const request = [
    `GET ${pathname} HTTP/1.1`,
    `Host: ${host}`,
    "Upgrade: websocket",
    "Connection: Upgrade",
    "Sec-WebSocket-Version: 13",
    "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==",
    ...(subprotocol ? [`Sec-WebSocket-Protocol: ${subprotocol}`] : []),
  ];
  return new Promise((resolve) => {
    const socket = net.connect(port, hostname, () => socket.write(`${request.join("\r\n")}\r\n\r\n`));
    let received = Buffer.alloc(0);
    let isOpen = false;
    socket.on("data", (chunk) => {
      received = Buffer.concat([received, chunk]);
      const end = received.indexOf("\r\n\r\n");
      if (!isOpen && end >= 0) {
        const status = Number(received.subarray(9, 12));
        if (status !== 101) {
          resolve(status);
          socket.destroy();
          return;
        }
        isOpen = true;
        received = received.subarray(end + 4);
        for (const frame of frames) socket.write(frame);
      }
      if (!isOpen) return;
      received = behindMessages(received);
      if (received.length >= 4 && received[0] === 0x88) {
        resolve(received.readUInt16BE(2));
        socket.destroy();
      }
    });
    socket.on("close", () => resolve(null));
    socket.on("error", () => resolve(null));
  });
}
