#!/usr/bin/env python3
"""spectra map on small folders of frames: what it writes, what it says of damaged ones, and that an end in the middle leaves nothing."""
import json
import os
import shutil
import signal
import struct
import subprocess
import tempfile
import time
import unittest
import urllib.error
import urllib.request
import zlib

SPECTRA = os.environ["SPECTRA_BIN"]
WIDTH, HEIGHT, FOCAL = 80, 60, 70.0
IDENTITY = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]


def png16(rows):
    """A PNG of 16-bit grey."""
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    body = b"".join(b"\0" + struct.pack(">%dH" % len(row), *row) for row in rows)
    head = struct.pack(">IIBBBBB", len(rows[0]), len(rows), 16, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(body)) + chunk(b"IEND", b"")


def camera(**more):
    return dict(width=WIDTH, height=HEIGHT, fx=FOCAL, fy=FOCAL, cx=(WIDTH - 1) / 2, cy=(HEIGHT - 1) / 2, **more)


class Frames(unittest.TestCase):
    """A wall 1.5 m away with a warm half, seen ten times in a second."""

    COUNT = 10

    def setUp(self):
        self.folder = tempfile.mkdtemp(prefix="spectra-map-")
        for part in ("depth", "thermal"):
            os.mkdir(os.path.join(self.folder, part))
        calibration = {"depth": camera(), "thermal": camera(unit="centikelvin", from_depth=IDENTITY)}
        self.write("calibration.json", json.dumps(calibration))
        self.write("poses.txt", "".join("%.2f 0 0 0 0 0 0 1\n" % (0.05 * i) for i in range(2 * self.COUNT)))
        self.write("frames.txt", "".join("%.1f depth/%d.png - thermal/%d.png\n" % (0.1 * i, i, i) for i in range(self.COUNT)))
        for i in range(self.COUNT):
            depth = [[1500] * WIDTH for _ in range(HEIGHT)]
            warm = [[29315 + i % 3 + (1000 if x > WIDTH // 2 else 0) for x in range(WIDTH)] for _ in range(HEIGHT)]
            self.write("depth/%d.png" % i, png16(depth))
            self.write("thermal/%d.png" % i, png16(warm))
        self.output = os.path.join(self.folder, "map.ply")

    def tearDown(self):
        shutil.rmtree(self.folder)

    def path(self, name):
        return os.path.join(self.folder, name)

    def write(self, name, content):
        with open(self.path(name), "wb") as file:
            file.write(content if isinstance(content, bytes) else content.encode())

    def map(self, *more):
        return subprocess.run([SPECTRA, "map", self.folder, self.output, "--voxel", "0.02", *more], capture_output=True, text=True)

    def test_writes_a_mesh_that_the_other_commands_read(self):
        done = self.map()
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(done.stderr, "")
        self.assertIn("10 of depth, 0 of colour, 10 of temperature", done.stdout)
        facts = json.loads(subprocess.run([SPECTRA, "info", "--json", self.output], capture_output=True, text=True, check=True).stdout)
        self.assertGreater(facts["vertex_count"], 2000)
        with open(self.output, "rb") as file:
            head = file.read(600)
        for name in (b"property float temperature\n", b"property float temperature_sigma\n", b"property double seen\n"):
            self.assertIn(name, head)

    def test_the_same_bytes_for_any_number_of_threads(self):
        contents = []
        for threads in ("1", "5"):
            self.assertEqual(self.map("--threads", threads).returncode, 0)
            with open(self.output, "rb") as file:
                contents.append(file.read())
        self.assertEqual(contents[0], contents[1])

    def test_says_once_what_is_wrong_and_goes_on(self):
        for i in (3, 4):
            with open(self.path("depth/%d.png" % i), "r+b") as file:
                file.truncate(100)
        os.remove(self.path("thermal/5.png"))
        self.write("thermal/6.png", png16([[29315] * 16] * 16))
        with open(self.path("frames.txt"), "a") as file:
            file.write("0.2 depth/2.png - -\n0.3 depth/3.png - -\n7.5 depth/1.png - -\nnonsense\n1.1 depth/9.png")
        with open(self.path("poses.txt"), "a") as file:
            file.write("nan 0 0 0 0 0 0 1\n")
        done = self.map()
        self.assertEqual(done.returncode, 0, done.stderr)
        lines = done.stderr.splitlines()
        for words in ("no whole PNG", "cannot be read", "16 x 16 pixels", "not later than", "no pose is known", "not a timestamp",
                      "without a time, a place and a rotation"):
            self.assertEqual(sum(words in line for line in lines), 1, (words, done.stderr))
        self.assertEqual(len(lines), 7, done.stderr)
        self.assertIn("(2 times)", next(line for line in lines if "no whole PNG" in line))
        self.assertIn("8 of depth", done.stdout)

    def test_refuses_what_cannot_be_meant(self):
        for arguments, words in (([self.path("none"), self.output], "no folder of frames"),
                                 ([self.folder, self.path("map.obj")], "must end in .ply"),
                                 ([self.folder, self.output, "--voxel", "0"], "--voxel"),
                                 ([self.folder, self.output, "--poses", self.path("none")], "poses cannot be read")):
            done = subprocess.run([SPECTRA, "map", *arguments], capture_output=True, text=True)
            self.assertIn(done.returncode, (1, 2))
            self.assertIn(words, done.stderr)
            self.assertEqual(len(done.stderr.splitlines()), 1, done.stderr)
        for i in range(self.COUNT):
            os.remove(self.path("depth/%d.png" % i))
        done = self.map()
        self.assertEqual(done.returncode, 1)
        self.assertIn("nothing was written", done.stderr)
        self.assertFalse(os.path.exists(self.output))

    def server(self, *arguments):
        """A server on a free port; its address."""
        child = subprocess.Popen([SPECTRA, "serve", *arguments, "--listen", "127.0.0.1:0", "--web", self.folder], stdout=subprocess.PIPE,
                                 stderr=subprocess.DEVNULL, text=True)
        self.addCleanup(child.stdout.close)
        self.addCleanup(child.wait)
        self.addCleanup(child.terminate)
        return child.stdout.readline().split()[-1]

    @staticmethod
    def blocks(url):
        with urllib.request.urlopen(url + "/api/v1/blocks?limit=1000") as answer:
            return json.load(answer)["blocks"]

    def wait_for_blocks(self, url, count):
        for _ in range(400):
            try:
                found = self.blocks(url)
                if len(found) >= count:
                    return found
            except urllib.error.HTTPError as refused:
                self.assertEqual(refused.code, 503, "the map is not open yet")
            time.sleep(0.05)
        self.fail("the map stays empty")

    def test_sends_units_to_a_server(self):
        self.write("index.html", "")
        url = self.server("--live")
        done = subprocess.run([SPECTRA, "map", self.folder, self.output, "--to", url, "--voxel", "0.02"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn(" 0 refused", done.stdout)
        blocks = self.blocks(url)
        self.assertTrue(all(block["id"].startswith("unit_") for block in blocks))
        mesh = json.loads(subprocess.run([SPECTRA, "info", "--json", self.output], capture_output=True, text=True, check=True).stdout)
        # Units have vertices of their own where they meet.
        self.assertGreaterEqual(sum(block["vertex_count"] for block in blocks), mesh["vertex_count"])
        self.assertEqual(sum(block["triangle_count"] for block in blocks), mesh["triangle_count"])
        self.assertEqual(subprocess.run([SPECTRA, "map", self.folder], capture_output=True).returncode, 2)

    def test_says_what_was_sent_when_no_file_is_written(self):
        self.write("index.html", "")
        url = self.server("--live")
        poses = self.path("poses.txt")
        done = subprocess.run([SPECTRA, "map", self.folder, self.output, "--to", url, "--voxel", "0.02", "--corrected-poses", poses],
                              capture_output=True, text=True)
        self.assertEqual(done.returncode, 1, done.stdout)
        count = len(self.blocks(url))
        self.assertGreater(count, 0)
        self.assertRegex(done.stderr, r"no file was written, and \d+ units of the map stay where they were sent")
        self.assertFalse(os.path.exists(self.output))

    def test_tracking_says_where_it_is_lost_and_needs_no_poses(self):
        os.remove(self.path("poses.txt"))
        poses = self.path("found.txt")
        done = self.map("--track", "--save-poses", poses)
        self.assertEqual(done.returncode, 0, done.stderr)
        # A bare wall does not tell where it is seen from.
        self.assertIn("at 0.100 s what is seen no longer tells where it is seen from", done.stderr)
        self.assertEqual(done.stderr.count("warning"), 1, done.stderr)
        self.assertIn("tracking     0 poses found", done.stdout)
        self.assertIn("9 lost", done.stdout)
        with open(poses) as file:
            self.assertEqual([line.split()[0] for line in file if not line.startswith("#")], ["0.000000"])
        self.assertEqual(self.map("--save-poses", poses).returncode, 2)

    def test_corrected_poses_move_the_map(self):
        def bounds():
            done = subprocess.run([SPECTRA, "info", "--json", self.output], capture_output=True, text=True, check=True)
            facts = json.loads(done.stdout)
            return facts["origin"][2] + facts["bounds"]["max"][2]

        self.write("later.txt", "".join("%.2f 0 0 0.5 0 0 0 1\n" % (0.05 * i) for i in range(2 * self.COUNT)))
        done = self.map("--corrected-poses", self.path("later.txt"), "--threads", "1")
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertIn("submaps      1, 1 of them moved", done.stdout)
        self.assertAlmostEqual(bounds(), 2.0, delta=0.01)
        # Poses that nothing was made with say nothing of it.
        self.write("later.txt", "100 0 0 0.5 0 0 0 1\n")
        done = self.map("--corrected-poses", self.path("later.txt"))
        self.assertEqual(done.returncode, 1)
        self.assertIn("none of its poses", done.stderr)
        done = self.map("--corrected-poses", self.path("later.txt"), "--track")
        self.assertEqual(done.returncode, 2)

    def test_calibration_is_refused_where_it_cannot_be_told(self):
        done = subprocess.run([SPECTRA, "calibrate", "thermal-delay", self.folder], capture_output=True, text=True)
        self.assertEqual(done.returncode, 1)
        self.assertIn("the delay of the thermal camera cannot be told: only 0 of 10 thermal pictures", done.stderr)
        picture = self.path("v.pfm")
        done = subprocess.run([SPECTRA, "calibrate", "vignetting", self.folder, picture], capture_output=True, text=True)
        self.assertEqual(done.returncode, 1)
        self.assertIn("the vignetting of the thermal camera cannot be told", done.stderr)
        self.assertFalse(os.path.exists(picture))
        done = subprocess.run([SPECTRA, "calibrate", "vignetting", self.folder, self.path("v.png")], capture_output=True, text=True)
        self.assertEqual(done.returncode, 2)
        self.assertIn("must end in .pfm", done.stderr)
        self.assertEqual(subprocess.run([SPECTRA, "calibrate"], capture_output=True).returncode, 2)

    def test_a_server_maps_frames_itself(self):
        self.write("index.html", "")
        self.assertGreater(len(self.wait_for_blocks(self.server("--map", self.folder, "--voxel", "0.02"), 4)), 3)
        done = subprocess.run([SPECTRA, "serve", "--map", self.path("none"), "--listen", "127.0.0.1:0"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 1)
        self.assertIn("no folder of frames", done.stderr)
        done = subprocess.run([SPECTRA, "serve", "--map", self.folder, "--submaps", "--listen", "127.0.0.1:0"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 2)
        self.assertIn("--submaps goes with --map live", done.stderr)

    def test_a_server_tracks_and_says_where_it_is_lost(self):
        self.write("index.html", "")
        os.remove(self.path("poses.txt"))
        log = self.path("log.txt")
        url = self.server("--map", self.folder, "--voxel", "0.02", "--track", "--log-file", log)
        self.assertGreater(len(self.wait_for_blocks(url, 4)), 3, "of the first picture")
        for _ in range(200):
            with open(log) as file:
                text = file.read()
            if "mapping is done" in text:
                break
            time.sleep(0.05)
        self.assertIn("tracking has lost its place: nothing is fused", text)
        self.assertIn("mapping is done: 1 depth", text)

    def test_the_example_of_a_sender(self):
        self.write("index.html", "")
        example = os.path.join(os.path.dirname(os.path.abspath(__file__)), "../../docs/examples/send_frames.py")
        url = self.server("--map", "live", "--voxel", "0.02")
        done = subprocess.run(["python3", example, self.folder, url, "--as-fast-as-possible"], capture_output=True, text=True, timeout=60)
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertRegex(done.stdout, r"sent 3\d messages, .* 0 refused, 0 skipped")
        self.assertGreater(len(self.wait_for_blocks(url, 4)), 3)

    def test_a_simulated_robot_fills_a_map(self):
        self.write("index.html", "")
        self.assertGreater(len(self.wait_for_blocks(self.server("--demo-drive"), 20)), 19)

    def test_an_end_in_the_middle_leaves_nothing(self):
        before = set(os.listdir(self.folder))
        child = subprocess.Popen([SPECTRA, "map", self.folder, self.output, "--voxel", "0.004"], stdout=subprocess.DEVNULL,
                                 stderr=subprocess.DEVNULL)
        time.sleep(0.1)
        child.send_signal(signal.SIGINT)
        status = child.wait()
        if status != 0:
            self.assertEqual(status, -signal.SIGINT)
            self.assertEqual(set(os.listdir(self.folder)), before)


if __name__ == "__main__":
    unittest.main()
