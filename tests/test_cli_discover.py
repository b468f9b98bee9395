"""What a new user finds out from the command line alone."""

from __future__ import annotations

import json
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest

import phonotaxis
from analysis import installation
from diagrams import load_scenario
from diagrams.scenario.fields.shipped import schema_text
from phonotaxis.commands.command_line import COMMANDS, make_parser


def call(capsys, *words: str) -> tuple[int, str, str]:
    status = phonotaxis.main(words)
    printed = capsys.readouterr()
    return status, printed.out, printed.err


def test_fields(capsys):
    status, out, _ = call(capsys, "fields", "room.reverb")
    assert status == 0
    assert out.startswith(
        "room.reverberation_time_s = 0.4 s  (number, from 0.001 to 20)"
    )
    listed = json.loads(call(capsys, "fields", "room.reverb", "--json")[1])["fields"]
    assert [(each["path"], each["unit"]) for each in listed] == [
        ("room.reverberation_time_s", "s")
    ]
    assert call(capsys, "fields", "--schema")[1] == schema_text()
    status, out, complaint = call(capsys, "fields", "reverberatoin_time_s")
    assert (status, out) == (2, "")
    assert "did you mean 'reverberation_time_s'" in complaint


def test_all_faults_are_told_a_line_each(capsys, tmp_path):
    words = ["simulate", "--set", "room.reverberation_time=1", "--set", "seed=x"]
    status, out, complaint = call(capsys, *words)
    assert (status, out) == (2, "")
    seed, room = complaint.splitlines()
    assert seed.startswith("phonotaxis: seed: is 'x'")
    assert "did you mean 'room.reverberation_time_s'?" in room
    document = json.loads(call(capsys, *words, "--json")[1])
    assert document["error"] == document["errors"][0]
    assert [each["field"] for each in document["errors"]] == [
        "seed",
        "room.reverberation_time",
    ]


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        (["simulat"], "simulate"),
        (["simulate", "--velocity-therm", "printed"], "--velocity-term"),
        (["simulate", "two_static_obstacle"], "two_static_obstacles"),
        (["simulate", "--law", "activ"], "active"),
        (["simulate", "--set", "source.spee_m_s=1"], "source.speed_m_s"),
    ],
)
def test_near_misses_are_named(capsys, words, meant):
    status, _, complaint = call(capsys, *words)
    assert status == 2
    assert f"did you mean {meant!r}?" in complaint


@pytest.mark.parametrize(
    ("words", "end"),
    [
        (["simulate", "--sed", "3"], " (did you mean '--seed'?)"),
        (
            ["simulate", "--runs", "10"],
            "of compare, sweep, falsify)",
        ),
        (["locate", "a.wav", "--array", "x"], " (did you mean '--geometry'?)"),
        (["accuracy", "--guard", "on"], "simulate, compare, stability, sweep, design)"),
    ],
)
def test_options_are_near_to_those_of_the_same_command(capsys, words, end):
    status, _, complaint = call(capsys, *words)
    assert status == 2
    told = f"{end}; see phonotaxis {words[0]} --help"
    assert complaint.rstrip().endswith(told)
    assert "unrecognized arguments: --" in complaint


def test_examples_of_the_help_are_commands():
    for command in COMMANDS.values():
        assert command.examples, command.name
        for example in command.examples:
            words = example.partition(" > ")[0].replace("'", "").split()
            assert make_parser().parse_args(words).command == command.name


def test_init_copies_the_template_once(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    status, out, _ = call(capsys, "init", "my_robot", "--json")
    template = Path(phonotaxis.__file__).parent / "template"
    assert status == 0
    for file in json.loads(out)["files"]:
        original = template / Path(file).relative_to("my_robot")
        assert Path(file).read_text() == original.read_text()
    assert len(json.loads(out)["files"]) == 8
    status, _, complaint = call(capsys, "init", "my_robot")
    assert status == 2
    assert "my_robot cannot be written (File exists); name a new" in complaint


def test_init_gives_a_project_the_name_of_its_directory(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    status, out, _ = call(capsys, "init", "Ear-Bot", "--json")
    files = [Path(file) for file in json.loads(out)["files"]]
    assert status == 0
    assert Path("Ear-Bot/ear_bot/laws.py") in files
    assert 'name = "ear-bot"' in Path("Ear-Bot/pyproject.toml").read_text()
    assert not [file for file in files if "my_robot" in file.read_text()]
    for name in ("analysis", "2nd"):
        status, _, complaint = call(capsys, "init", name)
        assert (status, Path(name).exists()) == (2, False)
        assert "write for example phonotaxis init my_robot" in complaint


def test_version(capsys):
    with pytest.raises(SystemExit) as left:
        phonotaxis.main(["--version"])
    assert left.value.code == 0
    assert capsys.readouterr().out == f"phonotaxis {version('phonotaxis')}\n"


def test_doctor(capsys, monkeypatch):
    status, out, _ = call(capsys, "doctor", "--json")
    document = json.loads(out)
    assert (status, document["ok"]) == (0, True)
    found = {each["name"]: each for each in document["findings"]}
    assert found["drake"]["found"] == version("drake")
    assert {"python", "numba", "compiled code", "disk", "sound card", "browser"} <= {
        *found
    }
    monkeypatch.setattr(installation, "LEAST_FREE_MB", 1e12)
    status, out, complaint = call(capsys, "doctor")
    assert status == 1
    assert "BAD  disk" in out
    assert "not ready: disk" in complaint


def test_result_directory_has_what_an_editor_needs(tmp_path):
    from diagrams import write_scenario

    write_scenario(load_scenario("u_trap"), tmp_path)
    first = (tmp_path / "scenario.yaml").read_text().partition("\n")[0]
    assert first == "# yaml-language-server: $schema=scenario.schema.json"
    assert (tmp_path / "scenario.schema.json").read_text() == schema_text()
    assert load_scenario(tmp_path / "scenario.yaml") == load_scenario("u_trap")


def test_the_scenario_of_a_result_begins_with_what_differs(tmp_path):
    """The comments are settings: on all defaults, they make the same scenario."""
    from diagrams import write_scenario
    from diagrams.scenario.differences import differences

    changed = load_scenario({"law": "conventional", "source": {"speed_m_s": 0.2}})
    write_scenario(changed, tmp_path)
    text = (tmp_path / "scenario.yaml").read_text("utf-8")
    lines = text.partition("# All fields:")[0].splitlines()
    assert lines[1:] == [
        "# Fields that differ from their defaults:",
        '#   law: "conventional"',
        "#   source.speed_m_s: 0.2",
    ]
    assert load_scenario(tmp_path) == changed
    for name in ("u_trap", "robots_4", "odor_search"):
        whole = load_scenario(name, seed=3)
        names = {"name": whole.name, "description": whole.description}
        again = load_scenario(_tree(differences(whole) | names))
        assert again == whole


def _tree(settings):
    data: dict[str, Any] = {}
    for path, value in settings.items():
        *parents, last = path.split(".")
        node = data
        for part in parents:
            node = node.setdefault(part, {})
        node[last] = value
    return data
