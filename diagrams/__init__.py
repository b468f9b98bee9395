"""Scenarios, the builder that wires blocks, and the run."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from diagrams.audio.audible import check_audible
    from diagrams.audio.run_audio import RunAudio
    from diagrams.builder import SoundFollower, build_sound_follower
    from diagrams.loading import (
        dump_scenario,
        library_scenarios,
        load_scenario,
        write_scenario,
    )
    from diagrams.scenario import Scenario
    from diagrams.simulation import (
        RunResult,
        load_compiled_code,
        make_simulator,
        prepared_loop,
        simulate,
    )
    from systems.framework.input_error import InputError
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = [
    "InputError",
    "RunAudio",
    "RunResult",
    "Scenario",
    "SoundFollower",
    "build_sound_follower",
    "check_audible",
    "dump_scenario",
    "library_scenarios",
    "load_compiled_code",
    "load_scenario",
    "make_simulator",
    "prepared_loop",
    "simulate",
    "write_scenario",
]
