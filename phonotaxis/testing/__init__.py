"""Functions that test blocks: yours, those of phonotaxis, and other Drake systems.

- ``evaluate`` evaluates the outputs of a block once.
- ``run`` simulates a block over time.
- ``Bench`` holds a block whose inputs, state and time a test changes step by step.
- ``assert_linearization`` compares derivatives with finite differences.
- ``drive`` runs a scenario in which signals of the test replace signals of the robot.

The pytest plugin ``phonotaxis_pytest`` has fixtures for tests of blocks.
"""

from phonotaxis.testing.bench import Bench
from phonotaxis.testing.driving import drive
from phonotaxis.testing.evaluation import History, evaluate, run
from phonotaxis.testing.linearization import assert_linearization

__all__ = ["Bench", "History", "assert_linearization", "drive", "evaluate", "run"]
