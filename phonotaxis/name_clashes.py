"""Detects modules of a user that have the name of a package of phonotaxis.

phonotaxis installs the packages ``systems``, ``diagrams`` and ``analysis``. If a folder
or a file of the user has one of these names, Python finds only one of the two.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import find_spec
from types import ModuleType

#: Packages beside this one. ``import phonotaxis`` checks that Python finds them.
PACKAGES = ("systems", "diagrams", "analysis")
_HOME = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))  # noqa: PTH100, PTH120


def refuse_clashes() -> None:
    """Ensures that Python finds the packages of phonotaxis, and not a user's modules.

    If phonotaxis has just been started as a program, the function prints the message
    and ends the process.

    Raises:
        ImportError: A module of the user hides a package of phonotaxis.
    """
    places = {name: _place(_spec(name)) for name in PACKAGES}
    hiding = [
        f"{place} hides the package {name!r} of phonotaxis; rename yours"
        for name, place in places.items()
        if place and not _is_ours(place, name)
    ]
    if not hiding:
        return
    # Python's documentation: while ``-m`` locates a module, argv[0] is "-m".
    if os.path.basename(sys.argv[0] if sys.argv else "") in {"-m", "phonotaxis"}:  # noqa: PTH119
        sys.stderr.write(f"phonotaxis: {hiding[0]}\n")
        raise SystemExit(2)
    raise ImportError(hiding[0])


def explain_hidden_modules() -> None:
    """Makes Python name a module of the user that a package of phonotaxis hides.

    The message appears where the import of the user's module fails.
    """
    sys.meta_path.append(_LastFinder)


class _LastFinder:
    """Python asks this finder for modules that no other finder has found."""

    @staticmethod
    def find_spec(
        fullname: str,
        path: Sequence[str] | None = None,
        target: ModuleType | None = None,
    ) -> None:
        package, _, below = fullname.partition(".")
        if package not in PACKAGES or not below:
            return
        for entry in sys.path:
            place = _place(PathFinder.find_spec(package, [entry]))
            if place and not _is_ours(place, package):
                # ``from package import name`` ignores a ModuleNotFoundError.
                raise ImportError(
                    f"phonotaxis has no {fullname}; its package {package!r} hides "
                    f"{place}; rename yours",
                    name=fullname,
                )


def _spec(name: str) -> ModuleSpec | None:
    """Returns where a module was loaded from, or would be loaded from."""
    try:
        return find_spec(name)
    except ValueError:  # a module that a program has made without a file
        return None


def _place(spec: ModuleSpec | None) -> str:
    """Returns the folder of a package or the file of a module; empty: neither."""
    if spec is None:
        return ""
    folders = list(spec.submodule_search_locations or ())
    return folders[0] if folders else spec.origin or ""


def _is_ours(place: str, name: str) -> bool:
    return os.path.realpath(place) == os.path.realpath(os.path.join(_HOME, name))  # noqa: PTH118
