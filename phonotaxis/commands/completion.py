"""``phonotaxis completion``: prints a script with which a shell completes words."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Iterable

from phonotaxis.commands.arguments import (
    LAW_WORDS,
    SCENARIO_WORDS,
    completed_by,
    take_json,
)
from phonotaxis.commands.command import Command, Printed, Take
from phonotaxis.result import Prepared

#: Text of a shell function, by shell. The function completes words and file names.
_FUNCTIONS = {
    "bash": '{name}() {{ compgen -W "{words}" -- "$1"; compgen -f -- "$1"; }}',
    "zsh": "{name}() {{ _alternative 'words:name:({words})' 'files:file:_files' }}",
    "fish": "function {name}\n"
    "  string split ' ' '{words}'; __fish_complete_path (commandline -ct)\nend",
}


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument(
        "shell", choices=list(_FUNCTIONS), help="shell that the script is for"
    )
    take_json(parser)


def _prepare(options: Namespace, take: Take) -> Prepared[Printed]:
    import shtab

    from analysis.report.provenance import SCHEMA_VERSION
    from diagrams import library_scenarios
    from diagrams.scenario.fields.shipped import known_laws

    _complete_paths(options.parser)
    functions = [
        _function(options.shell, SCENARIO_WORDS, library_scenarios()),
        _function(options.shell, LAW_WORDS, known_laws()),
    ]
    script: str = shtab.complete(
        options.parser, shell=options.shell, preamble="\n".join(functions)
    )
    # shtab registers the function only if the script runs under eval. Users also
    # source such scripts.
    script = script.replace("[-1] == eval ]]", "[-1] == (eval|file) ]]")
    return Prepared(
        run=lambda _: Printed(
            {"schema_version": SCHEMA_VERSION, "script": script}, script
        )
    )


def _complete_paths(parser: ArgumentParser) -> None:
    """Sets the completion of file and directory arguments, by the word in the help."""
    for command in parser.below.values():  # type: ignore[attr-defined]
        for argument in command._actions:
            name = str(argument.metavar)
            if hasattr(argument, "complete"):
                continue
            if name == "DIR":
                completed_by(argument, "directory")
            elif name == "FILE" or name.endswith(".yaml"):
                completed_by(argument, "file")


def _function(shell: str, words: dict[str, str], names: Iterable[str]) -> str:
    name = words["bash"]
    return _FUNCTIONS[shell].format(name=name, words=" ".join(names))


COMMAND = Command(
    "completion",
    "print a script that completes commands, options, scenarios and laws",
    _add_arguments,
    _prepare,
    examples=(
        "completion bash > ~/.local/share/bash-completion/completions/phonotaxis",
        "completion zsh > ~/.zfunc/_phonotaxis",
        "completion fish > ~/.config/fish/completions/phonotaxis.fish",
    ),
)
