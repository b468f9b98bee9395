"""Uncertain parameters of the robot, and their effects on the poles of its loops.

A loop is represented by a function from parameter values to poles in the z plane. The
code that evaluates this function does not depend on the operating point or on the
meaning of the parameters.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.loops.contact_mode import contact_model
from analysis.loops.equilibria import nearest_equilibrium
from analysis.loops.force_field import ForceField
from analysis.loops.ideal_loop import ideal_loop
from analysis.loops.linear_models import damping_ratio, growth_per_s, s_plane
from analysis.loops.operating_points import OperatingPoint, resting_equilibrium
from analysis.loops.radial_law import radial_law
from diagrams import Scenario
from diagrams.scenario.scenario import scenario_from_mapping
from systems.framework.input_error import InputError

#: Function from parameter values by name to poles in the z plane. It leaves out poles
#: that are at z = 1 for all values, such as that of the heading at rest.
PoleFunction = Callable[[Mapping[str, float]], NDArray[np.complex128]]

#: Step of the finite differences, as a share of the parameter's interval.
_STEP = 1e-3
#: Range of air temperatures, which bounds the speed of sound, deg C.
_TEMPERATURES_C = (5.0, 35.0)


@dataclass(frozen=True)
class UncertainParameter:
    """Parameter that is known only to lie in an interval."""

    name: str
    """Name of a field of the scenario, or another name that the pole function knows."""
    symbol: str
    unit: str
    nominal: float
    low: float
    high: float
    reason: str
    """Reason for the width of the interval."""
    whole: bool = False
    """Whether only whole numbers are possible."""
    scaled: bool = True
    """Whether the interval grows if the box is scaled. If not, or if only whole numbers
    are possible, the interval is always the whole one."""

    def __post_init__(self) -> None:
        if not self.low <= self.nominal <= self.high or self.low == self.high:
            raise InputError(
                f"{self.name}",
                f"{self.nominal:g} is not within [{self.low:g}, {self.high:g}], or "
                "its ends are equal; correct the interval",
            )


#: Share of the true wheel radius, which the encoders do not measure.
WHEEL_RADIUS = UncertainParameter(
    "wheel_radius_share", "r", "1", 1.0, 0.98, 1.02,
    "true radius over stated radius: wear, pressure",
)  # fmt: skip
#: Reason for the width of the interval of the motor lag.
LAG_REASON = "not printed; load, battery"


@dataclass(frozen=True)
class PoleCloud:
    """Poles at random and at the worst combinations of uncertain parameters."""

    period_s: float
    parameters: tuple[UncertainParameter, ...]
    nominal_poles: NDArray[np.complex128]
    """Poles at the nominal values, in the z plane."""
    values: NDArray[np.float64]
    """(samples, parameters) random values of the parameters."""
    poles: tuple[NDArray[np.complex128], ...]
    """Poles of each sample, in the z plane."""
    worst_values: dict[str, float]
    """Values of the worst case that was found: slowest decay or fastest growth."""
    worst_poles: NDArray[np.complex128]
    """Poles in the worst case, in the z plane."""

    @property
    def radii(self) -> NDArray[np.float64]:
        """(samples,) largest |z| of each sample."""
        return np.array([np.abs(poles).max() for poles in self.poles])

    @property
    def nominal_radius(self) -> float:
        """Largest |z| at the nominal values."""
        return float(np.abs(self.nominal_poles).max())

    @property
    def worst_radius(self) -> float:
        """Largest |z| in the worst case. Below 1, no unstable case was found."""
        return float(np.abs(self.worst_poles).max())

    @property
    def stable_share(self) -> float:
        """Share of stable samples, 0 to 1."""
        return float(np.mean(self.radii < 1.0))

    @property
    def worst_damping_ratio(self) -> float:
        """Damping ratio of the slowest pole in the worst case."""
        return float(damping_ratio(slowest_pole(self.worst_poles, self.period_s)))

    @property
    def nominal_damping_ratio(self) -> float:
        """Damping ratio of the slowest pole at the nominal values."""
        return float(damping_ratio(slowest_pole(self.nominal_poles, self.period_s)))

    @property
    def worst_growth_per_s(self) -> float:
        """Growth rate in the worst case, 1/s; negative if the motion decays."""
        return float(growth_per_s(self.worst_radius, self.period_s))


@dataclass(frozen=True)
class PoleSensitivity:
    """Sensitivity of the slowest pole to one parameter."""

    parameter: UncertainParameter
    pole: complex
    """Slowest pole ln(z)/T at the nominal values, 1/s."""
    derivative: complex
    """Derivative of the pole by the parameter, in 1/s per unit of the parameter."""
    per_interval: complex
    """Derivative times the width of the parameter's interval, 1/s."""


def slowest_pole(poles: NDArray[np.complex128], period: float) -> complex:
    """Returns the pole with the largest |z|, converted to the s plane, 1/s.

    ``poles`` are in the z plane, and ``period`` is the control period, s. Of a
    conjugate pair, the pole with the positive imaginary part is returned.
    """
    pole = complex(s_plane(poles[[np.argmax(np.abs(poles))]], period)[0])
    return pole if pole.imag >= 0.0 else pole.conjugate()


def pole_cloud(
    poles: PoleFunction,
    parameters: Sequence[UncertainParameter],
    *,
    period: float,
    samples: int,
    seed: int,
) -> PoleCloud:
    """Computes the poles at random parameter values and searches for the worst values.

    The random values are a Latin hypercube. A search for the worst corner begins at the
    nominal values. It moves one parameter at a time to an end of its interval, and
    keeps each move that slows the decay. The search finds the worst corner if each
    parameter changes the decay in one direction only, whatever the values of the other
    parameters are. The worst case is the worse of this corner and the worst sample.
    ``period`` is the control period, s.
    """
    from scipy.stats import qmc

    low = np.array([p.low for p in parameters])
    high = np.array([p.high for p in parameters])
    unit = qmc.LatinHypercube(len(parameters), rng=np.random.default_rng(seed))
    values = low + unit.random(samples) * (high - low)
    whole = np.array([p.whole for p in parameters])
    values = np.where(whole, np.round(values), values)
    found = [poles(_named(parameters, row)) for row in values]
    candidates = [*zip(values, found, strict=True), _worst_corner(poles, parameters)]
    worst, worst_poles = max(candidates, key=lambda item: _radius(item[1]))
    return PoleCloud(
        period,
        tuple(parameters),
        poles({p.name: p.nominal for p in parameters}),
        values,
        tuple(found),
        _named(parameters, worst),
        worst_poles,
    )


def _named(
    parameters: Sequence[UncertainParameter], row: NDArray[np.float64]
) -> dict[str, float]:
    return {p.name: float(value) for p, value in zip(parameters, row, strict=True)}


def _radius(poles: NDArray[np.complex128]) -> float:
    return float(np.abs(poles).max())


def _worst_corner(
    poles: PoleFunction, parameters: Sequence[UncertainParameter]
) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
    best = np.array([p.nominal for p in parameters])
    best_poles = poles(_named(parameters, best))
    improved = True
    while improved:
        improved = False
        for k, parameter in enumerate(parameters):
            for end in {parameter.low, parameter.high} - {best[k]}:
                trial = best.copy()
                trial[k] = end
                trial_poles = poles(_named(parameters, trial))
                if _radius(trial_poles) > _radius(best_poles) + 1e-12:
                    best, best_poles, improved = trial, trial_poles, True
    return best, best_poles


def pole_sensitivities(
    poles: PoleFunction, parameters: Sequence[UncertainParameter], *, period: float
) -> tuple[PoleSensitivity, ...]:
    """Computes the derivatives of the slowest pole by finite differences.

    The differences are central, with two exceptions. If the nominal value is an end of
    the interval, the parameter varies only toward the inside. A parameter with whole
    numbers varies over its whole interval. After a variation, the pole nearest to the
    nominal pole counts as the same pole. This is valid for simple poles. ``period`` is
    the control period, s.
    """
    nominal = {p.name: p.nominal for p in parameters}
    pole = slowest_pole(poles(nominal), period)
    rows = []
    for p in parameters:
        step = (1.0 if p.whole else _STEP) * (p.high - p.low)
        ends = (max(p.nominal - step, p.low), min(p.nominal + step, p.high))
        moved = [
            _nearest(s_plane(poles({**nominal, p.name: end}), period), pole)
            for end in ends
        ]
        derivative = (moved[1] - moved[0]) / (ends[1] - ends[0])
        change = derivative * (p.high - p.low)
        rows.append(PoleSensitivity(p, pole, derivative, change))
    return tuple(rows)


def _nearest(poles: NDArray[np.complex128], pole: complex) -> complex:
    return complex(poles[np.argmin(np.abs(poles - pole))])


def following_uncertainty(scenario: Scenario) -> tuple[UncertainParameter, ...]:
    """Returns the uncertain parameters of the loop that follows the source."""
    common = (p for p in _common(scenario) if p.name != "extra_ticks")
    return (*common, _sound_speed(scenario))


def contact_uncertainty(scenario: Scenario) -> tuple[UncertainParameter, ...]:
    """Returns the uncertain parameters of the motion straight toward an obstacle.

    Raises InputError if the push of the law does not grow toward the obstacle.
    """
    stiffness = radial_law(scenario).stiffest_n_m
    if stiffness <= 0.0:
        raise InputError(
            "law",
            f"{scenario.only.law!r} does not push harder as an obstacle comes nearer, "
            "so that it has no contact mode; choose another law",
        )
    law = within_share(
        "law_stiffness_n_m", "K_law", "N/m", stiffness, 0.1, "largest slope -df/dc"
    )
    return (*_common(scenario), law)


def _common(scenario: Scenario) -> tuple[UncertainParameter, ...]:
    gains, robot = scenario.follower.attraction, scenario.only.robot
    printed = "printed without unit"
    shares = (
        ("robot.mass_kg", "M", "kg", robot.mass_kg, 0.1, "virtual mass, as set"),
        ("attraction.stiffness_n_m", "K_r", "N/m", gains.stiffness_n_m, 0.1, printed),
        ("attraction.damping_n_s_m", "D_r", "N s/m", gains.damping_n_s_m, 0.1, printed),
        (
            "plant.motor_lag_s", "lag", "s", scenario.only.plant.motor_lag_s, 0.4,
            LAG_REASON,
        ),
    )  # fmt: skip
    return (
        # A parameter with the value zero is left out: the robot has no such spring,
        # damper or lag.
        *(within_share(*row) for row in shares if row[3] > 0.0),
        WHEEL_RADIUS,
        extra_tick(scenario),
    )


def extra_tick(scenario: Scenario) -> UncertainParameter:
    """Returns the uncertain latency of one tick."""
    return UncertainParameter(
        "extra_ticks", "latency", f"{scenario.tick_s * 1e3:g} ms", 0.0, 0.0, 1.0,
        "a processor that needs one more tick; whole ticks", whole=True,
    )  # fmt: skip


def within_share(
    name: str, symbol: str, unit: str, nominal: float, share: float, reason: str
) -> UncertainParameter:
    """Returns a parameter that is within a share of its nominal value, both ways."""
    low, high = nominal * (1.0 - share), nominal * (1.0 + share)
    return UncertainParameter(name, symbol, unit, nominal, low, high, reason)


def _sound_speed(scenario: Scenario) -> UncertainParameter:
    c = scenario.sound_speed_m_s
    ends = [331.5 + 0.6 * t for t in _TEMPERATURES_C]
    return UncertainParameter(
        "sound_speed_m_s", "c", "m/s", c, min(c, ends[0]), max(c, ends[1]),
        "air of 5 to 35 deg C, while the estimator assumes one speed",
    )  # fmt: skip


def with_values(scenario: Scenario, values: Mapping[str, float]) -> Scenario:
    """Returns a validated copy with uncertain parameters at given values, in SI units.

    The name of a parameter determines its effect:

    - A name with a dot is a field of the scenario.
    - ``wheel_radius_share`` is the true over the stated wheel radius. It acts as the
      slip 1 - ``wheel_radius_share`` of both wheels, which the encoders do not measure.
    - ``sound_speed_m_s`` is the true speed of sound. It multiplies the stiffness of the
      attraction by ``range_slope``.
    - All other names are ignored here.
    """
    data = scenario.model_dump()
    for name, value in values.items():
        *groups, field = name.split(".")
        node: dict[str, Any] = data
        for group in groups:
            node = node[group]
        if groups:
            node[field] = value
    if "wheel_radius_share" in values:
        data["plant"]["slip"] = [1.0 - values["wheel_radius_share"]] * 2
    if "sound_speed_m_s" in values:
        slope = range_slope(scenario, values["sound_speed_m_s"])
        data["attraction"]["stiffness_n_m"] *= slope
    return scenario_from_mapping(data)


def range_slope(scenario: Scenario, true_speed: float) -> float:
    """Returns the derivative of the estimated range by the true range of a source.

    The source is straight ahead at the follow distance. Let l be half the length of the
    row of microphones, R the true range, h^2 = R^2 + l^2, and k the ratio of the speed
    of sound that the estimator assumes to ``true_speed``, m/s. From the measured delay,
    the estimator computes the range

        l^2/(2 k (h - R)) - k (h - R)/2.

    Its derivative by R is ((h + R)/k + k (h - R))/(2 h), which is 1 for k = 1.
    """
    k = scenario.believed_sound_speed_m_s / true_speed
    half = max(abs(y) for _, y in scenario.only.robot.microphones_m)
    distance = scenario.follower.attraction.follow_distance_m
    h = math.hypot(distance, half)
    return ((h + distance) / k + k * (h - distance)) / (2.0 * h)


def contact_poles(scenario: Scenario) -> PoleFunction:
    """Returns a function for the z-plane poles of the motion toward an obstacle.

    The robot is at the distance from the obstacle at which the law is stiffest.
    """

    def poles(values: Mapping[str, float]) -> NDArray[np.complex128]:
        changed = with_values(scenario, values)
        stiffness = changed.follower.attraction.stiffness_n_m + values.get(
            "law_stiffness_n_m", 0.0
        )
        late = round(values["extra_ticks"])
        return contact_model(changed, stiffness, latency_ticks=late).poles

    return poles


def following_poles(at: OperatingPoint) -> PoleFunction:
    """Returns a function for the z-plane poles of the motion about an equilibrium.

    The equilibrium moves with the parameters. Neutral poles (z = 1) are left out. The
    latency of hearing is not a parameter. The tracker combines each measurement with
    the pose, from odometry, at which the robot heard the sound. A latency therefore
    delays the response to motion of the source, but not the feedback of the robot's own
    motion.
    """

    def poles(values: Mapping[str, float]) -> NDArray[np.complex128]:
        loop = ideal_loop(with_values(at.loop.scenario, values))
        place = nearest_equilibrium(ForceField(loop), at.p_WP)
        if place is None:
            raise InputError(
                "attraction",
                f"with {dict(values)} the equilibrium at ({at.p_WP[0]:.3f},"
                f" {at.p_WP[1]:.3f}) m is gone; narrow the box",
            )
        moved = resting_equilibrium(loop, place)
        return np.asarray(np.exp(moved.eigenvalues * loop.tick_s))

    return poles
