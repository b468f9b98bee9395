"""The tables of docs/results_stability.md, from small trials."""

from __future__ import annotations

import json
import re

import pytest

from analysis.energy.certificate_trials import try_certificate
from analysis.energy.energy_certificate import certify_energy
from studies import certificates as table
from studies.__main__ import main
from studies.proofs.diagram_trials import try_diagram


@pytest.fixture(scope="module")
def row(two_boxes):
    certificate = certify_energy(
        two_boxes("conventional", "hearing=ideal"), cell_m=0.05
    )
    return table.CertificateRow(
        "conventional",
        try_certificate(certificate, starts=5, duration_s=5.0),
        try_diagram(certificate, starts=2),
        "law: 'conventional' has no region; lower its stiffness",
    )


def test_every_row_has_as_many_cells_as_its_heading(row):
    for part in table.certificate_tables([row, row]):
        lines = str(part).splitlines()
        assert len(lines) == 4
        assert len({line.count("|") for line in lines}) == 1


def test_cells_are_the_trials_own(row):
    energy, diagram, squares = map(str, table.certificate_tables([row]))
    cells = [c.strip() for c in energy.splitlines()[2].strip("|").split("|")]
    assert cells[:4] == ["`conventional`", "printed", "5", "0"]
    assert float(cells[6]) == pytest.approx(row.trials.certified_share, abs=1e-4)
    assert re.search(rf"\| 2 \| {row.diagram.collisions} \|", diagram)
    assert "no: 'conventional' has no region; lower its stiffness" in squares


def test_command_prints_and_keeps_the_tables(row, monkeypatch, capsys, tmp_path):
    asked: dict[str, object] = {}

    def rows(scenario, laws, *, progress, **settings):
        asked.update(settings, scenario=scenario, laws=list(laws))
        progress("conventional: certificate")
        return [row]

    monkeypatch.setattr(table, "certificate_rows", rows)
    words = ["certificates", "corridor", "--laws", "active", "--starts", "7"]
    words += [
        "--hearing",
        "ideal",
        "--set",
        "seed=3",
        "--out",
        str(tmp_path / "a.json"),
    ]
    assert main(words) == 0
    printed = capsys.readouterr()
    document = json.loads((tmp_path / "a.json").read_text("utf-8"))
    for each in table.certificate_tables([row]):
        assert str(each) in printed.out
        kept = document["tables"][each.name]
        assert kept["columns"] == [*each.columns]
        assert kept["rows"] == [[*cells] for cells in each.rows]
    assert document["command"].startswith("python -m studies certificates corridor")
    assert printed.err == "conventional: certificate\n"
    assert asked == {
        "scenario": "corridor",
        "laws": ["active"],
        "starts": 7,
        "diagram_starts": 200,
        "hearing": "ideal",
        "settings": ["seed=3"],
    }


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["nowhere"], "nowhere"),
        (["--laws", "passive", "--starts", "5"], "law: 'passive' is not known"),
        (["--starts", "0"], "starts: 0 must be at least 1"),
    ],
)
def test_bad_input_ends_with_status_2(words, message, capsys):
    with pytest.raises(SystemExit) as ended:
        main(["certificates", *words])
    assert ended.value.code == 2
    assert message in capsys.readouterr().err
