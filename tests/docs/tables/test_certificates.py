"""The tables of docs/certificates.md, from small trials."""

from __future__ import annotations

import re

import pytest

from analysis.certificates.certificate_trials import try_certificate
from analysis.certificates.diagram_trials import try_diagram
from analysis.certificates.energy_certificate import certify_energy
from docs.tables import certificates as table


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
    for part in table.certificate_table([row, row]).split("\n\n"):
        lines = part.splitlines()
        assert len(lines) == 4
        assert len({line.count("|") for line in lines}) == 1


def test_cells_are_the_trials_own(row):
    energy, diagram, squares = table.certificate_table([row]).split("\n\n")
    cells = [c.strip() for c in energy.splitlines()[2].strip("|").split("|")]
    assert cells[:4] == ["`conventional`", "printed", "5", "0"]
    assert float(cells[6]) == pytest.approx(row.trials.certified_share, abs=1e-4)
    assert re.search(rf"\| 2 \| {row.diagram.collisions} \|", diagram)
    assert "no: 'conventional' has no region; lower its stiffness" in squares


def test_command_prints_the_tables_and_says_what_it_does(row, monkeypatch, capsys):
    asked: dict[str, object] = {}

    def rows(scenario, laws, *, progress, **settings):
        asked.update(settings, scenario=scenario, laws=list(laws))
        progress("conventional: certificate")
        return [row]

    monkeypatch.setattr(table, "certificate_rows", rows)
    table.main(
        [
            "corridor",
            "--laws",
            "active",
            "--starts",
            "7",
            "--hearing",
            "ideal",
            "--set",
            "seed=3",
        ]
    )
    printed = capsys.readouterr()
    assert printed.out == table.certificate_table([row]) + "\n"
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
        table.main(words)
    assert ended.value.code == 2
    assert message in capsys.readouterr().err
