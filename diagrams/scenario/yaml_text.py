"""Reads YAML texts within limits, because users write them, and writes YAML."""

from __future__ import annotations

from io import StringIO
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.events import (
    AliasEvent,
    CollectionEndEvent,
    CollectionStartEvent,
    Event,
    ScalarEvent,
)
from ruamel.yaml.parser import Parser

from systems.framework.input_error import InputError

#: Largest text, bytes; the parser takes some seconds for a text of this size.
LARGEST_BYTES = 300_000
#: Largest number of levels.
DEEPEST = 20
#: Largest number of characters after the expansion of all aliases. Without this
#: limit, a few lines of aliases could expand to gigabytes.
LARGEST_MEANING = 1_000_000


def parse_yaml(text: str | bytes, field: str) -> Any:
    """Parses a YAML text into plain values, within limits that protect the program.

    Args:
        text: One YAML document.
        field: Name of the field or file, for the start of error messages.

    Returns:
        Mappings, lists and scalars. The result is None for an empty text.

    Raises:
        InputError: The text is not YAML, or is longer than 300 kB.
        InputError: The text has more than 20 levels.
        InputError: Aliases expand the text to more than a million characters.
    """
    if len(text) > LARGEST_BYTES:
        raise InputError(
            field,
            f"has more than {LARGEST_BYTES // 1000} kB of YAML; shorten or split it",
        )
    yaml = YAML(typ="safe", pure=True)
    yaml.Parser = _BoundedParser
    try:
        return yaml.load(text)
    except InputError as error:
        raise InputError(field, error.message) from None
    except MarkedYAMLError as error:
        mark = error.problem_mark
        where = f" in line {mark.line + 1}, column {mark.column + 1}" if mark else ""
        what = error.problem or error.context or "it cannot be parsed"
        raise InputError(
            field, f"is not valid YAML{where}: {what}; correct it"
        ) from None
    # The constructors of ruamel raise these errors for values that do not fit their
    # tag, for example !!int x, 2024-13-45, !!bool x.
    except (YAMLError, ValueError, ArithmeticError, LookupError, TypeError) as error:
        text = f"is not valid YAML: {type(error).__name__}: {error}; correct it"
        raise InputError(field, text) from None


def dump_yaml(document: dict[str, Any]) -> str:
    """Returns plain values as YAML, with the innermost groups on one line."""
    yaml = YAML()
    yaml.default_flow_style = None
    stream = StringIO()
    yaml.dump(document, stream)
    return stream.getvalue()


class _BoundedParser(Parser):
    """Refuses excessive nesting and aliases during parsing."""

    def __init__(self, loader: Any) -> None:
        super().__init__(loader)
        self._anchors: dict[str, int] = {}
        # Anchor and size so far of each open collection.
        self._open: list[tuple[str | None, int]] = [(None, 0)]

    def get_event(self) -> Event:
        event = super().get_event()
        if isinstance(event, CollectionStartEvent):
            self._open.append((event.anchor, 1))
            if len(self._open) > DEEPEST + 1:
                raise InputError("", f"is nested more than {DEEPEST} deep; flatten it")
        elif isinstance(event, CollectionEndEvent):
            self._add(*self._open.pop())
        elif isinstance(event, AliasEvent):
            if any(anchor == event.anchor for anchor, _ in self._open):
                raise InputError("", f"*{event.anchor} contains itself; correct it")
            self._add(None, self._anchors.get(event.anchor, 1))
        elif isinstance(event, ScalarEvent):
            self._add(event.anchor, 1 + len(event.value))
        return event

    def _add(self, anchor: str | None, size: int) -> None:
        """Adds the size of a complete node to its collection; records its anchor."""
        if anchor is not None:
            self._anchors[anchor] = size
        around, total = self._open[-1]
        if total + size > LARGEST_MEANING:
            raise InputError(
                "",
                "has aliases (*name) that stand for more than "
                f"{LARGEST_MEANING:,} characters; write the values out",
            )
        self._open[-1] = (around, total + size)
