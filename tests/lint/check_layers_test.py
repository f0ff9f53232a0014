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


assert outcome({"fusion/a.cpp": '#include <vector>\n#include "fusion/base/a.hpp"\n'}) == 0
assert outcome({"fusion/a.cpp": '#include "protocol/tile_frame.hpp"\n'}) == 1
assert outcome({"fusion/a.cpp": "#include <nlohmann/json.hpp>\n"}) == 1
assert outcome({"fusion/mesh/a.cpp": "#include <boost/asio.hpp>\n"}) == 1
assert outcome({"fusion/mesh/a.cpp": '#include "fusion/files/a.hpp"\n'}) == 1
assert outcome({"fusion/a.cpp": '#include "fusion/mesh/a.hpp"\n'}) == 1
assert outcome({"protocol/a.cpp": '#include "fusion/a.hpp"\n'}) == 1
assert outcome({"protocol/codec/a.cpp": '#include "fusion/base/a.hpp"\n'}) == 0
assert outcome({"protocol/codec/a.cpp": '#include "fusion/mesh/a.hpp"\n'}) == 1
assert outcome({"server/a.cpp": "#include <vector>\n#include <draco/mesh/mesh.h>\n"}) == 1
assert outcome({"server/stream/a.cpp": "#include <boost/beast.hpp>\n"}) == 1
assert outcome({"server/net/a.cpp": "#include <boost/beast.hpp>\n"}) == 0
assert outcome({"web/src/draw/a.ts": "import { Mesh } from 'three';\nimport type { Vec3 } from '../protocol/messages';\n"}) == 0
assert outcome({"web/src/draw/a.ts": "import type { Store } from '../state/store.svelte';\n"}) == 1
assert outcome({"web/src/draw/a.ts": "import {\n  Store,\n} from '../state/store.svelte';\n"}) == 1
assert outcome({"web/src/draw/a.ts": "// import { Store } from '../state/store.svelte';\n/* from '../ui/App.svelte' */\n"}) == 0
assert outcome({"web/src/tiles/a.ts": "export { DoubleSide } from 'three';\n"}) == 1
assert outcome({"web/src/state/a.ts": "const panel = () => import('../ui/Panel.svelte');\n"}) == 1
assert outcome({"web/src/transport/a.ts": "new Worker(new URL('../decode/worker.ts', import.meta.url));\n"}) == 1
assert outcome({"web/src/transport/a.ts": "new URL('/api', location.href);\n"}) == 0
assert outcome({"web/src/ui/A.svelte": "<script lang=\"ts\">\n  import '../decode/pool';\n</script>\n"}) == 1
assert outcome({"web/src/draw/a.test.ts": "import { Store } from '../state/store.svelte';\n", "fusion/a.cpp": ""}) == 0
assert outcome({"web/src/scene/a.ts": "export const a = 1;\n"}) == 1
assert outcome({}) == 1
print("24 of 24 trees judged rightly")
