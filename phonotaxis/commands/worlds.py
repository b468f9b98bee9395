"""``phonotaxis worlds``: lists the worlds of a set."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from phonotaxis.commands.arguments import completed_by, take_json
from phonotaxis.commands.command import Command, Printed, Take
from phonotaxis.result import Prepared


def _add_arguments(parser: ArgumentParser) -> None:
    path = parser.add_argument(
        "path",
        nargs="?",
        default="shipped",
        help="folder with worlds (default: the worlds that come with phonotaxis)",
    )
    completed_by(path, "directory")
    take_json(parser)


def _prepare(options: Namespace, take: Take) -> Prepared[Printed]:
    from phonotaxis.listings import worlds

    found = worlds(options.path)
    return Prepared(run=lambda _: Printed(found.document(), str(found)))


COMMAND = Command(
    "worlds",
    "list worlds of cylinders, for simulate and compare",
    _add_arguments,
    _prepare,
    examples=("worlds", "worlds barn --json"),
)
