"""``phonotaxis doctor``: checks whether everything that a run needs is installed."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from analysis.commands.arguments import take_json
from analysis.commands.command import Command, Job, Take

if TYPE_CHECKING:
    from analysis.installation import Diagnosis

_SIGNS = {"ok": "ok  ", "note": "note", "bad": "BAD "}


def _prepare(options: Namespace, take: Take) -> Job[list[Diagnosis]]:
    from analysis.installation import examine
    from analysis.run_error import RunError

    def summary(findings: list[Diagnosis]) -> dict[str, Any]:
        return {
            "schema_version": 1,
            "ok": not _bad(findings),
            "findings": [asdict(each) for each in findings],
        }

    def text(findings: list[Diagnosis], _: dict[str, Any]) -> str:
        lines = []
        for each in findings:
            remedy = f"; {each.remedy}" if each.remedy else ""
            lines.append(f"{_SIGNS[each.verdict]} {each.name:<15} {each.found}{remedy}")
        return "\n".join(lines)

    def demand(findings: list[Diagnosis]) -> None:
        if bad := _bad(findings):
            raise RunError(f"not ready: {', '.join(bad)}")

    return Job(run=lambda _: examine(), summary=summary, text=text, demand=demand)


def _bad(findings: list[Diagnosis]) -> list[str]:
    return [each.name for each in findings if each.verdict == "bad"]


COMMAND = Command(
    "doctor",
    "check the installation: packages, compiled code, sound card, browser, disk",
    take_json,
    _prepare,
    examples=("doctor", "doctor --json"),
)
