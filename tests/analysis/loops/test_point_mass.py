"""The point-mass model against the blocks' functions, scipy and closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from analysis.loops.point_mass import STEP_S, point_mass
from diagrams.building.laws import make_controller
from systems.framework.input_error import InputError
from systems.laws.impedance_controller import (
    attraction_force,
    obstacle_speed,
    repulsion_force,
)
from systems.ranging.ideal_obstacle_sensor import nearest_vectors

#: A disc, and a wall with round ends.
ROUND = (
    "obstacles=[{name: disc, radius_m: 0.3, waypoints_m: [[2.0, 0.4]]}, "
    "{name: wall, wall_m: [[3.0, -1.0], [3.5, -1.6]], thickness_m: 0.4}]"
)
LAWS = ("conventional", "active", "conventional2017", "active2017")


def block_force(scenario, law, state, *, before=None):
    """Sum of forces by the blocks' functions; C a tick ago is that of ``before``."""
    bodies = [body.rectangles(0.0)[0] for body in scenario.bodies().values()]

    def vectors(p):
        slots = 3 if scenario.follower.collision_vector.aggregation == "sum" else 1
        return nearest_vectors(
            (p[0], p[1], 0.0), bodies, range(len(bodies)), 0.0, 3.0, slots
        )

    C = {} if before is None else {round(v[0]): v[1:] for v in vectors(before)}
    closing = scenario.follower.collision_vector.velocity_term == "closing"
    pushes = [(0.0, 0.0)]
    for feature, *C_W in vectors(state):
        then = C.get(round(feature))
        s = 0.0 if then is None else obstacle_speed(C_W, then, closing, 1e-6)
        pushes.append(repulsion_force(C_W, s, law))
    F_b = np.sum(pushes, axis=0)
    p_WS = scenario.source.path().pose(0.0)[:2]
    F_m = attraction_force(
        state[:2], state[2:], p_WS, 1.0, scenario.follower.attraction, 3.94
    )
    return F_m[0] + F_b[0], F_m[1] + F_b[1]


def states(count, seed=3):
    rng = np.random.default_rng(seed)
    return np.column_stack(
        [
            rng.uniform(-1.0, 6.0, count),
            rng.uniform(-2.0, 2.0, count),
            rng.uniform(-0.5, 0.5, (count, 2)),
        ]
    )


@pytest.mark.parametrize("aggregation", ["nearest", "sum"])
@pytest.mark.parametrize("law", LAWS)
def test_force_at_rest_is_that_of_the_blocks(two_boxes, law, aggregation):
    scenario = two_boxes(law, f"collision_vector.aggregation={aggregation}")
    model = point_mass(scenario)
    function = make_controller(scenario).radial_force
    free = states(200)
    free = free[model.clearances(free[:, :2]) > 0.0]
    expected = [block_force(scenario, function, state.tolist()) for state in free]
    np.testing.assert_allclose(model.force(free, "none"), expected, atol=2e-4)


@pytest.mark.parametrize("round_", [False, True])
@pytest.mark.parametrize("term", ["printed", "closing"])
@pytest.mark.parametrize("law", LAWS)
def test_force_in_motion_is_that_of_the_blocks(two_boxes, law, term, round_):
    """The blocks' difference over a very short tick is the derivative here."""
    obstacles = (ROUND,) if round_ else ()
    scenario = two_boxes(law, f"collision_vector.velocity_term={term}", *obstacles)
    model = point_mass(scenario)
    function = make_controller(scenario).radial_force
    free = states(200)
    free = free[model.clearances(free[:, :2]) > 0.01]
    expected = [
        block_force(
            scenario, function, s.tolist(), before=(s[:2] - 1e-6 * s[2:]).tolist()
        )
        for s in free
    ]
    near_reach = np.abs(model.clearances(free[:, :2]) - 0.8) < 2e-3
    found = model.force(free, term)[~near_reach]
    np.testing.assert_allclose(found, np.array(expected)[~near_reach], atol=1e-3)


def test_pushes_of_walls_with_corners_are_not_added(two_boxes):
    corner = "obstacles=[{name: L, wall_m: [[2, -1], [2, 1], [3, 1]]}]"
    with pytest.raises(InputError, match="'sum' has no model with 'L'"):
        point_mass(two_boxes("active", corner, "collision_vector.aggregation=sum"))
    assert len(point_mass(two_boxes("active", corner)).rectangles) == 3


def test_distances_are_those_of_the_sensor(two_boxes):
    model = point_mass(two_boxes("conventional"))
    points = states(100)[:, :2]
    for k, rectangle in enumerate(model.rectangles):
        expected = [
            math.hypot(*v[0][1:])
            for p in points
            if (v := nearest_vectors((*p, 0.0), [rectangle], [0], 0.0, 99.0, 1))
        ]
        np.testing.assert_allclose(model.distances(points)[:, k], expected, atol=1e-12)


def test_motion_agrees_with_scipy(two_boxes):
    """Within reach throughout, so that no force steps: to 1e-6 over 10 s."""
    scenario = two_boxes("active", "robot.top_speed_m_s=5.0", "obstacles=[]")
    model = point_mass(scenario)
    start = [2.0, 0.4, 0.2, -0.1]

    def slope(_, y):
        return [*y[2:], *(model.force(y[None], "none")[0] / model.mass_kg)]

    expected = solve_ivp(slope, (0.0, 10.0), start, rtol=1e-10, atol=1e-12).y[:, -1]
    found = model.trajectory(start, duration_s=10.0, term="none")[-1]
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_without_obstacles_the_stretch_is_a_damped_oscillator(two_boxes):
    """Poles of M s^2 + D_r s + K_r: -0.1269 +- 0.7011j."""
    model = point_mass(two_boxes("none", "obstacles=[]", "robot.top_speed_m_s=5.0"))
    start = [model.p_WS[0] - 1.2 - 0.5, model.p_WS[1], 0.0, 0.0]
    states = model.trajectory(start, duration_s=20.0, term="none")
    t = STEP_S * np.arange(len(states))
    pole = -0.1269 + 0.7011j
    expected = 0.5 * np.real((1 + 1j * pole.real / pole.imag) * np.exp(pole * t))
    stretch = model.p_WS[0] - 1.2 - states[:, 0]
    np.testing.assert_allclose(stretch, expected, atol=1e-3)


def test_speed_never_exceeds_the_clamp(two_boxes):
    model = point_mass(two_boxes("conventional"))
    states = model.trajectory([0.0, 0.0, 0.0, 0.0], duration_s=10.0, term="printed")
    speed = np.hypot(*states[:, 2:].T)
    assert speed.max() == pytest.approx(model.top_speed_m_s, abs=1e-9)


def test_without_damping_energy_stays(two_boxes):
    model = point_mass(
        two_boxes(
            "conventional", "attraction.damping_n_s_m=0", "robot.top_speed_m_s=9.0"
        )
    )
    states = model.trajectory([2.0, 0.3, 0.0, 0.0], duration_s=20.0, term="none")
    energy = model.energy(states)
    assert np.ptp(energy) < 1e-4 * energy[0]


def test_contact_is_noticed(two_boxes):
    """Straight into a box without any avoidance: at constant speed 0.72 m/s."""
    model = point_mass(two_boxes("none"))
    x = 1.6 - 0.025
    start = [x - 0.4, 0.35, model.top_speed_m_s, 0.0]
    runs = model.run([start], contact_m=0.03, duration_s=5.0, term="none")
    assert runs.collided[0]
    assert runs.contact_times_s[0] == pytest.approx(0.37 / 0.72, abs=2 * STEP_S)


def test_sum_over_more_than_three_bodies_is_refused(two_boxes):
    boxes = ", ".join(
        f"{{name: b{k}, size_m: [0.1, 0.1], waypoints_m: [[2, {k}]]}}"
        for k in (1, 2, 3)
    )
    scenario = two_boxes(
        "active", f"obstacles=[{boxes}]", "collision_vector.aggregation=sum"
    )
    with pytest.raises(ValueError, match=r"aggregation: .* 3 of 4 bodies"):
        point_mass(scenario)
