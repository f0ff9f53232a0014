"""Writes what is derived from protocol/schema: the C++ messages, the client's types and readers, the tables of docs/protocol.md.

usage: python3 protocol/generate [--check] [ROOT]

--check changes nothing and fails where a file is not what would be written. ROOT: of the project; else of this program.
"""

import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import cpp  # noqa: E402
import markdown  # noqa: E402
import typescript  # noqa: E402
from schema import Protocol, SchemaError, name_of_reference  # noqa: E402
from tile_frame import TileFrame  # noqa: E402

# Said over HTTP or within another message, so that methods.json does not name them.
READ_BESIDE = ["Catalogue", "RpcError"]
# Envelopes are read before it is known what they hold: protocol/jsonrpc.
WRITTEN_BY_HAND = ["rpc"]


def read_by_the_client(protocol):
    messages = [entry["result"] for entry in protocol.methods["requests"].values()]
    messages += [entry["params"] for entry in protocol.methods["server_notifications"].values()]
    names = dict.fromkeys(map(name_of_reference, messages))
    return [name for name in [*names, *READ_BESIDE] if name != "Empty" and protocol.definitions[name].family != "ingest"]


def formatted(source, file):
    return subprocess.run(["clang-format-14", f"--assume-filename={file}"], input=source, capture_output=True, text=True,
                          check=True).stdout


def outputs(root):
    """What each derived file must hold."""
    schemas, client = root / "protocol" / "schema", root / "web" / "src" / "protocol"
    protocol, frame = Protocol(schemas), TileFrame(schemas / "tile_frame.json")
    results = {}
    writer = cpp.Writer(protocol)
    definitions = protocol.closure(protocol.definitions)
    for family in protocol.families:
        if family in WRITTEN_BY_HAND:
            continue
        for ending, source in (("hpp", writer.header(family, definitions)), ("cpp", writer.source(family, definitions))):
            results[root / "protocol" / "messages" / f"{family}_messages.{ending}"] = source
    results[root / "protocol" / "tile_frame_header.hpp"] = frame.cpp_header()
    results[root / "protocol" / "tile_frame_header.cpp"] = frame.cpp_source()
    results = {file: formatted(source, file) for file, source in results.items()}
    results[client / "generated.ts"] = typescript.Writer(protocol).source(read_by_the_client(protocol))
    results[client / "generated_frame.ts"] = frame.typescript()
    document = root / "docs" / "protocol.md"
    results[document] = frame.document(markdown.Writer(protocol).document(document.read_text(encoding="utf-8")))
    return results


def main():
    arguments = sys.argv[1:]
    is_check = "--check" in arguments
    folders = [argument for argument in arguments if argument != "--check"]
    if len(folders) > 1 or any(folder.startswith("-") for folder in folders):
        sys.exit(__doc__)
    root = Path(folders[0] if folders else Path(__file__).parents[2]).resolve()
    stale = []
    try:
        for file, content in outputs(root).items():
            if file.exists() and file.read_text(encoding="utf-8") == content:
                continue
            stale.append(str(file.relative_to(root)))
            if not is_check:
                file.write_text(content, encoding="utf-8")
    except SchemaError as error:
        sys.exit(f"protocol/schema: {error}")
    if is_check and stale:
        sys.exit("not what protocol/schema says: " + ", ".join(stale) + "; run: python3 protocol/generate")


main()
