#!/usr/bin/env python3
"""Notices of third parties, from what the built program and client really hold.

notices.py BUILD WEB_DIST [--list]
    BUILD     a Ninja build of the program: which headers and static libraries are compiled in stands in its records
    WEB_DIST  the built client, whose own notices (licences.txt) follow
    --list    package names alone: "compiled NAME" and "linked NAME"
Written to standard output. Ends with 1 when a work has no terms that can be found.
"""
import os
import pathlib
import re
import subprocess
import sys

PARTS_OF_THE_PLATFORM = re.compile(r"^(libc6|linux-libc-dev|libcrypt-dev|libc-dev-bin)")
SOURCE = pathlib.Path(__file__).resolve().parents[2]


def output(*command, **options):
    return subprocess.run(command, capture_output=True, text=True, check=True, **options).stdout


def packages_of(files):
    """The Debian package that each file belongs to, {package: file}; files of none are left out."""
    found = {}
    files = sorted(files)
    # Packages know the names from before /lib was joined with /usr/lib.
    asked = files + [name.removeprefix("/usr") for name in files if name.startswith("/usr/lib")]
    for begin in range(0, len(asked), 500):
        text = subprocess.run(["dpkg", "-S", *asked[begin : begin + 500]], capture_output=True, text=True).stdout
        for line in text.splitlines():
            owners, _, name = line.rpartition(": ")
            if not owners.startswith("diversion"):
                for owner in owners.split(", "):
                    found.setdefault(owner.partition(":")[0], name)
    return found


def compiled_in(build):
    """Packages whose headers or static libraries are part of the program."""
    objects = [name for name in output("ninja", "-t", "inputs", "spectra", cwd=build).splitlines()]
    ours = {name for name in objects if name.endswith(".o")}
    files = {name for name in objects if name.startswith("/") and name.endswith(".a")}
    current = None
    for line in output("ninja", "-t", "deps", cwd=build).splitlines():
        if line and not line.startswith(" "):
            current = line.partition(": ")[0]
        elif current in ours and line.strip().startswith("/"):
            files.add(os.path.realpath(line.strip()))
    beside = SOURCE / "build/packages"
    files = {name.replace(str(beside), "", 1) if name.startswith(str(beside)) else name for name in files}
    return packages_of(files)


def linked(program):
    libraries = re.findall(r"=> (/\S+)", output("ldd", str(program)))
    return packages_of({os.path.realpath(name) for name in libraries})


def terms(package):
    for root in (pathlib.Path("/"), SOURCE / "build/packages"):
        file = root / f"usr/share/doc/{package}/copyright"
        if file.exists():
            return file.read_text(errors="replace").strip()
    sys.exit(f"notices: /usr/share/doc/{package}/copyright is not here")


def fields_of(paragraph):
    """Of a machine-readable copyright file, {name: value}."""
    fields, name = {}, None
    for line in paragraph.splitlines():
        start = re.match(r"([A-Z][A-Za-z-]*):(.*)", line)
        if start:
            name = start[1]
            fields[name] = start[2].strip()
        elif name:
            fields[name] += "\n" + line
    return fields


def shortened(text):
    """Machine-readable terms without the lists of files: Boost's name every file of its source. Who holds rights, by terms; then the terms."""
    if not text.startswith("Format:"):
        return text
    holders, bodies = {}, {}
    for paragraph in re.split(r"\n\s*\n", text):
        fields = fields_of(paragraph)
        if "License" not in fields or fields.get("Files", "").strip() == "debian/*":
            continue
        name, _, body = fields["License"].partition("\n")
        if body.strip():
            bodies.setdefault((name, " ".join(body.split())), body)
        lines = [line.strip() for line in fields.get("Copyright", "").splitlines()]
        holders.setdefault(name, {}).update((line, None) for line in lines if line)
    out = [f"{name}: " + "; ".join(sorted(lines)) for name, lines in holders.items() if lines]
    out += [f"{name}:\n{body}" for (name, _), body in bodies.items()]
    return "\n\n".join(out)


def version(package):
    text = subprocess.run(["dpkg-query", "-W", "-f", "${Version}", package], capture_output=True, text=True).stdout
    return text or "unpacked"


def main():
    build, dist = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
    compiled = {name for name in compiled_in(build) if not PARTS_OF_THE_PLATFORM.match(name)}
    shared = set(linked(build / "bin/spectra"))
    if not compiled or not shared:
        sys.exit("notices: nothing is compiled in or linked, which cannot be")
    if "--list" in sys.argv:
        print("\n".join([f"compiled {name}" for name in sorted(compiled)] + [f"linked {name}" for name in sorted(shared)]))
        return
    rule = "=" * 100
    print("Spectra holds and uses works of others. These are their notices, made from what this build holds.\n")
    print(rule + "\nLibraries of Debian that the program is linked with; they come as packages of their own, with their terms in")
    print("/usr/share/doc/PACKAGE/copyright:\n")
    for name in sorted(shared):
        print(f"  {name} {version(name)}")
    told = {}
    for name in sorted(compiled):
        text = terms(name)
        same = told.setdefault(text, name)
        print(f"\n{rule}\nCompiled into the program: {name} {version(name)}\n")
        print(shortened(text) if same == name else f"The same terms as of {same} above.")
    own = dist / "licences.txt"
    if not own.exists():
        sys.exit(f"notices: {own} is not here; build the client first (deploy/build_web.sh)")
    print(f"\n{rule}\n{own.read_text().strip()}")


main()
