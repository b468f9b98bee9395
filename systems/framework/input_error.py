"""Defines the error that all invalid input raises."""

from __future__ import annotations

from collections.abc import Iterable

#: Largest number of characters of a message, including its field.
LONGEST_MESSAGE = 280
_LONGEST_FIELD = 100


class InputError(ValueError):
    """Invalid input. The error states the field, the fault and the remedy.

    The text is one line of at most 280 printable characters, whatever the input
    contains. If the field or the message is too long, the middle is omitted.

    Args:
        field: Dotted path of the field, name of the option, or name of the block.
        message: The value, the fault and the remedy.
        others: Further errors in the same input.
    """

    def __init__(
        self, field: str, message: str, others: Iterable[InputError] = ()
    ) -> None:
        self.field = shortened(field, _LONGEST_FIELD)
        room = LONGEST_MESSAGE - len(self.field) - 2
        self.message = shortened(message, room)
        self._others = tuple(others)
        super().__init__(self.field, self.message)

    @property
    def all(self) -> tuple[InputError, ...]:
        """This error and the further errors."""
        return (self, *self._others)

    @classmethod
    def joined(cls, errors: Iterable[InputError], below: str = "") -> InputError:
        """Combines several errors into one error, without duplicates.

        Args:
            errors: At least one error.
            below: Path that is put before the field of each error.

        Returns:
            The first error, which stores all others as its further errors.
        """
        texts = {
            (".".join(filter(None, (below, each.field))), each.message): None
            for error in errors
            for each in error.all
        }
        first, *others = texts
        return cls(*first, others=[cls(*other) for other in others])

    def __str__(self) -> str:
        return f"{self.field}: {self.message}" if self.field else self.message


def shortened(text: str, length: int) -> str:
    """Converts a text to one line, and omits its middle if it is too long.

    Args:
        text: Any text. White space becomes single blanks. Characters that are not
            printable become escape sequences.
        length: Largest number of characters of the result, more than 10.

    Returns:
        The whole line if it is short enough. Otherwise the beginning and the end of the
        line, with `` ... `` between them.
    """
    # A text that is far too long is cut first, because escape sequences need memory.
    if len(text) > 8 * length:
        text = f"{text[: 4 * length]}{text[-4 * length :]}"
    text = " ".join(text.split())
    text = "".join(
        c if c.isprintable() else c.encode("unicode_escape").decode() for c in text
    )
    if len(text) <= length:
        return text
    tail = length // 2
    return f"{text[: length - tail - 5]} ... {text[-tail:]}"
