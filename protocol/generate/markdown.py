"""The tables of docs/protocol.md."""

import re

from schema import LARGEST_U32, SchemaError, bounds_of, name_of_reference, number_text, words_text

HEAD = "| field | type | meaning |\n| --- | --- | --- |\n"
NAMED_HEAD = "| named value | is |\n| --- | --- |\n"


def number_words(schema):
    low, above, high, below = bounds_of(schema)
    kind = schema["type"]
    if kind == "integer" and low == 0 and high == LARGEST_U32:
        return "u32"
    if low is not None and high is not None:
        return f"{kind} {number_text(low)}..{number_text(high)}"
    limits = [word + number_text(value) for word, value in
              (("above ", above), ("≥ ", low), ("at most ", high), ("below ", below)) if value is not None]
    return " ".join([kind, ", ".join(limits)]) if limits else kind


class Writer:
    def __init__(self, protocol):
        self.protocol = protocol

    def type_of(self, schema, plural=False):
        if "$ref" in schema:
            return self.protocol.referred(schema).name
        if "title" in schema:
            return schema["title"]
        if "enum" in schema:
            return words_text(schema["enum"])
        if "const" in schema:
            return words_text([schema["const"]])
        kinds = schema.get("type")
        if isinstance(kinds, list):
            return ", ".join(kinds[:-1]) + " or " + kinds[-1]
        if kinds == "array":
            return self.list_words(schema, plural)
        if kinds == "object":
            return f"object: name to {self.type_of(schema['additionalProperties'])}" if "additionalProperties" in schema else "object"
        words = number_words(schema) if kinds in ("number", "integer") else kinds
        return re.sub(r"^(number|integer|string)\b", r"\1s", words) if plural else words

    def list_words(self, schema, plural):
        start = "lists of " if plural else "list of "
        if "prefixItems" in schema:
            return f"{start}{len(schema['prefixItems'])} integers"
        fewest, most = schema.get("minItems"), schema.get("maxItems")
        if fewest == most and most is not None:
            count = f"{most} "
        elif most is not None:
            count = f"at most {most} "
        else:
            count = f"at least {fewest} " if fewest else ""
        return start + count + self.type_of(schema["items"], True)

    def rows(self, definition):
        rows = []
        for field in self.protocol.fields(definition):
            kind = self.type_of(field.schema) + (" or null" if field.is_nullable else "")
            kind += "" if field.is_required else " (optional)"
            meaning = field.description.replace("|", "\\|")
            rows.append(f"| `{field.name}` | {kind} | {meaning} |\n".replace("|  |", "| |"))
        return "".join(rows)

    def named_values(self):
        rows = []
        for name, definition in sorted(self.protocol.definitions.items()):
            if not definition.is_message and definition.name not in ("Empty", "RpcId"):
                description = definition.schema.get("description", "")
                rows.append(f"| {name} | {self.type_of(definition.schema)}{': ' + description if description else ''} |\n")
        return NAMED_HEAD + "".join(rows)

    def methods(self, group):
        """What may be said, and with what."""
        answers = group == "requests"
        head = ["method", "params", "result", "meaning"] if answers else ["method", "params", "meaning"]
        rows = [head, ["---"] * len(head)]
        for name, entry in self.protocol.methods[group].items():
            types = [name_of_reference(entry[key]) for key in ("params", "result") if key in entry]
            rows.append([f"`{name}`", *("{}" if kind == "Empty" else kind for kind in types), entry["description"]])
        return "".join("| " + " | ".join(row) + " |\n" for row in rows)

    def document(self, text):
        """The document with all its tables as they must be: those below `**Name** — ...` and below `<!-- fields of Name -->`."""
        seen = []

        def titled(match):
            name = match["name"]
            if name not in self.protocol.definitions:
                return match[0]
            definition = self.protocol.definitions[name]
            seen.append(name)
            return f"**{name}** — {definition.schema.get('description', '')}\n\n{HEAD}{self.rows(definition)}"

        def marked(match):
            name = match["name"]
            if name not in self.protocol.definitions:
                raise SchemaError(f"docs/protocol.md wants the fields of {name}, which protocol/schema does not define")
            seen.append(name)
            return f"<!-- fields of {name} -->\n\n{HEAD}{self.rows(self.protocol.definitions[name])}"

        table = r"(?:\|[^\n]*\n)+"
        text = re.sub(rf"^\*\*(?P<name>\w+)\*\* — [^\n]*\n\n{table}", titled, text, flags=re.M)
        text = re.sub(rf"^<!-- fields of (?P<name>\w+) -->\n\n{table}", marked, text, flags=re.M)
        text = re.sub(rf"^<!-- named values -->\n\n{table}", lambda _: "<!-- named values -->\n\n" + self.named_values(), text, flags=re.M)
        for group in ("requests", "client_notifications", "server_notifications"):
            text = re.sub(rf"^<!-- {group} -->\n\n{table}", lambda _: f"<!-- {group} -->\n\n{self.methods(group)}", text, flags=re.M)
        twice = {name for name in seen if seen.count(name) > 1}
        missing = [d.name for d in self.protocol.definitions.values()
                   if d.is_message and d.name not in seen and d.family != "rpc"]
        if twice or missing:
            raise SchemaError(f"docs/protocol.md shows {sorted(twice)} twice and lacks {missing}")
        return text
