"""The table of docs/known_answers.md: published answers, computed again."""

from __future__ import annotations

import math
from pathlib import Path

import control
import numpy as np
import pytest
import scipy.linalg
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import Adder, Gain, Integrator, ZeroOrderHold

import phonotaxis

PAGE = Path(__file__).parents[3] / "docs" / "known_answers.md"
NONE = "no such function"
FREQUENCIES = np.geomspace(1e-2, 1e2, 5_000)
SEILER = control.tf([25.0], [1.0, 10.0, 10.0, 10.0])


def digits(*values):
    return ", ".join(f"{value:.4g}" for value in values)


def satellite(loops):
    a = 10.0
    C = np.array([[1.0, a], [-a, 1.0]])
    whole = control.ss([[0.0, a], [-a, 0.0]], np.eye(2), C, np.zeros((2, 2)))
    if loops == 2:
        return whole
    # The second loop is closed.
    return control.ss(
        whole.A - whole.B[:, [1]] @ C[[1]], whole.B[:, [0]], C[[0]], [[0.0]]
    )


def both_loops():
    loop = satellite(2)
    with pytest.raises(control.ControlMIMONotImplemented):
        control.disk_margins(loop, FREQUENCIES)
    return digits(phonotaxis.disk_margin(loop).alpha), "needs slycot"


def disk(loop):
    theirs = control.disk_margins(loop, FREQUENCIES)[0]
    return digits(phonotaxis.disk_margin(loop).alpha), digits(theirs)


def classical():
    found = phonotaxis.margins(SEILER)
    theirs = control.stability_margins(SEILER)[:2]
    return digits(found.gain_increase_margin, found.phase_margin_deg), digits(*theirs)


def delay(loop):
    return digits(phonotaxis.margins(loop).delay_margin_s), NONE


def gain(loop, form=".4g"):
    found = phonotaxis.margins(loop).gain_increase_margin
    return f"{found:{form}}", f"{control.stability_margins(loop)[0]:{form}}"


def doyle():
    """LQG without guaranteed margins: the loop at the input of the plant."""
    A, B, C = np.array([[1.0, 1.0], [0.0, 1.0]]), np.array([[0.0], [1.0]]), [[1.0, 0.0]]
    weight = 60.0 * np.ones((2, 2))
    X = scipy.linalg.solve_continuous_are(A, B, weight, [[1.0]])
    Y = scipy.linalg.solve_continuous_are(A.T, np.array(C).T, weight, [[1.0]])
    K, G = B.T @ X, Y @ np.array(C).T
    controller = control.ss(A - B @ K - G @ C, G, K, [[0.0]])
    loop = control.ss(A, B, C, [[0.0]]) * controller
    return gain(loop)


def multirate():
    builder, T = DiagramBuilder(), 0.1
    plant = builder.AddNamedSystem("plant", Integrator(1))
    total = builder.AddNamedSystem("total", Adder(2, 1))
    for k, (period, size) in enumerate([(T, 4.0), (2.0 * T, 5.0)]):
        hold = builder.AddNamedSystem(f"hold_{k}", ZeroOrderHold(period, 1))
        back = builder.AddNamedSystem(f"back_{k}", Gain(-size, 1))
        builder.Connect(plant.get_output_port(), hold.get_input_port())
        builder.Connect(hold.get_output_port(), back.get_input_port())
        builder.Connect(back.get_output_port(), total.get_input_port(k))
    builder.Connect(total.get_output_port(), plant.get_input_port())
    poles = phonotaxis.linearize(builder.Build(), None).model.poles
    pole = poles[np.abs(poles).argmax()].real
    return digits(pole), "no multirate"


def scale(found):
    return digits(found.scale_proven, found.scale_unstable), NONE


LEAD = control.tf([1.0, 1.0], [0.001, 1.0])
CARTS_CONTROLLER = 100.0 * control.ss(LEAD) * control.ss(LEAD) * control.ss(LEAD)


def carts(values):
    k, m1, m2 = values["k"], values["m1"], values["m2"]
    A = np.zeros((4, 4))
    A[:2, 2:] = np.eye(2)
    A[2:, :2] = [[-k / m1, k / m1], [k / m2, -k / m2]]
    B, C = np.array([[0.0], [0.0], [1.0 / m1], [0.0]]), np.array([[0.0, 1.0, 0.0, 0.0]])
    c = CARTS_CONTROLLER
    # Closed by hand, because ``control.feedback`` takes most of the time.
    return np.block([[A - B @ c.D @ C, B @ c.C], [-c.B @ C, c.A]])


def polynomial(*coefficients):
    return np.vstack([-np.array(coefficients), np.eye(len(coefficients))[:-1]])


def island(values, r=0.05):
    a, b = values["q1"], values["q2"]
    last = 1.0 + r * r + 6.0 * a + 6.0 * b + 2.0 * a * b
    return polynomial(a + b + 1.0, a + b + 3.0, last)


def island_growth():
    found = phonotaxis.robustness(island, {"q1": (0.3, 2.5), "q2": (0.0, 1.7)})
    assert found.verdict == "unstable"
    return digits(found.growth_per_s, found.proven_growth_per_s), NONE


def worst(margin):
    found = phonotaxis.worst_margins(
        lambda v: control.tf([v["K"]], [1.0, v["p"], 0.0]),
        {"K": (1.0, 3.0), "p": (0.5, 1.5)},
    )
    either = getattr(found, margin)
    return digits(either.found, either.proven), NONE


def light_mode():
    mode = control.tf([0.2], [1.0, 0.02, 100.0]) + control.tf([0.2], [1.0, 0.0])
    return delay(control.ss(mode))


#: In the order of the table.
CASES = [
    both_loops,
    lambda: disk(satellite(1)),
    lambda: disk(SEILER),
    classical,
    light_mode,
    lambda: delay(control.tf([2.0], [1.0, 0.0])),
    lambda: gain(control.tf([1.0], [1.0, 3.0, 3.0, 1.0])),
    lambda: gain(control.tf([0.5], [1.0, -1.0, 0.0, 0.0], 1.0), ".6f"),
    doyle,
    multirate,
    lambda: scale(
        phonotaxis.robustness(carts, dict.fromkeys(("k", "m1", "m2"), (0.8, 1.2)))
    ),
    lambda: scale(phonotaxis.robustness(island, {"q1": (0.3, 2.5), "q2": (0.0, 1.7)})),
    island_growth,
    lambda: scale(
        phonotaxis.robustness(
            lambda v: polynomial(v["a"], v["b"], v["c"]),
            dict.fromkeys("abc", (3.0, 5.0)),
        )
    ),
    lambda: scale(
        phonotaxis.robustness(
            lambda v: polynomial(v["a"], v["b"]),
            {"a": (-0.1, 0.1), "b": (0.7, 0.8)},
            period_s=1.0,
        )
    ),
    lambda: worst("disk"),
    lambda: worst("delay"),
]


def rows():
    lines = PAGE.read_text("utf-8").splitlines()
    table = [line.strip("|") for line in lines if line.startswith("| ")]
    return [[cell.strip() for cell in line.split(" | ")] for line in table]


def test_the_table_has_all_answers():
    heads, *table = rows()
    assert heads[3:5] == ["phonotaxis", "python-control"]
    assert len(table) == len(CASES) >= 10


@pytest.mark.parametrize("k", range(len(CASES)))
def test_known_answer(k):
    row = rows()[k + 1]
    assert CASES[k]() == (row[3], row[4]), row[0]
    plain = row[2].replace(" deg", "").replace(" to", ",")
    stated = [float(word) for word in plain.split(", ")]
    ours = [float(word) for word in row[3].split(", ")]
    if "scale" in row[0] or "growth" in row[0]:
        assert ours[0] * (1.0 - 1e-3) <= stated[0] <= ours[1] * (1.0 + 1e-3)
    elif "worst" in row[0]:
        assert ours[1] <= stated[0] <= ours[0] * (1.0 + 1e-3)
    elif "satellite: disk margin of both" in row[0]:
        assert stated[0] <= ours[0] <= stated[1]
    else:
        assert ours == pytest.approx(stated, rel=5e-3)


def test_the_island_is_where_the_growth_is_largest():
    """The growth on the line q1 = q2, on which the island has its middle."""
    q = np.linspace(0.95, 1.05, 2001)
    growth = [np.roots([1, *-island({"q1": x, "q2": x})[0]]).real.max() for x in q]
    assert max(growth) == pytest.approx(8.931e-5, rel=1e-3)
    assert math.isclose(q[int(np.argmax(growth))], 1.0, abs_tol=2e-3)
