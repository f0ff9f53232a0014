#!/usr/bin/env python3
"""A radio link as the kernel sees one: two network namespaces, joined by packets that this program holds back, loses or lets through.

radio.py [--rate MBIT_PER_S] [--delay MS] [--jitter MS] [--loss SHARE] [--control FIFO] -- COMMAND...     (root; needs iproute2)

COMMAND runs in the namespace of the viewers, 10.77.0.2; with `ip netns exec $RADIO_ROBOT PROGRAM` it starts what runs on the robot, 10.77.0.1.
Rate, delay and loss hold for each direction. A line "cut SECONDS" written to the file $RADIO_CONTROL lets nothing through for that long.
The queue holds what the rate passes in 200 ms, and what comes on top is lost, as with a modem. Ends with the status of COMMAND.
"""
import argparse
import fcntl
import heapq
import os
import random
import select
import struct
import subprocess
import sys
import tempfile
import time

QUEUE_S = 0.2


def tun(name):
    descriptor = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(descriptor, 0x400454CA, struct.pack("16sH", name.encode(), 0x1001))  # TUNSETIFF; IFF_TUN | IFF_NO_PI
    return descriptor


def ip(*words):
    subprocess.run(["ip", *words], check=True)


def main():
    parser = argparse.ArgumentParser()
    for name, value in (("rate", 4.0), ("delay", 60.0), ("jitter", 0.0), ("loss", 0.0)):
        parser.add_argument(f"--{name}", type=float, default=value)
    parser.add_argument("command", nargs=argparse.REMAINDER)
    options = parser.parse_args()
    command = options.command[1:] if options.command[:1] == ["--"] else options.command
    bytes_per_s = options.rate * 1e6 / 8
    spaces = [f"radio{os.getpid()}{side}" for side in "rv"]
    folder = tempfile.mkdtemp()
    control_path = os.path.join(folder, "control")
    os.mkfifo(control_path)
    control = os.open(control_path, os.O_RDWR | os.O_NONBLOCK)
    ends = []
    try:
        for number, space in enumerate(spaces, 1):
            ip("netns", "add", space)
            ends.append(tun(space))
            ip("link", "set", space, "netns", space)
            ip("-n", space, "address", "add", f"10.77.0.{number}/24", "dev", space)
            ip("-n", space, "link", "set", "lo", "up")
            ip("-n", space, "link", "set", space, "up", "mtu", "1400")
        environment = {**os.environ, "RADIO_ROBOT": spaces[0], "RADIO_CONTROL": control_path}
        child = subprocess.Popen(["ip", "netns", "exec", spaces[1], *command], env=environment)
        free_at = [0.0, 0.0]
        last = [0.0, 0.0]
        flying = []
        closed_until = 0.0
        count = lost = 0
        while child.poll() is None:
            now = time.monotonic()
            while flying and flying[0][0] <= now:
                _, _, end, packet = heapq.heappop(flying)
                try:
                    os.write(ends[end], packet)
                except OSError:
                    pass
            wait = min(flying[0][0] - now, 0.2) if flying else 0.2
            readable, _, _ = select.select([*ends, control], [], [], max(0.0, wait))
            now = time.monotonic()
            if control in readable:
                for line in os.read(control, 4096).decode().splitlines():
                    closed_until = now + float(line.removeprefix("cut "))
            for end in (0, 1):
                if ends[end] not in readable:
                    continue
                for _ in range(32):
                    try:
                        packet = os.read(ends[end], 2048)
                    except BlockingIOError:
                        break
                    count += 1
                    start = max(free_at[end], now)
                    if now < closed_until or start - now > QUEUE_S or random.random() < options.loss:
                        lost += 1
                        continue
                    free_at[end] = start + len(packet) / bytes_per_s
                    # In order, as a link layer delivers.
                    last[end] = max(last[end], free_at[end] + (options.delay + random.random() * options.jitter) / 1000)
                    heapq.heappush(flying, (last[end], count, 1 - end, packet))
        print(f"radio: {count} packets, {lost} lost", file=sys.stderr)
        return child.returncode
    finally:
        for space in spaces:
            subprocess.run(["ip", "netns", "delete", space], check=False)
        os.remove(control_path)
        os.rmdir(folder)


sys.exit(main())
