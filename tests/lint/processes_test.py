#!/usr/bin/env python3
"""Scripts and tests end processes that they started, by their ids: a name pattern may be somebody else's server. Call: processes_test.py ROOT"""
import pathlib
import re
import sys

BY_NAME = re.compile(r"\b(pkill|killall5?|pidof|fuser\s+-\w*k)\b|\bkill\b[^\n]*\bpgrep\b|\bkill\b[^\n]*\bps\s+a")
ENDINGS = {".sh", ".py", ".mjs", ".in", ""}
HERE = pathlib.Path(__file__).resolve()


def found(text):
    return [number for number, line in enumerate(text.splitlines(), 1) if BY_NAME.search(line)]


# What it has to see, and what it has to leave alone.
assert found("pkill -f spectra") and found("kill $(pgrep spectra)") and found("killall spectra") and found("fuser -k 8080/tcp")
assert not found('kill -TERM "$server"\nserver.kill("SIGTERM")\nkill -9 "$(shows MainPID)"')

root = pathlib.Path(sys.argv[1])
wrong = []
for folder in ("deploy", "tests", "web/e2e", "web/scripts", "cmake"):
    for path in sorted((root / folder).rglob("*")):
        if path.suffix not in ENDINGS or "node_modules" in path.parts or not path.is_file() or path.resolve() == HERE:
            continue
        try:
            text = path.read_text(encoding="utf-8")
        except UnicodeDecodeError:
            continue
        wrong += [f"{path.relative_to(root)}:{number}: ends processes by their name" for number in found(text)]
print("\n".join(wrong) or "processes are ended by their ids")
sys.exit(1 if wrong else 0)
