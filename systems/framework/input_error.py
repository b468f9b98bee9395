"""The one error of bad input."""

from __future__ import annotations

from collections.abc import Iterable

#: A whole message, with its field, has at most so many characters.
LONGEST_MESSAGE = 280
_LONGEST_FIELD = 100


class InputError(ValueError):
    """Bad input: which field, what is wrong with it, and how to mend it.

    Whatever was in a file, the text is one line of printable characters, and at
    most 280 of them: of longer ones the middle is left out, so that field and
    remedy stay.

    Args:
        field: Dotted path of the field, name of the option, or name of the block.
        message: The value, what is wrong, and the remedy.
        others: What else is wrong with the same input.
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
        """This error and the others."""
        return (self, *self._others)

    @classmethod
    def joined(cls, errors: Iterable[InputError], below: str = "") -> InputError:
        """One error that has all of some, each once.

        Args:
            errors: One or more.
            below: Begins the path of each.

        Returns:
            The first, with the others.
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
    """A text on one line without its middle, so that it has at most ``length``.

    Args:
        text: Any text; white space becomes single blanks, what cannot be printed an
            escape.
        length: Most characters, more than 10.

    Returns:
        The text itself where it is short enough, else its ends about `` ... ``.
    """
    # What is far too long is cut first: escaping all of it would take memory.
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
