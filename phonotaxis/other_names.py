"""Names that users guess in Python, and what they mean."""

from __future__ import annotations

from collections.abc import Iterable

#: What to write instead of a name that the package does not have.
_OF_MODULE = {
    "run": "simulate",
    "sim": "simulate",
    "Simulation": "simulate",
    "Simulator": "simulate",
    "Robot": "load_scenario",
    "World": "load_scenario",
    "Environment": "load_scenario",
    "load": "load_scenario",
    "read_scenario": "load_scenario",
    "Law": "laws",
    "list_laws": "laws",
    "list_scenarios": "scenarios",
    "plot": "simulate('default').plot",
    "show": "simulate('default').plot",
    "replay": "simulate('default').replay",
    "animate": "simulate('default').replay",
    "linearize": "stability('default').state_space",
    "margins": "stability",
    "parameter_sweep": "sweep",
    "benchmark": "compare",
    "track": "listen",
    "Array": "ArrayGeometry",
    "load_geometry": "ArrayGeometry",
    "fields": "Scenario.model_fields",
}
#: What to write instead of an attribute that results do not have.
_OF_RESULT = {
    "plot_trajectory": "plot",
    "plot_time_series": "plot('time_series')",
    "show": "plot",
    "figure": "plot",
    "fig": "plot",
    "animate": "replay",
    "animation": "replay",
    "movie": "replay",
    "df": "trajectory",
    "data": "trajectory",
    "dataframe": "trajectory",
    "to_pandas": "trajectory",
    "states": "trajectory",
    "t": "time",
    "outcome": "ending",
    "status": "cause",
    "collided": "collision",
    "ok": "success",
    "to_dict": "document",
    "to_json": "document",
    "json": "document",
    "summary": "document",
    "warnings": "notes",
    "write_figures": "save_figures",
    "savefig": "save_figures",
    "results": "table",
    "runs": "table",
    "rows": "table",
}


def of_module(name: str, known: Iterable[str]) -> str:
    """Suggests a public name for a name that the package does not have.

    Args:
        name: The unknown name.
        known: Public names of the package.

    Returns:
        End of the message; empty if there is no suggestion.
    """
    if name.startswith("_"):
        return ""
    return _hint(name, _OF_MODULE.get(name, ""), known, "phonotaxis.")


def of_result(name: str, known: Iterable[str]) -> str:
    """Suggests an attribute of a result, see ``of_module``."""
    if name.startswith("_"):
        return ""
    known = sorted(known)
    meant = _OF_RESULT.get(name, "")
    if meant.partition("(")[0] not in known:
        meant = ""
    return _hint(name, meant, known, ".")


def _hint(name: str, meant: str, known: Iterable[str], before: str) -> str:
    if not meant:
        from difflib import get_close_matches

        meant = next(iter(get_close_matches(name, known, n=1)), "")
    return f"; did you mean {before}{meant}?" if meant else ""
