"""``phonotaxis completion``: what the tab key does in a shell."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Iterable

from analysis.commands.arguments import LAW_WORDS, SCENARIO_WORDS, take_json
from analysis.commands.command import Command, Job, Take

__all__ = ["COMMAND"]

#: A function of a shell that gives some words, and files.
_FUNCTIONS = {
    "bash": '{name}() {{ compgen -W "{words}" -- "$1"; compgen -f -- "$1"; }}',
    "zsh": "{name}() {{ _alternative 'words:name:({words})' 'files:file:_files' }}",
    "fish": "function {name}\n"
    "  string split ' ' '{words}'; __fish_complete_path (commandline -ct)\nend",
}


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("shell", choices=list(_FUNCTIONS), help="whose script it is")
    take_json(parser)


def _prepare(options: Namespace, take: Take) -> Job[str]:
    from diagrams import library_scenarios
    from diagrams.fields import known_laws

    def script() -> str:
        import shtab

        functions = [
            _function(options.shell, SCENARIO_WORDS, library_scenarios()),
            _function(options.shell, LAW_WORDS, known_laws()),
        ]
        text: str = shtab.complete(
            options.parser, shell=options.shell, preamble="\n".join(functions)
        )
        return text

    return Job(
        run=lambda _: script(),
        summary=lambda text: {"schema_version": 1, "script": text},
        text=lambda text, _: text,
    )


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
