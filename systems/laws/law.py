"""The record of a law. All lists of laws are made from these records."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Literal

from systems.framework.parameters import Parameters
from systems.laws.parameters import ImpedanceParameters

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
    """Rule that derives the gains from the requirements.

    ``barrier`` determines the two gains ``Law.loop_gains``. The first gain follows from
    the required barrier, which is the kinetic energy that the law must remove during an
    approach. The push must be proportional to this gain. The second gain follows from
    the energy that the velocity term may return to the motion.

    ``matched`` is the rule of the active law of 2019. It suits laws with the same gains
    as that law.
    """
    spring_speed: Callable[[Any], float] = _always_at_rest
    """Function of the gains. It returns the speed s, m/s, at which the force f(c, s)
    consists only of its spring term.
    """
    sets_follow_distance: bool = False
    """Whether the design chooses a follow distance at which the push of the law is
    weak.

    The value is false for a law without a limit of reach, because the push of such a
    law acts at every useful follow distance.
    """


@dataclass(frozen=True)
class Law:
    """One law. ``systems.laws.catalog`` lists them all."""

    name: str
    """Name of the law in scenarios."""
    title: str
    """Heading in reports."""
    label: str
    """Label in the legends of pictures."""
    equations: tuple[Equation, ...]
    """Equations for the model sheet."""
    force: Callable[..., Any] | None = None
    """Function ``force(c, s, gains)`` that returns the push away from an obstacle, N.

    c is a distance in m, and s is a speed in m/s; both are floats or AutoDiffXd. f(c,
    0) must have a potential energy. If the field is None, the law commands a motion
    instead of a force, and has no linear model.
    """
    least_range: bool = False
    """Whether ``force`` takes the sensors' least range, m, as a fourth argument."""
    gains: type[Parameters] | None = None
    """Model of the gains in ``laws.<name>``. Every field has a default."""
    impedance: type[ImpedanceParameters] | None = None
    """Model of all parameters of a law on planned routes: those in ``impedance`` and
    those in ``laws.<name>``."""
    controller_name: str = ""
    """Name of the class of the law's block in ``systems``. If it is empty, the block
    ``RadialLawController`` computes the force.
    """
    loop_gains: tuple[str, str] | None = None
    """Names of the gains of the distance term and the velocity term."""
    tuning: Tuning | None = None
    """How the design chooses the gains. None: there are no gains to choose."""
    robot: RobotKind = "follower"
    """Kind of the robot that runs the law. A ``follower`` follows a sound. A ``router``
    drives to a goal on a planned route. An ``odor_searcher`` or a ``sound_searcher``
    searches step by step.
    """
    guarded: bool = False
    """Whether the robot of this law always has the guard."""
    color: str | None = None
    """Color in pictures. None: the next color of the palette."""

    @property
    def controller(self) -> type | None:
        """Class of the law's block, or None if the law names no class.

        The class is imported only when the property is read, so that a scenario can be
        checked without Drake and without compiled code.

        The constructor of the class may take any of these arguments:

        - ``gains``
        - ``velocity_term``
        - ``robot``
        - ``attraction``
        - ``sensors``
        - ``tick_s``
        - ``guard``: parameters of the guard and its map
        - ``bodies``: number of bodies
        - ``seed``
        """
        if not self.controller_name:
            return None
        return getattr(import_module("systems"), self.controller_name)

    def arguments(self, gains: Any, least_range_m: float) -> tuple[Any, ...]:
        """Returns the arguments that the function ``force`` takes after c and s.

        The first argument is ``gains``. If ``gains`` is None, the default gains of the
        law replace it. For a law without gains, the first argument is None. If the
        field ``least_range`` is true, the second argument is the least range of the
        sensors, m.
        """
        if gains is None and self.gains is not None:
            gains = self.gains()
        return (gains, least_range_m) if self.least_range else (gains,)
