#!/usr/bin/env python3
"""Man page and shell completion of the program, made of what it says of itself with --help.

describe.py man PROGRAM | completion PROGRAM     written to standard output
"""
import pathlib
import re
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent


class Command:
    def __init__(self, name, program):
        self.words = name.split()
        text = subprocess.run([program, *self.words, "--help"], capture_output=True, text=True, check=True).stdout
        lines = text.splitlines()
        self.purpose = lines[0]
        self.usage = next(line for line in lines if line.startswith("Usage: ")).removeprefix("Usage: ")
        self.parts = {"Positionals": [], "Options": [], "Subcommands": []}
        part = None
        for line, following in zip(lines, lines[1:] + [""]):
            if line.rstrip(":") in self.parts:
                part = self.parts[line.rstrip(":")]
            elif part is not None and re.match(r" {2}\S", line):
                # What it means stands in the same line where there is room, else in the next.
                width = len(line) if following.startswith(" " * 10) else 30
                part.append([line[2:width].strip(), line[width:].strip()])
            elif part and line.startswith(" " * 10):
                part[-1][1] = line.strip()

    def options(self):
        return [re.match(r"(?:-\w,)?(--[a-z-]+)", item).group(1) for item, _ in self.parts["Options"]]

    def takes_value(self, option):
        item = next(item for item, _ in self.parts["Options"] if re.match(r"(?:-\w,)?" + option + r"\b(?!-)", item))
        return option == "--config" or bool(re.search(r" (TEXT|UINT|INT|FLOAT)", item))


def commands_of(program):
    """All commands, those of commands after them; the first is the program itself."""
    found = [Command("", program)]
    for name, _ in found[0].parts["Subcommands"]:
        command = Command(name, program)
        found.append(command)
        found += [Command(f"{name} {inner}", program) for inner, _ in command.parts["Subcommands"]]
    return found


def roff(text):
    return re.sub(r"^([.'])", r"\\\\&\1", text.replace("\\", "\\e").replace("-", "\\-"))


def item_of_man(item, meaning):
    """An entry: the name bold, what it takes plain, what it excludes after the meaning."""
    names, _, takes = item.partition(" ")
    names, _, default = names.partition("=")
    match = re.match(r"(?P<takes>.*?)\s*(?P<needs>(?:Needs|Excludes): .*)?$", takes)
    takes, needs = match["takes"].replace("REQUIRED", "(required)"), match["needs"]
    lines = [".TP", f"\\fB{roff(names)}\\fR" + (f" \\fI{roff(takes)}\\fR" if takes else ""), roff(meaning or "\\&")]
    if needs:
        words = re.sub(r"(Needs|Excludes): ", lambda m: {"Needs": "; needs ", "Excludes": "; not together with "}[m[1]], needs)
        lines.append("(" + roff(re.sub(r"\s*;\s*", "; ", words).lstrip("; ").strip()) + ")")
    return lines


def man(program):
    commands = commands_of(program)
    version = subprocess.run([program, "--version"], capture_output=True, text=True, check=True).stdout.split()[1]
    out = []
    for command in commands[1:]:
        if command.parts["Subcommands"]:
            continue
        out.append(f".SS {roff(' '.join(command.words))}")
        out.append(f"{roff(command.purpose)}.")
        positionals = " ".join(
            f"\\fI{roff(item.split()[0])}\\fR" if "REQUIRED" in item else f"[\\fI{roff(item.split()[0])}\\fR]"
            for item, _ in command.parts["Positionals"]
        )
        out += [".PP", f"\\fBspectra {roff(' '.join(command.words))}\\fR [options] {positionals}".rstrip()]
        for item, meaning in command.parts["Positionals"] + command.parts["Options"]:
            if not item.startswith(("-h,", "--help-all", "--quiet")):
                out += item_of_man(item, meaning)
    general = [line for item, meaning in commands[0].parts["Options"] for line in item_of_man(item, meaning)]
    frame = (HERE / "spectra.1.in").read_text()
    return frame.replace("@VERSION@", version).replace("@OPTIONS@\n", "\n".join(general) + "\n").replace("@COMMANDS@\n", "\n".join(out) + "\n")


def completion(program):
    commands = commands_of(program)
    rows = []
    for command in commands:
        words = [name for name, _ in command.parts["Subcommands"]] + command.options()
        rows.append(f'    "{" ".join(command.words)}") words="{" ".join(words)}" ;;')
    valued = sorted({o for c in commands for o in c.options() if c.takes_value(o)})
    inner = sorted({c.words[0] for c in commands if len(c.words) == 2})
    frame = (HERE / "completion.in").read_text()
    return frame.replace("@ROWS@", "\n".join(rows)).replace("@VALUED@", "|".join(valued)).replace("@INNER@", "|".join(inner)).replace("@INNER_WORDS@", " ".join(inner))


if __name__ == "__main__":
    print({"man": man, "completion": completion}[sys.argv[1]](sys.argv[2]), end="")
