"""Names of the elements of the diagram's state vector."""

from __future__ import annotations

from itertools import chain

from diagrams.builder import SoundFollower
from systems.hearing.target_filter import HYPOTHESIS, TRACK
from systems.ranging.collision_vector import SLOTS

__all__ = ["state_names"]

_POSE = ("x", "y", "theta")
_TRACK = (
    "age", "x", "y", "vx", "vy", "Axx", "Axy", "Ayy", "Cxx", "Cxy", "Cyx", "Cyy",
    "Vxx", "Vxy", "Vyy", "scatter",
)  # fmt: skip
_TRACKER_POSES = ("pose_1", "pose_2", "pose_heard")

#: Elements of each role's state, in the order in which its block declares them.
_NAMES: dict[str, tuple[str, ...]] = {
    "plant": (
        *_POSE, "angle_left", "angle_right", "speed_left", "speed_right",
    ),
    "odometry": (*_POSE, "angle_left", "angle_right"),
    "hearing": ("p_PS_B_x", "p_PS_B_y", "detected"),
    "command": ("v_WP_x", "v_WP_y", "wheel_left", "wheel_right"),
    "controller": tuple(
        f"{name}_{slot}"
        for slot in range(1, SLOTS + 1)
        for name in ("feature", "C_x", "C_y")
    ),
}  # fmt: skip


def _tracker_names(size: int) -> tuple[str, ...]:
    poses = [f"{pose}_{axis}" for pose in _TRACKER_POSES for axis in _POSE]
    hypotheses = (size - len(poses) - 1) // HYPOTHESIS
    memory = chain.from_iterable(
        (
            f"hypothesis_{k}_cost",
            f"hypothesis_{k}_outliers",
            *(f"track_{k}_{name}" for name in _TRACK),
            *(f"outlier_track_{k}_{name}" for name in _TRACK),
        )
        for k in range(hypotheses)
    )
    return (*poses, "chosen", *memory)


def state_names(follower: SoundFollower) -> tuple[str, ...]:
    """``role.element`` of every state: continuous first, then discrete.

    A block that is not known here, as a user's own law, has its elements
    numbered.
    """
    assert len(_TRACK) == TRACK
    context = follower.diagram.CreateDefaultContext()
    continuous: list[str] = []
    discrete: list[str] = []
    for role, block in follower.blocks.items():
        own = block.GetMyContextFromRoot(context)
        size = own.num_total_states()
        names = _tracker_names(size) if role == "tracker" else _NAMES.get(role, ())
        if len(names) != size:
            names = tuple(f"state_{k}" for k in range(size))
        kind = continuous if own.num_continuous_states() else discrete
        kind.extend(f"{role}.{name}" for name in names)
    return (*continuous, *discrete)
