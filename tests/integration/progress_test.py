#!/usr/bin/env python3
"""What a command tells a terminal about its progress, seen through a pseudo-terminal; and that nobody else sees any of it."""
import fcntl
import os
import pty
import re
import select
import signal
import struct
import subprocess
import sys
import tempfile
import termios
import threading
import time
import unittest

SPECTRA = os.environ["SPECTRA_BIN"]
PROGRESS = re.compile(rb"\d+ %")
FIRST_PAUSE_S = 0.5  # longer than the line waits before it appears
PAUSE_S = 0.05


class Brake:
    """Makes a process as slow as a large scene would: it may only run for `run_s` at a time, after a first long pause."""

    def __init__(self, child, run_s):
        self.child = child
        self.run_s = run_s
        self.is_over = threading.Event()
        self.thread = threading.Thread(target=self.work)
        self.thread.start()

    def work(self):
        pause_s = FIRST_PAUSE_S
        while not self.is_over.wait(self.run_s):
            self.child.send_signal(signal.SIGSTOP)
            self.is_over.wait(pause_s)
            self.child.send_signal(signal.SIGCONT)
            pause_s = PAUSE_S

    def release(self):
        self.is_over.set()
        self.thread.join()


def on_terminal(*args, columns=100, run_s=None, interrupt_after_s=None):
    """Runs a command whose standard error is a terminal; returns its status, what the terminal got as (time, bytes), and stdout.
    With `run_s` it is slowed down; with `interrupt_after_s` it is interrupted so long after its first progress."""
    master, slave = pty.openpty()
    fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
    with tempfile.TemporaryFile() as out:
        # On a busy machine the brake has to come first.
        child = subprocess.Popen(["nice", "-n", "19", SPECTRA, *args], stdout=out, stderr=slave, stdin=subprocess.DEVNULL)
        os.close(slave)
        brake = Brake(child, run_s) if run_s else None
        chunks = []
        begin = time.monotonic()
        while True:
            ready, _, _ = select.select([master], [], [], 0.05)
            if ready:
                try:
                    data = os.read(master, 65536)
                except OSError:
                    break
                if not data:
                    break
                chunks.append((time.monotonic() - begin, data))
            if interrupt_after_s is not None and PROGRESS.search(b"".join(data for _, data in chunks)):
                time.sleep(interrupt_after_s)
                child.send_signal(signal.SIGINT)
                interrupt_after_s = None
        if brake:
            brake.release()
        status = child.wait()
        os.close(master)
        out.seek(0)
        return status, chunks, out.read()


def shown(data):
    """What is left on the terminal's lines after all has been written."""
    lines = []
    line = []
    column = 0
    for char in data.decode():
        if char == "\r":
            column = 0
        elif char == "\n":
            lines.append("".join(line).rstrip())
            line, column = [], 0
        else:
            line[column:column + 1] = [char]
            column += 1
    lines.append("".join(line).rstrip())
    return lines


class Progress(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.scene = os.path.join(cls.folder.name, "scene.ply")
        subprocess.run([SPECTRA, "demo-scene", cls.scene, "--vertices", "150000"], check=True, stderr=subprocess.PIPE)
        # Its topology is read off in less than a tenth of a second.
        cls.large_mesh = os.path.join(cls.folder.name, "mesh.ply")
        subprocess.run([SPECTRA, "demo-scene", cls.large_mesh, "--vertices", "600000"], check=True, stderr=subprocess.PIPE)
        # For what is done at the speed of memory: a brake that comes late must still find it at work.
        cls.large_cloud = os.path.join(cls.folder.name, "cloud.ply")
        block = b"".join(struct.pack("<ffff", i % 300 * 0.01, i // 300 * 0.01, 0, 20 + i % 700 * 0.01) for i in range(90_000))
        block_count = 80
        with open(cls.large_cloud, "wb") as file:
            file.write(b"ply\nformat binary_little_endian 1.0\nelement vertex %d\n" % (90_000 * block_count))
            file.write(b"".join(b"property float %s\n" % name for name in (b"x", b"y", b"z", b"temperature")) + b"end_header\n")
            for _ in range(block_count):
                file.write(block)

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def output(self, name):
        return os.path.join(self.folder.name, name)

    def check(self, *args, words, run_s=0.04, least_before_end=0):
        """The line is there, tells of each of `words` (of what takes longest: the rest may be over between two looks), is redrawn at
        most ten times a second, comes to 100 %, and is gone at the end."""
        status, chunks, out = on_terminal(*args, run_s=run_s)
        seen = b"".join(data for _, data in chunks)
        self.assertEqual(status, 0, seen)
        self.assertRegex(seen, PROGRESS)
        for word in words:
            self.assertIn(word, seen)
        self.assertRegex(seen, rb"about \d+ (s|min)")
        draws = [at for at, data in chunks for _ in PROGRESS.findall(data)]
        self.assertLessEqual(len(draws), 10 * (draws[-1] - draws[0]) + 2)
        shares = [int(share) for share in re.findall(rb"(\d+) %", seen)]
        self.assertEqual(shares, sorted(shares), "only ahead")
        self.assertEqual(shares[-1], 100, "to the end")
        # What is shown just before the end is not far from it: the estimate is worth something.
        self.assertGreaterEqual(shares[-2] if len(shares) > 1 else 100, least_before_end)
        for line in shown(seen):
            self.assertTrue(line == "" or line.startswith("spectra: note: "), line)
        return out

    def test_fuse_to_ply(self):
        self.check("fuse", self.large_cloud, self.output("o.ply"), "--method", "histogram_bin",
                   words=[b"fusing to o.ply"], run_s=0.02)

    def test_fuse_to_glb(self):
        self.check("fuse", self.large_cloud, self.output("o.glb"), "--method", "thermal_only", words=[b"writing o.glb"],
                   run_s=0.02)

    def test_fuse_to_drc(self):
        self.check("fuse", self.scene, self.output("o.drc"), "--method", "thermal_only",
                   words=[b"cutting into tiles", b"writing o.drc"], least_before_end=85)

    def test_info(self):
        out = self.check("info", self.large_mesh, words=[b"examining the topology"], run_s=0.01)
        self.assertIn(b"vertices", out)

    def test_demo_scene(self):
        self.check("demo-scene", self.output("demo.ply"), "--vertices", "100000", words=[b"modelling the demo scene"], run_s=0.4)

    def test_tradeoff(self):
        small = self.output("small.ply")
        subprocess.run([SPECTRA, "demo-scene", small, "--vertices", "20000"], check=True, stderr=subprocess.PIPE)
        self.check("tradeoff", small, "--out", self.output("tradeoff"), words=[b"measuring"], run_s=0.1)

    def test_the_line_fits_a_narrow_terminal(self):
        _, chunks, _ = on_terminal("info", self.large_mesh, columns=24, run_s=0.01)
        seen = b"".join(data for _, data in chunks)
        self.assertRegex(seen, PROGRESS)
        for line in re.split(rb"[\r\n]", seen):
            self.assertLess(len(line), 24)

    def test_an_error_stands_alone(self):
        status, chunks, _ = on_terminal("fuse", self.scene, "/nowhere/o.ply", "--method", "thermal_only")
        self.assertEqual(status, 1)
        self.assertRegex("\n".join(shown(b"".join(data for _, data in chunks))), r"^spectra: /nowhere/o.ply [^\n]*\n$")

    def test_interrupted_leaves_neither_line_nor_file(self):
        before = set(os.listdir(self.folder.name))
        status, chunks, _ = on_terminal("fuse", self.scene, self.output("stopped.drc"), "--method", "thermal_only",
                                        run_s=0.02, interrupt_after_s=0.3)
        self.assertEqual(status, -signal.SIGINT)
        self.assertEqual(set(os.listdir(self.folder.name)), before)
        self.assertEqual(shown(b"".join(data for _, data in chunks)), [""])

    def test_quiet(self):
        for args in (["--quiet", "info", self.large_mesh], ["info", self.large_mesh, "--quiet"]):
            status, chunks, out = on_terminal(*args, run_s=0.01)
            self.assertEqual(status, 0)
            self.assertEqual(b"".join(data for _, data in chunks), b"")
            self.assertIn(b"vertices", out)

    def test_nobody_but_a_terminal_sees_it(self):
        result = subprocess.run([SPECTRA, "fuse", self.scene, self.output("p.ply"), "--method", "thermal_only"],
                                stderr=subprocess.PIPE, check=True)
        for line in result.stderr.splitlines():
            self.assertTrue(line.startswith(b"spectra: note: "), line)


if __name__ == "__main__":
    unittest.main(verbosity=2)
