"""Letters of straight strokes: the same in every form, without a font, and none of them round.

The o of a usual font is a circle, and in a photograph from near by it would be measured as one.
"""

from __future__ import annotations

from collections.abc import Iterable

Point = tuple[float, float]

_STROKES = {
    "a": "06 36 32 02 04 34",
    "b": "08 02 32 36 06",
    "c": "36 06 02 32",
    "d": "38 32 02 06 36",
    "e": "04 34 36 06 02 32",
    "f": "28 18 12/06 26",
    "g": "32 02 06 36 30 00",
    "h": "08 02/06 36 32",
    "i": "02 06/07 08",
    "j": "16 10 00/17 18",
    "k": "08 02/36 04 32",
    "l": "08 02 12",
    "m": "02 06 46 42/26 22",
    "n": "02 06 36 32",
    "o": "02 06 36 32 02",
    "p": "00 06 36 32 02",
    "q": "30 36 06 02 32",
    "r": "02 06 26",
    "s": "36 06 04 34 32 02",
    "t": "18 12 22/06 26",
    "u": "06 02 32 36",
    "v": "06 12 26",
    "w": "06 12 26 32 46",
    "x": "06 32/02 36",
    "y": "06 02 32/36 30 00",
    "z": "06 36 02 32",
    "A": "02 08 38 32/05 35",
    "B": "02 08 28 25/05 35 32 02",
    "C": "38 08 02 32",
    "D": "02 08 28 37 33 22 02",
    "E": "38 08 02 32/05 25",
    "F": "38 08 02/05 25",
    "G": "38 08 02 32 35 25",
    "H": "08 02/38 32/05 35",
    "I": "08 28/18 12/02 22",
    "J": "38 32 02 04",
    "K": "08 02/38 05 32",
    "L": "08 02 32",
    "M": "02 08 25 48 42",
    "N": "02 08 32 38",
    "O": "02 08 48 42 02",
    "P": "02 08 38 35 05",
    "Q": "02 08 48 42 02/24 41",
    "R": "02 08 38 35 05/15 32",
    "S": "38 08 05 35 32 02",
    "T": "08 48/28 22",
    "U": "08 02 32 38",
    "V": "08 22 48",
    "W": "08 12 26 32 48",
    "X": "08 32/02 38",
    "Y": "08 25 48/25 22",
    "Z": "08 38 02 32",
    "0": "02 08 38 32 02",
    "1": "07 18 12/02 22",
    "2": "08 38 35 05 02 32",
    "3": "08 38 32 02/05 35",
    "4": "08 05 35/38 32",
    "5": "38 08 05 25 34 33 22 02",
    "6": "38 08 02 32 35 05",
    "7": "08 38 12",
    "8": "02 08 38 32 02/05 35",
    "9": "02 32 38 08 05 35",
    ".": "02 12 03 02",
    ",": "13 00",
    ":": "02 12 03 02/05 15 06 05",
    ";": "05 15 06 05/13 00",
    "-": "04 24",
    "_": "01 31",
    "/": "01 38",
    "\\": "08 31",
    "{": "28 18 16 05 14 12 22",
    "}": "08 18 16 25 14 12 02",
    "(": "18 07 03 12",
    ")": "08 17 13 02",
    "[": "18 08 02 12",
    "]": "08 18 12 02",
    "%": "02 48/08 18 17 07 08/33 43 42 32 33",
    "+": "04 24/13 15",
    "=": "03 23/05 25",
    "'": "08 07",
    '"': "08 07/18 17",
    "#": "12 18/32 38/04 44/06 46",
    "&": "32 07 08 18 17 04 02 12 34",
    "*": "04 26/24 06",
    "!": "08 04/02 12 03 02",
    "?": "08 38 35 15 14/12 22 13 12",
    "@": "32 02 08 38 34 14 16 36",
    "<": "26 04 22",
    ">": "06 24 02",
    "$": "38 08 05 35 32 02/19 11",
    "^": "06 18 26",
    "`": "08 17",
    "|": "09 00",
    "~": "04 15 24 35",
    " ": "",
}
"""Strokes of each letter through points on a grid: x from 0; y from 0 at the foot of a g, 2 on the base line, 6 on
top of an x and 8 on top of an X. A dot is a triangle: others are round to a camera."""
_BASE = 2
_CAPITAL = 6
"""Height of a capital on the grid."""
_SPACE = 2
_BETWEEN = 1.6
"""Between two letters."""
STROKE = 0.11
"""Width of a stroke, in heights of a capital."""
_WIDTH = {
    letter: max((int(point[0]) for point in strokes.replace("/", " ").split()), default=_SPACE - _BETWEEN)
    for letter, strokes in _STROKES.items()
}


def _width(letter: str) -> float:
    return _WIDTH.get(letter, _WIDTH["?"])


def text_length(letters: str, size_mm: float) -> float:
    """Return the length in mm of a line of letters whose capitals are `size_mm` high."""
    return size_mm / _CAPITAL * (sum(_width(letter) + _BETWEEN for letter in letters) - _BETWEEN) if letters else 0.0


def strokes_of(letters: str, size_mm: float) -> list[list[Point]]:
    """Return the strokes of a line, each through points in mm: x to the right, y down from where the line begins.

    What has no strokes is a question mark.
    """
    unit = size_mm / _CAPITAL
    strokes = []
    at = 0.0
    for letter in letters:
        for stroke in filter(None, _STROKES.get(letter, _STROKES["?"]).split("/")):
            strokes.append([(unit * (at + int(x)), unit * (_BASE - int(y))) for x, y in map(tuple, stroke.split())])
        at += _width(letter) + _BETWEEN
    return strokes


def plain_letters(text: str) -> str:
    """Return `text` with ? in place of each character that has no strokes."""
    return "".join(letter if letter in _STROKES else "?" for letter in text)


def wrapped(words: Iterable[str], length_mm: float, size_mm: float) -> list[str]:
    """Return `words` as lines that are no longer than `length_mm`; a longer word is broken."""
    lines: list[str] = []
    for word in words:
        longer = f"{lines[-1]} {word}" if lines else word
        if lines and text_length(longer, size_mm) <= length_mm:
            lines[-1] = longer
            continue
        rest = word
        while text_length(rest, size_mm) > length_mm and len(rest) > 1:
            fits = next((n for n in range(len(rest) - 1, 0, -1) if text_length(rest[:n], size_mm) <= length_mm), 1)
            lines.append(rest[:fits])
            rest = rest[fits:]
        lines.append(rest)
    return lines
