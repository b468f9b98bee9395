"""The plan of a sweep: which scenarios to run, with random draws and seeds."""

from __future__ import annotations

import copy
import hashlib
import json
import math
import pickle
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Annotated, Any
from zlib import crc32

import numpy as np
from pydantic import Field, Strict, ValidationError, model_validator

from analysis.batches.conditions import Conditions
from analysis.batches.distributions import Distribution
from analysis.batches.sweep_file import read_sweep
from analysis.report.file_names import distinct_names
from diagrams.scenario.fields.explain import explain
from diagrams.scenario.loading import (
    SCENARIO_FILE,
    resolve_files,
    written_fields,
)
from diagrams.scenario.own_code import own_files
from diagrams.scenario.own_objects import require_file, with_names
from diagrams.scenario.scenario import Scenario, scenario_from_mapping
from diagrams.scenario.settings import apply_settings, set_fields
from diagrams.scenario.worlds.catalog import world_files
from diagrams.scenario.yaml_text import dump_yaml
from systems.framework.input_error import InputError
from systems.framework.parameters import Line, Parameters

GridValues = Annotated[tuple[Any, ...], Strict(False), Field(min_length=1)]
#: Greatest number of runs. All runs are drawn and checked before the first one starts,
#: which takes about 1 ms per run.
MOST_RUNS = 1_000_000
#: Number of cells that ``SweepPlan.check`` checks before all runs are drawn.
_FIRST_CELLS = 64
Count = Annotated[int, Field(ge=1, le=MOST_RUNS)]


@dataclass(frozen=True)
class SweepPoint:
    """One run of a sweep."""

    index: int
    """Number of the run in the sweep: ``run`` times number of cells, plus ``cell``."""
    cell: int
    """Number of the cell of the grid, from 0."""
    run: int
    """Number of the run within the cell, from 0."""
    seed: int
    """Seed of the scenario."""
    fields: dict[str, Any]
    """Values of all fields in ``grid`` and ``draw``, by dotted path."""
    redraws: int
    """Number of draws that made no valid scenario and were replaced."""


class SweepPlan(Parameters):
    """Plan of a parameter sweep: the variants of a scenario to run.

    The format is described in docs/compare.md. A field has a dotted path, for example
    ``source.speed_m_s``. A key of ``draw`` may list several paths, separated by commas.
    All these fields then get the same drawn value, or values that ``each`` of the
    distribution derives from the drawn number.
    """

    name: Line = Field(default="sweep", min_length=1)
    """Title of the result page."""
    scenario: str = Field(default="default", min_length=1)
    """Name of a scenario in the library, or path of a YAML file relative to
    ``folder``."""
    set: dict[str, Any] = Field(default_factory=dict)
    """Fields with the same value in all runs."""
    grid: dict[str, GridValues] = Field(default_factory=dict)
    """Fields with several values. Each combination of values is a cell."""
    draw: dict[str, Distribution] = Field(default_factory=dict)
    """Distributions of the fields that are drawn for every run. A scenario first gets
    the fields of ``set``, then those of ``grid``, and then the drawn fields."""
    require: Conditions = Conditions()
    """Conditions on every layout. If a draw violates them, the draw is not valid."""
    runs: Count = 1
    """Number of runs in each cell."""
    seed: int = Field(default=1, ge=0, lt=2**63)
    """Seed of all draws. It also determines the seeds of all scenarios."""
    pair: bool = True
    """If true, run k has the same draws and the same scenario seed in every cell."""
    redraws: int = Field(default=0, ge=0, le=10_000)
    """Greatest number of times that a run is drawn again if its draws make no valid
    scenario. If ``pair`` is true, the draws must make a valid scenario in every
    cell."""
    trajectories: bool = False
    """Whether to keep the trajectory of every run."""
    folder: str = Field(default=".", min_length=1, exclude=True)
    """Folder in which relative paths start: the folder of the sweep's file."""

    def __init__(self, **fields: Any) -> None:
        try:
            super().__init__(**fields)
        except ValidationError as error:
            raise explain(error, type(self).model_json_schema(), "a sweep") from None

    @model_validator(mode="before")
    @classmethod
    def _name_objects(cls, data: Any) -> Any:
        return with_names(data)

    @model_validator(mode="after")
    def _check_fields(self) -> SweepPlan:
        earlier: list[str] = []
        for part in ("set", "grid", "draw"):
            for key in getattr(self, part):
                for path in _paths(key):
                    _check_path(f"{part}.{path}", path, earlier)
                    earlier.append(path)
            if part != "set":
                _check_presets(part, getattr(self, part), [*self.set])
        for key, values in self.grid.items():
            texts = [json.dumps(value, default=str) for value in values]
            for text in texts:
                if texts.count(text) > 1:
                    raise InputError(
                        f"grid.{key}", f"{text} is listed twice; remove one"
                    )
        for key, distribution in self.draw.items():
            each, count = distribution.each, len(_paths(key))
            if each is not None and len(each) != count:
                raise InputError(
                    f"draw.{key}.each",
                    f"has {len(each)} pairs for {count} paths; give one pair per path",
                )
        total = self.runs * self.cell_count
        if total > MOST_RUNS:
            raise InputError(
                "grid",
                f"its cells with {self.runs} runs each make {total} runs; at most "
                f"{MOST_RUNS} are possible, narrow grid or lower runs",
            )
        for part in ("set", "grid"):
            _check_plain(part, getattr(self, part))
        _check_plain("draw", self.model_dump(include={"draw"}, exclude_none=True))
        for field, name in self._own_names({**self.set, **self.grid}):
            require_file(name, field, "a sweep runs in several processes")
        return self

    @cached_property
    def base(self) -> dict[str, Any]:
        """Fields of the scenario file after ``set`` is applied.

        The caller must not change this mapping. If the sweep sets an element of a list,
        the mapping contains the whole list, even if the scenario file omits the list.
        """
        data = written_fields(self.source)
        _state_lists(data, scenario_from_mapping(data), self.set)
        apply_settings(data, copy.deepcopy(self.set), Path(self.folder))
        resolve_files(data, Path(self.folder))
        _state_lists(data, scenario_from_mapping(data), self.paths)
        return data

    @cached_property
    def _base_copy(self) -> bytes:
        """Pickle of ``base``. Loading it is five times faster than ``deepcopy``."""
        return pickle.dumps(self.base)

    @property
    def source(self) -> str:
        """Name of the scenario in the library, or full path of the scenario's file."""
        if Path(self.scenario).suffix in (".yaml", ".yml"):
            return str(Path(self.folder).absolute() / self.scenario)
        return self.scenario

    @property
    def paths(self) -> list[str]:
        """Dotted paths of all fields in ``grid`` and ``draw``."""
        return [path for key in (*self.grid, *self.draw) for path in _paths(key)]

    @property
    def cell_count(self) -> int:
        """Number of cells of the grid."""
        return math.prod(len(values) for values in self.grid.values())

    def cells(self) -> list[dict[str, Any]]:
        """Returns the values of ``grid`` in each cell; an empty grid has one cell."""
        return [
            dict(zip(self.grid, values, strict=True))
            for values in product(*self.grid.values())
        ]

    def points(self) -> list[SweepPoint]:
        """Draws all runs, and checks the scenario of each run.

        Returns:
            Runs, sorted by their number. The draws of a run do not depend on the total
            number of runs.

        Raises:
            InputError: A field is unknown, or a value or a layout is not valid. The
                message names the field by its dotted path.
        """
        cells = self.cells()
        points: list[SweepPoint] = []
        for run in range(self.runs):
            if self.pair:
                points += self._draw_run(run, list(enumerate(cells)), [])
                continue
            for cell, fields in enumerate(cells):
                label = crc32(json.dumps(fields).encode())
                points += self._draw_run(run, [(cell, fields)], [label])
        return points

    def check(self) -> None:
        """Checks the first 64 cells of the grid, before all runs are drawn.

        A cell is one combination of the values in the grid. The function checks each
        cell twice: without random draws, and with the first draws. It rejects a cell
        only if neither scenario is valid. The method ``points`` is slower, but finds
        all faults.

        Raises:
            InputError: One of these cells is not valid.
        """
        drawn = dict(self._draws([self.seed, 0, 0]))
        for cell, fields in enumerate(self.cells()[:_FIRST_CELLS]):
            alone = SweepPoint(cell, cell, 0, self.seed, fields, 0)
            both = replace(alone, fields={**fields, **drawn})
            if self._fault(alone) and (fault := self._fault(both)):
                raise InputError(
                    fault.field,
                    f"{fault.message} (cell {cell} of the grid)",
                    others=fault.all[1:],
                )

    def _fault(self, point: SweepPoint) -> InputError | None:
        try:
            self.scenario_of(point)
        except InputError as error:
            return error
        return None

    def scenario_of(self, point: SweepPoint) -> Scenario:
        """Makes the scenario of a run."""
        data = pickle.loads(self._base_copy)
        apply_settings(data, copy.deepcopy(point.fields), Path(self.folder))
        data["seed"] = point.seed
        resolve_files(data, Path(self.folder))
        return scenario_from_mapping(data)

    @property
    def digest(self) -> str:
        """Hash of everything that influences the draws and the runs.

        The number of runs influences neither.
        """
        base = scenario_from_mapping(self.base).model_dump(mode="json")
        # ``base`` has the contents of the scenario, wherever its file is.
        rest = self.model_dump(mode="json", exclude={"runs", "scenario"})
        document = {**rest, "base": base}
        if self.named_digests:
            document["files"] = self.named_digests
        return hashlib.sha256(json.dumps(document).encode()).hexdigest()

    @cached_property
    def file_digests(self) -> dict[str, str]:
        """SHA-256 of each sound file and user's module that the runs use, by path."""
        files: set[Path] = set()
        for field, text in self._own_names({**self.base, **self.grid}):
            files.update(own_files(text, field))
        for field, text in self._all_texts({**self.base, **self.grid}):
            if field in ("file", "ego_noise_file"):
                files.add(Path(self.folder, text).resolve())
            elif field == "world" and text:
                files.update(world_files(text, Path(self.folder)))
        return {
            str(path): hashlib.sha256(path.read_bytes()).hexdigest()
            for path in sorted(files)
            if path.is_file()
        }

    def own_names(self) -> list[str]:
        """Returns the names of all laws and blocks that the runs use, each once."""
        named = self._own_names({**self.base, **self.grid})
        return list(dict.fromkeys(name for _, name in named))

    def _own_names(self, fixed: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
        for field, text in self._all_texts(fixed):
            if field in ("law", "blocks"):
                yield field, text

    def _all_texts(self, fixed: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
        """Yields the texts in ``fixed`` and in the draws, with the names of fields."""
        drawn = self.model_dump(include={"draw"})["draw"]
        yield from _texts("", {**fixed, **drawn})

    @property
    def named_digests(self) -> dict[str, str]:
        """``file_digests`` by names of files, without their folders."""
        names = distinct_names(Path(path).name for path in self.file_digests)
        return dict(zip(names, self.file_digests.values(), strict=True))

    def _draw_run(
        self, run: int, cells: list[tuple[int, dict[str, Any]]], stream: list[int]
    ) -> list[SweepPoint]:
        """Draws one run in several cells, which all get the same draws.

        The argument ``run`` is the number of the run, and ``cells`` contains the
        number and the fields of each cell. The numbers in ``stream`` make the draws
        differ from those of other cells. Raises InputError if no attempt gives a valid
        scenario in all cells.
        """
        entropy = [self.seed, run, *stream]
        seed = int(np.random.SeedSequence(entropy).generate_state(1, np.uint64)[0] >> 1)
        for attempt in range(self.redraws + 1):
            drawn = dict(self._draws([*entropy, attempt]))
            points = [
                SweepPoint(
                    index=run * self.cell_count + cell,
                    cell=cell,
                    run=run,
                    seed=seed,
                    fields={**fields, **drawn},
                    redraws=attempt,
                )
                for cell, fields in cells
            ]
            complaint = self._complaint(points)
            if complaint is None:
                return points
        assert complaint is not None
        raise complaint

    def _complaint(self, points: list[SweepPoint]) -> InputError | None:
        """Returns the fault of the first scenario that is not valid, or None."""
        for point in points:
            try:
                self.require.check(self.scenario_of(point))
            except InputError as error:
                where = f"cell {point.cell} of the grid"
                if self._valid_undrawn(point):
                    times = f"drawn {self.redraws + 1} times; " if self.redraws else ""
                    where = f"run {point.run}, {where}; {times}narrow the draws, or "
                    where += "raise redraws to replace such runs"
                message = f"{error.message} ({where})"
                return InputError(error.field, message, others=error.all[1:])
        return None

    def _valid_undrawn(self, point: SweepPoint) -> bool:
        undrawn = replace(point, fields=self.cells()[point.cell])
        return bool(self.draw) and self._fault(undrawn) is None

    def _draws(self, entropy: list[int]) -> Iterator[tuple[str, Any]]:
        """Draws the values of all fields in ``draw``; yields paths and values.

        The numbers in ``entropy`` are the seed. The second one is the run. The draws of
        one key do not depend on the other keys.
        """
        for key, distribution in self.draw.items():
            words = [*entropy, crc32(key.encode())]
            generator = np.random.Generator(np.random.Philox(seed=words))
            paths = _paths(key)
            drawn = distribution.draw(generator, len(paths), entropy[1])
            yield from zip(paths, drawn, strict=True)


def load_sweep(path: str | Path) -> SweepPlan:
    """Loads the plan of a parameter sweep from a YAML file.

    Relative paths in the file start in its folder. Raises InputError if the file cannot
    be read, or if a field is unknown or not valid.
    """
    data = read_sweep(path)
    try:
        return SweepPlan.model_validate(data)
    except ValidationError as error:
        raise explain(error, SweepPlan.model_json_schema(), "a sweep") from None


def dump_plan(plan: SweepPlan) -> str:
    """Writes the plan as YAML, which ``load_sweep`` can load.

    If the scenario is a file, the plan names ``scenario.yaml``: a result directory has
    this file beside the plan, and no path of the machine.
    """
    document = plan.model_dump(mode="json", exclude_none=True)
    if plan.source != plan.scenario:
        document["scenario"] = SCENARIO_FILE
    return dump_yaml(document)


def _paths(key: str) -> list[str]:
    return [path.strip() for path in key.split(",")]


def _texts(key: str, value: Any) -> Iterator[tuple[str, str]]:
    """Yields each text within a value, preceded by the name of its field."""
    if isinstance(value, dict):
        for inner, item in value.items():
            for path in _paths(str(inner)):
                known = path.split(".")[-1]
                # Listed values belong to the field that is drawn.
                listed = known in ("choice", "in_turn")
                yield from _texts(key if listed else known, item)
    elif isinstance(value, list | tuple):
        for item in value:
            yield from _texts(key, item)
    elif isinstance(value, str):
        yield key, value


def _state_lists(
    data: dict[str, Any], scenario: Scenario, paths: Iterable[str]
) -> None:
    """Adds lists to the fields of a scenario, so that their elements can be set later.

    A list is added if a path leads into the list and ``data`` does not contain it yet.
    The added list has its value from ``scenario``.
    """
    whole = scenario.model_dump(mode="json")
    for group in ("robots", "sources"):
        named = getattr(scenario, group)
        whole[group] = {k: each.model_dump(mode="json") for k, each in named.items()}
    for path in paths:
        parts = path.split(".")
        index = next((k for k, part in enumerate(parts) if part.isdigit()), 0)
        values, there = _value_at(whole, parts[:index]), _value_at(data, parts[:index])
        if isinstance(values, list) and there is None:
            set_fields(data, [(".".join(parts[:index]), values)])


def _value_at(data: Any, place: Sequence[str]) -> Any:
    for part in place:
        data = data.get(part) if isinstance(data, dict) else None
    return data


def _check_path(field: str, path: str, earlier: list[str]) -> None:
    if not all(path.split(".")):
        raise InputError(
            field, "is not a dotted path like source.speed_m_s; correct it"
        )
    if path == "seed":
        raise InputError(
            field, "every run gets a seed of its own; set the sweep's own seed"
        )
    for other in earlier:
        if path == other or other.startswith(f"{path}."):
            raise InputError(
                field, f"would overwrite {other}, which precedes it; remove one of them"
            )


def _check_presets(part: str, keys: Iterable[str], fixed: list[str]) -> None:
    """Rejects a field ``preset`` that would overwrite a field in ``set``."""
    for path in (path for key in keys for path in _paths(key)):
        group, _, last = path.rpartition(".")
        for other in fixed if last == "preset" else ():
            if f"{other}.".startswith(f"{group}."):
                raise InputError(
                    f"{part}.{path}",
                    f"replaces all of {group}, without {other} from set; give this "
                    "field in grid, too",
                )


def _check_plain(part: str, value: Any) -> None:
    try:
        json.dumps(value, allow_nan=False)
    except (TypeError, ValueError):
        raise InputError(
            part,
            "values must be finite numbers, texts, truth values, lists or mappings; "
            "put quotes around text",
        ) from None
