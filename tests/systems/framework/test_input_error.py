"""One line, of a length that can be read, whatever was in the file."""

from __future__ import annotations

import pickle

from hypothesis import given, strategies as st

from systems.framework.input_error import LONGEST_MESSAGE, InputError, shortened


def test_field_and_message():
    error = InputError("robot.mass_kg", "is -1; raise it")
    assert isinstance(error, ValueError)
    assert str(error) == "robot.mass_kg: is -1; raise it"
    assert str(InputError("", "nothing fits")) == "nothing fits"
    again = pickle.loads(pickle.dumps(error))  # workers send it back
    assert (again.field, again.message) == (error.field, error.message)


@given(st.text(), st.text())
def test_texts_are_one_printable_line(field, message):
    text = str(InputError(field, message))
    assert len(text) <= LONGEST_MESSAGE
    assert text.isprintable()


def test_of_a_long_message_the_remedy_stays():
    error = InputError("sound.file", f"{'x' * 10**7} is missing; give another")
    assert len(str(error)) <= LONGEST_MESSAGE
    assert str(error).startswith("sound.file: xxx")
    assert str(error).endswith("is missing; give another")


def test_nothing_short_is_changed():
    assert shortened("a \u00e9 b", 6) == "a \u00e9 b"
    assert shortened("a\n  b\x1b", 20) == "a b\\x1b"
    # Half of 11 for the end, 5 for the dots, 1 for the beginning.
    assert shortened("abcdefghijkl", 11) == "a ... hijkl"
    assert shortened("abcdefghijk", 11) == "abcdefghijk"


def test_a_long_field_leaves_room_for_the_message():
    """100 characters of the field, a colon, a space, 178 of the message."""
    error = InputError("f" * 500, "m" * 5_000)
    assert len(error.field) == 100
    assert len(error.message) == 178
    assert len(str(error)) == 280
