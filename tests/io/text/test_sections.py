"""TOML and INI as keys and values."""

from __future__ import annotations

import pytest

from circlepose.errors import CalibrationError
from circlepose.io.text.sections import load_sections


def load(text: str) -> dict[str, object] | None:
    return load_sections(text, "f.ini", CalibrationError)


def test_toml() -> None:
    text = 'title = "a"\n[cam.left]\nmatrix = [\n  [1.5, 0],\n  [0, 2.5],\n]\n'
    assert load(text) == {"title": "a", "cam": {"left": {"matrix": [[1.5, 0], [0, 2.5]]}}}


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        ("900", 900),
        ("-1.5e-3", -1.5e-3),
        (".5", 0.5),
        ("900 ; in px", 900),
        ("900 # in px", 900),
        ("900;", 900),
        ("[640 480]", [640, 480]),
        ("[1 0 2; 0 1 3; 0 0 1]", [[1, 0, 2], [0, 1, 3], [0, 0, 1]]),
        ("{1, 2}", [1, 2]),
        ("0.1, 0.2", [0.1, 0.2]),
        ("0.1 0.2", [0.1, 0.2]),
        ("[]", []),
        ("Yes", True),
        ("plumb_bob", "plumb_bob"),
        ("1280x960", "1280x960"),
        ("", None),
        ("a = b", "a = b"),
    ],
)
def test_values_of_ini(value: str, expected: object) -> None:
    # The first line is no TOML.
    assert load(f"word = a word\n[cam]\nkey = {value}\n") == {"word": "a word", "cam": {"key": expected}}


@pytest.mark.parametrize(
    "text", ["", "a: 1\nb: 2\n", "{}", "just words\nand = more\nof them\n", "a == 1\n", "[a]\n[b]\n"]
)
def test_texts_of_other_kinds(text: str) -> None:
    assert load(text) is None


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("a = a b\nb = 2\n[c]\nd = 3\nrubbish\n", "f.ini, line 5: is neither `[section]` nor `key = value`"),
        ("[a]\nb = [[1, 2], [3,,4]]\n", "f.ini, line 2: is not valid TOML (Invalid value); correct this line."),
        ("a = a b\na = 2\n", "line 2: a: is given twice"),
        ("[a]\nb = a b\n[a]\nb = 2\n", "line 3: [a] is there twice"),
    ],
)
def test_slips_are_named_with_their_line(text: str, says: str) -> None:
    with pytest.raises(CalibrationError) as caught:
        load(text)
    assert says in str(caught.value)
