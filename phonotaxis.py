"""The command line: one subcommand for each thing to do."""

from __future__ import annotations

import argparse
import json
import os
import signal
import sys
import traceback
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NoReturn

__all__ = ["main"]

DONE, FAILED, BAD_INPUT = 0, 1, 2
#: Stands in a help text for the names of the laws.
_LAWS = "{laws}"


class _UsageError(Exception):
    """Words of the command line that make no command."""


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise _UsageError(f"{message}; see {self.prog} --help")

    def format_help(self) -> str:
        for action in self._actions:
            if _LAWS in (action.help or ""):
                # Only here: the import takes seconds, a command's words do not.
                from systems.laws.catalogue import LAWS

                action.help = str(action.help).replace(_LAWS, ", ".join(LAWS))
        return super().format_help()


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs a command.

    Args:
        arguments: Words after the program's name; none: those of the process.

    Returns:
        Exit status: 0 done, 2 bad input, 1 anything else.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    _prepare_process()
    try:
        options = _parser().parse_args(words)
        _run_command(options)
    except KeyboardInterrupt:
        print("phonotaxis: interrupted; nothing was written", file=sys.stderr)
        return FAILED
    except BrokenPipeError:
        # The reader of our output has left; Python must not complain at exit.
        sys.stdout = None
        return FAILED
    except Exception as error:  # noqa: BLE001  # bad input, a failed run, or a bug
        return _report(error, words)
    return DONE


def _prepare_process() -> None:
    """Makes a process fit for a command, however it was started.

    SIGTERM counts as Ctrl-C. Standard streams that are closed lead nowhere: a
    result file must not get their numbers. Characters that a terminal cannot
    show are escaped. Pictures go to files, whatever a notebook has chosen.
    """
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    while (descriptor := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(descriptor)
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, Path(os.devnull).open("w"))  # noqa: SIM115
        if hasattr(getattr(sys, name), "reconfigure"):
            getattr(sys, name).reconfigure(errors="backslashreplace")
    os.environ["MPLBACKEND"] = "agg"


def _run_command(options: argparse.Namespace) -> None:
    from analysis.run_error import no_exit

    with no_exit():
        options.run(options)
    sys.stdout.flush()


def _report(error: Exception, words: Sequence[str]) -> int:
    """Says on one line what an exception means; returns the exit status."""
    if "--debug" in words:
        traceback.print_exception(error)
    if isinstance(error, _UsageError):
        field, message, status = "command line", str(error), BAD_INPUT
    elif isinstance(error, ImportError):
        text = f"{error}; the installation is not whole, install it again"
        field, message, status = "", text, FAILED
    else:
        from analysis.run_error import failure_text
        from systems.framework.input_error import InputError

        if isinstance(error, InputError):
            field, message, status = error.field, error.message, BAD_INPUT
        else:
            field, message, status = "", failure_text(error), FAILED
    _complain(field, message, as_json="--json" in words)
    return status


def _complain(field: str, message: str, *, as_json: bool) -> None:
    if len(message) > 250 or not message.isprintable():
        from systems.framework.input_error import LONGEST_MESSAGE, shortened

        message = shortened(message, LONGEST_MESSAGE - len(field) - 2)
    if as_json:
        print(json.dumps({"error": {"field": field, "message": message}}))
        return
    text = f"{field}: {message}" if field else message
    print(f"phonotaxis: {text}", file=sys.stderr)


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="phonotaxis", description="A robot that follows a sound.")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for add in (
        _add_simulate,
        _add_scenarios,
        _add_locate,
        _add_localization,
        _add_compare,
        _add_stability,
        _add_sweep,
        _add_design,
    ):
        add(commands)
    for command in commands.choices.values():
        command.add_argument(
            "--debug", action="store_true", help="print the traceback of an error"
        )
    return parser


def _add_simulate(commands: Any) -> None:
    simulate = commands.add_parser("simulate", help="run a scenario")
    simulate.add_argument("--sound", metavar="FILE", help="sound file to play")
    simulate.add_argument("--law", help=f"{_LAWS}, or package.module:Name")
    _take_scenario(simulate)
    _take_output(simulate)
    simulate.set_defaults(run=_simulate)


def _add_scenarios(commands: Any) -> None:
    scenarios = commands.add_parser("scenarios", help="list the library's scenarios")
    scenarios.add_argument(
        "--json", action="store_true", help="print one JSON document"
    )
    scenarios.set_defaults(run=_scenarios)


def _add_locate(commands: Any) -> None:
    locate = commands.add_parser(
        "locate", help="bearing and range over time of a recording"
    )
    locate.add_argument("recording", metavar="FILE", help="multi-channel WAV or FLAC")
    locate.add_argument(
        "--geometry", metavar="FILE.yaml", help="places of the microphones"
    )
    locate.add_argument(
        "--out", metavar="DIR", help="directory for locate.json and locate.png"
    )
    locate.add_argument("--json", action="store_true", help="print one JSON document")
    locate.set_defaults(run=_locate)


def _add_localization(commands: Any) -> None:
    localization = commands.add_parser(
        "localization", help="the papers' localisation tables, ours, and the bound"
    )
    localization.add_argument(
        "--trials", metavar="N", type=int, default=100, help="measurements a cell (100)"
    )
    localization.add_argument("--seed", metavar="N", help="seed of all random numbers")
    localization.add_argument(
        "--tolerances",
        action="store_true",
        help="redraw errors of the array for every measurement, within 0.2 mm, "
        "0.2 us and 0.2 %% of the speed of sound",
    )
    _take_output(localization)
    localization.set_defaults(run=_localization)


def _add_compare(commands: Any) -> None:
    compare = commands.add_parser(
        "compare", help="laws side by side on the same random layouts"
    )
    compare.add_argument(
        "scenario",
        nargs="*",
        help="library name, YAML file of layouts, or YAML file of a scenario "
        "(default: the papers' four experiments)",
    )
    compare.add_argument(
        "--laws", metavar="LAW,...", help=f"laws to compare (default: {_LAWS})"
    )
    compare.add_argument(
        "--velocity-term",
        metavar="TERM,...",
        help="printed, closing, or both (default: the scenario's)",
    )
    compare.add_argument(
        "--runs", metavar="N", type=int, default=50, help="layouts a scenario (50)"
    )
    compare.add_argument("--seed", metavar="N", help="seed of layouts and noise (1)")
    compare.add_argument(
        "--set",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        help="set any field, as hearing=ideal; may be repeated",
    )
    compare.add_argument(
        "--grid",
        metavar="KEY=[VALUE,...]",
        action="append",
        default=[],
        help="compare values of a further field, as hearing=[audio,ideal]",
    )
    compare.add_argument(
        "--workers", metavar="N", type=int, help="processes (default: one a core)"
    )
    compare.add_argument(
        "--resume", action="store_true", help="go on with the runs in --out"
    )
    _take_output(compare)
    compare.set_defaults(run=_compare)


def _add_stability(commands: Any) -> None:
    stability = commands.add_parser(
        "stability", help="stability of a scenario's loop: report, models, numbers"
    )
    stability.add_argument(
        "--law",
        metavar="LAW",
        action="append",
        help=f"{_LAWS}, or package.module:Name; may be repeated, to compare laws; "
        "all: those that avoid obstacles (default: the scenario's law)",
    )
    _take_scenario(stability)
    stability.add_argument(
        "--full", action="store_true", help="everything, also what takes minutes"
    )
    _take_output(stability)
    stability.set_defaults(run=_stability)


def _add_sweep(commands: Any) -> None:
    sweep = commands.add_parser(
        "sweep", help="run many scenarios, drawn from distributions and grids"
    )
    sweep.add_argument("sweep", metavar="SWEEP.yaml", help="see docs/sweeps.md")
    sweep.add_argument(
        "--workers", metavar="N", type=int, help="local processes (default: one a core)"
    )
    sweep.add_argument(
        "--scheduler", metavar="ADDRESS", help="a Dask cluster, as tcp://host:8786"
    )
    sweep.add_argument(
        "--resume", action="store_true", help="go on with what --out holds"
    )
    _take_output(sweep)
    sweep.set_defaults(run=_sweep)


def _add_design(commands: Any) -> None:
    design = commands.add_parser(
        "design", help="the laws' gains, derived from stated requirements"
    )
    _take_scenario(design)
    _take_output(design)
    design.set_defaults(run=_design)


def _take_output(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--out", metavar="DIR", help="result directory (default: results/NUMBER)"
    )
    command.add_argument("--json", action="store_true", help="print one JSON document")


def _take_scenario(command: argparse.ArgumentParser) -> None:
    """A scenario, and the options that change its fields."""
    command.add_argument(
        "scenario", nargs="?", default="default", help="library name or YAML file"
    )
    command.add_argument("--seed", metavar="N", help="seed of all random numbers")
    command.add_argument(
        "--velocity-term",
        metavar="TERM",
        help="printed (|dC/dt|) or closing (the speed of approach alone)",
    )
    command.add_argument(
        "--set",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        help="set any field, as source.speed_m_s=0.2; may be repeated",
    )


def _overrides(options: argparse.Namespace) -> list[str]:
    """The options that stand for fields, after --set so that they win."""
    overrides = list(options.set)
    for option, field in (
        ("seed", "seed"),
        ("velocity_term", "repulsion.velocity_term"),
    ):
        value = getattr(options, option)
        if value is not None:
            overrides.append(f"{field}={value}")
    return overrides


def _simulate(options: argparse.Namespace) -> None:
    from analysis.reporting.result_directory import whole_directory
    from analysis.runs.run_report import run_summary, summary_text, write_run
    from diagrams import build_sound_follower, load_scenario

    with ExitStack() as stack:
        out, directory = stack.enter_context(whole_directory(options.out))
        overrides = _overrides(options)
        if options.sound is not None:
            overrides += [
                "sound.kind=wav",
                f"sound.file={json.dumps(options.sound)}",
            ]
        if options.law is not None:
            overrides.append(f"law={options.law}")
        scenario = load_scenario(options.scenario, overrides)
        follower = build_sound_follower(scenario, log=True)
        result = _run(scenario, follower)
        summary = run_summary(result, out)
        write_run(result, summary, directory)
    if options.json:
        print(json.dumps(summary, allow_nan=False))
    else:
        print(summary_text(result, summary))
        print(f"{'results':<21} {out}")


def _run(scenario: Any, follower: Any) -> Any:
    """Simulates; what stops the run midway becomes one line."""
    from analysis.run_error import RunError
    from diagrams import simulate
    from systems.framework.input_error import InputError

    with _Progress(scenario.duration_s, "s simulated") as progress:
        try:
            return simulate(scenario, follower=follower, progress=progress)
        except InputError as error:  # found after the input had been accepted
            raise RunError(str(error)) from error


class _Progress:
    """A bar on a terminal, nothing in a pipe.

    Holds Ctrl-C back to the next call: compiled callbacks turn an exception
    that strikes inside them into a SystemError.
    """

    def __init__(self, total: float, unit: str, done: float = 0.0) -> None:
        from tqdm import tqdm

        form = f"{{l_bar}}{{bar}}| {{n:.0f}}/{{total:.0f}} {unit}, {{remaining}} left"
        self._bar = tqdm(
            total=total,
            initial=done,
            disable=not sys.stderr.isatty(),
            bar_format=form,
            leave=False,
        )
        self._interrupted = False
        self._steps = 0

    def __enter__(self) -> _Progress:
        signals = (signal.SIGINT, signal.SIGTERM)
        self._handlers = {s: signal.signal(s, self._interrupt) for s in signals}
        return self

    def _interrupt(self, *_: Any) -> None:
        self._interrupted = True

    def __call__(self, done: float) -> None:
        self._bar.update(done - self._bar.n)
        if self._interrupted:
            raise KeyboardInterrupt

    def step(self, title: str) -> None:
        """Names what comes next; what came before is done."""
        self._bar.set_description(title)
        self(self._steps)
        self._steps += 1

    def __exit__(self, *exception: Any) -> None:
        for number, handler in self._handlers.items():
            signal.signal(number, handler)
        self._bar.close()


def _scenarios(options: argparse.Namespace) -> None:
    from diagrams import library_scenarios, load_scenario

    rows = [(name, load_scenario(name).description) for name in library_scenarios()]
    if options.json:
        listed = [{"name": name, "description": text} for name, text in rows]
        print(json.dumps({"schema_version": 1, "scenarios": listed}))
        return
    width = max(len(name) for name, _ in rows)
    for name, text in rows:
        print(f"{name:<{width}}  {text}")


def _locate(options: argparse.Namespace) -> None:
    from analysis.recordings.locate import load_geometry, locate
    from analysis.recordings.locate_text import locate_text
    from analysis.reporting.result_directory import whole_directory

    with ExitStack() as stack:
        geometry = load_geometry(Path(options.geometry)) if options.geometry else None
        if options.out is not None:
            out, directory = stack.enter_context(whole_directory(options.out))
        result = locate(Path(options.recording), geometry)
        document = result.to_dict()
        if options.out is not None:
            from analysis.recordings.locate_plots import write_locate

            document["out"] = str(out)
            write_locate(result, document, directory)
    for fault in result.faults:
        print(f"phonotaxis: {fault.message}", file=sys.stderr)
    if options.json:
        print(json.dumps(document, allow_nan=False))
        return
    print(locate_text(result))
    if options.out is not None:
        print(f"results in {out}")


def _localization(options: argparse.Namespace) -> None:
    from analysis.hearing.localization import prepare_localization
    from analysis.hearing.localization_report import (
        localization_summary,
        localization_text,
        write_localization,
    )
    from analysis.reporting.result_directory import whole_directory

    with ExitStack() as stack:
        out, directory = stack.enter_context(whole_directory(options.out))
        experiment = prepare_localization(
            [] if options.seed is None else [f"seed={options.seed}"],
            trials=options.trials,
            tolerances=options.tolerances,
        )
        with _Progress(experiment.measurements, "measurements") as progress:
            cells = experiment.run(progress)
        summary = localization_summary(experiment, cells, out)
        write_localization(experiment, cells, summary, directory)
    if options.json:
        print(json.dumps(summary, allow_nan=False))
    else:
        print(localization_text(summary))
        print(f"\nresults in {out}")


def _stability(options: argparse.Namespace) -> None:
    from analysis.reporting.result_directory import whole_directory
    from analysis.run_error import RunError
    from analysis.stability.law_analysis import analyse_law, chosen_laws
    from analysis.stability.report_files import (
        stability_document,
        stability_text,
        write_stability,
    )
    from analysis.stability.report_parts import parts
    from diagrams import load_scenario

    with ExitStack() as stack:
        out, directory = stack.enter_context(whole_directory(options.out))
        scenario = load_scenario(options.scenario, _overrides(options))
        scenarios = chosen_laws(scenario, options.law or [])
        work = parts(full=options.full)
        total = len(work) * len(scenarios) + 1
        progress = stack.enter_context(_Progress(total, "parts"))
        analyses = [analyse_law(each, work, step=progress.step) for each in scenarios]
        progress.step("writing the report")
        document = stability_document(analyses, out)
        write_stability(analyses, document, directory)
    if options.json:
        print(json.dumps(document, allow_nan=False))
    else:
        print(stability_text(document))
        print(f"\nreport in {out / 'report.html'}")
    failures = [each for analysis in analyses for each in analysis.failures.items()]
    if failures:
        names = ", ".join(key for key, _ in failures)
        raise RunError(
            f"parts of the report failed: {names}; {out / 'report.html'} says how "
            "(--debug prints the traceback)"
        ) from failures[0][1]


def _sweep(options: argparse.Namespace) -> None:
    from analysis.run_error import RunError
    from analysis.sweeps.one_run import require_runs
    from analysis.sweeps.page import write_sweep
    from analysis.sweeps.plan import load_sweep
    from analysis.sweeps.summary import sweep_summary, sweep_text
    from analysis.sweeps.sweep import prepare_sweep

    plan = load_sweep(options.sweep)
    sweep = prepare_sweep(
        plan,
        options.out,
        workers=options.workers,
        scheduler=options.scheduler,
        resume=options.resume,
    )
    total, done, out = len(sweep.points), sweep.store.done, sweep.store.out
    try:
        with _Progress(total, "runs", len(done)) as progress:
            results = sweep.run(progress)
        summary = sweep_summary(plan, sweep.points, results, out)
        write_sweep(plan, sweep.points, results, summary)
        require_runs([results], out)
    except KeyboardInterrupt:
        raise RunError(
            f"interrupted; {len(done)} of {total} runs are kept: go on with --out "
            f"{out} --resume"
        ) from None
    if options.json:
        print(json.dumps(summary, allow_nan=False))
    else:
        print(sweep_text(plan, results))
        print(f"\nresults in {out}, report in {out / 'report.html'}")


def _compare(options: argparse.Namespace) -> None:
    from analysis.comparison.compare import prepare_comparison
    from analysis.comparison.options import comparison_plans
    from analysis.comparison.report import (
        compare_summary,
        compare_text,
        write_comparison,
    )
    from analysis.run_error import RunError

    plans = comparison_plans(
        options.scenario,
        laws=options.laws,
        velocity_terms=options.velocity_term,
        runs=options.runs,
        seed=options.seed,
        settings=options.set,
        grid=options.grid,
    )
    prepared = prepare_comparison(
        plans, options.out, workers=options.workers, resume=options.resume
    )
    try:
        with _Progress(prepared.runs, "runs", prepared.done) as progress:
            comparisons, pooled = prepared.run(progress)
        summary = compare_summary(prepared, comparisons, pooled)
        write_comparison(prepared, comparisons, summary)
    except KeyboardInterrupt:
        raise RunError(
            f"interrupted; {prepared.done} of {prepared.runs} runs are kept: go on "
            f"with --out {prepared.out} --resume"
        ) from None
    if options.json:
        print(json.dumps(summary, allow_nan=False))
    else:
        print(compare_text(summary, comparisons, pooled))
        print(f"\nresults in {prepared.out}")


def _design(options: argparse.Namespace) -> None:
    from analysis.design.design_study import STUDY_RUNS, study_design
    from analysis.design.design_text import design_summary, design_text, write_design
    from analysis.reporting.result_directory import whole_directory
    from diagrams import load_scenario

    with ExitStack() as stack:
        out, directory = stack.enter_context(whole_directory(options.out))
        scenario = load_scenario(options.scenario, _overrides(options))
        with _Progress(STUDY_RUNS, "runs") as progress:
            study = study_design(scenario, progress=progress)
        summary = design_summary(study, out)
        write_design(study, summary, directory)
    if options.json:
        print(json.dumps(summary, allow_nan=False))
    else:
        print(design_text(study))
        print(f"\nresults in {out}")


if __name__ == "__main__":
    sys.exit(main())
