"""TypeScript types of all definitions, and readers of what the server says."""

import textwrap

from schema import SchemaError

BANNER = "/** Made by protocol/generate from protocol/schema: types, and readers of what a server says. Not to be edited. */\n\n"


def comment(description, indent=""):
    if not description:
        return ""
    if len(indent) + len(description) + 7 <= 125:
        return f"{indent}/** {description} */\n"
    lines = textwrap.wrap(description, 120 - len(indent))
    return f"{indent}/**\n" + "".join(f"{indent} * {line}\n" for line in lines) + f"{indent} */\n"


def quoted(words):
    return [f"'{word}'" for word in words]


def reader_name(name):
    return name[0].lower() + name[1:]


class Writer:
    def __init__(self, protocol):
        self.protocol = protocol

    def type_of(self, schema):
        if "$ref" in schema:
            return self.protocol.referred(schema).name
        if "enum" in schema:
            return " | ".join(quoted(schema["enum"]))
        if "const" in schema:
            return f"'{schema['const']}'"
        if "prefixItems" in schema:
            return "[" + ", ".join("number" for _ in schema["prefixItems"]) + "]"
        kinds = schema.get("type")
        if isinstance(kinds, list):
            return " | ".join(dict.fromkeys(self.type_of({"type": kind}) for kind in kinds))
        if kinds == "array":
            item = self.type_of(schema["items"])
            most = schema.get("maxItems")
            if most is not None and most <= 4 and schema.get("minItems") == most:
                return "[" + ", ".join([item] * most) + "]"
            return f"({item})[]" if " " in item and not item.startswith("[") else f"{item}[]"
        if kinds == "object":
            return f"Record<string, {self.type_of(schema['additionalProperties'])}>" if "additionalProperties" in schema else "object"
        plain = {"string": "string", "number": "number", "integer": "number", "boolean": "boolean", "null": "null"}
        if kinds not in plain:
            raise SchemaError(f"no TypeScript type for {schema}")
        return plain[kinds]

    def declaration(self, definition):
        note = comment(definition.schema.get("description", ""))
        if not definition.is_message:
            is_open = definition.schema.get("x-open", False)
            kind = "string" if is_open else self.type_of(definition.schema)
            return f"{note}export type {definition.name} = {kind};\n"
        lines = [f"{note}export interface {definition.name} {{\n"]
        for field in self.protocol.fields(definition):
            absent = "" if field.is_required else "?"
            null = " | null" if field.is_nullable else ""
            lines.append(comment(field.description, "  ") + f"  {field.name}{absent}: {self.type_of(field.schema)}{null};\n")
        return "".join(lines) + "}\n"

    def reader_of(self, schema, used):
        """An expression that reads a value; `used` collects the readers of decode.ts that it needs."""
        def use(name, *inner):
            used.add(name)
            return f"{name}({', '.join(inner)})" if inner else name

        definition = self.protocol.referred(schema)
        if definition:
            if definition.is_message:
                return reader_name(definition.name)
            if definition.schema.get("x-open"):
                return use("string")
            return self.reader_of(definition.schema, used)
        if "enum" in schema:
            return use("oneOf", *quoted(schema["enum"]))
        if "const" in schema:
            return use("oneOf", *quoted([schema["const"]]))
        kinds = schema.get("type")
        if isinstance(kinds, list):
            return use("scalar")
        if kinds == "array":
            item = self.reader_of(schema["items"], used)
            most = schema.get("maxItems") if schema.get("minItems") == schema.get("maxItems") else None
            return use({2: "pair", 3: "triple"}.get(most, "array"), item)
        if kinds == "object":
            return use("dictionary", self.reader_of(schema["additionalProperties"], used))
        if kinds == "integer":
            return use("count" if schema.get("minimum", -1) >= 0 else "number")
        return use({"string": "string", "number": "number", "boolean": "boolean"}[kinds])

    def reader(self, definition, used):
        lines = []
        used.add("object")
        for field in self.protocol.fields(definition):
            expression = self.reader_of(field.schema, used)
            if field.is_nullable:
                used.add("nullable")
                expression = f"nullable({expression})"
            if not field.is_required:
                used.add("optional")
                expression = f"optional({expression})"
            lines.append(f"  {field.name}: {expression},\n")
        name = reader_name(definition.name)
        return f"export const {name}: Decoder<{definition.name}> = object({{\n{''.join(lines)}}});\n"

    def source(self, read):
        """`read`: names of the messages that the client reads."""
        used = set()
        needed = [d for d in self.protocol.closure(read) if d.is_message]
        readers = [self.reader(definition, used) for definition in needed]
        types = [self.declaration(d) for _, d in sorted(self.protocol.definitions.items())]
        names = ", ".join(sorted(used))
        imports = f"import type {{ Decoder }} from './decode';\nimport {{ {names} }} from './decode';\n\n"
        return BANNER + imports + "\n".join(types) + "\n" + "\n".join(readers)
