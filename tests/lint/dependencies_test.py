"""What deploy/dependencies.sh does on machines of several kinds, with a made-up apt-get, dpkg-query, id and sudo on its path."""

import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

SCRIPT = pathlib.Path(__file__).resolve().parents[2] / "deploy" / "dependencies.sh"

# Plays a machine described by files in $MACHINE: `installed` (package names), `conflicts/PACKAGE` (what apt prints in place of
# installing it; for several packages together A&B), `failing/COMMAND` (that command of apt-get fails with this text),
# `debs/PACKAGE.deb`. Writes down every call in `log`.
FAKE_APT_GET = "#!" + sys.executable + r""" -IS
import os, pathlib, shutil, sys
machine = pathlib.Path(os.environ["MACHINE"])
arguments = sys.argv[1:]
command = next(a for a in arguments if a in ("update", "install", "download"))
is_simulated = "-s" in arguments
tail = arguments[arguments.index(command) + 1:]
packages, skip = [], False
for argument in tail:
    if skip: skip = False
    elif argument == "-o": skip = True
    elif not argument.startswith("-"): packages.append(argument)
with open(machine / "log", "a") as log:
    print("simulate" if is_simulated else command, *sorted(packages), *(["--no-remove"] if "--no-remove" in arguments else []), file=log)
failing = machine / "failing" / command
if failing.exists() and not is_simulated:
    sys.exit(failing.read_text())
if command == "install":
    together = [c.name for c in (machine / "conflicts").iterdir() if "&" in c.name and set(c.name.split("&")) <= set(packages)]
    for package in packages + together:
        conflict = machine / "conflicts" / package
        text = conflict.read_text() if conflict.exists() else f"Inst {package} (1.0 Debian:12 [amd64])\n"
        if text.startswith("E:"): sys.exit(text)
        if is_simulated: print(text, end="")
        else: open(machine / "installed", "a").write(package + "\n")
elif command == "download":
    for package in packages: shutil.copy(machine / "debs" / f"{package}.deb", ".")
"""
FAKE_DPKG_QUERY = r"""#!/bin/sh
shift 3
for package; do grep -qx "$package" "$MACHINE/installed" && printf 'installed:%s ' "$package"; done
true
"""
PCL_HOLDS_BOOST = "".join(f"Remv libboost{name}1.74-dev [1.74.0+ds1-21]\n" for name in ["", "-system", "-thread", "-regex",
                                                                                     "-filesystem", "-date-time", "-random"])
PCL_HOLDS_BOOST += "Inst libboost1.81-dev (1.81.0-5 Debian:12 [amd64])\n"


class Dependencies(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="spectra-dependencies-"))
        self.addCleanup(shutil.rmtree, self.folder)
        self.machine = self.folder / "machine"
        for name in ("conflicts", "failing", "debs"):
            (self.machine / name).mkdir(parents=True)
        self.script = self.folder / "clone" / "deploy" / "dependencies.sh"
        self.script.parent.mkdir(parents=True)
        shutil.copy(SCRIPT, self.script)
        self.beside = self.folder / "clone" / "build" / "packages"
        self.path = self.folder / "path"
        self.path.mkdir()
        self.fake("apt-get", FAKE_APT_GET)
        self.fake("dpkg-query", FAKE_DPKG_QUERY)
        self.fake("node", "#!/bin/sh\necho true\n")
        self.fake("npm", "#!/bin/sh\n")
        self.fake("id", "#!/bin/sh\necho 0\n")
        listed = lambda name: SCRIPT.read_text().split(f"\n{name}_packages=(")[1].split(")")[0].split()
        self.module = listed("module")
        everything = listed("build") + self.module
        self.assertIn("libboost1.81-dev", everything)
        self.assertIn("wasi-libc", everything)
        self.set_installed(everything)

    def fake(self, name, text):
        (self.path / name).write_text(text)
        (self.path / name).chmod(0o755)

    def set_installed(self, packages):
        self.before = list(packages)
        (self.machine / "installed").write_text("".join(f"{p}\n" for p in packages))

    def lack(self, *packages):
        self.set_installed([p for p in self.before if p not in packages])

    def conflict(self, package, text):
        (self.machine / "conflicts" / package).write_text(text)

    def give_deb(self, package, files):
        tree = self.folder / "deb" / package
        (tree / "DEBIAN").mkdir(parents=True)
        (tree / "DEBIAN" / "control").write_text(
            f"Package: {package}\nVersion: 1.0\nArchitecture: all\nMaintainer: a test <test@localhost>\nDescription: a test\n"
        )
        for name, target in files.items():
            path = tree / name
            path.parent.mkdir(parents=True, exist_ok=True)
            if target is None:
                path.write_text("// a header\n")
            else:
                path.symlink_to(target)
        subprocess.run(["dpkg-deb", "--build", tree, self.machine / "debs" / f"{package}.deb"], check=True,
                       stdout=subprocess.DEVNULL)

    def run_script(self, what="run"):
        (self.machine / "log").write_text("")
        environment = dict(os.environ, PATH=f"{self.path}:{os.environ['PATH']}", MACHINE=str(self.machine))
        result = subprocess.run([self.script, what], env=environment, stdin=subprocess.DEVNULL, capture_output=True, text=True)
        self.told = result.stderr
        self.calls = (self.machine / "log").read_text().splitlines()
        self.changes = [c for c in self.calls if c.split()[0] == "install"]
        return result.returncode

    def installed(self):
        return (self.machine / "installed").read_text().split()

    def test_asks_apt_nothing_when_nothing_is_missing(self):
        self.assertEqual(self.run_script(), 0)
        self.assertEqual((self.calls, self.told), ([], ""))

    def test_installs_what_only_adds(self):
        self.lack("libfmt-dev", "ccache")
        self.assertEqual(self.run_script(), 0, self.told)
        self.assertEqual(self.calls, ["update", "simulate ccache libfmt-dev", "install ccache libfmt-dev --no-remove"])
        self.assertFalse(self.beside.exists())
        self.assertEqual(self.run_script(), 0)
        self.assertEqual(self.calls, [])

    def test_upgrades_may_come_along(self):
        self.lack("libfmt-dev")
        self.conflict("libfmt-dev", "Inst libfmt9 [9.1.0-1] (9.1.0-2 Debian:12 [amd64])\nInst libfmt-dev (9.1.0-2 Debian:12 [amd64])\n")
        self.assertEqual(self.run_script(), 0, self.told)
        self.assertEqual(self.changes, ["install libfmt-dev --no-remove"])

    def test_unpacks_beside_what_would_remove_a_package(self):
        self.lack("libboost1.81-dev", "libfmt-dev")
        self.conflict("libboost1.81-dev", PCL_HOLDS_BOOST)
        self.give_deb("libboost1.81-dev", {"usr/include/boost/version.hpp": None})
        self.assertEqual(self.run_script(), 0, self.told)
        self.assertEqual(self.changes, ["install libfmt-dev --no-remove"])
        self.assertTrue((self.beside / "usr/include/boost/version.hpp").exists())
        self.assertEqual([p.name for p in self.beside.parent.iterdir()], ["packages"], "no half-made folder")
        self.assertIn("remove libboost1.74-dev", self.told)
        self.assertIn("and 1 more", self.told)
        self.assertIn(str(self.beside), self.told)
        # Quick the second time; and another package joins what is there.
        self.assertEqual(self.run_script(), 0)
        self.assertEqual(self.calls, [])
        self.lack("libcli11-dev")
        self.conflict("libcli11-dev", "Remv cli11 [3]\n")
        self.give_deb("libcli11-dev", {"usr/include/CLI/CLI.hpp": None})
        self.assertEqual(self.run_script(), 0, self.told)
        self.assertTrue((self.beside / "usr/include/boost/version.hpp").exists())
        self.assertTrue((self.beside / "usr/include/CLI/CLI.hpp").exists())

    def test_unpacks_beside_what_would_downgrade_a_package(self):
        self.lack("nlohmann-json3-dev")
        self.conflict("nlohmann-json3-dev", "Inst libc6-dev [2.40-1] (2.36-9 Debian:12 [amd64])\nInst nlohmann-json3-dev (3.11 Debian:12 [all])\n")
        self.give_deb("nlohmann-json3-dev", {"usr/include/nlohmann/json.hpp": None})
        self.assertEqual(self.run_script(), 0, self.told)
        self.assertEqual(self.changes, [])
        self.assertIn("downgrade libc6-dev from 2.40-1 to 2.36-9", self.told)

    def test_unpacks_beside_what_apt_refuses(self):
        self.lack("libcli11-dev")
        self.conflict("libcli11-dev", "E: Unable to correct problems, you have held broken packages.\n")
        self.give_deb("libcli11-dev", {"usr/include/CLI/CLI.hpp": None})
        self.assertEqual(self.run_script(), 0, self.told)
        self.assertIn("you have held broken packages", self.told)

    def assert_stopped_unchanged(self, *told):
        self.assertEqual(self.changes, [])
        self.assertEqual(self.installed(), self.before)
        self.assertFalse(self.beside.exists() and any(self.beside.iterdir()))
        for text in (*told, "nothing was changed"):
            self.assertIn(text, self.told)

    def test_stops_before_a_change_when_a_library_of_another_package_is_needed(self):
        self.lack("libfmt-dev", "libspdlog-dev")
        self.conflict("libspdlog-dev", "Remv robot-software [1]\n")
        self.give_deb("libspdlog-dev", {"usr/include/spdlog/spdlog.h": None, "usr/lib/libspdlog.so": "libspdlog.so.1.10"})
        self.assertEqual(self.run_script(), 1)
        self.assert_stopped_unchanged("libspdlog-dev", "remove robot-software", "libspdlog.so needs a library of another package")

    def test_stops_before_a_change_when_nothing_can_be_downloaded(self):
        self.lack("libboost1.81-dev", "libfmt-dev")
        self.conflict("libboost1.81-dev", PCL_HOLDS_BOOST)
        (self.machine / "failing" / "download").write_text("E: Failed to fetch: no network\n")
        (self.machine / "failing" / "update").write_text("E: no network\n")
        self.assertEqual(self.run_script(), 1)
        self.assert_stopped_unchanged("could not be brought up to date", "Failed to fetch: no network")

    def test_stops_when_apt_does_not_know_a_package(self):
        self.lack("libhwy-dev")
        self.conflict("libhwy-dev", "E: Unable to locate package libhwy-dev\n")
        (self.machine / "failing" / "download").write_text("E: Unable to locate package libhwy-dev\n")
        self.assertEqual(self.run_script(), 1)
        self.assert_stopped_unchanged("Unable to locate package libhwy-dev")

    def test_stops_when_packages_do_not_go_together(self):
        self.lack("libhwy-dev", "libfmt-dev")
        self.conflict("libfmt-dev&libhwy-dev", "Remv robot-software [1]\n")
        self.assertEqual(self.run_script(), 1)
        self.assert_stopped_unchanged("remove robot-software")

    def test_stops_with_the_command_for_an_administrator_when_sudo_wants_a_password(self):
        self.lack("libfmt-dev")
        self.fake("id", "#!/bin/sh\necho 1000\n")
        self.fake("sudo", '#!/bin/sh\n[ "$1" = -n ] && { echo "sudo: a password is required" >&2; exit 1; }\nexec "$@"\n')
        self.assertEqual(self.run_script(), 1)
        self.assert_stopped_unchanged("apt-get install --no-remove libfmt-dev")
        self.fake("sudo", '#!/bin/sh\nshift\nexec "$@"\n')
        self.assertEqual(self.run_script(), 0, self.told)
        self.assertEqual(self.changes, ["install libfmt-dev --no-remove"])

    def test_the_compiler_of_the_module_comes_along(self):
        self.lack("libfmt-dev", *self.module)
        self.assertEqual(self.run_script(), 0, self.told)
        self.assertEqual(self.changes, [f"install {' '.join(sorted(['libfmt-dev', *self.module]))} --no-remove"])

    def test_goes_on_without_the_module_where_its_compiler_would_do_harm_and_asks_once(self):
        self.lack("libfmt-dev", "lld-14", "wasi-libc")
        self.conflict("lld-14", "Remv lld-16 [16.0.6]\n")
        self.assertEqual(self.run_script(), 0, self.told)
        self.assertEqual(self.changes, ["install libfmt-dev --no-remove"])
        for text in ("lld-14 wasi-libc cannot be installed here", "remove lld-16", "leaves fusing to the robot"):
            self.assertIn(text, self.told)
        self.assertEqual(self.run_script(), 0, self.told)
        self.assertEqual((self.calls, self.told), ([], ""))

    def test_goes_on_without_the_module_where_apt_does_not_know_it(self):
        self.lack("wasi-libc")
        self.conflict("wasi-libc", "E: Unable to locate package wasi-libc\n")
        self.assertEqual(self.run_script(), 0, self.told)
        self.assertEqual(self.changes, [])
        self.assertIn("Unable to locate package wasi-libc", self.told)

    def test_goes_on_without_the_module_where_nobody_is_root(self):
        self.lack("wasi-libc")
        self.fake("id", "#!/bin/sh\necho 1000\n")
        self.fake("sudo", "#!/bin/sh\nexit 1\n")
        self.assertEqual(self.run_script(), 0, self.told)
        self.assertEqual(self.calls, [])
        self.assertIn("apt-get install --no-remove wasi-libc", self.told)

    def test_keeps_a_node_that_is_new_enough_and_adds_one_where_there_is_none(self):
        self.fake("node", '#!/bin/sh\ngrep -qx nodejs "$MACHINE/installed" && echo true || echo false\n')
        self.assertEqual(self.run_script(), 0, self.told)
        self.assertEqual(self.changes, ["install nodejs npm --no-remove"])

    def test_does_not_replace_a_node_whose_owner_would_lose_it(self):
        self.fake("node", "#!/bin/sh\necho false\n")
        self.conflict("npm", "Remv nodejs [16.20.2-1nodesource1]\nInst npm (9.2 Debian:12 [all])\n")
        self.assertEqual(self.run_script(), 1)
        self.assert_stopped_unchanged("remove nodejs")
        self.assertIn("older than 18", self.told)

    def test_says_that_an_old_node_comes_before_the_one_it_has_installed(self):
        self.fake("node", "#!/bin/sh\necho false\n")
        self.assertEqual(self.run_script(), 1)
        self.assertEqual(self.changes, ["install nodejs npm --no-remove"])
        self.assertIn("comes before what is installed", self.told)


if __name__ == "__main__":
    sys.exit(unittest.main())
