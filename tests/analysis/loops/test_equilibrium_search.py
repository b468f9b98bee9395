"""The search for places of rest against brute force, and where the robot can go.

The brute force has its own forces: distances from ``PointMass``, forces and energy of
``RadialLaw``, and solvers of scipy that begin in every cell of a dense grid.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.optimize import fsolve, minimize

from analysis.loops.equilibria import find_equilibria
from analysis.loops.force_field import ForceField
from analysis.loops.ideal_loop import ideal_loop
from analysis.loops.ideal_scenarios import ideal_scenario
from analysis.loops.point_mass import point_mass
from diagrams import load_scenario
from diagrams.scenario.scenario import Scenario
from systems.world.geometry import nearest_point_on_rectangle

LAWS = ("conventional", "active", "active2017", "conventional2017")
STEP_M = 0.02
#: The search vouches for three cells of 2 mm about each listed point.
KNOWN_M = 7e-3


def two_walls(law: str, **data) -> Scenario:
    """A resting source at the end of two walls 1.8 m apart."""
    walls = [
        {"name": name, "size_m": [3.0, 0.1], "waypoints_m": [[2.3, y]]}
        for name, y in (("left wall", 0.95), ("right wall", -0.95))
    ]
    return Scenario.model_validate(
        {"law": law, "source": {"waypoints_m": [[4.0, 0.0]]}, "obstacles": walls} | data
    )


def random_scene(seed: int, law: str) -> Scenario:
    """Two to four walls and boxes, turned any way, between the start and a source."""
    rng = np.random.default_rng(seed)
    obstacles = []
    for k in range(rng.integers(2, 5)):
        size = [3.0, 0.1] if rng.random() < 0.5 else rng.uniform(0.2, 0.8, 2).tolist()
        place = [rng.uniform(1.5, 4.0), rng.choice([-1.0, 1.0]) * rng.uniform(0.8, 1.5)]
        turned = float(rng.choice([0.0, rng.uniform(-90.0, 90.0)]))
        obstacles.append(
            {
                "name": f"body {k}",
                "size_m": size,
                "waypoints_m": [place],
                "heading_deg": turned,
            }
        )
    source = {"waypoints_m": [[rng.uniform(3.0, 4.5), rng.uniform(-0.5, 0.5)]]}
    return Scenario.model_validate(
        {"law": law, "source": source, "obstacles": obstacles}
    )


class BruteForce:
    """Forces of a scene, and all rests that solvers find from a dense grid."""

    def __init__(self, search):
        self.model = point_mass(search.scenario)
        x0, x1, y0, y1 = search.area_m
        self.x, self.y = np.arange(x0, x1, STEP_M), np.arange(y0, y1, STEP_M)
        grid = np.stack(np.meshgrid(self.x, self.y, indexing="ij"), axis=-1)
        self.shape = grid.shape[:2]
        self.points = grid.reshape(-1, 2)

    def each(self, points):
        """Distances (k, n) and forces (k, n, 2) as if each body were the nearest."""
        model = self.model
        to = model.p_WS - points
        far = np.linalg.norm(to, axis=-1, keepdims=True)
        pull = model.stiffness_n_m * (1.0 - model.follow_distance_m / far) * to
        distances, forces = [], []
        for body in model.rectangles:
            v = np.stack(nearest_point_on_rectangle(points.T, body), axis=-1)
            c = np.linalg.norm(v, axis=-1)
            push = model.law.at_rest(c)
            forces.append(pull - v / np.maximum(c, 1e-12)[:, None] * push[:, None])
            distances.append(c)
        return np.array(distances), np.array(forces)

    def minima(self):
        """Local minima of the potential, by Nelder and Mead from the grid's."""
        U = self.model.potential(self.points)
        U[self.model.clearances(self.points) < 0.02] = np.inf
        U = U.reshape(self.shape)
        inner = U[1:-1, 1:-1]
        least = np.isfinite(inner)
        for i in (0, 1, 2):
            for j in (0, 1, 2):
                shifted = U[i : i + inner.shape[0], j : j + inner.shape[1]]
                least &= inner <= shifted
        for i, j in np.argwhere(least) + 1:
            found = minimize(
                lambda p: float(self.model.potential(p[None])[0]),
                [self.x[i], self.y[j]],
                method="Nelder-Mead",
                options={"xatol": 1e-7, "fatol": 1e-12, "maxiter": 2000},
            )
            if self.model.clearances(found.x[None])[0] > 0.01:
                yield found.x

    def switches(self):
        """Where two bodies are equally near and their forces are opposed."""
        distances, forces = self.each(self.points)
        nearest = distances.min(axis=0)
        for a in range(len(distances)):
            for b in range(a):
                opposed = np.einsum("nj,nj->n", forces[a], forces[b]) < 0.0
                line = np.abs(distances[a] - distances[b]) <= 2.0 * STEP_M
                line &= np.minimum(distances[a], distances[b]) <= nearest + 2 * STEP_M
                (ax, ay), (bx, by) = forces[a].T, forces[b].T
                cross = (ax * by - ay * bx).reshape(self.shape)
                flips = np.zeros(self.shape, dtype=bool)
                flips[:-1] |= cross[:-1] * cross[1:] <= 0.0
                flips[:, :-1] |= cross[:, :-1] * cross[:, 1:] <= 0.0
                tried: list[Any] = []
                for begin in self.points[opposed & line & flips.ravel()]:
                    if any(math.dist(begin, p) < 2.0 * STEP_M for p in tried):
                        continue
                    tried.append(begin)
                    found = self.switch(begin, a, b)
                    if found is not None:
                        yield found

    def switch(self, begin, a, b):
        def residual(p):
            distances, forces = self.each(p[None])
            F, G = forces[a, 0], forces[b, 0]
            return distances[a, 0] - distances[b, 0], F[0] * G[1] - F[1] * G[0]

        p, _, success, _ = fsolve(residual, begin, full_output=True, xtol=1e-12)
        if success != 1 or np.abs(p - begin).max() > 3.0 * STEP_M:
            return None
        distances, forces = self.each(p[None])
        least = distances[:, 0].min()
        apart = max(abs(distances[a, 0] - least), abs(distances[b, 0] - least))
        F, G = forces[a, 0], forces[b, 0]
        if apart > 1e-6 or least < 0.01 or F @ G > -1e-4:
            return None
        return p if abs(F[0] * G[1] - F[1] * G[0]) < 1e-6 else None

    def turns(self):
        """Middles of cells round which the force of one body alone turns."""
        distances, forces = self.each(self.points)
        nearest = distances.argmin(axis=0)
        row = np.arange(len(self.points))
        F = forces[nearest, row].reshape(*self.shape, 2)
        angle = np.arctan2(F[..., 1], F[..., 0])
        around = [angle[:-1, :-1], angle[1:, :-1], angle[1:, 1:], angle[:-1, 1:]]
        steps = [
            np.angle(np.exp(1j * (b - a)))
            for a, b in zip(around, [*around[1:], around[0]], strict=True)
        ]
        same = nearest.reshape(self.shape)
        alone = (same[:-1, :-1] == same[1:, :-1]) & (same[:-1, :-1] == same[1:, 1:])
        alone &= same[:-1, :-1] == same[:-1, 1:]
        free = distances.min(axis=0).reshape(self.shape)[:-1, :-1] > 2.0 * STEP_M
        # On a ring of equilibria rounding turns the force.
        strong = np.linalg.norm(F, axis=-1)[:-1, :-1] > 1e-6
        turned = np.rint(sum(steps) / math.tau) != 0
        for i, j in np.argwhere(turned & alone & free & strong):
            yield np.array([self.x[i], self.y[j]]) + STEP_M / 2.0


def away_from(search, place):
    """Distance of a place from the nearest listed point of rest, m."""
    listed = [point.p_WP for point in search.points]
    listed += [point.p_WP for point in search.switching]
    return min((math.dist(place, p) for p in listed), default=math.inf)


def on_ring(search, place, tolerance):
    """Whether a place is on a circle of equilibria that is listed."""
    source = np.array(search.scenario.source.path().pose(0.0)[:2])
    return any(
        abs(math.dist(place, source) - math.dist(point.p_WP, source)) < tolerance
        for point in search.points
        if point.continuum
    )


#: Of two scenes a law: minima, switching points, turns that brute force finds.
FOUND = {
    "conventional": (11, 14, 10),
    "active": (26, 17, 17),
    "active2017": (21, 15, 12),
    "conventional2017": (20, 14, 13),
}


@pytest.mark.parametrize(
    "law",
    [
        "active",
        *(pytest.param(n, marks=pytest.mark.long) for n in LAWS if n != "active"),
    ],
)
def test_brute_force_finds_no_rest_that_is_not_listed(law):
    counts = [0, 0, 0]
    for seed in (3, 4):
        search = find_equilibria(random_scene(seed, law))
        assert search.complete, search.statement
        brute = BruteForce(search)
        for k, (places, tolerance) in enumerate(
            (
                (brute.minima(), KNOWN_M),
                (brute.switches(), KNOWN_M),
                (brute.turns(), KNOWN_M + STEP_M),
            )
        ):
            for place in places:
                if on_ring(search, place, tolerance):
                    continue  # rounding decides how many of these there are
                assert away_from(search, place) < tolerance, (seed, k, place)
                counts[k] += 1
    assert tuple(counts) == FOUND[law]


@pytest.mark.parametrize("law", ["active", "active2017", "conventional2017"])
def test_the_middle_of_a_corridor_is_an_attractive_switching_point(law):
    """Attraction is 0 there, and two equal pushes oppose each other."""
    search = find_equilibria(two_walls(law))
    assert search.complete, search.statement
    (point,) = [p for p in search.switching if p.attractive]
    np.testing.assert_allclose(point.p_WP, [2.8, 0.0], atol=1e-6)
    field = ForceField(ideal_loop(search.scenario))
    right, left = (
        field.force([point.p_WP[0], point.p_WP[1] + y]) for y in (-1e-3, 1e-3)
    )
    assert right[1] > 0.5
    assert left[1] < -0.5
    assert any("(2.800, 0.000)" in note for note in search.notes)


def test_three_walls_hold_p_in_a_dead_end():
    """Three bodies are equally near, and no two of their forces are opposed."""
    ends = [
        {"name": "end", "size_m": [0.1, 2.0], "waypoints_m": [[2.35, 0.0]]},
        {"name": "left", "size_m": [2.0, 0.1], "waypoints_m": [[1.3, 0.55]]},
        {"name": "right", "size_m": [2.0, 0.1], "waypoints_m": [[1.3, -0.55]]},
    ]
    scene = Scenario.model_validate(
        {
            "law": "conventional",
            "laws": {"conventional": {"stiffness_n_m": 16.0, "reach_m": 0.8}},
            "source": {"waypoints_m": [[5.0, 0.0]]},
            "obstacles": ends,
        }
    )
    search = find_equilibria(scene)
    assert search.complete, search.statement
    assert any(
        np.allclose(p.p_WP, [1.8, 0.0], atol=1e-6) and p.attractive
        for p in search.switching
    )


def test_the_operating_point_is_the_one_nearest_to_the_start():
    """Ahead of the source and behind it P is at the same distance from it."""
    search = find_equilibria(load_scenario("corridor", ["law=conventional"]))
    at = search.follow_point()
    np.testing.assert_allclose(at.p_WP, [0.4, 0.0], atol=3e-3)
    assert search.moving == ("source",)
    assert any("Bodies move (source)" in note for note in search.notes)


def room(*gaps):
    """Four walls about the source; a wall that is a gap is left out."""
    walls = {
        "west": ([0.1, 4.0], [1.95, 0.0]),
        "east": ([0.1, 4.0], [6.05, 0.0]),
        "north": ([4.2, 0.1], [4.0, 2.05]),
        "south": ([4.2, 0.1], [4.0, -2.05]),
    }
    return [
        {"name": name, "size_m": size, "waypoints_m": [place]}
        for name, (size, place) in walls.items()
        if name not in gaps
    ]


def test_a_point_behind_walls_is_said_to_be_out_of_reach():
    """Without a law P rests round the source alone, in a room with and without a door.

    ``none`` does not push, so that nothing holds P before the walls.
    """
    closed, opened = (
        find_equilibria(two_walls("none", obstacles=room(*gaps)))
        for gaps in ((), ("east",))
    )
    at = closed.follow_point()
    assert closed.way_m(at) == math.inf
    assert any("not reachable" in note for note in closed.notes)
    at = opened.follow_point()
    assert 6.0 < opened.way_m(at) < math.inf
    assert any("behind a body" in note for note in opened.notes)


def test_a_sink_in_reach_is_preferred_to_a_better_one_behind_walls():
    """A source in a closed room: outside, P comes to rest before the wall."""
    search = find_equilibria(two_walls("conventional", obstacles=room()))
    at = search.follow_point()
    assert at.offset_m == pytest.approx(1.46, abs=0.01)
    assert math.isfinite(search.way_m(at))
    better = [p for p in search.points if p.stable and abs(p.offset_m) < 1e-6]
    assert [search.way_m(p) for p in better] == [math.inf]


def test_what_stays_open_is_said_first():
    """Cells as large as these decide nothing."""
    search = find_equilibria(two_walls("active"), area_m=(2.0, 3.5, -0.5, 0.5))
    assert not search.empty_outside
    assert not search.complete
    with pytest.raises(ValueError, match="no stable equilibrium"):
        search.follow_point()


@pytest.mark.parametrize(
    "shape",
    [
        {"polygon_m": [[0.2, 0.5], [-0.2, 0.5], [-0.2, -0.5], [0.2, -0.5]]},
        {"radius_m": 0.3},
    ],
    ids=["polygon", "disc"],
)
def test_places_of_rest_before_other_shapes(shape):
    """A box by its corners has those of a box; before a disc, push and pull balance."""
    fields = {"hearing": "ideal_always", "law": "conventional"}
    place = {"name": "it", "waypoints_m": [[2.0, 0.0]]}

    def search(body):
        obstacles = {"obstacles": [place | body]}
        return find_equilibria(
            ideal_scenario(load_scenario("wall", fields | obstacles))
        )

    found = search(shape)
    assert found.complete
    if "radius_m" not in shape:
        expected = search({"size_m": [0.4, 1.0]})
        assert [p.kind for p in found.points] == [p.kind for p in expected.points]
        for one, other in zip(found.points, expected.points, strict=True):
            np.testing.assert_allclose(one.p_WP, other.p_WP, atol=1e-6)
        return
    model = point_mass(found.scenario)
    before = min(found.points, key=lambda point: float(point.p_WP[0]))
    assert before.nearest_body == "it"
    gap = 2.0 - 0.3 - before.p_WP[0]
    pull = model.stiffness_n_m * (4.0 - before.p_WP[0] - model.follow_distance_m)
    assert before.p_WP[1] == pytest.approx(0.0, abs=1e-9)
    assert model.law.at_rest(np.array([gap]))[0] == pytest.approx(pull, rel=1e-3)
