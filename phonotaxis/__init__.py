"""A robot that follows a sound past obstacles: functions for scripts and notebooks.

The package loads each part only when the part is used. ``import phonotaxis`` therefore
takes no noticeable time. The names in ``__all__`` are public. CONTRIBUTING.md states
which changes of public names are allowed.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any

from phonotaxis.name_clashes import explain_hidden_modules, refuse_clashes

if TYPE_CHECKING:
    from analysis.arrays.array_geometry import ArrayGeometry
    from analysis.arrays.source_estimate import SourceEstimate
    from analysis.arrays.voting.source_listener_block import SourceListener
    from analysis.batches.plan import SweepPlan
    from analysis.loops.diagram_linearization import linearize
    from analysis.loops.given_bursts import burst_cycle
    from analysis.loops.given_delays import delay_margin
    from analysis.loops.given_loops import loop_at
    from analysis.loops.given_margins import disk_margin, margins
    from analysis.loops.given_oscillations import describing_function
    from analysis.loops.given_robustness import Robustness, robustness
    from analysis.loops.given_worst_margins import WorstMargins, worst_margins
    from analysis.loops.linearized_diagram import LinearizedDiagram
    from analysis.run_error import RunError
    from analysis.runs.columns import columns
    from analysis.views.live_view import add_live_view
    from diagrams.scenario.loading import library_scenarios, load_scenario
    from diagrams.scenario.scenario import Scenario
    from phonotaxis import testing as testing
    from phonotaxis.arrays import ResolutionResult, array_resolution
    from phonotaxis.batches import ComparisonResult, SweepResult, compare, sweep
    from phonotaxis.delays import DelayResult, calibrate_delays, locate_delays
    from phonotaxis.law_runs import LawsResult, simulate_laws
    from phonotaxis.listening import ListenResult, listen
    from phonotaxis.listings import Listing, laws, scenarios, worlds
    from phonotaxis.loops import DesignResult, StabilityResult, design, stability
    from phonotaxis.recordings import (
        CalibrationResult,
        LocateResult,
        calibrate,
        locate,
    )
    from phonotaxis.result import Result
    from phonotaxis.runs import RunResult, simulate
    from phonotaxis.saved_runs import load_run
    from systems.framework.input_error import InputError

__all__ = [
    "ArrayGeometry",
    "CalibrationResult",
    "ComparisonResult",
    "DelayResult",
    "DesignResult",
    "InputError",
    "LawsResult",
    "LinearizedDiagram",
    "ListenResult",
    "Listing",
    "LocateResult",
    "ResolutionResult",
    "Result",
    "Robustness",
    "RunError",
    "RunResult",
    "Scenario",
    "SourceEstimate",
    "SourceListener",
    "StabilityResult",
    "SweepPlan",
    "SweepResult",
    "WorstMargins",
    "__version__",
    "add_live_view",
    "array_resolution",
    "burst_cycle",
    "calibrate",
    "calibrate_delays",
    "columns",
    "compare",
    "delay_margin",
    "describing_function",
    "design",
    "disk_margin",
    "laws",
    "library_scenarios",
    "linearize",
    "listen",
    "load_run",
    "load_scenario",
    "locate",
    "locate_delays",
    "loop_at",
    "main",
    "margins",
    "robustness",
    "scenarios",
    "simulate",
    "simulate_laws",
    "stability",
    "sweep",
    "worlds",
    "worst_margins",
]

#: Version of the installed package.
__version__: str

#: Module of each public name. Type checkers use the imports above instead.
_HOMES = {
    "ArrayGeometry": "analysis.arrays.array_geometry",
    "CalibrationResult": "phonotaxis.recordings",
    "ComparisonResult": "phonotaxis.batches",
    "DelayResult": "phonotaxis.delays",
    "DesignResult": "phonotaxis.loops",
    "InputError": "systems.framework.input_error",
    "LinearizedDiagram": "analysis.loops.linearized_diagram",
    "LawsResult": "phonotaxis.law_runs",
    "ListenResult": "phonotaxis.listening",
    "Listing": "phonotaxis.listings",
    "LocateResult": "phonotaxis.recordings",
    "ResolutionResult": "phonotaxis.arrays",
    "Result": "phonotaxis.result",
    "Robustness": "analysis.loops.given_robustness",
    "WorstMargins": "analysis.loops.given_worst_margins",
    "RunError": "analysis.run_error",
    "RunResult": "phonotaxis.runs",
    "Scenario": "diagrams.scenario.scenario",
    "SourceEstimate": "analysis.arrays.source_estimate",
    "SourceListener": "analysis.arrays.voting.source_listener_block",
    "StabilityResult": "phonotaxis.loops",
    "SweepPlan": "analysis.batches.plan",
    "SweepResult": "phonotaxis.batches",
    "add_live_view": "analysis.views.live_view",
    "array_resolution": "phonotaxis.arrays",
    "calibrate": "phonotaxis.recordings",
    "calibrate_delays": "phonotaxis.delays",
    "columns": "analysis.runs.columns",
    "compare": "phonotaxis.batches",
    "design": "phonotaxis.loops",
    "delay_margin": "analysis.loops.given_delays",
    "describing_function": "analysis.loops.given_oscillations",
    "burst_cycle": "analysis.loops.given_bursts",
    "disk_margin": "analysis.loops.given_margins",
    "laws": "phonotaxis.listings",
    "loop_at": "analysis.loops.given_loops",
    "margins": "analysis.loops.given_margins",
    "robustness": "analysis.loops.given_robustness",
    "library_scenarios": "diagrams.scenario.loading",
    "linearize": "analysis.loops.diagram_linearization",
    "listen": "phonotaxis.listening",
    "load_run": "phonotaxis.saved_runs",
    "load_scenario": "diagrams.scenario.loading",
    "locate": "phonotaxis.recordings",
    "scenarios": "phonotaxis.listings",
    "locate_delays": "phonotaxis.delays",
    "simulate": "phonotaxis.runs",
    "simulate_laws": "phonotaxis.law_runs",
    "stability": "phonotaxis.loops",
    "sweep": "phonotaxis.batches",
    "worlds": "phonotaxis.listings",
    "worst_margins": "analysis.loops.given_worst_margins",
}

refuse_clashes()
explain_hidden_modules()


def __getattr__(name: str) -> Any:
    """Loads a public name when it is used for the first time."""
    value: Any
    if name == "__version__":
        from importlib.metadata import version

        value = version("phonotaxis")
    elif name == "testing":
        value = import_module("phonotaxis.testing")
    elif name in _HOMES:
        value = getattr(import_module(_HOMES[name]), name)
    else:
        from phonotaxis.other_names import of_module

        hint = of_module(name, __all__)
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}{hint}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs a command of the command line.

    Args:
        arguments: Words after the name of the program. None means the words with which
            this process was started. In that case, the caller must end the process
            when the function returns, because the process ignores interrupts after the
            command.

    Returns:
        Exit status: 0 if the command succeeded, 2 if the input is not valid, 1 after
        any other failure.
    """
    try:
        # All imports are inside the ``try`` statement, because an interrupt may come
        # while they run.
        from phonotaxis.commands.interrupts import Interrupts

        with Interrupts(last=arguments is None) as interrupts:
            from phonotaxis.commands.command_line import run_words

            words = sys.argv[1:] if arguments is None else arguments
            status = run_words(list(words), interrupts)
            if arguments is None:
                # The result has been printed. Text that a user's module prints at exit
                # does not belong to the result, and goes to standard error.
                sys.stdout = sys.stderr
            return status
    except KeyboardInterrupt:
        print("phonotaxis: interrupted; nothing was written", file=sys.stderr)
        return 1
