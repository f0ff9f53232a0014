#!/usr/bin/env python3
"""Sends a folder of frames to `spectra serve --map live` as a robot would, with Python's standard library alone.

usage: send_frames.py FOLDER [URL] [--as-fast-as-possible]

FOLDER: frames.txt, poses.txt, calibration.json and pictures (docs/mapping.md, "A folder of frames"); a sender of its own makes the same
messages of what its drivers give it (docs/protocol.md, "A stream of frames"). URL: http://127.0.0.1:8080 unless said otherwise. A token,
where the server wants one, is taken from SPECTRA_TOKEN.
"""
import base64
import json
import os
import socket
import struct
import sys
import time
from urllib.parse import urlsplit


class Robot:
    """A WebSocket (RFC 6455) of the subprotocol spectra.frames.v1."""

    def __init__(self, url):
        parts = urlsplit(url)
        self.socket = socket.create_connection((parts.hostname, parts.port or 80))
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.received = b""
        lines = [
            "GET /frames HTTP/1.1",
            f"Host: {parts.netloc}",
            "Connection: Upgrade",
            "Upgrade: websocket",
            "Sec-WebSocket-Version: 13",
            "Sec-WebSocket-Key: " + base64.b64encode(os.urandom(16)).decode(),
            "Sec-WebSocket-Protocol: spectra.frames.v1",
        ]
        if "SPECTRA_TOKEN" in os.environ:
            lines.append("Authorization: Bearer " + os.environ["SPECTRA_TOKEN"])
        self.socket.sendall(("\r\n".join(lines) + "\r\n\r\n").encode())
        while b"\r\n\r\n" not in self.received:
            self.receive()
        answer, self.received = self.received.split(b"\r\n\r\n", 1)
        if b" 101 " not in answer.split(b"\r\n")[0]:
            sys.exit(answer.split(b"\r\n")[0].decode())
        self.messages = self.bytes = self.refused = self.skipped = self.answered = 0
        self.credit = {"messages": 0, "bytes": 0}
        # The hello.
        self.next_answer()

    def receive(self):
        data = self.socket.recv(65536)
        if not data:
            sys.exit("the server has ended the connection")
        self.received += data

    def take(self, count):
        while len(self.received) < count:
            self.receive()
        data, self.received = self.received[:count], self.received[count:]
        return data

    def write(self, kind, data):
        mask = os.urandom(4)
        size = len(data)
        length = bytes([0x80 | size]) if size < 126 else struct.pack(">BH" if size < 65536 else ">BQ", 0x80 | (126 if size < 65536 else 127), size)
        key = int.from_bytes(mask * (size // 4 + 1), "big") >> (8 * (4 - size % 4))
        masked = (int.from_bytes(data, "big") ^ key).to_bytes(size, "big")
        self.socket.sendall(bytes([0x80 | kind]) + length + mask + masked)

    def next_answer(self):
        while True:
            first, size = self.take(2)
            if size == 126:
                (size,) = struct.unpack(">H", self.take(2))
            elif size == 127:
                (size,) = struct.unpack(">Q", self.take(8))
            data = self.take(size)
            if first & 15 == 9:
                self.write(10, data)
            elif first & 15 == 8:
                sys.exit("the server has ended the connection: " + data[2:].decode())
            elif first & 15 == 1:
                break
        message = json.loads(data)
        answer = message["params"]
        if message["method"] == "frames.refused":
            self.refused += 1
            print(f"refused: {answer['reason']}", file=sys.stderr)
        elif answer.get("skipped"):
            self.skipped += 1
        self.answered += 1
        self.credit = answer.get("credit", self.credit)
        return answer

    def send(self, head, body=b""):
        # Within the credit; what goes beyond it would be left out.
        while self.messages >= self.credit["messages"] or self.bytes >= self.credit["bytes"]:
            self.next_answer()
        self.messages += 1
        text = json.dumps({"sequence": self.messages, **head}).encode()
        message = b"SPF1" + struct.pack("<I", len(text)) + text + body
        self.bytes += len(message)
        self.write(2, message)

    def finish(self):
        """Waits until everything is answered; the hello counts, too."""
        self.send({"kind": "end"})
        while self.answered < self.messages + 1:
            self.next_answer()


def lines_of(path):
    with open(path) as file:
        return [line.split() for line in file if line.strip() and not line.startswith("#")]


def main():
    arguments = [argument for argument in sys.argv[1:] if not argument.startswith("--")]
    if not 1 <= len(arguments) <= 2:
        sys.exit(__doc__)
    folder = arguments[0]
    is_paced = "--as-fast-as-possible" not in sys.argv
    robot = Robot(arguments[1] if len(arguments) > 1 else "http://127.0.0.1:8080")
    with open(os.path.join(folder, "calibration.json"), "rb") as file:
        robot.send({"kind": "calibration"}, file.read())
    poses_file = os.path.join(folder, "poses.txt")
    # Without any the server has to track (--track).
    poses = [[float(word) for word in line] for line in lines_of(poses_file)] if os.path.exists(poses_file) else []
    told = 0
    begin = time.monotonic()
    rows = lines_of(os.path.join(folder, "frames.txt"))
    for row in rows:
        stamp = float(row[0])
        if is_paced:
            time.sleep(max(0, begin + stamp - float(rows[0][0]) - time.monotonic()))
        news = told
        while news < len(poses) and poses[news][0] <= stamp + 0.1:
            news += 1
        for first in range(told, news, 100):
            robot.send({"kind": "poses", "poses": poses[first : min(first + 100, news)]})
        told = news
        # Colour before the depth picture of its moment, which takes it.
        for sensor, column in (("color", 2), ("depth", 1), ("thermal", 3)):
            if len(row) <= column or row[column] == "-":
                continue
            with open(os.path.join(folder, row[column]), "rb") as file:
                encoding = "jpeg" if row[column].lower().endswith((".jpg", ".jpeg")) else "png"
                robot.send({"kind": "picture", "sensor": sensor, "encoding": encoding, "time": stamp}, file.read())
    robot.finish()
    print(f"sent {robot.messages} messages, {robot.bytes / 1e6:.1f} MB; {robot.refused} refused, {robot.skipped} skipped")


main()
