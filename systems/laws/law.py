"""The record of a law. All lists of laws are made from these records."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Literal

from systems.framework.parameters import Parameters

#: Columns of the port ``forces_W`` of a law's block.
FORCE_COLUMNS = "attraction_x", "attraction_y", "repulsion_x", "repulsion_y"

#: Kinds of robots; each law belongs to one.
RobotKind = Literal["follower", "router", "odor_searcher", "sound_searcher"]


@dataclass(frozen=True)
class Equation:
    """A formula of a law."""

    title: str
    """Title of the formula."""
    tex: str
    """Formula in matplotlib's subset of TeX, without dollar signs."""
    text: str
    """Formula in plain text."""


def _always_at_rest(gains: Any) -> float:
    """Returns the spring speed of a law whose velocity term is 0 at rest, m/s."""
    return 0.0


@dataclass(frozen=True)
class Tuning:
    """How ``phonotaxis design`` derives the gains of a law from requirements."""

    rule: Literal["barrier", "matched"]
    """How the gains follow from the requirements.

    ``barrier``: the first gain of ``Law.loop_gains`` follows from the required barrier.
    The push must be proportional to this gain. The second gain follows from the energy
    that the velocity term may return to the motion. ``matched``: the rule of the active
    law of 2019. It suits laws that have the same gains."""
    stiffest: Callable[[Any, float], float]
    """Function of the gains and the sensors' least range in m. It returns the largest
    -df/dc for an obstacle at rest, N/m."""
    spring_speed: Callable[[Any], float] = _always_at_rest
    """Function of the gains. It returns the speed s at which f(c, s) has only its
    spring term, m/s."""
    sets_follow_distance: bool = False
    """Whether the design chooses a follow distance that allows for the push of the law.
    For a law without a limit of reach this choice makes no sense, because the push acts
    at every useful follow distance."""


@dataclass(frozen=True)
class Law:
    """One law. ``systems.laws.catalogue`` lists them all."""

    name: str
    """Name of the law in scenarios."""
    title: str
    """Heading in reports."""
    label: str
    """Label in the legends of pictures."""
    equations: tuple[Equation, ...]
    """Equations for the model sheet."""
    force: Callable[..., Any] | None = None
    """Function ``force(c, s, gains)``: push away from an obstacle, N.

    The function takes a distance in m and a speed in m/s, floats or AutoDiffXd. Its
    part f(c, 0) has a potential energy. None: the block of the law decides on a motion
    instead of a force, so that the law has no linear model."""
    least_range: bool = False
    """Whether ``force`` takes the sensors' least range, m, as a fourth argument."""
    gains: type[Parameters] | None = None
    """Model of the gains. Every field has a default."""
    controller_name: str = ""
    """Class name of the law's block in ``systems``. If it is empty,
    ``RadialLawController`` runs the force."""
    loop_gains: tuple[str, str] | None = None
    """Names of the gains of the distance term and the velocity term, for root loci."""
    tuning: Tuning | None = None
    """How the design chooses the gains. None: there are no gains to choose."""
    robot: RobotKind = "follower"
    """Kind of the robot that runs the law. A ``follower`` follows a sound, a ``router``
    drives to a goal on a planned route, and a searcher searches step by step."""
    guarded: bool = False
    """Whether the robot of this law always has the guard."""
    colour: str | None = None
    """Color in pictures. None: the next color of the palette."""

    @property
    def controller(self) -> type | None:
        """Class of the law's block, or None if the law names none.

        The class may take the arguments ``gains``, ``velocity_term``, ``robot``,
        ``attraction``, ``sensors``, ``tick_s``, ``guard`` (parameters of the map),
        ``bodies`` (number of bodies), and ``seed``. This property imports the class
        when it is read. Therefore the check of a scenario needs no Drake and no
        compiled code.
        """
        if not self.controller_name:
            return None
        return getattr(import_module("systems"), self.controller_name)

    def arguments(self, gains: Any, least_range_m: float) -> tuple[Any, ...]:
        """Returns the arguments of ``force`` after c and s.

        Args:
            gains: Gains of the law, or None for the default gains.
            least_range_m: Least range of the sensors, m.

        Returns:
            The gains, or None for a law without gains. If ``least_range`` is true, the
            least range in m follows.
        """
        if gains is None and self.gains is not None:
            gains = self.gains()
        return (gains, least_range_m) if self.least_range else (gains,)
