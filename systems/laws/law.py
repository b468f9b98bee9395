"""What a law says of itself, once: all lists of laws are made from these records."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Literal

from systems.framework.parameters import Parameters

#: Columns of the port ``forces_W`` of a law's block.
FORCE_COLUMNS = "attraction_x", "attraction_y", "repulsion_x", "repulsion_y"


@dataclass(frozen=True)
class Equation:
    """A formula."""

    title: str
    """What it is."""
    tex: str
    """In matplotlib's subset of TeX, without the dollar signs."""
    text: str
    """The same in plain signs."""


def _always_at_rest(gains: Any) -> float:
    """Of a velocity term that is nothing at rest, m/s."""
    return 0.0


@dataclass(frozen=True)
class Tuning:
    """How ``phonotaxis design`` finds a law's gains from requirements."""

    rule: Literal["barrier", "matched"]
    """``barrier``: the first of ``Law.loop_gains``, to which the push is
    proportional, holds the barrier, and the second puts back the energy allowed.
    ``matched``: a law with the gains of the active law of 2019, its way."""
    stiffest: Callable[[Any, float], float]
    """Largest -df/dc at rest, N/m, from gains and the sensors' least range, m."""
    spring_speed: Callable[[Any], float] = _always_at_rest
    """The speed s, from the gains, at which f(c, s) is the spring alone, m/s."""
    sets_follow_distance: bool = False
    """Whether a follow distance has to allow for the law's push: not for one
    without an end, which pushes a robot off any distance worth following at."""


@dataclass(frozen=True)
class Law:
    """One law. ``systems.laws.catalogue`` lists them all."""

    name: str
    """As in ``Scenario.law`` and, of its gains, in ``Scenario.repulsion``."""
    title: str
    """Heading in reports."""
    label: str
    """In the legends of pictures."""
    equations: tuple[Equation, ...]
    """For the model sheet."""
    force: Callable[..., Any] | None = None
    """``force(c, s, gains)``: push away from an obstacle, N.

    It takes a distance in m and a speed in m/s, floats or AutoDiffXd. Its part f(c, 0)
    has an energy. A law whose block decides on a motion has no force."""
    least_range: bool = False
    """Whether ``force`` takes the sensors' least range, m, as a fourth argument."""
    gains: type[Parameters] | None = None
    """Model of its gains; every field has a default."""
    controller_name: str = ""
    """Name of its block's class in ``systems``; without one ``RadialLawController``
    runs the force."""
    loop_gains: tuple[str, str] | None = None
    """Gains of the distance term and of the velocity term, for root loci."""
    tuning: Tuning | None = None
    """None for a law without gains to choose."""
    plans: bool = False
    """Whether its block decides on a motion in the place of a force: it may ask for
    ``following``, ``known``, the map's parameters, ``bodies``, how many there are, and
    ``seed``, too, and has no linear model."""
    on_route: bool = False
    """Whether it drives to a goal on a planned way, in the place of following a
    sound; it then ``plans``, too."""
    searches: Literal["odor", "sound"] | None = None
    """What it searches for step by step, in the place of following a sound; it then
    ``plans``, too."""
    guarded: bool = False
    """Whether its robot is always guarded."""
    colour: str | None = None
    """In pictures; none: the next one of the palette."""

    @property
    def controller(self) -> Callable[..., Any] | None:
        """Class of its block, if the law names one.

        The class takes robot, attraction, repulsion and sensors. It is loaded on the
        first call: the check of a scenario needs neither Drake nor compiled code.
        """
        if not self.controller_name:
            return None
        return getattr(import_module("systems"), self.controller_name)

    def arguments(self, repulsion: Any, least_range_m: float) -> tuple[Any, ...]:
        """What ``force`` takes after c and s.

        Args:
            repulsion: ``RepulsionParameters``.
            least_range_m: Least range of the sensors, m.

        Returns:
            The gains, or None where the law has none; then the least range, m, where it
            counts.
        """
        gains: Any = None
        if self.gains is not None:
            gains = getattr(repulsion, self.name)
        return (gains, least_range_m) if self.least_range else (gains,)
