"""Names of files and folders, made from names that a user chose."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Sequence

#: Characters that some file systems do not allow in a name.
_RESERVED = re.compile(r'[<>:"/\\|?*\x00-\x1f\x7f]')
#: Greatest length of a name, bytes. Most systems allow 255. The rest is for the number
#: and the ending.
_MOST_BYTES = 200


def distinct_names(
    wanted: Iterable[str],
    *,
    taken: Iterable[str] = (),
    endings: Sequence[str] = ("",),
    joint: str = "-",
) -> list[str]:
    """Makes a different file name for each text, as close to the text as possible.

    The caller can append each of the ``endings`` to each name. If a file name that
    results is in ``taken``, or belongs to an earlier text, the function appends
    ``joint`` and a number to the name, for example ``summary-2``. File names that
    differ only in upper and lower case count as equal, as in the file systems of macOS
    and Windows.

    Hyphens replace characters that some file systems reserve. Dots and spaces at both
    ends are removed. A name has at most 200 bytes, not counting its number.
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
    # The names "." and ".." are folders. A dot at the beginning hides a file.
    plain = _RESERVED.sub("-", encoded.decode("utf-8", "ignore")).strip(". ")
    return plain or "unnamed"


def _folded(name: str) -> str:
    return unicodedata.normalize("NFC", name).casefold()
