"""How well a burst is located in reverberant rooms, over random layouts.

Robot and source rest. A burst reaches the microphones through the room's
response, frames go through the converter, ``systems.hearing.localize`` and the tracker,
as they do in the diagram, and what the tracker holds when the burst is over is
compared with the truth. No diagram is built, so that a layout costs little more
than its response.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.report.intervals import Estimate, estimate_rate
from diagrams.scenario.bodies import microphones_W
from systems.base.robot import RobotParameters
from systems.framework.noise import frame_noise, tick_generator
from systems.framework.signals import FRAME_SAMPLES, SAMPLE_RATE_HZ, TICK_S
from systems.hearing.localize import Localizer
from systems.hearing.parameters import TDOAParameters, TrackerParameters
from systems.hearing.tdoa_estimator import port_values, robot_localizer
from systems.hearing.tracking.tracker_model import (
    TrackerNumbers,
    blank_track,
    track_step,
    tracker_numbers,
)
from systems.sound.acoustics import SOUND_SPEED_M_S
from systems.sound.adc import convert
from systems.sound.parameters import MicArrayParameters, RoomParameters, SoundParameters
from systems.sound.room import room_images, room_impulse_responses
from systems.sound.waveforms import make_waveform
from systems.world.geometry import rotate

#: Least distance of source and microphones from a wall, m.
WALL_M = 0.5
#: Sources nearer than this are seen, not heard, m.
LEAST_RANGE_M = 0.5
#: Largest bearing to either side, deg.
LARGEST_BEARING_DEG = 60.0
#: What counts as located: largest error of the bearing, deg, and of the range,
#: as a share of it.
BEARING_WITHIN_DEG = 2.0
RANGE_WITHIN = 0.1


@dataclass(frozen=True)
class Layout:
    """A robot and a source at rest."""

    pose_WB: NDArray[np.float64]
    """(3,) x, y, theta."""
    p_WS: NDArray[np.float64]
    """(2,) m."""
    range_m: float
    """Of the source from M2, m."""
    bearing_deg: float
    """deg."""


@dataclass(frozen=True)
class RoomResult:
    """Errors of the bursts in some layouts."""

    layouts: list[Layout]
    bearing_errors_deg: NDArray[np.float64]
    """(n,); NaN where nothing was heard."""
    range_errors: NDArray[np.float64]
    """(n,) over the true range; NaN where nothing was heard."""

    @property
    def heard(self) -> NDArray[np.bool_]:
        """(n,) whether any frame was believed."""
        return np.isfinite(self.bearing_errors_deg)

    @property
    def located(self) -> NDArray[np.bool_]:
        """(n,) whether bearing and range are within their limits."""
        return (np.abs(self.bearing_errors_deg) <= BEARING_WITHIN_DEG) & (
            np.abs(self.range_errors) <= RANGE_WITHIN
        )

    @property
    def located_rate(self) -> Estimate:
        """Share that is located, with Wilson's 95 % interval."""
        return estimate_rate(int(self.located.sum()), len(self.layouts))


def draw_layouts(
    room: RoomParameters, largest_range_m: float, count: int, seed: int
) -> Iterator[Layout]:
    """Layouts at random: robot anywhere in any heading, source within 60 deg.

    Args:
        room: Its floor bounds them.
        largest_range_m: Farthest source, m; ranges are uniform up to it.
        count: How many.
        seed: Decides them.

    Yields:
        ``count`` layouts; source and microphones are at least WALL_M from the walls.
    """
    generator = tick_generator(seed, 0)
    robot = RobotParameters()
    low = np.array(room.corner) + WALL_M
    high = low + np.array(room.size_m[:2]) - 2.0 * WALL_M
    found = 0
    while found < count:
        x, y = generator.uniform(low, high)
        theta = generator.uniform(-math.pi, math.pi)
        bearing = math.radians(LARGEST_BEARING_DEG) * generator.uniform(-1.0, 1.0)
        distance = generator.uniform(LEAST_RANGE_M, largest_range_m)
        ahead = rotate(theta, robot.control_point_m, 0.0)
        away = rotate(theta + bearing, distance, 0.0)
        p_WS = np.array([x + ahead[0] + away[0], y + ahead[1] + away[1]])
        pose = np.array([x, y, theta])
        places = np.vstack((microphones_W(pose, robot), p_WS))
        if ((places >= low) & (places <= high)).all():
            found += 1
            yield Layout(pose, p_WS, distance, math.degrees(bearing))


def locate_bursts(
    room: RoomParameters,
    sound: SoundParameters,
    layouts: list[Layout],
    *,
    parameters: TDOAParameters | None = None,
    tracking: TrackerParameters | None = None,
    snr_db_at_1m: float = 30.0,
    seed: int = 0,
) -> RoomResult:
    """Locates one burst in each layout.

    Args:
        room: The walls.
        sound: What is played, once.
        layouts: Where robot and source stand.
        parameters: Of the estimator.
        tracking: Of the tracker; here every source counts as in front.
        snr_db_at_1m: As of ``MicArrayParameters``.
        seed: Of sound and noise.

    Returns:
        Errors of bearing, deg, and of range, as shares of it; NaN: nothing heard.
    """
    robot = RobotParameters()
    microphones = MicArrayParameters(snr_db_at_1m=snr_db_at_1m)
    images = room_images(room, SOUND_SPEED_M_S)
    burst = make_waveform(sound, seed)[: round(sound.on_s * SAMPLE_RATE_HZ)]
    localizer, p_PA_B = robot_localizer(
        parameters or TDOAParameters(), robot, SOUND_SPEED_M_S
    )
    tracker = tracker_numbers(
        tracking or TrackerParameters(), robot, 1.5 * TICK_S, resolve_front_back=False
    )
    errors = []
    for k, layout in enumerate(layouts):
        p_WM = microphones_W(layout.pose_WB, robot)
        response = room_impulse_responses(
            room, layout.p_WS, p_WM, SOUND_SPEED_M_S, images=images
        )
        frames = _frames(response, burst, microphones, seed + k)
        estimates = _estimates(frames, localizer, p_PA_B)
        errors.append(_errors(_tracked(estimates, tracker, layout.pose_WB), layout))
    bearing, distance = np.array(errors).T
    return RoomResult(layouts, bearing, distance)


def _frames(
    response: NDArray[np.float32],
    burst: NDArray[np.float32],
    microphones: MicArrayParameters,
    seed: int,
) -> Iterator[NDArray[np.int16]]:
    """(m, FRAME_SAMPLES) counts, until the burst has been emitted."""
    from scipy.signal import oaconvolve

    # Sound begins at any place of a frame, after some frames of noise alone.
    lead = int(tick_generator(seed, 1).integers(4, 5 * FRAME_SAMPLES)) + FRAME_SAMPLES
    frames = -(-(lead + len(burst)) // FRAME_SAMPLES)
    pressure = np.zeros((len(response), frames, FRAME_SAMPLES), dtype=np.float32)
    stream = pressure.reshape(len(response), -1)
    heard = oaconvolve(response, burst[np.newaxis], axes=1)
    length = min(heard.shape[1], stream.shape[1] - lead)
    stream[:, lead : lead + length] = heard[:, :length]
    noise_pa = float(
        np.sqrt(np.mean(burst**2)) * 10.0 ** (-microphones.snr_db_at_1m / 20.0)
    )
    for k in range(frames):
        part = np.ascontiguousarray(pressure[:, k])
        noise = frame_noise(part.shape, seed, k)
        yield convert(part, noise, noise_pa, microphones)


def _estimates(
    frames: Iterator[NDArray[np.int16]],
    localizer: Localizer,
    p_PA_B: NDArray[np.float64],
) -> Iterator[tuple[NDArray[np.float64], ...]]:
    """The estimate of each frame, as the tracker takes it."""
    memory = localizer.blank()
    for frame in frames:
        fix, memory = localizer.localize(frame, memory)
        yield port_values(fix, p_PA_B)[2:6]


def _tracked(
    estimates: Iterator[tuple[NDArray[np.float64], ...]],
    tracker: TrackerNumbers,
    pose: NDArray[np.float64],
) -> NDArray[np.float64] | None:
    """(2,) where the tracker of a robot at rest has the source at last, in W, m."""
    state, heard = blank_track(tracker, pose.tolist()), False
    outputs = tuple(np.zeros(size) for size in (2, 2, 4, 1, 1))
    for tick, estimate in enumerate(estimates):
        heard = heard or bool(estimate[2][0])
        track_step(tick, state, (*estimate, pose), outputs, tracker)
    # The target a tick after the last frame.
    silence = tuple(np.zeros(size) for size in (2, 4, 1, 1))
    track_step(0, state, (*silence, pose), outputs, tracker)
    return outputs[0] if heard else None


def _errors(p_WS: NDArray[np.float64] | None, layout: Layout) -> tuple[float, float]:
    """Error of the bearing in deg, and of the range over the true one."""
    if p_WS is None:
        return math.nan, math.nan
    robot = RobotParameters()
    x, y, theta = layout.pose_WB
    dx, dy = rotate(-theta, p_WS[0] - x, p_WS[1] - y)
    dx -= robot.control_point_m
    bearing = math.degrees(math.atan2(dy, dx)) - layout.bearing_deg
    bearing = math.remainder(bearing, 360.0)
    return bearing, math.hypot(dx, dy) / layout.range_m - 1.0
