"""The definitions of protocol/schema as the generators see them."""

import json
import re
from pathlib import Path

LARGEST_U32 = 2**32 - 1


class SchemaError(Exception):
    """A schema says what the generators cannot write."""


class Definition:
    """One entry of $defs: `family` is the file's name without its ending."""

    def __init__(self, name, schema, family):
        self.name, self.schema, self.family = name, schema, family

    @property
    def is_message(self):
        return "properties" in self.schema

    @property
    def is_enum(self):
        return "enum" in self.schema

    @property
    def is_external(self):
        """Its C++ type is written by hand, in the header that x-header names."""
        return "x-header" in self.schema


class Field:
    """A property of a message."""

    def __init__(self, definition, name, schema):
        self.name = name
        self.description = schema.get("description", "")
        self.has_default = "default" in schema
        self.default = schema.get("default")
        self.is_required = name in definition.schema.get("required", [])
        # Our server always says it, servers before it did not.
        self.is_written = self.is_required or schema.get("x-added", False)
        self.is_nullable, self.schema = without_null(schema)

    @property
    def is_plain(self):
        """Always has a value: required, or empty where it is absent."""
        return not self.is_nullable and (self.is_written or self.is_empty_when_absent)

    @property
    def is_empty_when_absent(self):
        return not self.is_written and self.has_default and self.default in ("", [], {})


def without_null(schema):
    """Whether null is allowed, and what else is."""
    kinds = schema.get("type")
    if isinstance(kinds, list) and "null" in kinds and len(kinds) == 2:
        return True, {**schema, "type": next(kind for kind in kinds if kind != "null")}
    if "anyOf" in schema:
        others = [option for option in schema["anyOf"] if option != {"type": "null"}]
        if len(others) != 1 or len(others) == len(schema["anyOf"]):
            raise SchemaError(f"anyOf is for one thing or null, not {schema['anyOf']}")
        return True, others[0]
    return False, schema


def name_of_reference(reference):
    return re.sub(r"^.*#/\$defs/", "", reference)


class Protocol:
    """All schema files of a folder."""

    def __init__(self, folder):
        self.definitions, self.families = {}, {}
        for file in sorted(Path(folder).glob("*.schema.json")):
            family = file.name.removesuffix(".schema.json")
            content = json.loads(file.read_text(encoding="utf-8"))
            self.families[family] = content["title"]
            for name, schema in content["$defs"].items():
                if name in self.definitions:
                    raise SchemaError(f"{file.name}: {name} is defined twice")
                self.definitions[name] = Definition(name, schema, family)
        self.methods = json.loads((Path(folder) / "methods.json").read_text(encoding="utf-8"))

    def fields(self, definition):
        return [Field(definition, name, schema) for name, schema in definition.schema["properties"].items()]

    def referred(self, schema):
        """The definition that a schema refers to, or None."""
        return self.definitions[name_of_reference(schema["$ref"])] if "$ref" in schema else None

    def resolved(self, schema):
        definition = self.referred(schema)
        return definition.schema if definition else schema

    def names_in(self, schema):
        """Names of the definitions that a schema refers to, at any depth."""
        if isinstance(schema, list):
            return [name for item in schema for name in self.names_in(item)]
        if not isinstance(schema, dict):
            return []
        found = [name_of_reference(schema["$ref"])] if "$ref" in schema else []
        return found + [name for key, value in schema.items() if key != "$ref" for name in self.names_in(value)]

    def closure(self, names):
        """These definitions and all that they need, what is needed first."""
        order = []

        def add(name):
            if name in order:
                return
            for needed in self.names_in(self.definitions[name].schema):
                add(needed)
            order.append(name)

        for name in names:
            add(name)
        return [self.definitions[name] for name in order]


def bounds_of(schema):
    """minimum, exclusive minimum, maximum, exclusive maximum; None where there is none."""
    return tuple(schema.get(key) for key in ("minimum", "exclusiveMinimum", "maximum", "exclusiveMaximum"))


def number_text(value):
    return f"{value:.10g}" if isinstance(value, float) and abs(value) < 1e15 else str(value)


def words_text(words):
    quoted = [f'"{word}"' for word in words]
    return quoted[0] if len(quoted) == 1 else ", ".join(quoted[:-1]) + " or " + quoted[-1]
