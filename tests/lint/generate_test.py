"""What is derived from protocol/schema is up to date; and a field that is changed, wrong or missing is noticed."""

import json
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

ROOT = Path(sys.argv.pop(1)).resolve()
GENERATOR = ROOT / "protocol" / "generate"


def run(*arguments):
    return subprocess.run([sys.executable, str(GENERATOR), *map(str, arguments)], capture_output=True, text=True)


class Generated(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.root = Path(self.folder.name)
        for part in ("protocol", "web/src/protocol"):
            shutil.copytree(ROOT / part, self.root / part)
        (self.root / "docs").mkdir()
        shutil.copy(ROOT / "docs" / "protocol.md", self.root / "docs" / "protocol.md")
        shutil.copy(ROOT / ".clang-format", self.root / ".clang-format")

    def change(self, name, edit):
        file = self.root / "protocol" / "schema" / name
        content = json.loads(file.read_text())
        edit(content)
        file.write_text(json.dumps(content))

    def test_the_project_is_up_to_date(self):
        done = run("--check", ROOT)
        self.assertEqual(done.returncode, 0, done.stderr)

    def test_a_new_field_reaches_both_languages_and_the_document(self):
        def edit(schema):
            schema["$defs"]["StreamComplete"]["properties"]["pace"] = {"type": "number", "exclusiveMinimum": 0, "description": "Of frames."}
        self.change("stream.schema.json", edit)
        stale = run("--check", self.root)
        self.assertNotEqual(stale.returncode, 0)
        for file in ("stream_messages.hpp", "stream_messages.cpp", "generated.ts", "docs/protocol.md"):
            self.assertIn(file, stale.stderr)
        self.assertEqual(run(self.root).returncode, 0)
        self.assertEqual(run("--check", self.root).returncode, 0)
        self.assertIn("std::optional<double> pace;", (self.root / "protocol/messages/stream_messages.hpp").read_text())
        self.assertIn('"a number above 0"', (self.root / "protocol/messages/stream_messages.cpp").read_text().split('"pace"')[2])
        self.assertIn("pace: optional(number),", (self.root / "web/src/protocol/generated.ts").read_text())
        self.assertIn("| `pace` | number above 0 (optional) | Of frames. |", (self.root / "docs/protocol.md").read_text())

    def test_a_field_of_the_tile_header_moves_what_stands_behind_it(self):
        def edit(schema):
            schema["fields"].append({"name": "age_s", "type": "f32", "added": True, "description": "Of the tile."})
        self.change("tile_frame.json", edit)
        self.assertEqual(run(self.root).returncode, 0)
        self.assertIn("kTileFrameHeaderSize = 84;", (self.root / "protocol/tile_frame_header.hpp").read_text())
        client = (self.root / "web/src/protocol/generated_frame.ts").read_text()
        self.assertIn("age_s: size >= 84 ? f32(80) : Number.NaN,", client)
        self.assertIn("colour_error_levels: size >= 76 ? f32(72) : Number.NaN,", client)

    def test_an_added_field_before_an_old_one_is_refused(self):
        self.change("tile_frame.json", lambda schema: schema["fields"].insert(2, {"name": "late", "type": "f32", "added": True, "description": ""}))
        self.assertIn("what was added must stand last", run(self.root).stderr)

    def test_a_message_that_the_document_does_not_show_is_refused(self):
        self.change("stream.schema.json", lambda schema: schema["$defs"].update(
            Hidden={"type": "object", "properties": {"a": {"type": "string"}}, "required": ["a"]}))
        self.assertIn("lacks ['Hidden']", run(self.root).stderr)

    def test_a_type_that_cannot_be_written_is_refused(self):
        self.change("stream.schema.json", lambda schema: schema["$defs"]["StreamAck"]["properties"].update(odd={"type": "object"}))
        self.assertIn("no C++ type", run(self.root).stderr)


unittest.main()
