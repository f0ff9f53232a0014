#!/usr/bin/env python3
"""The layer check must fail on a forbidden include: shown on a tree made for it."""
import pathlib
import subprocess
import sys
import tempfile

check = pathlib.Path(__file__).parent / "check_layers.py"


def outcome(files):
    with tempfile.TemporaryDirectory() as folder:
        for name, text in files.items():
            path = pathlib.Path(folder) / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        return subprocess.run([sys.executable, check, folder], capture_output=True, text=True).returncode


assert outcome({"fusion/a.cpp": '#include <vector>\n#include "fusion/a.hpp"\n'}) == 0
assert outcome({"fusion/a.cpp": '#include "protocol/tile_frame.hpp"\n'}) == 1
assert outcome({"fusion/a.cpp": "#include <nlohmann/json.hpp>\n"}) == 1
assert outcome({"fusion/mesh/a.cpp": "#include <boost/asio.hpp>\n"}) == 1
assert outcome({"protocol/a.cpp": '#include "fusion/a.hpp"\n'}) == 1
assert outcome({"server/stream/a.cpp": "#include <boost/beast.hpp>\n"}) == 1
assert outcome({"server/net/a.cpp": "#include <boost/beast.hpp>\n"}) == 0
assert outcome({}) == 1
print("8 of 8 trees judged rightly")
