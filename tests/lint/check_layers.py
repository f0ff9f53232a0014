#!/usr/bin/env python3
"""Checks that every #include of fusion/, protocol/ and server/, and every import of web/src, is one its folder may use (layers.json)."""
import json
import pathlib
import posixpath
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
                violations.append(f"{relative}:{number}: this folder has no row in layers.json")
                break
            allowed = name.startswith(tuple(rules["folders"][folder]))
            forbidden = name.startswith(tuple(rules["forbidden"].get(folder, [])) or ("\0",))
            if not allowed or forbidden:
                violations.append(f"{relative}:{number}: {folder} may not include {name}")

# import and export ... from, import for its effect, import(), and the address of a worker.
web_import = re.compile(
    r"""(?:\bfrom\s*|\bimport\s*\(?\s*|\bnew\s+URL\(\s*)(?P<quote>['"])(?P<name>[^'"\n]+)(?P=quote)(?P<address>\s*,\s*import\.meta\.url)?"""
)
comment = re.compile(r"/\*.*?\*/|(?<![:'\"])//[^\n]*", re.DOTALL)
for path in sorted((root / "web/src").rglob("*")):
    if path.suffix not in (".ts", ".svelte") or path.name.endswith((".test.ts", ".d.ts")):
        continue
    relative = path.relative_to(root).as_posix()
    folder = posixpath.dirname(relative)
    checked += 1
    if folder not in rules["web"]:
        violations.append(f"{relative}: this folder has no row in layers.json")
        continue
    text = comment.sub(lambda match: re.sub(r"[^\n]", " ", match.group()), path.read_text())
    for match in web_import.finditer(text):
        if match.group().startswith("new") and not match["address"]:
            continue
        name = match["name"]
        if name.startswith("."):
            name = posixpath.relpath(posixpath.normpath(posixpath.join(folder, name)), "web/src")
        if not name.startswith(tuple(rules["web"][folder])):
            line = text.count("\n", 0, match.start()) + 1
            violations.append(f"{relative}:{line}: {folder} may not import {name}")

print("\n".join(violations) or f"{checked} files keep to their layers")
sys.exit(1 if violations or checked == 0 else 0)
