"""Names of files and folders that are made of a user's own names."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Sequence

#: What some file systems do not take in a name.
_RESERVED = re.compile(r'[<>:"/\\|?*\x00-\x1f\x7f]')
#: Most systems take 255; what is added to a name needs the rest.
_MOST_BYTES = 200


def distinct_names(
    wanted: Iterable[str],
    *,
    taken: Iterable[str] = (),
    endings: Sequence[str] = ("",),
    joint: str = "-",
) -> list[str]:
    """Names for files of one folder, each as it is wanted where that is possible.

    Names count as one also where they differ in case alone, as they do for the file
    systems of macOS and Windows.

    Args:
        wanted: Any text; a user's names.
        taken: Names of other files in that folder.
        endings: Each name stands for files with these endings.
        joint: Stands before the number of a name that is taken, as in ``summary-2``.

    Returns:
        A name for each text, in order. Reserved characters become hyphens, dots at
        its ends are left out, and it has at most 200 bytes before its number.
    """
    used = {_folded(name) for name in taken}
    names = []
    for text in wanted:
        name = plain = _plain(text)
        number = 1
        while used & (files := {_folded(f"{name}{ending}") for ending in endings}):
            number += 1
            name = f"{plain}{joint}{number}"
        used |= files
        names.append(name)
    return names


def _plain(text: str) -> str:
    encoded = text.encode("utf-8", "backslashreplace")[:_MOST_BYTES]
    # Names of one or two dots are folders that exist; one more dot hides a file.
    plain = _RESERVED.sub("-", encoded.decode("utf-8", "ignore")).strip(". ")
    return plain or "unnamed"


def _folded(name: str) -> str:
    return unicodedata.normalize("NFC", name).casefold()
