"""Draws the frames of a movie, with moving bodies on a constant background."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.patches import Circle, Polygon, Wedge
from numpy.typing import NDArray

from analysis.reporting.palette import COLOURS
from analysis.views.picture import map_axes
from analysis.views.scene import (
    compose,
    contact_point,
    followed_sources,
    logged_sensors,
    looks,
    moving_and_static,
    run_title,
    sensor_pose,
    sound_bursts,
    tick_at,
)
from analysis.views.trajectory_artists import draw_room
from diagrams import RunResult
from diagrams.scenario.bodies import microphones_W, robot_rectangle
from systems.world.geometry import rectangle_corners

#: Resolution of the frames, dots per inch. The frames are 8 inches wide.
DPI = 90
#: Rings around a source while it sounds. ``RING_S``: time between two rings, s.
#: ``RING_M_S``: growth of the radius, m/s; sound is about a hundred times faster.
#: ``RING_M``: largest radius, m.
RING_S, RING_M_S, RING_M = 0.15, 3.0, 1.5


class RunFrames:
    """Draws a run from above at any time of the run.

    The picture shows:

    - robots with their microphones, sensor cones and paths
    - sources, with rings while they sound
    - the source position that each robot estimates
    - obstacles, walls, and touched bodies

    Args:
        result: Result of the run.
    """

    def __init__(self, result: RunResult) -> None:
        self._result, self._looks = result, looks(result)
        self._moving, static = moving_and_static(result.full_scenario)
        figure, self._axes = map_axes(result)
        figure.set_dpi(DPI)
        self._canvas = FigureCanvasAgg(figure)
        self._axes.grid(color="#E5E5E5", linewidth=0.6)
        self._axes.set_title(run_title(result), fontsize=11, wrap=True)
        draw_room(self._axes, result)
        for obstacle in static:
            self._add_body([*obstacle.path().pose(0.0), *obstacle.size_m], "obstacle")
        figure.legend(
            handles=self._legend(),
            loc="lower center",
            ncols=4,
            fontsize=8.5,
            frameon=False,
        )
        self._axes.set_autoscale_on(False)
        self._canvas.draw()
        self._rest = self._canvas.copy_from_bbox(figure.bbox)

    def _legend(self) -> list[Any]:
        scenario = self._result.full_scenario
        followed = followed_sources(scenario)
        named = [(look.result.name, look.colour) for look in self._looks]
        named += [
            (name, COLOURS["source" if name in followed else "interferer"])
            for name in scenario.sources
        ]
        if scenario.obstacles:
            named.append(("obstacles", COLOURS["obstacle"]))
        if "target_valid" in self._result.columns:
            named.append(("estimates", self._looks[0].estimates))
        return [
            Polygon(np.zeros((1, 2)), closed=True, color=colour, label=name)
            for name, colour in named
        ]

    def _add_body(self, rectangle: Any, role: str, **style: Any) -> Polygon:
        corners = rectangle_corners(np.asarray(rectangle, dtype=float))
        colour = COLOURS.get(role, role)
        patch = Polygon(corners, color=colour, zorder=3.0, **style)
        self._axes.add_patch(patch)
        return patch

    def frames(self, frames_per_s: float) -> Iterator[NDArray[np.uint8]]:
        """Yields the frames of a movie. The last frame shows the end of the run.

        Args:
            frames_per_s: Number of frames per second of the run.

        Yields:
            (rows, columns, 3) red, green and blue values of each frame.
        """
        count = max(1, round(self._result.simulated_s * frames_per_s))
        for number in range(count):
            yield self.frame(min((number + 1) / frames_per_s, self._result.simulated_s))

    def frame(self, time: float) -> NDArray[np.uint8]:
        """Returns the frame at a time, s, in the format of ``frames``."""
        self._canvas.restore_region(self._rest)
        for artist in self._artists(time):
            self._axes.draw_artist(artist)
            artist.remove()
        clock = self._axes.text(
            0.99,
            0.98,
            f"{time:.1f} s",
            transform=self._axes.transAxes,
            ha="right",
            va="top",
            fontsize=12,
            zorder=20,
        )
        self._axes.draw_artist(clock)
        clock.remove()
        return np.asarray(self._canvas.buffer_rgba())[:, :, :3].copy()

    def _artists(self, time: float) -> list[Any]:
        """Adds the moving objects to the axes, and returns them in drawing order."""
        found: list[Any] = []
        for obstacle in self._moving:
            pose = obstacle.path().pose(time)
            found.append(self._add_body([*pose, *obstacle.size_m], "obstacle"))
        found += self._sources(time)
        for look in self._looks:
            found += self._robot(look.result, look.colour, look.estimates, time)
        for own in self._result.robots.values():
            if own.collision is not None and time >= own.collision.time:
                body = own.surroundings.bodies[own.collision.object]
                found.append(self._add_body(body.rectangle(own.collision.time), "hit"))
                x, y = contact_point(own)
                found += self._axes.plot(
                    x, y, "*", mfc="none", mec="black", mew=1.4, ms=19
                )
        return found

    def _sources(self, time: float) -> list[Any]:
        found: list[Any] = []
        scenario = self._result.full_scenario
        followed, sounds = followed_sources(scenario), scenario.sounds()
        for name, source in scenario.sources.items():
            role = "source" if name in followed else "interferer"
            pose = source.path().pose(time)
            if source.body:
                size = source.length_m, source.width_m
                found.append(self._add_body([*pose, *size], role, alpha=0.6))
            else:
                marker = self._axes.plot(*pose[:2], "D", color=COLOURS[role], ms=6)
                found += marker
            for start, end in sound_bursts(sounds[name], self._result.simulated_s):
                if start <= time < end + RING_M / RING_M_S:
                    since, lasts = time - start, end - start
                    found += self._rings(pose[:2], since, lasts, COLOURS[role])
        return found

    def _rings(
        self, center: tuple[float, float], since: float, lasts: float, color: str
    ) -> list[Any]:
        """Adds the rings of a burst, for the time since its start and its length, s."""
        found = []
        for left in np.arange(0.0, min(since, lasts), RING_S):
            radius = RING_M_S * (since - left)
            if radius < RING_M:
                circle = Circle(
                    center,
                    radius,
                    fill=False,
                    edgecolor=color,
                    linewidth=1.8,
                    alpha=1.0 - radius / RING_M,
                )
                found.append(self._axes.add_patch(circle))
        return found

    def _robot(
        self, own: RunResult, colour: str, estimates: str, time: float
    ) -> list[Any]:
        tick, scenario = tick_at(own, time), own.scenario
        pose = own.poses("WB")[tick]
        found: list[Any] = []
        for sensor in logged_sensors(own):
            echo = own.columns[f"echo_{sensor + 1}"][tick] > 0.5
            x, y, theta = compose(pose, sensor_pose(scenario, sensor))
            half = scenario.sensing.ultrasonic.sensors[sensor].beam_half_angle_deg
            axis = np.degrees(theta)
            cone = Wedge(
                (float(x), float(y)),
                float(own.columns[f"range_{sensor + 1}"][tick]),
                axis - half,
                axis + half,
                facecolor=(*to_rgb(COLOURS["echo" if echo else "empty"]), 0.2),
            )
            found.append(self._axes.add_patch(cone))
        way = own.vector("p_WP")[:, : tick + 1]
        found += self._axes.plot(*way, color=colour, linewidth=1.6)
        found.append(
            self._add_body(
                robot_rectangle(pose, scenario.only.robot), colour, alpha=0.55
            )
        )
        if scenario.only.kind != "router" and scenario.only.searches != "odor":
            bar = microphones_W(pose, scenario.only.robot).T
            found += self._axes.plot(*bar, "-o", color=colour, ms=3.2, lw=2.0)
        if "target_valid" in own.columns and own.columns["target_valid"][tick] > 0.5:
            x, y = own.vector("p_WS_estimated")[:, tick]
            found += self._axes.plot(x, y, "x", color=estimates, ms=9, mew=2.2)
        return found
