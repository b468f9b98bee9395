"""The geometry file of a robot's microphones, for ``phonotaxis locate``."""

from __future__ import annotations

import numpy as np

from diagrams.scenario.participants import HasMicrophones
from diagrams.scenario.scenario import Scenario
from diagrams.scenario.yaml_text import dump_yaml
from systems.base.robot import microphones_B
from systems.framework.input_error import shortened

#: Standard deviations in the file: the first of the positions (the rounding of a
#: drawing), and the second of the speed of sound.
_POSITION_STD_M, _SOUND_SPEED_STD = 0.0005, 0.5  # m, m/s
#: Positions are rounded to a nanometer, which removes the rounding errors of sums.
_DECIMALS = 9


def geometry_text(scenario: Scenario, robot: str, file: str) -> str:
    """Returns the YAML text that describes the microphones of a recording.

    The text has the nominal positions of the microphones in the body frame B, m, and
    the speed of sound, m/s. Its comments describe the recording and the faults of the
    microphones.

    Args:
        scenario: Scenario of the recorded run.
        robot: Name of the robot that records.
        file: Name of the recording.

    Returns:
        YAML text.
    """
    own = scenario.robots[robot]
    assert isinstance(own, HasMicrophones)
    places = np.round(microphones_B(own.robot), _DECIMALS).tolist()
    name = shortened(scenario.name, 60)
    comments = [
        f"Microphones of {robot} in scenario {name}, seed {scenario.seed}.",
        f"Their sound is in {file}, one channel per microphone, in this order;",
        f"its full scale is {own.microphones.full_scale} counts of the converter.",
        "Positions in the robot's frame B, m: origin midway between the wheels,",
        "x ahead, y to the left.",
        *(
            f"Microphone {each.number} is {each.kind} from {each.start_s:g} s on."
            for each in own.faults
            if each.sensor == "microphones"
        ),
    ]
    document = dump_yaml(
        {
            "microphones": places,
            "position_std_m": _POSITION_STD_M,
            "sound_speed": scenario.sound_speed_m_s,
            "sound_speed_std": _SOUND_SPEED_STD,
        }
    )
    return "".join(f"# {line}\n" for line in comments) + document
