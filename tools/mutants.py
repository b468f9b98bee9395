"""How many small faults in the code its tests would notice: ``make mutate``.

Cosmic Ray makes the mutants. A sample of places in each module is mutated, one at a
time, in a copy of the project; the tests of that module are run against each: the
file that mirrors it, then the others that import it or hold all blocks or parameters,
then, with ``--evals``, the whole-system ones, then those named with ``--tests``. What
none notices is printed as a diff.

Left out, since they mean the same or tests should not hold them: annotations,
``if TYPE_CHECKING``, decorators, ``__all__``, and the texts of messages.
"""

from __future__ import annotations

import argparse
import ast
import difflib
import importlib
import json
import multiprocessing
import os
import random
import re
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

ROOT = Path(__file__).parents[1]
#: What is mutated unless modules are named: the blocks, and what computes places from
#: recordings, verdicts, metrics, statistics and claims.
MODULES = (
    "systems/*/*.py",
    "diagrams/running/referee.py",
    "diagrams/running/stop_rules.py",
    "analysis/arrays/*.py",
    "analysis/report/criterion.py",
    "analysis/report/intervals.py",
    "analysis/runs/measured_run.py",
    "analysis/runs/metric_table.py",
    "analysis/runs/proximity.py",
    "analysis/runs/shortest_path.py",
    "analysis/runs/smoothness.py",
    "analysis/loops/loop_margins.py",
    "analysis/loops/margin_results.py",
    "analysis/stability/*_parts.py",
    "studies/support/claim_judges.py",
    "studies/claims.py",
    "analysis/batches/cells.py",
    "analysis/batches/pairs.py",
)
#: Operators whose mutants do not run, or mean the same.
LEFT_OUT = ("NoOp", "Variable", "RemoveDecorator", "ExceptionReplacer")
#: What holds ranges and defaults of all parameters.
PARAMETER_TESTS = (
    Path("tests/systems/framework/test_parameter_ranges.py"),
    Path("tests/systems/framework/test_parameters.py"),
    Path("tests/test_docs.py"),
)
#: Loaded once, so that the forks that test have them.
LIBRARIES = ("control", "pandas", "pydrake.systems.analysis", "scipy.signal")
#: A mutant that runs this much longer than the tests did is one that hangs.
PATIENCE = 4.0
LEAST_TIMEOUT_S = 90.0


@dataclass(frozen=True)
class Mutant:
    """One fault, and what became of it."""

    module: str
    line: int
    operator: str
    diff: str
    outcome: str
    """killed, hung or survived."""
    by: str
    """The stage of tests that noticed it."""


def main() -> int:
    """Mutates, prints the survivors and the share that was killed of each module."""
    options = _options()
    modules = [path for pattern in options.modules for path in sorted(_glob(pattern))]
    found: list[Mutant] = []
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(
        options.workers, mp_context=context, max_tasks_per_child=1
    ) as pool:
        results = pool.map(partial(_mutate, options=options), modules)
        for module, mutants in zip(modules, results, strict=True):
            found += mutants
            _print_module(module, mutants)
            if options.out:
                text = json.dumps([asdict(mutant) for mutant in found], indent=1)
                Path(options.out).write_text(text, "utf-8")
    killed = sum(mutant.outcome != "survived" for mutant in found)
    print(f"\nkilled {killed} of {len(found)}: {killed / max(len(found), 1):.1%}")
    return 0


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m tools.mutants", description=__doc__
    )
    parser.add_argument("modules", nargs="*", default=list(MODULES))
    parser.add_argument("--sample", type=int, default=10, help="mutants a module (10)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    parser.add_argument("--evals", action="store_true", help="also tests/evals")
    parser.add_argument(
        "--tests", action="append", default=[], help="a test file beside those found"
    )
    parser.add_argument(
        "--deselect", action="append", default=[], help="a test that fails anyway"
    )
    parser.add_argument("--out", help="JSON file of all mutants")
    return parser.parse_args()


def _glob(pattern: str) -> list[str]:
    paths = (path for path in ROOT.glob(pattern) if path.name != "__init__.py")
    return [path.relative_to(ROOT).as_posix() for path in paths]


def _mutate(module: str, options: argparse.Namespace) -> list[Mutant]:
    """Mutates one module in a copy of the project, compiled code included."""
    for library in LIBRARIES:
        importlib.import_module(library)
    leave = shutil.ignore_patterns(".venv*", ".git", "results", ".*_cache")
    with tempfile.TemporaryDirectory(prefix="mutants.") as folder:
        copy = Path(folder) / "project"
        shutil.copytree(ROOT, copy, ignore=leave)
        shutil.copytree(ROOT / "docs", copy / "docs", dirs_exist_ok=True)
        os.chdir(copy)
        sys.path.insert(0, str(copy))
        stages = _stages(module, evals=options.evals)
        if options.tests:
            stages["named"] = options.tests
        without = [f"--deselect={test}" for test in options.deselect]
        stages = {name: [*tests, *without] for name, tests in stages.items()}
        limits = {name: _limit(module, tests) for name, tests in stages.items()}
        code = Path(module).read_text("utf-8")
        generator = random.Random(f"{options.seed} {module}")
        places = _places(code)
        mutants = []
        for place in sorted(
            generator.sample(sorted(places), min(options.sample, len(places)))
        ):
            operator, occurrence = generator.choice(places[place])
            mutated = _mutated(code, operator, occurrence)
            _write(Path(module), mutated)
            outcome, by = "survived", ""
            for name, tests in stages.items():
                outcome, by = _run(tests, limits[name]), name
                if outcome != "survived":
                    break
            diff = _diff(code, mutated, module)
            mutants.append(Mutant(module, place[0], operator, diff, outcome, by))
        os.chdir(ROOT)
    return mutants


def _limit(module: str, tests: list[str]) -> float:
    """How long the tests may take with a mutant, s."""
    start = time.perf_counter()
    if _run(tests, 3600.0) != "survived":
        raise RuntimeError(f"{module}: tests fail without a mutant: {tests}")
    return max(LEAST_TIMEOUT_S, PATIENCE * (time.perf_counter() - start))


def _stages(module: str, *, evals: bool) -> dict[str, list[str]]:
    """Test files by nearness: the mirror, those that import it, whole-system ones."""
    path = Path(module)
    mirror = Path("tests") / path.parent / f"test_{path.name}"
    dotted = module.removesuffix(".py").replace("/", ".")
    names = re.compile(rf"\b{re.escape(dotted)}\b")
    package = path.parts[0] == "systems" and path.stem.replace("_", "")
    code = path.read_text("utf-8")
    importers = []
    for test in sorted(Path("tests").rglob("test_*.py")):
        text = test.read_text("utf-8")
        block = re.search(r"from systems import ([^\n(]+|\([^)]*\))", text)
        by_block = package and block and package in block[1].lower()
        held = ("Parameters):" in code and test in PARAMETER_TESTS) or (
            "(Block" in code and "systems.__all__" in text
        )
        if test != mirror and (names.search(text) or by_block or held):
            importers.append(test)
    whole = [p for p in importers if "evals" in p.parts]
    near = [str(p) for p in importers if p not in whole]
    stages = {"mirror": [str(mirror)] if mirror.exists() else [], "importers": near}
    if evals:
        stages["evals"] = sorted({*map(str, whole), "tests/evals"})
    return {name: tests for name, tests in stages.items() if tests}


def _run(tests: list[str], limit_s: float) -> str:
    """The tests in a fork, which has the libraries loaded but none of our modules."""
    child = os.fork()
    if child == 0:
        os.setsid()
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, 1)
        os.dup2(nothing, 2)
        import pytest

        words = ["-x", "-q", "-p", "no:cacheprovider", "-p", "no:randomly", *tests]
        status = 3
        try:
            status = int(pytest.main(words))
        finally:
            os._exit(status)
    deadline = time.monotonic() + limit_s
    while time.monotonic() < deadline:
        pid, status = os.waitpid(child, os.WNOHANG)
        if pid:
            return "survived" if status in (0, 5 << 8) else "killed"
        time.sleep(0.02)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return "hung"


def _places(code: str) -> dict[tuple[int, int], list[tuple[str, int]]]:
    """(line, column) of what can be mutated: (operator, occurrence) of its mutants."""
    from cosmic_ray.ast import ast_nodes, get_ast
    from cosmic_ray.plugins import get_operator, operator_names

    tree, kept = get_ast(code), _kept_lines(code)
    places: dict[tuple[int, int], list[tuple[str, int]]] = {}
    for name in operator_names():
        if any(part in name for part in LEFT_OUT):
            continue
        operator = get_operator(name)
        if operator.arguments():
            continue
        positions = (
            start
            for node in ast_nodes(tree)
            for start, _ in operator().mutation_positions(node)
        )
        for occurrence, start in enumerate(positions):
            if kept(start):
                places.setdefault(start, []).append((name, occurrence))
    return places


def _kept_lines(code: str) -> Callable[[tuple[int, int]], bool]:
    """Whether a place is neither in an annotation nor in what is left out."""
    out: list[ast.expr | ast.stmt | None] = []
    for node in ast.walk(ast.parse(code)):
        match node:
            case ast.JoinedStr():
                out.append(node)
            case ast.AnnAssign():
                out.append(node.annotation)
            case ast.FunctionDef():
                out += [node.returns, *node.decorator_list]
                out += [
                    arg.annotation
                    for arg in ast.walk(node.args)
                    if isinstance(arg, ast.arg)
                ]
            case ast.ClassDef():
                out += node.decorator_list
            case ast.If(test=ast.Name(id="TYPE_CHECKING")):
                out.append(node)
            case ast.Assign(targets=[ast.Name(id=name)]) if name == "__all__":
                out.append(node)
    spans = [
        ((n.lineno, n.col_offset), (n.end_lineno or 0, n.end_col_offset or 0))
        for n in out
        if n
    ]
    return lambda start: not any(first <= start <= last for first, last in spans)


def _mutated(code: str, operator: str, occurrence: int) -> str:
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.plugins import get_operator

    return str(mutate_code(code, get_operator(operator)(), occurrence))


def _write(path: Path, code: str) -> None:
    """Writes a module, without what was compiled from the last one.

    Numba compiles a function into those that call it, in whichever file, and looks
    only whether their own file has changed.
    """
    path.write_text(code, "utf-8")
    changed = [path]
    for module in changed:
        for compiled in (module.parent / "__pycache__").glob(f"{module.stem}.*"):
            compiled.unlink()
        if "@njit" in module.read_text("utf-8"):
            dotted = ".".join(module.with_suffix("").parts)
            callers = re.compile(rf"from {re.escape(dotted)} import")
            changed += [
                other
                for room in ("systems", "analysis")
                for other in Path(room).rglob("*.py")
                if other not in changed and callers.search(other.read_text("utf-8"))
            ]


def _diff(code: str, mutated: str, module: str) -> str:
    lines = difflib.unified_diff(
        code.splitlines(), mutated.splitlines(), module, module, lineterm="", n=1
    )
    return "\n".join(list(lines)[2:])


def _print_module(module: str, mutants: list[Mutant]) -> None:
    killed = sum(mutant.outcome != "survived" for mutant in mutants)
    print(f"{module}: killed {killed} of {len(mutants)}", flush=True)
    for mutant in mutants:
        if mutant.outcome == "survived":
            print(f"  survived, {mutant.operator.removeprefix('core/')}:")
            print("    " + mutant.diff.replace("\n", "\n    "), flush=True)


if __name__ == "__main__":
    sys.exit(main())
