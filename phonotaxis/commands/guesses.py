"""Understands words that users guess: names of commands, options and fields."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence

_IN_RESULTS = (
    "every result directory holds its pictures and pages; 'phonotaxis results' lists "
    "these directories"
)
_NEW = (
    "use 'phonotaxis init my_robot' for a project, or 'phonotaxis scenarios default "
    "--copy my_scenario.yaml' for a scenario"
)
_REPLAY = f"{_IN_RESULTS}; open replay.html in a browser"
_COPY = "use 'phonotaxis scenarios default --copy my_scenario.yaml'"
_MANY = "use 'phonotaxis sweep SWEEP.yaml', or 'phonotaxis compare' for several laws"
_GAINS = "use 'phonotaxis design' for gains, or 'phonotaxis sweep' for other fields"
_LOOP = "use 'phonotaxis stability', which writes the linear models and all margins"
_ABOUT = (
    "use 'phonotaxis scenarios NAME', 'phonotaxis laws NAME' or 'phonotaxis fields'"
)
_PLAIN = (
    "results are plain directories under results/; remove those that you do not need"
)
_PICTURES = (
    "pictures are in the result directory; --figures writes them for papers, too"
)
_FIRST = "use 'phonotaxis simulate', which runs the default scenario"
_PIP = "use pip; 'phonotaxis doctor' checks the installation"
_CHECKED = "use 'phonotaxis scenarios FILE', which checks a file without a run"
#: What to do instead of a command that does not exist. A text names the line to type.
_NO_COMMANDS = {
    "plot": f"{_IN_RESULTS}, and 'phonotaxis simulate' writes a new one",
    "view": _IN_RESULTS,
    "open": _IN_RESULTS,
    **dict.fromkeys(
        ("replay", "gui", "viz", "visualize", "visualise", "animate", "watch"), _REPLAY
    ),
    "movie": "use 'phonotaxis simulate --movie FILE.mp4'",
    "report": f"{_IN_RESULTS}; open report.html in a browser",
    "new": _NEW,
    "create": _NEW,
    **dict.fromkeys(("edit", "copy"), _COPY),
    **dict.fromkeys(("batch", "montecarlo", "monte-carlo", "grid"), _MANY),
    **dict.fromkeys(("optimize", "optimise", "tune", "train", "fit"), _GAINS),
    **dict.fromkeys(("margins", "bode", "nyquist", "poles", "equilibria"), _LOOP),
    **dict.fromkeys(("info", "describe", "doc", "explain"), _ABOUT),
    **dict.fromkeys(("delete", "clean", "remove", "rm"), _PLAIN),
    **dict.fromkeys(("test", "demo", "quickstart"), _FIRST),
    **dict.fromkeys(("install", "update", "upgrade"), _PIP),
    "live": "use 'phonotaxis simulate --live' for a run, or 'phonotaxis listen'",
    "ls": "use 'phonotaxis results' or 'phonotaxis scenarios'",
    "log": "use 'phonotaxis results', which lists what is there",
    "example": "'phonotaxis COMMAND --help' ends with examples",
    "examples": "'phonotaxis COMMAND --help' ends with examples",
    "set": "use 'phonotaxis simulate --set KEY=VALUE'",
    "validate": _CHECKED,
    "check": _CHECKED,
    "docs": "'phonotaxis COMMAND --help' describes a command; the folder docs has more",
    **dict.fromkeys(
        ("config", "params", "parameters", "settings", "options"),
        "use 'phonotaxis fields', which lists all settings",
    ),
    "linearize": _LOOP,
    "record": "use 'phonotaxis listen', or record a file and use 'phonotaxis locate'",
}
#: What to do instead of an option that does not exist in any command.
_NO_OPTIONS = {
    "gui": "the result directory holds replay.html for a browser",
    "plot": _PICTURES,
    "plots": _PICTURES,
    "fast": "write --set engine=compiled",
    "compiled": "write --set engine=compiled",
    "ideal": "write --set hearing=ideal",
    "no-noise": "write --set hearing=ideal",
    "quiet": "--json prints one document, and 2>/dev/null hides the progress",
    "silent": "--json prints one document, and 2>/dev/null hides the progress",
    "dry-run": _CHECKED,
    "headless": "no command opens a window; see 'phonotaxis results'",
    "margins": "the report has all margins; see report.html",
    "matlab": "the result directory has models.mat",
    "latest": "results/latest is the last result directory",
    "parquet": "the directory of a run has trajectory.parquet already",
    "rosbag": "--mcap writes a file of ROS 2 messages",
    "verbose": "--debug prints the traceback of an error",
    "v": "--debug prints the traceback of an error; phonotaxis --version the version",
    "no-audio": "sound is written only with --save-audio DIR",
    "ros": "--mcap writes a file of ROS 2 messages",
    "last": "results/latest is the last result directory",
    "validate": _CHECKED,
    "check": _CHECKED,
    "realtime": "open replay.html of the result directory, which plays in real time",
    "list-devices": "'phonotaxis doctor' lists the sound cards",
}
#: Names that users guess for options of other names.
_OPTIONS = {
    "array": "geometry",
    "output": "out",
    "output-dir": "out",
    "dir": "out",
    "resolution": "rate",
    "jobs": "workers",
    "processes": "workers",
    "trials": "runs",
    "repeat": "runs",
    "repeats": "runs",
    "samples": "runs",
    "n": "runs",
    "runs": "trials",
    "threads": "workers",
    "parallel": "workers",
    "cores": "workers",
    "j": "workers",
    "dask": "scheduler",
    "wav": "sound",
    "gains": "set",
    "param": "set",
    "params": "set",
    "override": "set",
    "D": "set",
    "save": "out",
    "o": "out",
    "s": "seed",
    "l": "law",
    "controller": "law",
    "law": "drivers",
    "laws": "drivers",
    "video": "movie",
    "save-video": "movie",
    "gif": "movie",
    "mic": "device",
    "mics": "geometry",
    "microphones": "geometry",
    "format": "csv",
}
#: Options whose value is a word without an option.
_POSITIONAL = {
    "scenario": "set",
    "config": "set",
    "file": "set",
}


def meant_words(words: Sequence[str]) -> list[str]:
    """Replaces ``help`` and ``version`` by the options that they stand for."""
    if words[:1] == ["help"]:
        return [*words[1:2], "--help"]
    if words[:1] in (["version"], ["-V"], ["-v"]):
        return ["--version"]
    if words[:1] == ["--list"]:
        return ["scenarios", *words[1:]]
    return list(words)


def no_command(word: str, commands: Collection[str]) -> str:
    """Returns the message for a word that is not the name of a command."""
    if word in _NO_COMMANDS:
        return f"{word!r} is not a command; {_NO_COMMANDS[word]}"
    from diagrams.scenario.suggestions import did_you_mean

    hint = did_you_mean(word, commands)
    return f"{word!r} is not a command{hint}; 'phonotaxis --help' lists the commands"


def no_option(
    command: str,
    unknown: Sequence[str],
    words: Sequence[str],
    options: Mapping[str, Collection[str]],
) -> str:
    """Returns the message for words that a command does not know.

    The message names the line to type if the user's intention is clear: the field of a
    scenario with this name, an option of the command with a similar name, or other
    commands that have the option.

    Args:
        command: Name of the command.
        unknown: Unknown words of the command line, at least one.
        words: All words of the command line.
        options: Names of the options of each command, without dashes.

    Returns:
        The message.
    """
    text = f"unrecognized arguments: {' '.join(unknown)}"
    own = options[command]
    found = re.match(r"--?([A-Za-z][\w-]*)(?:=(.*))?$", unknown[0])
    if found is None:
        return f"{text}{_no_word(unknown[0], own)}"
    name, value = found[1], found[2] or _next_word(words, unknown[0])
    if name in _POSITIONAL and "set" in own:
        return f"{text}; write phonotaxis {command} {value or 'SCENARIO'}"
    if (command, name) == ("array", "geometry"):
        return f"{text}; write phonotaxis array {value or 'FILE.yaml'}"
    if name in _NO_OPTIONS:
        return f"{text}; {_NO_OPTIONS[name]}"
    hint = _of_field(name, value) if "set" in own else ""
    return f"{text}{hint or _of_option(name, own, options)}"


def _next_word(words: Sequence[str], word: str) -> str:
    """Returns the value after an option; empty if there is none."""
    after = [*words[words.index(word) + 1 :], ""] if word in words else [""]
    return "" if after[0].startswith("-") and not after[0][1:2].isdigit() else after[0]


def _no_word(word: str, own: Collection[str]) -> str:
    """Returns what to do with a word too many that is not an option."""
    if "=" in word and "set" in own:
        return f"; write --set {word}"
    if "set" in own:
        return "; give one scenario, or several to 'phonotaxis compare'"
    return ""


def _of_field(name: str, value: str) -> str:
    """Names the fields of a scenario that are called like the option."""
    from diagrams.scenario.fields.field_list import list_fields
    from diagrams.scenario.fields.near_miss import fields_called
    from diagrams.scenario.fields.shipped import scenario_schema

    schema, word = scenario_schema(), name.replace("-", "_")
    groups = {each.path for each in list_fields(schema) if "group" in each.kind}
    listed = f"'phonotaxis fields {word}'"
    if word in groups:
        return f"; {listed} lists its fields, for --set"
    paths = [path for path in fields_called(schema, word) if path not in groups]
    if not paths:
        return ""
    text = f"; write --set {paths[0]}={value or 'VALUE'}"
    return text if len(paths) == 1 else f"{text}, or see {listed}"


def _of_option(
    name: str, own: Collection[str], options: Mapping[str, Collection[str]]
) -> str:
    if _OPTIONS.get(name) in own:
        return f" (did you mean '--{_OPTIONS[name]}'?)"
    from diagrams.scenario.suggestions import did_you_mean

    if name in options:
        return f"; {name} is a command: phonotaxis {name} --help"
    if others := [each for each, known in options.items() if name in known]:
        return f" (--{name} is an option of {', '.join(others)})"
    # The names have no dashes, which would make all options look similar.
    return did_you_mean(name, own).replace("'", "'--", 1)
