from .building.builder import (
    SoundFollower as SoundFollower,
    build_sound_follower as build_sound_follower,
)
from .running.audio.run_audio import RunAudio as RunAudio
from .running.run_result import RunResult as RunResult
from .running.simulation import (
    load_compiled_code as load_compiled_code,
    make_simulator as make_simulator,
    prepared_loop as prepared_loop,
    simulate as simulate,
)
from .scenario.audible import check_audible as check_audible
from .scenario.loading import (
    dump_scenario as dump_scenario,
    library_scenarios as library_scenarios,
    load_scenario as load_scenario,
    write_scenario as write_scenario,
)
from .scenario.scenario import Scenario as Scenario

__all__: list[str]
