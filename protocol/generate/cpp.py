"""C++ structs of the messages, and how each is read, checked and written."""

import textwrap

from schema import LARGEST_U32, SchemaError, bounds_of, number_text, words_text

BANNER = "// Made by protocol/generate from protocol/schema. Not to be edited.\n"
PLAIN_TYPES = {"string": "std::string", "boolean": "bool", "number": "double"}


def camel(word):
    parts = word.replace("-", "minus_").split("_")
    return "".join(part[:1].upper() + part[1:] for part in parts)


def member(name):
    """The name of a field in C++; `default` is a word of the language."""
    return "default_value" if name == "default" else name


def text(value):
    return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'


def comment(description, indent=""):
    lines = textwrap.wrap(description, 110) if description else []
    return "".join(f"{indent}/// {line}\n" for line in lines)


class Writer:
    def __init__(self, protocol):
        self.protocol = protocol

    # Types

    def integer_type(self, schema):
        low, _, high, _ = bounds_of(schema)
        if low == 0 and high == 255:
            return "std::uint8_t"
        if low is None or low < 0:
            return "std::int64_t" if high is None else "int"
        if high is None or high > LARGEST_U32:
            return "std::uint64_t"
        return "int" if high <= 65536 else "std::uint32_t"

    def type_of(self, schema):
        definition = self.protocol.referred(schema)
        if definition:
            return definition.name if definition.is_message or definition.is_enum or definition.is_external \
                else self.alias_or_type(definition)
        kind = schema.get("type")
        if kind == "integer":
            return self.integer_type(schema)
        if kind == "array":
            if "prefixItems" in schema:
                return f"std::array<std::uint32_t, {len(schema['prefixItems'])}>"
            item = self.type_of(schema["items"])
            fewest, most = schema.get("minItems"), schema.get("maxItems")
            return f"std::array<{item}, {most}>" if fewest == most and most is not None and most <= 4 else f"std::vector<{item}>"
        if kind in PLAIN_TYPES:
            return PLAIN_TYPES[kind]
        raise SchemaError(f"no C++ type for {schema}")

    def alias_or_type(self, definition):
        """Lists of numbers have a name of their own; a string of a pattern is a string."""
        return definition.name if definition.schema.get("type") == "array" else self.type_of(definition.schema)

    def initial(self, field):
        if field.has_default and not field.is_empty_when_absent:
            definition = self.protocol.referred(field.schema)
            if definition and definition.is_enum:
                return f" = {definition.name}::{camel(field.default)}"
            if isinstance(field.default, bool):
                return f" = {str(field.default).lower()}"
            if isinstance(field.default, list):
                return "{" + ", ".join(number_text(value) for value in field.default) + "}"
            return f" = {text(field.default) if isinstance(field.default, str) else number_text(field.default)}"
        definition = self.protocol.referred(field.schema)
        kind = self.protocol.resolved(field.schema).get("type")
        if definition and definition.is_enum:
            return f" = {definition.name}::{camel(definition.schema['enum'][0])}"
        if "const" in field.schema:
            return f" = {text(field.schema['const'])}"
        if definition and definition.is_external:
            return ""
        return {"integer": " = 0", "number": " = 0", "boolean": " = false"}.get(kind, "{}" if self.is_fixed(field.schema) else "")

    def is_fixed(self, schema):
        return self.type_of(schema).startswith("std::array") or (
            self.protocol.referred(schema) is not None
            and self.protocol.resolved(schema).get("type") == "array"
            and self.type_of(self.protocol.resolved(schema)).startswith("std::array"))

    # Headers

    def header(self, family, definitions):
        own = [d for d in definitions if d.family == family]
        includes = {"<array>", "<cstdint>", "<optional>", "<string>", "<vector>"}
        local = {'"protocol/messages/message.hpp"'}
        for definition in own:
            for name in self.protocol.names_in(definition.schema):
                other = self.protocol.definitions[name]
                if other.is_external:
                    local.add(f'"{other.schema["x-header"]}"')
                elif other.family != family:
                    local.add(f'"protocol/messages/{other.family}_messages.hpp"')
            if definition.is_external and definition.is_enum:
                local.add(f'"{definition.schema["x-header"]}"')
        out = [BANNER, "#pragma once\n\n"]
        out += [f"#include {name}\n" for name in sorted(includes)] + ["\n"]
        out += [f"#include {name}\n" for name in sorted(local)]
        out.append(f"\n/// {self.protocol.families[family]}.\nnamespace spectra::protocol {{\n\n")
        for definition in own:
            out.append(self.declaration(definition))
        out += [f"extern template struct Wire<{d.name}>;\n" for d in own if d.is_message]
        out.append("\n}  // namespace spectra::protocol\n")
        return "".join(out)

    def declaration(self, definition):
        if definition.is_external:
            return ""
        description = comment(definition.schema.get("description", ""))
        if definition.is_enum:
            return f"{description}enum class {definition.name} {{ {', '.join(map(camel, definition.schema['enum']))} }};\n\n"
        if not definition.is_message:
            if definition.schema.get("type") != "array":
                return ""
            return f"{description}using {definition.name} = {self.type_of(definition.schema)};\n\n"
        lines = [f"{description}struct {definition.name} {{\n"]
        for field in self.protocol.fields(definition):
            kind = self.type_of(field.schema)
            note = field.description
            if field.is_nullable and "null" not in note:
                note = (note + " " if note else "") + "nullopt = null."
            lines.append(comment(note, "  "))
            if field.is_plain:
                lines.append(f"  {kind} {member(field.name)}{self.initial(field)};\n")
            else:
                lines.append(f"  std::optional<{kind}> {member(field.name)};\n")
        return "".join(lines) + "};\n\n"

    # Reading and writing

    def source(self, family, definitions):
        own = [d for d in definitions if d.family == family]
        out = [BANNER, f'#include "protocol/messages/{family}_messages.hpp"\n\n', '#include "protocol/messages/fields.hpp"\n',
               '#include "protocol/messages/rules.hpp"\n', "\nnamespace spectra::protocol {\n\n"]
        out += [self.words(d) for d in own if d.is_enum]
        out += [self.describe(d) for d in own if d.is_message]
        out += [f"template struct Wire<{d.name}>;\n" for d in own if d.is_message]
        out.append("\n}  // namespace spectra::protocol\n")
        return "".join(out)

    def words(self, definition):
        name = definition.name
        pairs = ", ".join(f"{{{name}::{camel(word)}, {text(word)}}}" for word in definition.schema["enum"])
        return (f"template <>\nstd::span<const EnumWord<{name}>> words_of() {{\n"
                f"  static constexpr EnumWord<{name}> kWords[] = {{{pairs}}};\n  return kWords;\n}}\n\n")

    def describe(self, definition):
        lines = [f"static void describe(auto& fields, Is<{definition.name}> auto& message) {{\n"]
        for field in self.protocol.fields(definition):
            if field.is_plain:
                verb = "field" if field.is_written else "unless_empty"
            elif field.is_nullable:
                verb = "nullable" if field.is_written else "optional_or_null"
            else:
                verb = "optional"
            lines.append(f'  fields.{verb}("{field.name}", message.{member(field.name)});\n')
            value = f"message.{member(field.name)}" if field.is_plain else f"*message.{member(field.name)}"
            condition = self.condition(value, field.schema)
            if condition:
                if not field.is_plain:
                    condition = f"!message.{member(field.name)} || ({condition})"
                lines.append(f'  fields.require("{field.name}", [&] {{ return {condition}; }}, {text(expected(self.protocol, field.schema))});\n')
        lines.append("  rules(fields, message);\n}\n\n")
        return "".join(lines)

    def condition(self, value, schema, depth=0):
        """A C++ expression that is true when a value keeps to the bounds of a schema; empty when its type already does."""
        definition = self.protocol.referred(schema)
        if definition and (definition.is_message or definition.is_enum or definition.is_external):
            return ""
        schema = self.protocol.resolved(schema)
        kind = schema.get("type")
        parts = []
        if "const" in schema:
            parts.append(f"{value} == {text(schema['const'])}")
        elif "pattern" in schema:
            parts.append(f"matches({value}, {text(schema['pattern'])})")
        elif kind in ("number", "integer"):
            for bound, sign in zip(bounds_of(schema), (">=", ">", "<=", "<")):
                if bound is None or (kind == "integer" and self.holds_by_type(schema, bound, sign)):
                    continue
                number = number_text(bound) + ("U" if kind == "integer" and self.integer_type(schema).startswith("std::uint") else "")
                parts.append(f"{value} {sign} {number}")
        elif kind == "array":
            parts += self.list_conditions(value, schema, depth)
        return " && ".join(parts)

    def holds_by_type(self, schema, bound, sign):
        kind = self.integer_type(schema)
        if kind == "int":
            return False
        return (sign == ">=" and bound == 0) or (sign == "<=" and bound in (255, LARGEST_U32))

    def list_conditions(self, value, schema, depth):
        parts = []
        fewest, most = schema.get("minItems"), schema.get("maxItems")
        if not self.is_fixed(schema):
            if fewest == most and most is not None:
                parts.append(f"{value_of(value)}.size() == {most}")
            elif fewest:
                parts.append(f"{value_of(value)}.size() >= {fewest}")
            if most is not None and fewest != most:
                parts.append(f"{value_of(value)}.size() <= {most}")
        if "prefixItems" in schema:
            for place, item in enumerate(schema["prefixItems"]):
                if item.get("minimum", 0) > 0:
                    parts.append(f"{value}[{place}] >= {item['minimum']}U")
                if item.get("maximum", LARGEST_U32) < LARGEST_U32:
                    parts.append(f"{value}[{place}] <= {item['maximum']}U")
            return parts
        name = "item" if depth == 0 else "part"
        inner = self.condition(name, schema["items"], depth + 1)
        if inner:
            parts.append(f"each({value}, [](const auto& {name}) {{ return {inner}; }})")
        return parts


def value_of(value):
    return f"({value})" if value.startswith("*") else value


def expected(protocol, schema):
    """What an error says would be accepted."""
    schema = protocol.resolved(schema)
    kind = schema.get("type")
    if "title" in schema:
        return ("a " if kind == "array" else "") + schema["title"]
    if "const" in schema:
        return words_text([schema["const"]])
    if kind in ("number", "integer"):
        return ("an integer" if kind == "integer" else "a number") + range_text(schema)
    if kind == "array":
        return "a list " + count_text(schema) + items_text(protocol, schema)
    raise SchemaError(f"no words for {schema}")


def range_text(schema):
    low, above, high, below = bounds_of(schema)
    if low is not None and high is not None:
        return f" from {number_text(low)} to {number_text(high)}"
    if above is not None and below is not None:
        return f" above {number_text(above)} and below {number_text(below)}"
    start = f" above {number_text(above)}" if above is not None else f" not below {number_text(low)}" if low is not None else ""
    return start + (f", at most {number_text(high)}" if high is not None else "")


def count_text(schema):
    fewest, most = schema.get("minItems"), schema.get("maxItems")
    if fewest == most and most is not None:
        return f"of {most}"
    if fewest:
        return f"of at least {fewest}"
    return f"of at most {most}" if most is not None else "of"


def items_text(protocol, schema):
    items = protocol.resolved(schema.get("items", {}))
    if "title" in items:
        return " " + items["title"]
    kind = items.get("type")
    if kind in ("number", "integer"):
        return (" integers" if kind == "integer" else " numbers") + range_text(items)
    return ""
