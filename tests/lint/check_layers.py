#!/usr/bin/env python3
"""Checks that every #include of fusion/, protocol/ and server/ is one its folder may use (layers.json)."""
import json
import pathlib
import re
import sys

root = pathlib.Path(sys.argv[1]).resolve()
rules = json.loads((pathlib.Path(__file__).parent / "layers.json").read_text())
folders = sorted(rules["folders"], key=len, reverse=True)
include = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]')


def folder_of(path):
    """The most specific folder with a rule that holds `path`, or None."""
    return next((f for f in folders if path == f or path.startswith(f + "/")), None)


def is_standard(name):
    return "/" not in name and "." not in name


violations = []
checked = 0
for top in ("fusion", "protocol", "server"):
    for path in sorted((root / top).rglob("*")):
        if path.suffix not in (".hpp", ".cpp", ".inc"):
            continue
        relative = path.relative_to(root).as_posix()
        folder = folder_of(relative)
        checked += 1
        for number, line in enumerate(path.read_text().splitlines(), 1):
            match = include.match(line)
            if not match:
                continue
            bracket, name = match.groups()
            if bracket == "<" and (is_standard(name) or name.startswith(tuple(rules["system"]))):
                continue
            if folder is None:
                if relative != "server/main.cpp":
                    violations.append(f"{relative}:{number}: this folder has no row in layers.json")
                    break
                folder = "server/app"
            allowed = name.startswith(tuple(rules["folders"][folder]))
            forbidden = name.startswith(tuple(rules["forbidden"].get(folder, [])) or ("\0",))
            if not allowed or forbidden:
                violations.append(f"{relative}:{number}: {folder} may not include {name}")

print("\n".join(violations) or f"{checked} files keep to their layers")
sys.exit(1 if violations or checked == 0 else 0)
