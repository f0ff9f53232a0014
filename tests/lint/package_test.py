"""What goes into the package, as far as it can be looked at without building one: the unit, the man page, completion, the maintainers'
scripts, notices. SPECTRA_BIN names the program. Checks by programs that are not installed here are skipped by name."""

import json
import os
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest

SOURCE = pathlib.Path(__file__).resolve().parents[2]
PACKAGE = SOURCE / "deploy" / "package"
PROGRAM = os.environ["SPECTRA_BIN"]
MOST_EXPOSURE = 1.5


def run(*command, **options):
    result = subprocess.run(command, capture_output=True, text=True, **options)
    assert result.returncode == 0, f"{command}: {result.stderr}{result.stdout}"
    return result.stdout


def described(what):
    return run("python3", PACKAGE / "describe.py", what, PROGRAM)


def options_said():
    """{command: its options} from --help-all, apart from how describe.py reads it."""
    found, command = {}, ""
    for line in run(PROGRAM, "--help-all").splitlines():
        if re.fullmatch(r"[a-z-]+", line):
            command = line
        elif match := re.match(r" +(?:-\w,)?(--[a-z-]+)", line):
            found.setdefault(command, set()).add(match[1])
    return found


class Unit(unittest.TestCase):
    UNIT = PACKAGE / "spectra.service"

    @unittest.skipUnless(shutil.which("systemd-analyze"), "systemd-analyze is not installed")
    def test_exposes_little(self):
        with tempfile.TemporaryDirectory() as folder:
            shutil.copy(self.UNIT, folder)
            said = run("systemd-analyze", "security", "--offline=true", "--no-pager", f"{folder}/spectra.service")
        exposure = float(re.search(r"Overall exposure level for spectra\.service: ([\d.]+)", said)[1])
        self.assertLessEqual(exposure, MOST_EXPOSURE)

    @unittest.skipUnless(shutil.which("systemd-analyze"), "systemd-analyze is not installed")
    def test_is_understood(self):
        # What is not installed here (the programs, the man page) is no fault of the unit.
        with tempfile.TemporaryDirectory() as folder:
            text = re.sub(r"(?m)^Documentation=.*\n", "", self.UNIT.read_text())
            text = re.sub(r"(?m)^(Exec\w+=\+?)/\S+", r"\1/bin/true", text)
            file = pathlib.Path(folder) / "spectra.service"
            file.write_text(text)
            result = subprocess.run(["systemd-analyze", "verify", "--man=no", file], capture_output=True, text=True)
        self.assertEqual([line for line in result.stderr.splitlines() if "spectra.service" in line], [])
        self.assertEqual(result.returncode, 0, result.stderr)

    def test_starts_what_the_package_has(self):
        text = self.UNIT.read_text()
        self.assertIn("ExecStart=/usr/bin/spectra serve --config /etc/spectra/spectra.toml\n", text)
        self.assertEqual((PACKAGE / "conffiles").read_text(), "/etc/spectra/spectra.toml\n")
        self.assertIn("DynamicUser=yes\n", text)
        sample = (SOURCE / "deploy" / "spectra.toml").read_text()
        active = dict(re.findall(r"(?m)^([a-z-]+) = (.*)$", sample))
        self.assertEqual(active, {"listen": '"127.0.0.1:8080"', "live": "true", "store": '"/var/lib/spectra/map.store"'})


class ManPage(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.folder.cleanup)
        cls.file = pathlib.Path(cls.folder.name) / "spectra.1"
        cls.text = described("man")
        cls.file.write_text(cls.text)

    def test_has_every_command_and_option(self):
        said = options_said()
        self.assertIn("--listen", said["serve"])
        self.assertGreater(len(said), 10)
        plain = self.text.replace("\\-", "-")
        general, *sections = re.split(r"(?m)^\.SS ", plain)
        for command, options in said.items():
            part = "".join(s for s in sections if s.split("\n")[0].split()[0] == command) if command else general
            for option in options - ({"--help", "--help-all", "--quiet"} if command else set()):
                self.assertRegex(part, rf"\\fB(?:-\w,)?{option}\\fR", f"{command} {option}")
        self.assertNotRegex(self.text, r"@[A-Z]+@")

    @unittest.skipUnless(shutil.which("mandoc"), "mandoc is not installed")
    def test_is_good_for_mandoc(self):
        result = subprocess.run(["mandoc", "-T", "lint", "-W", "warning", self.file], capture_output=True, text=True)
        self.assertEqual(result.stdout + result.stderr, "")

    @unittest.skipUnless(shutil.which("man"), "man is not installed")
    def test_is_good_for_man(self):
        result = subprocess.run(["man", "--warnings", "-l", "-Tutf8", self.file], capture_output=True, text=True,
                                env=dict(os.environ, MANWIDTH="80", LC_ALL="C.UTF-8"))
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        # Bold and italic letters are overstruck.
        self.assertTrue("check-config" in re.sub(r".\x08", "", result.stdout), "the page says little")


class Completion(unittest.TestCase):
    def completed(self, *words):
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / "spectra"
            file.write_text(described("completion"))
            script = f'. {file}; COMP_WORDS=({" ".join(repr(w) for w in words)}); COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1)); _spectra; printf "%s\\n" "${{COMPREPLY[@]}}"'
            return run("bash", "-euc", script, cwd=folder, env=dict(os.environ, PATH=f"{pathlib.Path(PROGRAM).parent}:{os.environ['PATH']}")).split()

    def test_knows_commands_and_options(self):
        self.assertEqual(self.completed("spectra", "che"), ["check-config"])
        self.assertEqual(self.completed("spectra", "serve", "--lis"), ["--listen"])
        self.assertEqual(self.completed("spectra", "store", "sa"), ["salvage"])
        self.assertEqual(self.completed("spectra", "calibrate", "thermal"), ["thermal-delay"])
        self.assertEqual(self.completed("spectra", "token", "--role", "vi"), ["viewer"])
        self.assertEqual(self.completed("spectra", "fuse", "--method", "thermal_visible_b"), ["thermal_visible_blend"])
        self.assertEqual(self.completed("spectra", "check-config", "sp"), ["spectra"])


class Scripts(unittest.TestCase):
    def test_are_shell_and_executable(self):
        for name in ("postinst", "prerm", "postrm", "hand-over"):
            run("sh", "-n", PACKAGE / name)
            self.assertTrue(os.access(PACKAGE / name, os.X_OK), name)

    def test_hand_over_gives_copies_and_takes_them_back(self):
        with tempfile.TemporaryDirectory() as folder:
            at = pathlib.Path(folder)
            private, given, state = at / "etc/spectra/private", at / "run/spectra", at / "var/lib/spectra"
            for folder in (private, state, at / "run"):
                folder.mkdir(parents=True)
            (private / "tokens").write_text("one")
            hand_over = lambda: run(PACKAGE / "hand-over", at)
            hand_over()
            self.assertEqual(oct((given / "tokens").stat().st_mode), "0o100400")
            self.assertEqual((given / "tokens").stat().st_uid, state.stat().st_uid)
            (private / "tokens").write_text("two")
            hand_over()
            self.assertEqual((given / "tokens").read_text(), "two")
            (private / "tokens").unlink()
            hand_over()
            self.assertEqual(list(given.iterdir()), [])


class Notices(unittest.TestCase):
    BUILD = pathlib.Path(PROGRAM).resolve().parent.parent

    @unittest.skipUnless(shutil.which("dpkg") and shutil.which("ninja"), "dpkg or ninja is not installed")
    def test_name_what_is_compiled_in_and_linked(self):
        said = run("python3", PACKAGE / "notices.py", self.BUILD, SOURCE / "web/dist", "--list").split("\n")
        for part in ("compiled libboost1.81-dev", "compiled nlohmann-json3-dev", "linked libdraco7", "linked libssl3"):
            self.assertIn(part, said)
        needed = re.findall(r"=> (/\S+)", run("ldd", PROGRAM))
        self.assertGreaterEqual(sum(line.startswith("linked") for line in said), len(needed) // 2)

    @unittest.skipUnless((SOURCE / "web/dist/licences.txt").exists(), "the client is not built")
    def test_of_the_client_name_its_packages_and_palettes(self):
        text = (SOURCE / "web/dist/licences.txt").read_text()
        packages = json.loads((SOURCE / "web/package.json").read_text())["dependencies"]
        for name, version in [*packages.items(), ("svelte", "")]:
            self.assertIn(f"In the client: {name} {version}", text)
        for table in (SOURCE / "fusion/colour/data").glob("*.cpp"):
            self.assertRegex(text, rf"(?m)^  {table.stem}: ")


if __name__ == "__main__":
    unittest.main()
