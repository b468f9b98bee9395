"""Bad inputs by kind: words, settings, files, laws, directories."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

from diagrams.scenario.loading import load_scenario
from diagrams.scenario.scenario import Scenario

#: What a run is made short with, where it should come to that.
SHORT = ("--set", "duration_s=0.05")
_COMMANDS = (
    "simulate",
    "scenarios",
    "laws",
    "locate",
    "accuracy",
    "compare",
    "stability",
    "sweep",
    "design",
    "export",
    "columns",
)
_EXTREMES = (
    "0 -1 1e-300 -1e-300 1e300 -1e300 1e999 .inf -.inf .nan null ~ true no '' x 1.5 "
    "10000000000000000000 -9223372036854775809 [] {} [1] [[1]] {a:1} [1,2,3,4] "
    "!!int x !!bool x !!python/object:os.system x &a [*a] *b 2024-13-45 2024-01-01 "
    "!!binary QUJD !!set {a} !foo 3 [1 {a 0x10 1_000 1e5 'a\\nb' \"\\u2028\""
)
_VALUES = (
    *(
        value
        for value in _EXTREMES.replace("!!int x", "!!int·x")
        .replace("!!bool x", "!!bool·x")
        .replace("object:os.system x", "object:os.system·x")
        .replace("&a [*a]", "&a·[*a]")
        .replace("!!binary QUJD", "!!binary·QUJD")
        .replace("!!set {a}", "!!set·{a}")
        .replace("!foo 3", "!foo·3")
        .replace("[1 {a", "[1,2 {a:")
        .split(" ")
    ),
    "9" * 5000,
    "x" * 100_000,
    "[" * 3000,
    "\x1b[31mred",
    "\udcff",
    "\u202eabc",
)
_NAMES = (
    "",
    ".",
    "..",
    "/",
    "~/nowhere/x",
    "~nobody-of-that-name/x",
    "a" * 300,
    "a/" * 2000,
    "\udcff\udcfe",
    "new\nline",
    "full",
    "full/kept.txt",
    "link",
    "dangling",
    "empty",
    "/proc/x",
    "/dev/null",
    "/dev/null/x",
    "-",
    "readonly/x",
    "results",
    "loop",
    "\x1b[2J",
)
LAWS = """
import functools, math, sys
from pydrake.systems.framework import LeafSystem
def good(c, s, laws): return 1.0 / c
def two(c, s): return 1.0
def none(c, s, laws): pass
def nan(c, s, laws): return float("nan")
def infinite(c, s, laws): return float("inf")
def text(c, s, laws): return "x" * 100000
def imaginary(c, s, laws): return 1j
def listed(c, s, laws): return [1.0]
def raises(c, s, laws): raise KeyError("k" * 10000)
def leaves(c, s, laws): sys.exit(0)
def stops(c, s, laws): raise KeyboardInterrupt
class Odd(BaseException): pass
def odd(c, s, laws): raise Odd("o" * 10000)
def late_odd(c, s, laws): return odd(c, s, 0) if c < 2.4 else 1.0 / c
def late(c, s, laws): return math.sqrt(0.5 - c) if c < 2.4 else 1.0 / c
def near(c, s, laws): return 1.0 / c if c > 2.0 or c < 0.2 else None
class Plain: pass
class Block(LeafSystem): pass
class Portless(LeafSystem):
    def __init__(self, robot, attraction, laws): super().__init__()
class Rude:
    def __repr__(self): raise RuntimeError("no")
    def __call__(self, c, s, laws): return self
rude = Rude()
partial = functools.partial(lambda k, c, s, laws: k / c, 2.0)
number = 5
"""
_LAW_NAMES = [
    "good",
    "two",
    "none",
    "nan",
    "infinite",
    "text",
    "imaginary",
    "listed",
    "raises",
    "leaves",
    "stops",
    "odd",
    "late_odd",
    "late",
    "near",
    "Plain",
    "Block",
    "Portless",
    "rude",
    "partial",
    "number",
    "missing",
]
_LAW_FILES = {
    "laws.py": LAWS,
    "syntax.py": "def f(:\n",
    "leaves.py": "import sys\nsys.exit(0)\n",
    "stops.py": "raise KeyboardInterrupt\n",
    "odd.py": "class Odd(BaseException): pass\nraise Odd('x' * 5000)\n",
    "closes.py": "raise GeneratorExit\n",
    "talks.py": "print('a line')\ndef good(c, s, laws): return 1.0 / c\n",
    "raises.py": "raise RuntimeError('x' * 5000)\n",
    "imports.py": "import nothing_of_that_name\n",
    "empty.py": "",
    "bytes.py": "\udcff\udcfe = 1\n",
}
_BASE = """name: base
duration_s: 0.05
law: active
source: {waypoints_m: [[2.0, 0.0], [3.0, 1.0]], speed_m_s: 0.3}
obstacles:
  - {name: box, waypoints_m: [[1.5, 0.8]], size_m: [0.1, 0.05]}
sound: {kind: horn, on_s: 0.5, period_s: 2.0}
"""
_SWEEP = """scenario: default
set: {duration_s: 0.05, hearing: ideal, obstacle_sensing: ideal}
grid: {law: [none, active]}
draw: {start.heading_deg: {uniform: [-10, 10]}}
runs: 1
seed: 3
"""


@dataclass(frozen=True)
class Case:
    """A command line, and the files that it finds in its directory."""

    kind: str
    words: tuple[str, ...]
    files: dict[str, bytes] = field(default_factory=dict)
    output: str = ""
    """Where standard output leads; empty: to a file."""


def cases(seed: int, count: int) -> Iterator[Case]:
    """So many cases, of all kinds in turn; the same for the same seed."""
    draw = random.Random(seed)  # no secret
    kinds = list(KINDS.items())
    for number in range(count):
        kind, make = kinds[number % len(kinds)]
        words, files = make(draw)
        # A word of the command line can hold neither.
        words = tuple(word.replace("\x00", "\\0") for word in words)
        encoded = {
            name: text.encode("utf-8", "surrogateescape")
            if isinstance(text, str)
            else text
            for name, text in files.items()
        }
        yield Case(kind, words, encoded, "/dev/full" if kind == "full output" else "")


Made = tuple[tuple[str, ...], dict[str, Any]]


def _value(draw: random.Random) -> str:
    return draw.choice(_VALUES).replace("·", " ")


_ONE_OF_EACH = {
    "obstacles": [{"name": "box"}],
    "robots": {"robot": {}, "other": {"start": {"position_m": [-2.0, 0.0]}}},
    "sources": {"source": {}, "radio": {"waypoints_m": [[0.0, 3.0]]}},
    "room": {},
}


def _fields(scenario: Scenario) -> list[str]:
    """Dotted paths of all fields of a scenario."""
    found: list[str] = []

    def walk(value: Any, path: str) -> None:
        found.append(path)
        items = value.items() if isinstance(value, dict) else ()
        for key, item in items or enumerate(value if isinstance(value, list) else ()):
            walk(item, f"{path}.{key}")

    for key, value in scenario.model_dump(mode="json").items():
        walk(value, key)
    return found


_FIELDS = _fields(Scenario.model_validate(_ONE_OF_EACH))
#: Fields of robots that do not follow a sound, by a scenario that has them.
_OTHER_FIELDS = {
    name: _fields(load_scenario(name))
    for name in ("unknown_block", "odor_search", "sound_search")
}


def _words(draw: random.Random) -> Made:
    """Options that are unknown, incomplete, repeated, or have no sense."""
    command = draw.choice([*_COMMANDS, "simulat", "", "x" * 10_000, "\udcff", "--help"])
    options = [
        "--out",
        "--json",
        "--seed",
        "--set",
        "--law",
        "--velocity-term",
        "--runs",
        "--trials",
        "--workers",
        "--resume",
        "--scheduler",
        "--geometry",
        "--tolerances",
        "--laws",
        "--grid",
        "--full",
        "--sound",
        "--mcap",
        "--csv",
        "--no-such",
        "-x",
        "--",
        "nothing.yaml",
        "default",
        "missing.wav",
    ]
    words = [command]
    for _ in range(draw.randint(1, 5)):
        words.append(draw.choice(options))
        if draw.random() < 0.6:
            words.append(_value(draw))
    # What is right by chance must not take minutes.
    if command in ("accuracy", "compare", "stability", "design", "simulate"):
        words.append(draw.choice(["--no-such", "--seed=-1", "--out=full"]))
    if command == "sweep":
        words.insert(1, "nothing.yaml")
    return tuple(words), {}


def _settings(draw: random.Random) -> Made:
    """Any field with any value."""
    words, fields = ["simulate", *SHORT], _FIELDS
    if draw.random() < 0.3:
        name = draw.choice([*_OTHER_FIELDS])
        words.insert(1, name)
        fields = _OTHER_FIELDS[name]
    else:
        hearing = draw.choice(["hearing=ideal", "hearing=ideal", "hearing=audio"])
        words += ["--set", hearing]
    for _ in range(draw.choice([1, 1, 1, 2])):
        key = draw.choice(fields)
        if draw.random() < 0.1:
            key = draw.choice(
                [f"{key}.x", f".{key}", f"{key}.", "x" * 5000, "a\nb", ""]
            )
        words += ["--set", f"{key}={_value(draw)}"]
    if draw.random() < 0.3:
        words.append("--json")
    return tuple(words), {}


def _mangled(draw: random.Random, text: str) -> bytes:
    """A file with bytes that are cut, doubled, changed, or foreign."""
    content, lines = text.encode(), text.splitlines()
    place, k = draw.randrange(len(content)), draw.randrange(len(lines))
    key, colon, _ = lines[k].partition(":")
    lines[k] = f"{key}{colon} {_value(draw)}"
    changed = "\n".join(lines).encode("utf-8", "surrogateescape")
    bomb = [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]" for k in range(1, 12)]
    ways = (
        content[:place],
        content[:place] + bytes([draw.randrange(256)]) + content[place + 1 :],
        content[:place] + content[place // 2 :],
        bytes(draw.randrange(256) for _ in range(200)),
        draw.choice([b"", b"\x00" * 50, b"[" * 5000, b"- " * 5000, b"a: " * 500]),
        "\n".join(["a0: &a0 [x, x]", *bomb, text]).encode(),
        text.encode(draw.choice(["utf-16", "utf-32", "utf-7"])),
        *[changed] * 3,
    )
    return draw.choice(ways)


def _scenario_file(draw: random.Random) -> Made:
    name = draw.choice(
        ["scene.yaml"] * 8 + ["loop", "missing.yaml", "full", "fifo.yaml"]
    )
    files = {"scene.yaml": _mangled(draw, _BASE)}
    if draw.random() < 0.1:
        files["scene.yaml"] = b"description: " + b"x" * draw.choice([90_000, 5_000_000])
    words = ("simulate", name, *SHORT, "--set", "hearing=ideal")
    # Most of what is right by chance runs nowhere: it would take seconds.
    return (*words, "--set", "zzz=1") if draw.random() < 0.8 else words, files


def _sweep_file(draw: random.Random) -> Made:
    if draw.random() < 0.5:
        content = _mangled(draw, _SWEEP)
    else:
        replaced = {
            "runs": draw.choice(["1000000000", "0", "-1", "1e9", "1.5", "x"]),
            "seed": _value(draw),
            "grid": draw.choice(
                [
                    "{a: [1], b: [2]}",
                    "{law: []}",
                    "{law: active}",
                    "{law: [.nan]}",
                    "{seed: [1]}",
                    *[
                        "{"
                        + ", ".join(
                            f"{key}: {list(range(1, 1001))}"
                            for key in (
                                "sound.tone_hz",
                                "duration_s",
                                "stop.lost_after_s",
                            )
                        )
                        + "}"
                    ],
                ]
            ),
            "draw": draw.choice(
                [
                    "{start.heading_deg: {uniform: [1, 0]}}",
                    "{start.heading_deg: {normal: [0, 1e300]}}",
                    "{start.heading_deg: {choice: []}}",
                    "{x.y: {uniform: [0, 1]}}",
                    "{'': {uniform: [0, 1]}}",
                    "{start: {choice: [1, x, null]}}",
                ]
            ),
            "scenario": _value(draw),
            "redraws": draw.choice(["10000", "1e5", "-1"]),
        }
        key = draw.choice(list(replaced))
        lines = [line for line in _SWEEP.splitlines() if not line.startswith(key)]
        content = "\n".join([*lines, f"{key}: {replaced[key]}"]).encode(
            "utf-8", "surrogateescape"
        )
    words = ["sweep", "sweep.yaml"]
    if draw.random() < 0.4:
        workers = draw.choice(["0", "-1", "1" + "0" * 19, "1e3", "x", "100000"])
        words += ["--workers", workers]
    else:
        words += ["--workers", "1"]
    if draw.random() < 0.15:
        words += [
            "--scheduler",
            draw.choice(["", "tcp://x", "\udcff", "1", "a" * 9999]),
        ]
    if draw.random() < 0.2:
        words += ["--resume", "--out", draw.choice(["full", "old", "missing", *_NAMES])]
    old = draw.choice([b"", b"[]", b"{}", b"{", b"null", b'{"plan_sha256": 1}'])
    return tuple(words), {
        "sweep.yaml": content,
        "old/sweep.json": old,
        "old/sweep.yaml": draw.choice([b"", b"[", b"a: b", b"\xff"]),
    }


def _compare(draw: random.Random) -> Made:
    words = ["compare", draw.choice(["wall", "default", "missing", "full", ""])]
    option = draw.choice(["--laws", "--velocity-term", "--grid", "--set", "--runs"])
    value = _value(draw)
    if option in ("--grid", "--set") and draw.random() < 0.8:
        value = f"{draw.choice(_FIELDS)}={value}"
    if option == "--runs":
        value = draw.choice(["0", "-1", "1000000000", "1" + "0" * 19, "x", "1e3"])
    if option == "--laws" and draw.random() < 0.5:
        value = draw.choice(
            ["none,none", ",", "laws:nan", "laws.py:raises", "x:y", "a,b"]
        )
    words += [option, value]
    if draw.random() < 0.5:
        words.append(f"--seed={draw.choice(['x', '-1', '1e3', '9' * 30])}")
    if draw.random() < 0.5:
        words.append("--json")
    # One that is right by chance runs nowhere.
    return (*words, "--out", "full"), {"laws.py": LAWS}


def _law(draw: random.Random) -> Made:
    module = draw.choice(["laws", "laws.py", "./laws.py"])
    name = f"{module}:{draw.choice(_LAW_NAMES)}"
    if draw.random() < 0.35:
        file = draw.choice(list(_LAW_FILES))
        name = f"{draw.choice([file, file.removesuffix('.py')])}:good"
    if draw.random() < 0.2:
        name = draw.choice(
            [
                "os:abort",
                "os:getpid",
                "builtins:repr",
                ":",
                "a:",
                ":b",
                "..a:b",
                "a b:c",
                "time:sleep",
                "builtins:exit",
                "json:loads",
                f"{'x' * 10_000}:y",
                "\udcff:a",
            ]
        )
    scene = ("--set", "hearing=ideal", "--set", "obstacle_sensing=ideal")
    obstacle = ("--set", 'obstacles=[{"waypoints_m": [[2.4, 0.6]]}]')
    words = ("simulate", "--law", name, *SHORT, *scene, *obstacle)
    return words + draw.choice([(), ("--json",)]), dict(_LAW_FILES)


def _out(draw: random.Random) -> Made:
    command = draw.choice(["simulate", "accuracy", "stability", "design", "compare"])
    words = [command, "--out", draw.choice(_NAMES)]
    # What is right runs nowhere: the law, or the number of trials, is not.
    if command == "accuracy":
        words += ["--trials", "0"]
    elif command == "compare":
        words += ["--laws", "nothing"]
    elif command == "simulate" and draw.random() < 0.1:
        words += [*SHORT, "--set", "hearing=ideal"]
    else:
        words += ["--set", "law=nothing", "--seed", "-1"]
    return tuple(words), {}


def _recording(draw: random.Random) -> Made:
    content = draw.choice(
        [
            b"",
            b"RIFF",
            b"RIFF\xff\xff\xff\x7fWAVEfmt \x10\x00\x00\x00",
            b"fLaC" + bytes(draw.randrange(256) for _ in range(60)),
            b"\x00" * 1000,
            b"OggS" + b"\x00" * 100,
        ]
    )
    name = draw.choice(["sound.wav", "sound.flac", "missing.wav", "full", "/dev/zero"])
    locating = ("locate", name, "--out", "found")
    playing = ("simulate", "--sound", name, *SHORT)
    words = locating if draw.random() < 0.5 else playing
    return words, {"sound.wav": content, "sound.flac": content}


def _geometry(draw: random.Random) -> Made:
    text = "microphones: [[0, 0.4], [0, 0], [0, -0.4]]\nsound_speed: 340\n"
    return ("locate", "missing.wav", "--geometry", "array.yaml"), {
        "array.yaml": _mangled(draw, text)
    }


def _name(draw: random.Random) -> Made:
    """Names of a user's that become names of files in a result directory."""
    if draw.random() < 0.8:
        robot = draw.choice(["summary", "a" * 64, "a" * 65, "a" * 5000, "A", "", "a/b"])
        text = f"{_BASE}hearing: ideal\nrobots:\n  {robot!r}: {{}}\n"
        text += "  other: {start: {position_m: [-2.0, 0.0]}}\n"
        film = draw.choice(["film.gif", "new/film.gif", f"{'x' * 300}.gif", "full"])
        option = draw.choice([(), ("--movie", film), ("--save-audio", "new/ears")])
        plots = draw.choice([(), ("--no-plots",)])
        return ("simulate", "scene.yaml", "--out", "new", *option, *plots), {
            "scene.yaml": text
        }
    name = draw.choice(["summary.json", "report.html", "examples", "x" * 250])
    # A third dot, as in ...yaml, makes a scenario that is called like a folder.
    file = f"{draw.choice([name, name.upper(), '..'])}.yaml"
    words = ("compare", file, "--laws", "none", "--runs", "1", "--workers", "1")
    ideal = ("--set", "hearing=ideal", "--set", "obstacle_sensing=ideal")
    return (*words, *ideal, "--out", "new"), {file: _BASE}


def _full_output(draw: random.Random) -> Made:
    """What cannot be printed."""
    command = draw.choice(
        [
            ("--help",),
            ("--version",),
            ("scenarios",),
            ("columns",),
            ("fields", "room"),
            ("simulate", "--help"),
            ("simulat",),
            ("simulate", *SHORT, "--set", "hearing=ideal", "--no-plots"),
        ]
    )
    return command + draw.choice([(), ("--json",)]), {}


#: What makes a case of each kind.
KINDS: dict[str, Callable[[random.Random], Made]] = {
    "words": _words,
    "settings": _settings,
    "scenario file": _scenario_file,
    "sweep file": _sweep_file,
    "compare": _compare,
    "law": _law,
    "directory": _out,
    "recording": _recording,
    "geometry": _geometry,
    "name": _name,
    "full output": _full_output,
}
