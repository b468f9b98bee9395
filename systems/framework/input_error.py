"""The one error of bad input."""

from __future__ import annotations

__all__ = ["InputError", "shortened"]

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
    """

    def __init__(self, field: str, message: str) -> None:
        self.field = shortened(field, _LONGEST_FIELD)
        room = LONGEST_MESSAGE - len(self.field) - 2
        self.message = shortened(message, room)
        super().__init__(self.field, self.message)

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
