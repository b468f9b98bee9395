"""Objects from beams, against bodies whose places and velocities are known."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from phonotaxis.testing import Bench
from systems.base.robot import RobotParameters
from systems.framework.compiling import njit
from systems.ranging.beam_groups import EXTENT, NEAR_X, NEAR_Y, OPEN, group_beams
from systems.ranging.object_detector import ObjectDetector, object_detector_step
from systems.ranging.objects import KNOWN, RADIUS, THERE, VX, VY, X, Y
from systems.ranging.parameters import RangeSensorParameters, UltrasonicParameters
from systems.ranging.ultrasonic_array import cone_ranges

BURGER = RobotParameters.model_validate({"preset": "turtlebot3_burger"})
EPSILON = 0.08
SCAN = UltrasonicParameters.model_validate({"preset": "scan_7"})
REST = (-EPSILON, 0.0, 0.0)


def ring(count: int, **fields: Any) -> UltrasonicParameters:
    """Rays all around P that see 2 m far."""
    own = {"sensors": count, "beam_half_angle_deg": 0.05, "maximum_range_m": 2.0}
    return UltrasonicParameters.model_validate({**own, **fields})


class Driven:
    """A detector that is driven tick by tick."""

    def __init__(self, sensors: UltrasonicParameters = SCAN, known: Any = ()) -> None:
        self.sensors = sensors
        self.block = ObjectDetector(sensors=sensors, robot=BURGER, known=known)
        self.state, self.tick = np.array(self.block.step.state), 0

    def see(self, ranges: Any, pose: Any = REST, ages: Any = None) -> Any:
        """Objects (8, 8) of a tick; infinite ranges give no echo."""
        farthest = self.sensors.maximum_range_m
        echo = [float(r <= farthest) for r in ranges]
        held = [min(r, farthest) for r in ranges]
        ages = np.zeros(len(held)) if ages is None else ages
        inputs = [*map(np.array, (held, echo, ages, pose))]
        outputs, step = [[0.0] * 64], self.block.step
        step.step(self.tick, self.state, inputs, outputs, step.numbers)
        self.tick += 1
        return np.reshape(outputs[0], (8, 8))

    def look(self, *bodies: Any, pose: Any = REST) -> Any:
        """The same of rectangles."""
        boxes = np.array(bodies, dtype=float).reshape(-1, 5)
        rectangles = np.pad(boxes, ((0, 0), (0, 1)))
        return self.see(cone_ranges(pose, rectangles, self.sensors, EPSILON), pose)


def disc_ranges(sensors: UltrasonicParameters, discs: Any) -> Any:
    """Of rays from the origin: the smaller root of |r u - c| = radius."""
    ranges = np.full(sensors.count, math.inf)
    for x, y, radius in discs:
        for k, axis in enumerate(sensors.axes):
            along = x * math.cos(axis) + y * math.sin(axis)
            root = along**2 - (x * x + y * y - radius**2)
            if root >= 0.0 and along > 0.0:
                ranges[k] = min(ranges[k], along - math.sqrt(root))
    return ranges


def there(objects: Any) -> Any:
    return objects[objects[:, THERE] > 0.5]


@pytest.mark.parametrize(
    ("sensors", "turned"),
    [(SCAN, 0.0), (SCAN, 1.0), (ring(36), 0.0), (ring(36), 0.3), (ring(72), 1.0)],
)
def test_a_wall_is_one_object(sensors, turned):
    """0.6 m from P: the foot of the perpendicular, on the line between two hits."""
    c, s = math.cos(turned), math.sin(turned)
    found = there(Driven(sensors).look([0.7 * c, 0.7 * s, turned, 0.2, 9.0]))
    assert len(found) == 1
    np.testing.assert_allclose(found[0, [X, Y]], [0.6 * c, 0.6 * s], atol=0.012)
    assert found[0, RADIUS] == 0.0


@pytest.mark.parametrize("sensors", [SCAN, ring(36)], ids=["7", "36"])
def test_two_discs_are_two_objects(sensors):
    """On the axes of beams, 60 deg apart: at 0.7 and 0.9 m."""
    c, s = math.cos(math.radians(30.0)), math.sin(math.radians(30.0))
    discs = [(0.9 * c, 0.9 * s, 0.2), (1.1 * c, -1.1 * s, 0.2)]
    found = there(Driven(sensors).see(disc_ranges(sensors, discs)))
    assert len(found) == 2
    np.testing.assert_allclose(found[0, [X, Y]], [0.7 * c, 0.7 * s], atol=1e-9)
    np.testing.assert_allclose(found[1, [X, Y]], [0.9 * c, -0.9 * s], atol=1e-9)


def test_the_radius_is_half_of_what_is_seen_and_a_beam():
    """A disc of 0.2 m at 1 m covers asin 0.2 = 11.5 deg to each side: rays up to 11."""
    found = there(Driven(ring(360)).see(disc_ranges(ring(360), [(1.0, 0.0, 0.2)])))
    outer = math.radians(11.0)
    hit = math.cos(outer) - math.sqrt(math.cos(outer) ** 2 - 1.0 + 0.2**2)
    expected = hit * math.sin(outer) + 0.5 * 0.8 * math.radians(1.0)
    assert found[0, RADIUS] == pytest.approx(expected, rel=1e-6)


def test_a_hollow_is_as_many_objects_as_it_has_walls():
    """A room of 2 by 1.6 m about P: four walls, the near ones first."""
    walls = [
        [1.1, 0.1, 0.0, 0.2, 4.0],
        [-1.1, 0.1, 0.0, 0.2, 4.0],
        [0.0, 1.0, 0.0, 4.0, 0.2],
        [0.0, -0.8, 0.0, 4.0, 0.2],
    ]
    found = there(Driven(ring(72)).look(*walls))
    expected = [[0.0, -0.7], [0.0, 0.9], [1.0, 0.0], [-1.0, 0.0]]
    np.testing.assert_allclose(found[:2, [X, Y]], expected[:2], atol=0.01)
    order = np.argsort(-found[2:4, X])
    np.testing.assert_allclose(found[2:4][order][:, [X, Y]], expected[2:], atol=0.01)
    assert len(found) == 4


def test_a_box_before_a_wall_is_an_object_of_its_own():
    found = there(Driven(ring(72)).look([1.6, 0, 0, 0.2, 9], [0.8, 0, 0, 0.2, 0.2]))
    assert found[0, X] == pytest.approx(0.7, abs=1e-3)
    # What is left of the wall to both sides, each nearest at the box's shadow.
    assert len(found) == 3
    assert np.all(found[1:, X] == pytest.approx(1.5, abs=1e-2))


def test_rows_of_hits_are_cut_where_neighbors_are_far_apart():
    """Three beams ahead; the threshold is gap + stretch 2 r sin(apart/2)."""
    beams = Driven().block.step.numbers.beams
    axes = np.radians([30.0, 0.0, -30.0])
    chord = 2.0 * math.sin(math.radians(15.0))
    for factor, groups in ((0.98, 1), (1.02, 2)):
        # Along the left beam, as far from the middle hit as a share of the threshold.
        far = factor * (0.2 + 2.0 * chord)
        left = math.sqrt(far**2 - 0.25) + math.cos(axes[0])
        ranges = np.array([left, 1.0, 3.0])
        hits = ranges[:, None] * np.column_stack([np.cos(axes), np.sin(axes)])
        own = beams._replace(apart_rad=np.radians([30.0, 30.0, 0.0]))
        heard = np.array([1.0, 1.0, 0.0])
        rows, used = group_beams(hits, ranges, heard, own)
        assert used == groups
        nearest = np.min(np.hypot(rows[:used, NEAR_X], rows[:used, NEAR_Y]))
        assert nearest == pytest.approx(1.0)
        if groups == 1:
            assert rows[0, OPEN] == 1.0
            assert rows[0, EXTENT] == pytest.approx(far)


def crossing(sensors, seed, *, moves):
    """Errors of a velocity, m/s, and its speed: a box that crosses, after a second."""
    draw = np.random.default_rng(seed)
    speed, course = draw.uniform(0.15, 0.3), draw.uniform(0.0, math.tau)
    bearing, far = draw.uniform(-1.2, 1.2), draw.uniform(0.8, 1.2)
    velocity = speed * np.array([math.cos(course), math.sin(course)])
    half_way = far * np.array([math.cos(bearing), math.sin(bearing)])
    turned, size = draw.uniform(0.0, math.pi), draw.uniform(0.3, 0.5, 2)
    driven = Driven(sensors)
    for tick in range(41):
        t = 0.025 * tick
        pose = (0.15 * t - EPSILON, 0.0, 0.2 * math.sin(t)) if moves else REST
        objects = driven.look(
            [*(half_way + velocity * (t - 0.5)), turned, *size], pose=pose
        )
    assert objects[0, KNOWN] == 1.0
    return np.hypot(*(objects[0, [VX, VY]] - velocity)), speed


@pytest.mark.parametrize("moves", [False, True])
def test_the_velocity_of_a_crossing_box_after_a_second(moves):
    """In any direction and turned in any way: as coarse as the rays."""
    for count, most in ((360, 0.1), (72, 0.18), (36, 0.29)):
        errors = np.array([crossing(ring(count), k, moves=moves) for k in range(30)])
        assert np.median(errors[:, 0] / errors[:, 1]) < most
        assert np.max(errors[:, 0]) < 0.2


@pytest.mark.parametrize(("count", "most"), [(360, 0.1), (72, 0.1), (36, 0.15)])
def test_the_velocity_of_a_box_that_crosses_ahead(count, most):
    """Broadside, 0.8 m off, 0.2 m/s, after a second."""
    for start in np.linspace(0.05, 0.2, 12):
        driven = Driven(ring(count))
        for tick in range(41):
            box = [1.0, start - 0.2 * 0.025 * tick, 0.0, 0.4, 0.4]
            objects = driven.look(box)
        error = np.hypot(*(objects[0, [VX, VY]] - [0.0, -0.2]))
        assert error < most * 0.2


def test_what_comes_straight_at_it_is_timed_well_by_any_ring():
    """Ranges toward P give the speed within 2 % for an even number of beams."""
    for count in (72, 360):
        driven = Driven(ring(count))
        for tick in range(41):
            objects = driven.look([1.3 - 0.2 * 0.025 * tick, 0.0, 0.0, 0.1, 0.1])
        assert objects[0, KNOWN] == 1.0
        assert objects[0, [VX, VY]] == pytest.approx([-0.2, 0.0], abs=0.004)


def test_what_is_on_the_map_rests():
    """The same box, where the map has an obstacle from 1 to 1.3 m."""
    driven = Driven(ring(72), [(1.15, 0.0, 0.0, 0.3, 0.1, 0.0)])
    for tick in range(41):
        objects = driven.look([1.3 - 0.2 * 0.025 * tick, 0.0, 0.0, 0.1, 0.1])
    assert objects[0, X] == pytest.approx(1.05, abs=0.01)
    assert objects[0, [KNOWN, VX, VY]].tolist() == [1.0, 0.0, 0.0]


def test_what_no_beam_hits_any_more_stays_if_its_motion_is_unknown():
    """The edge of a shadow on a wall, which came at 6 m/s."""
    driven = Driven()
    for ahead in (1.8, 1.65, 1.5, 1.35, 1.2):
        objects = driven.see([math.inf] * 3 + [ahead] + [math.inf] * 3)
    for _ in range(20):
        assert objects[0, [X, KNOWN]] == pytest.approx([1.2, 0.0], abs=1e-9)
        objects = driven.look()


def test_of_beams_that_are_far_apart_no_velocity_is_known():
    """30 deg at 0.48 m are 0.25 m."""
    for near, known in ((0.6, 0.0), (0.4, 1.0)):
        driven = Driven()
        for _ in range(41):
            objects = driven.look([near + 0.1, 0.0, 0.0, 0.2, 0.5])
        assert objects[0, KNOWN] == known


@pytest.mark.parametrize(("count", "most"), [(36, 0.4), (72, 0.12), (360, 0.0)])
def test_what_rests_rests_while_the_robot_moves(count, most):
    """Along a wall; past two boxes, turning: edges move by as much as beams do."""
    wall, *boxes = (
        [0.0, 1.2, 0.0, 20.0, 0.2],
        [1.9, 0.3, 0.4, 0.4, 0.4],
        [1.4, -0.8, 0.0, 0.3, 0.5],
    )
    alone, among = Driven(ring(count)), Driven(ring(count))
    for tick in range(160):
        t = 0.025 * tick
        pose = 0.2 * t - EPSILON, 0.0, 0.3 * math.sin(t)
        along = alone.look(wall, pose=(pose[0], pose[1], 0.0))
        assert not np.any(along[:, [VX, VY]])
        objects = among.look(wall, *boxes, pose=pose)
        assert np.max(np.hypot(objects[:, VX], objects[:, VY])) <= most


def test_a_wall_rests_however_the_noise_of_beams_moves_its_nearest_point():
    """1 cm at 0.5 m: from beam to beam the nearest one is another, by 10 deg and more.

    What is known of such a wall toward P alone is good to noise/sqrt(ticks).
    """
    noise = np.random.default_rng(1)
    sensors, rectangles = ring(72), np.array([[0.55, 0.0, 0.0, 0.1, 1.4, 0.0]])
    driven = Driven(sensors)
    for tick in range(400):
        t = 0.025 * tick
        pose = -EPSILON + 0.05 * math.sin(t), 0.1 * math.sin(0.7 * t), 0.3 * math.sin(t)
        ranges = cone_ranges(pose, rectangles, sensors, EPSILON)
        ranges = ranges + noise.normal(0.0, 0.01, len(ranges))
        objects = driven.see(ranges, pose)
        if tick > 80:
            assert np.max(np.hypot(objects[:, VX], objects[:, VY])) < 0.1


def test_it_remembers_for_a_while():
    """Half a second, in the place in W where it was, while the robot drives on."""
    driven = Driven()
    driven.look([0.9, 0.0, 0.0, 0.2, 0.2])
    counts = []
    for tick in range(1, 25):
        objects = driven.look(pose=(-EPSILON + 0.005 * tick, 0.0, 0.0))
        counts.append(len(there(objects)))
        if counts[-1]:
            assert objects[0, X] == pytest.approx(0.8 - 0.005 * tick, abs=1e-6)
    assert counts == [1] * 20 + [0] * 4


def test_it_forgets_a_sensor_that_fires_no_more():
    """Its range is held for a tick; then the object is remembered for 0.5 s."""
    driven = Driven()
    ranges = [math.inf] * 3 + [1.0] + [math.inf] * 3
    assert len(there(driven.see(ranges))) == 1
    for age, count in ((0.025, 30), (0.05, 20)):
        for _ in range(count):
            assert len(there(driven.see(ranges, ages=[age] * 7))) == 1
    assert len(there(driven.see(ranges, ages=[0.05] * 7))) == 0


def test_held_ranges_stay_where_they_were_seen():
    """Sensors in turn on a robot that drives at a wall: each hit is on it in W.

    Objects of single hits, at the first ticks, are forgotten by then.
    """
    sensors = UltrasonicParameters(
        sensors=tuple(
            RangeSensorParameters(axis_deg=axis, beam_half_angle_deg=0.1)
            for axis in (40.0, 0.0, -40.0)
        ),
        firing="sequential",
    )
    driven, held = Driven(sensors), [math.inf] * 3
    for tick in range(31):
        pose = 0.02 * tick - EPSILON, 0.0, 0.0
        wall = np.array([[1.6, 0.0, 0.0, 0.2, 9.0, 0.0]])
        held[tick % 3] = cone_ranges(pose, wall, sensors, EPSILON)[tick % 3]
        ages = [0.025 * ((tick - k) % 3) for k in range(3)]
        objects = driven.see(held, pose, ages)
    assert len(there(objects)) == 1
    assert objects[0, X] == pytest.approx(1.5 - 0.02 * 30, abs=0.002)


def test_no_more_than_eight_and_the_nearest():
    posts = [
        [far * math.cos(a), far * math.sin(a), a, 0.1, 0.1]
        for far, a in zip(np.linspace(0.6, 1.5, 10), np.arange(10) * 0.6, strict=True)
    ]
    found = there(Driven(ring(180)).look(*posts))
    assert len(found) == 8
    away = np.hypot(found[:, X], found[:, Y])
    np.testing.assert_allclose(away, np.linspace(0.55, 1.25, 8), atol=2e-3)


def test_drake_compiled_code_and_the_step_agree():
    sensors = ring(36)
    compiled, plain = njit(object_detector_step, cache=True), Driven(sensors)
    at = Bench(
        plain.block,
        ranges=[2.0] * 36,
        echo=[0.0] * 36,
        range_ages=[0.0] * 36,
        pose_WB_estimated=REST,
    )
    state = np.array(plain.state)
    for tick in range(30):
        pose = 0.004 * tick - EPSILON, 0.0, 0.01 * tick
        box = [1.4 - 0.005 * tick, 0.2, 0.3, 0.4, 0.3, 0.0]
        bodies = np.array([box, [0.0, 1.0, 0.0, 9.0, 0.2, 0.0]])
        ranges = cone_ranges(pose, bodies, sensors, EPSILON)
        expected = plain.see(ranges, pose)
        echo = (ranges <= 2.0).astype(float)
        inputs = np.minimum(ranges, 2.0), echo, np.zeros(36), np.array(pose)
        outputs = (np.zeros(64),)
        compiled(tick, state, inputs, outputs, plain.block.step.numbers)
        np.testing.assert_array_equal(outputs[0].reshape(8, 8), expected)
        names = "ranges", "echo", "range_ages", "pose_WB_estimated"
        at.set(**dict(zip(names, inputs, strict=True)))
        np.testing.assert_array_equal(at.output("objects_W"), expected.ravel())
        at.tick()
    np.testing.assert_array_equal(state, plain.state)
