"""Copies of a user's own laws and blocks in a result directory."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path

from diagrams.scenario.own_code import loaded_files
from diagrams.scenario.own_objects import source_in_memory

#: Folder of the copies in a result directory, and the file of their SHA-256 sums.
FOLDER, SUMS = "own_code", "SHA256SUMS"


def write_own_sources(names: Iterable[str], directory: Path) -> None:
    """Writes the source code of laws and blocks, and its SHA-256 sums.

    A copy of a file has the version that Python loaded. The names of copies are those
    of the files, with a number if two have the same name. ``sha256sum --check`` reads
    the sums. Without own code, the function writes nothing.

    Args:
        names: Names of laws and blocks. Those of the package have no effect.
        directory: Existing directory, in which the function makes the folder.
    """
    texts: dict[str, bytes] = {}
    for name in names:
        texts.update(loaded_files(name))
        if source := source_in_memory(name):
            texts[f"{name.partition(':')[0]}.py"] = source.encode()
    if not texts:
        return
    folder = directory / FOLDER
    folder.mkdir(exist_ok=True)
    sums: dict[str, str] = {}
    for path, text in texts.items():
        stem, ending = Path(path).stem, Path(path).suffix
        copy, number = f"{stem}{ending}", 2
        while copy in sums:
            copy, number = f"{stem}_{number}{ending}", number + 1
        (folder / copy).write_bytes(text)
        sums[copy] = hashlib.sha256(text).hexdigest()
    lines = [f"{digest}  {copy}\n" for copy, digest in sums.items()]
    (folder / SUMS).write_text("".join(lines), "utf-8")
