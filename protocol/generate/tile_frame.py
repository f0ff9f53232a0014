"""The header of tile frames, from protocol/schema/tile_frame.json: C++, TypeScript and the table of docs/protocol.md."""

import json
import re

import cpp
import typescript
from schema import SchemaError

SIZES = {"u8": 1, "u16": 2, "u32": 4, "f32": 4, "f32[3]": 12, "tile": 16}
CPP_TYPES = {"u8": "std::uint8_t", "u32": "std::uint32_t", "f32": "float", "f32[3]": "std::array<float, 3>", "tile": "TileId"}
TS_TYPES = {"f32[3]": "[number, number, number]", "tile": "TileId"}
# What the header is written and read by; no fields of the structs.
FRAMING = ("magic", "header_size_bytes")


class TileFrame:
    def __init__(self, file):
        content = json.loads(file.read_text(encoding="utf-8"))
        self.magic, self.kinds, self.fields = content["magic"], content["kinds"], content["fields"]
        offset = 0
        for field in self.fields:
            if field["type"] not in SIZES:
                raise SchemaError(f"{file.name}: no type {field['type']}")
            field["offset"] = offset
            offset += SIZES[field["type"]]
            field["end"] = offset
            if field.get("added") and field["type"] != "f32":
                raise SchemaError(f"{file.name}: what was added is f32, with NaN for unsaid, not {field['type']}")
        self.size = offset
        added = [field["offset"] for field in self.fields if field.get("added")]
        self.smallest = min(added, default=offset)
        if [field for field in self.fields if field["offset"] >= self.smallest and not field.get("added")]:
            raise SchemaError(f"{file.name}: what was added must stand last")

    def told(self):
        return [field for field in self.fields if field["name"] not in FRAMING]

    def offset_of(self, name):
        return next(field["offset"] for field in self.fields if field["name"] == name)

    def magic_number(self):
        return f"0x{int.from_bytes(self.magic.encode(), 'little'):08x}"

    # C++

    def cpp_header(self):
        members = []
        for field in self.told():
            kind = "FrameKind" if field["name"] == "kind" else CPP_TYPES[field["type"]]
            initial = {"FrameKind": f" = FrameKind::{cpp.camel(self.kinds[0])}", "TileId": "", "std::array<float, 3>": "{}"}.get(kind, " = 0")
            absent = " NaN where the sender did not say." if field.get("added") else ""
            members.append(cpp.comment((field["description"] + absent).strip(), "  ") + f"  {kind} {field['name']}{initial};\n")
        kinds = ", ".join(f"{cpp.camel(kind)} = {number}" for number, kind in enumerate(self.kinds, 1))
        return f"""{cpp.BANNER}#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "protocol/tile_id.hpp"

namespace spectra::protocol {{

enum class FrameKind : std::uint8_t {{ {kinds} }};

/// Header of a binary message.
struct TileFrameHeader {{
{"".join(members)}}};

inline constexpr std::uint32_t kTileFrameMagic = {self.magic_number()};  // "{self.magic}"
inline constexpr std::size_t kTileFrameHeaderSize = {self.size};
/// Headers of the first senders end before what was added.
inline constexpr std::size_t kSmallestTileFrameHeaderSize = {self.smallest};
inline constexpr std::size_t kTileFrameHeaderSizeOffset = {self.offset_of("header_size_bytes")};
/// Where `sequence` stands, so that a shared frame can be given a connection's own number.
inline constexpr std::size_t kTileFrameSequenceOffset = {self.offset_of("sequence")};

/// The bytes of a header, little-endian on every machine.
std::array<std::byte, kTileFrameHeaderSize> encoded_header(const TileFrameHeader& header);

/// The header that a message begins with. The caller has checked that there are `size` bytes, and that a header has so many.
TileFrameHeader header_in(std::span<const std::byte> message, std::size_t size);

}}  // namespace spectra::protocol
"""

    def cpp_source(self):
        put, get = [], []
        for field in self.fields:
            name, kind = field["name"], field["type"]
            value = f"header.{name}"
            if name == "magic":
                put.append("  out.put(kTileFrameMagic);\n")
                get.append("  in.get<std::uint32_t>();  // The magic number.\n")
                continue
            if name == "header_size_bytes":
                put.append("  out.put(static_cast<std::uint16_t>(kTileFrameHeaderSize));\n")
                get.append("  in.get<std::uint16_t>();  // The size.\n")
                continue
            if kind == "tile":
                put.append(f"  out.put(static_cast<std::uint32_t>({value}.level));  // And its three zero bytes.\n")
                get.append(f"  {value}.level = static_cast<std::uint8_t>(in.get<std::uint32_t>() & 0xFF);\n")
                for axis in "xyz":
                    put.append(f"  out.put({value}.{axis});\n")
                    get.append(f"  {value}.{axis} = in.get<std::uint32_t>();\n")
            elif kind == "f32[3]":
                put.append(f"  for (const float coordinate : {value}) out.put(coordinate);\n")
                get.append(f"  for (float& coordinate : {value}) coordinate = in.get_float();\n")
            elif kind == "f32":
                put.append(f"  out.put({value});\n")
                known = f"size < {field['end']} ? std::numeric_limits<float>::quiet_NaN() : " if field.get("added") else ""
                get.append(f"  {value} = {known}in.get_float();\n")
            elif name == "kind":
                put.append(f"  out.put(static_cast<std::uint8_t>({value}));\n")
                get.append(f"  {value} = static_cast<FrameKind>(in.get<std::uint8_t>());\n")
            else:
                put.append(f"  out.put({value});\n")
                get.append(f"  {value} = in.get<{CPP_TYPES[kind]}>();\n")
        return f"""{cpp.BANNER}#include "protocol/tile_frame_header.hpp"

#include <limits>

#include "protocol/little_endian.hpp"

namespace spectra::protocol {{

std::array<std::byte, kTileFrameHeaderSize> encoded_header(const TileFrameHeader& header) {{
  std::array<std::byte, kTileFrameHeaderSize> bytes{{}};
  LittleEndianWriter out(bytes);
{"".join(put)}  return bytes;
}}

TileFrameHeader header_in(std::span<const std::byte> message, std::size_t size) {{
  TileFrameHeader header;
  LittleEndianReader in(message);
{"".join(get)}  return header;
}}

}}  // namespace spectra::protocol
"""

    # TypeScript

    def typescript(self):
        members, values = [], []
        for field in self.told():
            name, kind, offset = field["name"], field["type"], field["offset"]
            note = field["description"] + (" NaN where the sender did not say." if field.get("added") else "")
            members.append(typescript.comment(note.strip(), "  ") + f"  {name}: {TS_TYPES.get(kind, 'number')};\n")
            value = {
                "u8": f"view.getUint8({offset})",
                "u32": f"u32({offset})",
                "f32": f"f32({offset})",
                "f32[3]": f"[f32({offset}), f32({offset + 4}), f32({offset + 8})]",
                "tile": f"{{ level: view.getUint8({offset}), x: u32({offset + 4}), y: u32({offset + 8}), z: u32({offset + 12}) }}",
            }[kind]
            if field.get("added"):
                value = f"size >= {field['end']} ? {value} : Number.NaN"
            values.append(f"    {name}: {value},\n")
        kinds = "".join(f"  {kind}: {number},\n" for number, kind in enumerate(self.kinds, 1))
        return f"""/** Made by protocol/generate from protocol/schema/tile_frame.json. Not to be edited. */

import type {{ TileId }} from './frame';

export const FRAME_MAGIC = {self.magic_number()};
/** The shortest header; what was added later stands behind it. */
export const FRAME_HEADER_BYTES = {self.smallest};
export const HEADER_SIZE_OFFSET = {self.offset_of("header_size_bytes")};

export const FrameKind = {{
{kinds}}} as const;

export interface TileFrameHeader {{
{"".join(members)}}}

/** The header that a message begins with; the caller has checked that there are `size` bytes, and that a header has so many. */
export function readHeader(view: DataView, size: number): TileFrameHeader {{
  const u32 = (offset: number) => view.getUint32(offset, true);
  const f32 = (offset: number) => view.getFloat32(offset, true);
  return {{
{"".join(values)}  }};
}}
"""

    # The document

    def document(self, text):
        types = {"tile": "u8, u8[3], u32[3]"}
        rows = "".join(f"| {f['offset']} | {types.get(f['type'], f['type'])} | `{f['name']}` | {f['description']} |\n".replace("|  |", "| |")
                       for f in self.fields)
        table = f"| offset | type | field | meaning |\n| --- | --- | --- | --- |\n{rows}| {self.size} | | payload | |\n"
        marker = "<!-- header of tile frames -->\n\n"
        if marker not in text:
            raise SchemaError("docs/protocol.md has no place for the header of tile frames")
        return re.sub(re.escape(marker) + r"(?:\|[^\n]*\n)+", lambda _: marker + table, text)
