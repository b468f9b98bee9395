"""Blocks that a scenario adds to the robot."""

from math import hypot

from systems import Block, Port, Step


def traveled_step(tick, state, inputs, outputs, numbers):
    """Adds the way since the last tick. The state: last x and y (m), sum (m)."""
    x, y = inputs[0][0], inputs[0][1]
    if tick > 0:
        state[2] += hypot(x - state[0], y - state[1])
    state[0], state[1] = x, y
    outputs[0][0] = state[2]


class TraveledDistance(Block):
    """Length of the path that the middle of the robot's axle has traveled."""

    part = "traveled_distance"
    inputs = (Port("pose_WB", 3, "m, m, rad"),)
    outputs = (Port("traveled_distance", 1, "m", ("traveled_distance",)),)

    def __init__(self, tick_s):
        super().__init__()
        self.set_name("traveled_distance")
        self.declare(Step(traveled_step, (), [0.0, 0.0, 0.0]), tick_s=tick_s)
