"""Runs the steps of the Dockerfile in an empty folder, without a container.

``python -m tools.run_dockerfile FOLDER`` copies what git knows into FOLDER, runs each
``RUN`` that needs no package manager of the system there, and at last ``CMD``. What it
cannot check is the base image.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def steps(text: str) -> list[tuple[str, str]]:
    """Instructions and their arguments, without comments; continued lines joined."""
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    joined = re.sub(r"\\\n\s*", "", "\n".join(lines))
    parts = (line.partition(" ") for line in joined.splitlines() if line.strip())
    return [(name.upper(), rest.strip()) for name, _, rest in parts]


def main(folder: Path) -> int:
    """Runs all; the status is that of the step that failed, or 0."""
    folder.mkdir(parents=True)
    environment = dict(os.environ)
    for name, rest in steps((ROOT / "Dockerfile").read_text("utf-8")):
        if name == "COPY":
            _copy(folder)
        elif name == "ENV":
            key, _, value = rest.partition("=")
            path = value.strip('"').replace("/phonotaxis", str(folder))
            environment[key] = os.path.expandvars(path)
        elif name in ("RUN", "CMD"):
            command = " ".join(json.loads(rest)) if name == "CMD" else rest
            if command.startswith("apt-get"):
                print(f"left to the system: {command}")
                continue
            print(f"+ {command}", flush=True)
            done = subprocess.run(
                command, shell=True, cwd=folder, env=environment, check=False
            )
            if done.returncode:
                return done.returncode
    return 0


def _copy(folder: Path) -> None:
    known = subprocess.run(
        ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.splitlines()
    for name in known:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, folder / name)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(f"{(__doc__ or '').splitlines()[0]}\nName the folder.")
    sys.exit(main(Path(sys.argv[1]).resolve()))
