"""Worst margins over boxes, from both sides, against closed forms and sampling."""

from __future__ import annotations

import json
import math

import control
import numpy as np
import pytest
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import FirstOrderLowPassFilter, Gain, Integrator

import phonotaxis
from analysis.loops import worst_margins
from analysis.loops.linear_models import LinearModel
from analysis.loops.loop_family import LoopFamily
from analysis.loops.worst_margins import bound_delay_margin, bound_disk_margin
from systems.framework.input_error import InputError

BOX = {"K": (1.0, 3.0), "p": (0.5, 1.5)}


def servo(values):
    """K / (s (s + p))."""
    return control.tf([values["K"]], [1.0, values["p"], 0.0])


def inner(values):
    """The same with p = 0.5 and a gain that is largest inside the box, at q = 0.3."""
    return servo({"K": 3.0 - (values["q"] - 0.3) ** 2, "p": 0.5})


def diagram_of(values):
    """The same as a Drake diagram, with the feedback at the gain."""
    builder = DiagramBuilder()
    lag = builder.AddNamedSystem("lag", FirstOrderLowPassFilter(1.0 / values["p"]))
    integrator = builder.AddNamedSystem("integrator", Integrator(1))
    back = builder.AddNamedSystem("back", Gain(-values["K"] / values["p"], 1))
    builder.Connect(lag.get_output_port(), integrator.get_input_port())
    builder.Connect(integrator.get_output_port(), back.get_input_port())
    builder.Connect(back.get_output_port(), lag.get_input_port())
    return builder.Build(), None, "back.u0"


@pytest.mark.parametrize(
    ("loop_of", "box"),
    [(servo, BOX), (inner, {"q": (-1.0, 1.0)}), (diagram_of, BOX)],
)
def test_the_worst_servo_is_the_closed_form(loop_of, box):
    # |(1 + L)/(1 - L)| is least at w^2 = K: alpha = 2 p / sqrt(4 K + p^2). |L| = 1
    # where w^2 (w^2 + p^2) = K^2, with the lag atan(p / w).
    K, p = 3.0, 0.5
    found = phonotaxis.worst_margins(loop_of, box)
    alpha = 2.0 * p / math.sqrt(4.0 * K + p * p)
    w = math.sqrt(0.5 * (math.sqrt(p**4 + 4.0 * K * K) - p * p))
    for margin, expected, omega in (
        (found.disk, alpha, math.sqrt(K)),
        (found.delay, math.atan(p / w) / w, w),
    ):
        assert margin.found == pytest.approx(expected, rel=1e-6)
        assert 0.99 * expected < margin.proven < expected
        assert margin.gap < 0.01
        assert margin.frequency_rad_s == pytest.approx(omega, rel=1e-4)
        if "q" in box:
            assert margin.worst_values["q"] == pytest.approx(0.3, abs=1e-3)
        else:
            assert margin.worst_values == pytest.approx({"K": K, "p": p})
    document = json.loads(json.dumps(found.document(), allow_nan=False))
    assert document["disk"]["proven"] == found.disk.proven
    assert str(found).startswith("disk margin: at least 0.28")


def test_a_sampled_integrator():
    # L = K / (z - 1): at z = -1, alpha = 2 (1 - K/2) / (1 + K/2). |L| = 1 where
    # 2 sin(w T / 2) = K, with the lag pi/2 - w T / 2.
    T, K = 0.1, 0.3
    found = phonotaxis.worst_margins(
        lambda v: control.tf([v["K"]], [1.0, -1.0], T), {"K": (0.1, K)}
    )
    w = 2.0 / T * math.asin(K / 2.0)
    assert found.disk.found == pytest.approx(2.0 * (1.0 - K / 2.0) / (1.0 + K / 2.0))
    assert found.delay.found == pytest.approx((math.pi / 2.0 - w * T / 2.0) / w)
    assert found.disk.gap < 0.01
    assert found.delay.gap < 0.01
    # Levin and May: 4 periods are stable, because 0.3 < 2 cos(4 pi / 9), 5 are not.
    assert str(found).count("proven for 4 periods of 0.1 s") == 1


def random_family(seed, n, period):
    """A stable loop whose matrix is bilinear in three parameters."""
    rng = np.random.default_rng(seed)
    while True:
        A, B, C = (rng.normal(size=size) for size in ((n, n), (n, 1), (1, n)))
        A -= np.eye(n) * (np.linalg.eigvals(A).real.max() + 0.1)
        steps = rng.normal(size=(3, n, n)) * 0.06
        if period:
            A, B, steps = np.eye(n) + 0.7 * period * A, period * B, period * steps

        def model_of(v, A=A, B=B, C=C, steps=steps):
            moved = A + v[0] * steps[0] + v[1] * steps[1] + v[1] * v[2] * steps[2]
            states = tuple(f"x{k}" for k in range(n))
            return LinearModel(
                "L", moved, B * (1.0 + 0.2 * v[2]), C, np.zeros((1, 1)),
                states, ("u",), ("y",), period,
            )  # fmt: skip

        nominal = phonotaxis.margins(model_of(np.zeros(3)))
        if nominal.disk.alpha > 0.6 and nominal.delay_margin_s < 5:
            points = rng.uniform(-1.0, 1.0, size=(60, 3))
            return LoopFamily(model_of, -np.ones(3), np.ones(3)), points


@pytest.mark.parametrize(("n", "period", "seed"), [(3, None, 7), (4, 0.1, 9)])
def test_no_sample_is_below_a_proven_margin(n, period, seed, monkeypatch):
    family, points = random_family(seed, n, period)
    sampled = [phonotaxis.margins(family.model_of(v)) for v in points]
    for bound, values in (
        (bound_disk_margin(family), [each.disk.alpha for each in sampled]),
        (bound_delay_margin(family), [each.delay_margin_s for each in sampled]),
    ):
        assert 0.0 < bound.proven < bound.found <= min(values) * (1.0 + 1e-6)
        assert bound.proven > 0.97 * bound.found
    # More than the worst margin cannot be proven.
    monkeypatch.setattr(worst_margins, "_GAP", -1e-3)
    monkeypatch.setattr(worst_margins, "_PROOFS", 1)
    assert bound_disk_margin(family, most_parts=1_000).proven == 0.0
    assert bound_delay_margin(family, most_parts=1_000).proven == 0.0


def test_unstable_unlimited_and_unproven_families():
    island = phonotaxis.worst_margins(
        lambda v: control.tf([1.0], [1.0, (v["q"] - 0.3) ** 2 - 1.01]),
        {"q": (-1.0, 1.0)},
    )
    assert island.disk.found == island.disk.proven == 0.0
    assert "an unstable loop was found" in str(island)
    lag = phonotaxis.worst_margins(
        lambda v: control.tf([v["K"]], [1.0, 1.0]), {"K": (0.2, 0.8)}
    )
    assert lag.delay.found == lag.delay.proven == math.inf
    assert lag.delay.gap == 0.0
    assert "delay margin: proven that it has no limit" in str(lag)
    few = phonotaxis.worst_margins(servo, BOX, most_parts=0)
    assert few.disk.proven == few.delay.proven == 0.0 < few.disk.found


@pytest.mark.parametrize(
    ("loop_of", "message"),
    [
        (
            lambda v: control.frequency_response(servo(v | {"p": 1.0}), [1.0, 2.0]),
            "has no states; give a model",
        ),
        (lambda v: control.ss(-np.eye(2), np.eye(2), np.eye(2), 0.0), "one loop at a"),
        (
            lambda v: control.tf([1.0], [1.0] * (2 + (v["K"] > 2.5))),
            "number of states or the period",
        ),
        (lambda v: diagram_of(v | {"p": 1.0})[0], "port: is missing"),
    ],
)
def test_wrong_families_are_refused(loop_of, message):
    with pytest.raises(InputError, match=message):
        phonotaxis.worst_margins(loop_of, {"K": (1.0, 3.0)})
