"""What the tab key offers, asked of the shells themselves."""

from __future__ import annotations

import os
import pty
import re
import select
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

import phonotaxis
from diagrams import library_scenarios
from diagrams.scenario.fields.shipped import known_laws
from phonotaxis.commands.command_line import COMMANDS

#: A shell that says nothing for so long hangs.
WAIT_S = 60.0
#: What zsh does at the tab key: it lists, and says that it is done.
ZSH = """\
autoload -Uz compinit; compinit -u -D
PS1=; setopt list_packed; LISTMAX=10000
zstyle ':completion:*' verbose no
offer() {{ zle list-choices; zle -R; zle -I; print 'OFF''ERED' }}
zle -N offer; bindkey '^I' offer
{setup}
print 'REA''DY'
"""


def installed(shell: str) -> str:
    if program := shutil.which(shell):
        return program
    pytest.skip(f"{shell} is not installed")


def in_bash(script: Path, line: str) -> set[str]:
    words = line.split(" ")
    quoted = " ".join(f"'{word}'" for word in words)
    code = (
        f"source {script}\nCOMP_WORDS=({quoted}); COMP_CWORD={len(words) - 1}\n"
        "_shtab_phonotaxis\nprintf '%s\\n' \"${COMPREPLY[@]}\""
    )
    ran = subprocess.run(
        ["bash", "--norc", "-c", code], capture_output=True, text=True, check=True
    )
    return set(ran.stdout.split())


def in_fish(script: Path, line: str) -> set[str]:
    """``complete -C`` tells what the tab key would offer, with meanings after a tab."""
    code = f"cat {script} | source; complete -C '{line}'"
    ran = subprocess.run(
        [installed("fish"), "--no-config", "-c", code],
        capture_output=True,
        text=True,
        check=True,
    )
    assert not ran.stderr
    return {each.partition("\t")[0] for each in ran.stdout.splitlines()}


def in_zsh(script: Path, line: str) -> set[str]:
    return _typed_in_zsh(f"source {script}", line)


def in_zsh_by_fpath(script: Path, line: str) -> set[str]:
    """As a function that is loaded when it is needed."""
    folder = script.with_name("functions")
    folder.mkdir(exist_ok=True)
    shutil.copy(script, folder / "_phonotaxis")
    setup = f"fpath=({folder} $fpath); compinit -u -D"
    return _typed_in_zsh(setup, line)


def _typed_in_zsh(setup: str, line: str) -> set[str]:
    """Completion of zsh works in a terminal alone."""
    program = installed("zsh")
    here, there = pty.openpty()
    shell = subprocess.Popen(
        [program, "-f", "-i"],
        stdin=there,
        stdout=there,
        stderr=there,
        start_new_session=True,
        env={**os.environ, "TERM": "xterm", "COLUMNS": "400"},
    )
    os.close(there)
    try:
        os.write(here, ZSH.format(setup=setup).encode())
        _heard(here, "READY")
        os.write(here, line.encode() + b"\t")
        told = _heard(here, "OFFERED")
    finally:
        shell.kill()
        shell.wait()
        os.close(here)
    # The line stands before the list and after it, and may have been echoed before.
    rows = re.split(r"[\r\n]+", told.partition("OFFERED")[0])
    before, after = [k for k, row in enumerate(rows) if line in row][-2:]
    return {word for row in rows[before + 1 : after] for word in row.split()}


def _heard(terminal: int, end: str) -> str:
    """All that a terminal shows until a word, without its control sequences."""
    shown = b""
    while end.encode() not in shown:
        ready, _, _ = select.select([terminal], [], [], WAIT_S)
        assert ready, f"no {end} after {shown.decode()!r}"
        shown += os.read(terminal, 4096)
    return re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", shown.decode())


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a scenario and a directory of one's own, where the shells are."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "two_of_mine.yaml").touch()
    (tmp_path / "my_results").mkdir()
    return tmp_path


@pytest.mark.parametrize(
    ("shell", "complete"),
    [
        ("bash", in_bash),
        ("zsh", in_zsh),
        ("zsh", in_zsh_by_fpath),
        ("fish", in_fish),
    ],
)
def test_shells_complete(
    capsys, home: Path, shell: str, complete: Callable[[Path, str], set[str]]
):
    assert phonotaxis.main(["completion", shell]) == 0
    (home / "hidden").mkdir()
    script = home / "hidden" / "script"
    script.write_text(capsys.readouterr().out)

    def offered(line: str) -> set[str]:
        return {word.rstrip("/") for word in complete(script, line)}

    assert offered("phonotaxis s") == {name for name in COMMANDS if name[0] == "s"}
    assert offered("phonotaxis simulate two_") == {
        "two_of_mine.yaml",
        *(name for name in library_scenarios() if name.startswith("two_")),
    }
    assert offered("phonotaxis simulate --law active") == {
        name for name in known_laws() if name.startswith("active")
    }
    assert offered("phonotaxis simulate --velo") == {"--velocity-term"}
    assert offered("phonotaxis simulate u_trap --guard o") == {"on", "off"}
    assert offered("phonotaxis sweep tw") == {"two_of_mine.yaml"}
    assert offered("phonotaxis locate --geometry tw") == {"two_of_mine.yaml"}
    assert offered("phonotaxis export my") == {"my_results"}


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_scripts_name_scenarios(capsys, shell):
    """Where the shell is not installed, this is all that is known."""
    assert phonotaxis.main(["completion", shell]) == 0
    script = capsys.readouterr().out
    assert "_phonotaxis_scenario_or_file" in script
    assert "two_static_obstacles" in script
    if shell == "zsh":
        assert "== (eval|file) ]]" in script
