"""One grammar: an option means the same, in the same form, in every command."""

from __future__ import annotations

import json
from argparse import ArgumentParser
from collections import defaultdict

import pytest

import phonotaxis
from phonotaxis.commands.command_line import COMMANDS

#: Options of all commands whose laws, seeds, fields or files a user chooses.
OF_SCENARIOS = {"--law", "--laws", "--seed", "--set", "--guard", "--velocity-term"}
OF_RESULTS = {"--out", "--figures", "--json"}
OF_BATCHES = {"--runs", "--workers", "--resume"}


def options_of(command: str) -> dict[str, tuple[object, ...]]:
    """The form of each option of a command: how often, what kind, which values."""
    parser = ArgumentParser()
    COMMANDS[command].add_arguments(parser)
    return {
        name: (
            *(action.option_strings, action.dest, action.metavar, action.nargs),
            *(type(action).__name__, action.type, action.choices),
        )
        for action in parser._actions
        for name in action.option_strings
        if action.dest != "help"
    }


def test_an_option_has_one_form_in_all_commands():
    forms: dict[str, dict[str, object]] = defaultdict(dict)
    for command in COMMANDS:
        for option, form in options_of(command).items():
            forms[option][command] = form
    shared = {option: own for option, own in forms.items() if len(own) > 1}
    # The sample rate of raw samples, and the speed of a live view.
    del shared["--rate"]
    assert len(shared) > 12
    for option, own in shared.items():
        assert len(set(map(str, own.values()))) == 1, (option, own)


@pytest.mark.parametrize(
    ("commands", "options"),
    [
        ("simulate stability design compare sweep", OF_SCENARIOS | OF_RESULTS),
        ("accuracy falsify", {"--seed", "--json"}),
        ("accuracy locate calibrate array", OF_RESULTS),
        ("compare sweep", OF_BATCHES),
        ("fields", {"--law", "--laws", "--json"}),
        ("export", {"--out", "--json"}),
        (" ".join(COMMANDS), {"--json"}),
    ],
)
def test_commands_of_one_kind_have_the_same_options(commands, options):
    for command in commands.split():
        assert options <= set(options_of(command)), command


def call(capsys, *words: str) -> tuple[int, str, str]:
    status = phonotaxis.main(words)
    printed = capsys.readouterr()
    return status, printed.out, printed.err


SWEEP = "scenario: obstacle_free\nset: {duration_s: 0.2, hearing: ideal}\nruns: 1\n"


@pytest.mark.parametrize(
    "words",
    [
        "simulate --seed x",
        "simulate --seed=-1",
        "stability --seed 1.5",
        "design --seed x",
        "compare --seed x",
        "sweep sweep.yaml --seed x",
        "falsify --seed x",
        "accuracy --seed x",
    ],
)
def test_a_seed_is_refused_alike(capsys, tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sweep.yaml").write_text(SWEEP)
    status, printed, complaint = call(capsys, *words.split())
    assert (status, printed) == (2, "")
    assert complaint.startswith("phonotaxis: seed: '")
    assert "is not a whole number; give 0 or more" in complaint


@pytest.mark.parametrize("command", ["simulate", "stability", "design", "compare"])
@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--law activ", "law: 'activ' is not known"),
        ("--laws=activ", "law: 'activ' is not known"),
        ("--set lawn=1", "lawn: did you mean 'law'?"),
        ("--set duration_s", "duration_s: is not of the form key=value; write"),
    ],
)
def test_laws_and_settings_are_refused_alike(
    capsys, tmp_path, monkeypatch, command, words, message
):
    monkeypatch.chdir(tmp_path)
    status, printed, complaint = call(capsys, command, *words.split())
    assert (status, printed) == (2, "")
    assert message in complaint


@pytest.mark.parametrize(
    "command", ["locate x.wav", "calibrate x.yaml", "array x.yaml"]
)
def test_figures_need_a_directory(command):
    from phonotaxis.commands.arguments import take_wanted_place
    from systems.framework.input_error import InputError

    parser = ArgumentParser()
    COMMANDS[command.split()[0]].add_arguments(parser)
    options = parser.parse_args([*command.split()[1:], "--figures"])
    with pytest.raises(InputError, match=r"figures: need a directory; add --out DIR"):
        take_wanted_place(options, lambda out: pytest.fail(str(out)))


def test_a_sweep_takes_laws_seed_runs_and_settings(tmp_path):
    """The command line replaces values of the file, in the grammar of ``compare``."""
    from analysis.batches.changed_plan import changed_plan
    from analysis.batches.plan import load_sweep

    (tmp_path / "sweep.yaml").write_text(f"{SWEEP}grid: {{law: [none, active]}}\n")
    plan = load_sweep(tmp_path / "sweep.yaml")
    assert changed_plan(plan) == plan
    changed = changed_plan(
        plan,
        laws=["active,guarded", "active"],
        runs=3,
        seed=7,
        settings=["duration_s=0.4", "collision_vector.velocity_term=printed,closing"],
    )
    assert changed.grid == {
        "law": ("active", "guarded"),
        "collision_vector.velocity_term": ("printed", "closing"),
    }
    assert (changed.runs, changed.seed) == (3, 7)
    assert changed.set == {"duration_s": 0.4, "hearing": "ideal"}
    assert len(changed.points()) == 12


def test_several_laws_are_one_picture(capsys, tmp_path, monkeypatch):
    """Each run is the run of this law alone; names, outcomes and files are there."""
    monkeypatch.chdir(tmp_path)
    short = ["--set", "duration_s=0.3", "--set", "hearing=ideal", "--no-plots"]
    laws = ["--law", "active", "--law", "none,active"]
    status, printed, _ = call(capsys, "simulate", *laws, *short, "--json")
    assert status == 0
    document = json.loads(printed)
    assert [*document["laws"]] == ["active", "none"]
    assert call(capsys, "simulate", "--law", "none", *short)[0] == 0
    alone = json.loads((tmp_path / "results/0002/summary.json").read_text("utf-8"))
    assert document["laws"]["none"]["metrics"] == alone["metrics"]
    assert document["laws"]["none"]["directory"] == "none"
    names = {path.name for path in (tmp_path / "results/0001").iterdir()}
    assert names == {"active", "none", "report.html", "summary.json"}
    again = json.loads((tmp_path / "results/0001/none/summary.json").read_text("utf-8"))
    assert again["out"] == "results/0001/none"
    assert again["metrics"] == alone["metrics"]
    status, _, complaint = call(capsys, "simulate", "results/0001")
    assert status == 2
    assert "phonotaxis simulate results/0001/active" in complaint
    status, _, complaint = call(capsys, "simulate", *laws, "--movie", "a.gif")
    assert status == 2
    assert "movie: is possible with one law only" in complaint


def test_the_picture_of_several_laws(tmp_path):
    """Curves are the paths of P; the legend states the outcome; one color per law."""
    import numpy as np

    found = phonotaxis.simulate_laws(
        "default", "none,active", duration_s=12.0, hearing="ideal"
    )
    figure = found.plot()
    (axes,) = figure.axes
    words = [text.get_text() for text in figure.legends[0].get_texts()]
    colors = set()
    for law, run in found.runs.items():
        (label,) = [word for word in words if word.startswith(f"{law}: ")]
        assert run.ending in label
        (line,) = [each for each in axes.lines if each.get_label() == label]
        drawn = np.asarray(line.get_xydata(), dtype=float).T
        np.testing.assert_allclose(drawn, run.vector("p_WP"))
        colors.add(line.get_color())
    assert len(colors) == 2
    assert [*found["none"].figures()] == ["trajectory", "time_series"]
    files = found.save_figures(tmp_path / "figures")
    assert {path.stem for path in files} == {"laws"}
    assert {path.suffix for path in files} == {".pdf", ".svg", ".png"}
    assert "none: " in next(f for f in files if f.suffix == ".svg").read_text("utf-8")
