"""The `.ini` (or `ost.txt`) of ROS' camera_calibration, which is that of Videre's cameras: titles, then numbers."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from circlepose.errors import CalibrationError
from circlepose.io.calibration import numbers
from circlepose.io.calibration.document import Document
from circlepose.io.calibration.form import Form, Reading, choose
from circlepose.io.text.validation import brief

_SECTION = re.compile(r"\[([^\]\n]{1,100})\]")
_SIGNATURE = re.compile(r"^[ \t]*camera matrix[ \t]*\r?\n[ \t]*[-+.\d]", re.MULTILINE)
_TITLE = re.compile(r"[A-Za-z][\w ]*")
_IMAGE = "image"


@dataclass(slots=True)
class _Entry:
    """The numbers under one title."""

    line: int
    values: list[float] = field(default_factory=list)


_Sections = dict[str, dict[str, _Entry]]


def _recognizes(document: Document) -> bool:
    """Whether a line `camera matrix` stands before a line of numbers, in a section with a name."""
    text = document.text
    return text is not None and "[" in text and _SIGNATURE.search(text) is not None


def _read(document: Document, camera_name: str | None) -> Reading:
    """Return the camera of a section (`camera_name`, or the first)."""
    where = document.name
    sections = _sections(document.text or "", where)
    names = [name for name, entries in sections.items() if "camera matrix" in entries]
    if not names:
        raise CalibrationError(
            f"{where}: camera matrix: stands in no section; give it one, such as [left], above it."
        )
    name, notes = choose(names, camera_name, where)
    entries = sections[name]
    matrix = _values(entries, "camera matrix", where, (9,))
    dist = _values(entries, "distortion", where, (4, 5, 8))
    if len(dist) == 4 and any(dist):
        raise CalibrationError(
            f"{where}, line {entries['distortion'].line}: distortion: 4 numbers may be of a fisheye, and this form "
            "states no lens model; give the .yaml that camera_calibration writes, too (ost.yaml)."
        )
    grid, turned = numbers.turned_matrix(matrix, where, "camera matrix")
    size = None
    if _IMAGE in sections:
        width, height = (_once(sections[_IMAGE], key, where) for key in ("width", "height"))
        size = numbers.image_size(width, height, where, "width, height")
    camera = numbers.build_camera(where, ("camera matrix", grid), ("distortion", dist), size, "pinhole")
    return Reading(camera, notes + turned)


def _sections(text: str, where: str) -> _Sections:
    """Return the numbers by section and title; the size of the image may be stated once for each camera."""
    sections: _Sections = {}
    section: dict[str, _Entry] = {}
    entry: _Entry | None = None
    for number, line in enumerate((each.strip() for each in text.splitlines()), 1):
        if not line or line[0] in "#;":
            continue
        header = _SECTION.fullmatch(line)
        if header:
            name = header[1].strip()
            if name in sections and name != _IMAGE:
                raise CalibrationError(f"{where}, line {number}: [{name}] is there twice; give each camera its name.")
            section = sections.setdefault(name, {})
            entry = None
        elif _TITLE.fullmatch(line):
            if line in section and section is not sections.get(_IMAGE):
                raise CalibrationError(f"{where}, line {number}: {brief(line)}: is given twice; remove one of them.")
            entry = section.setdefault(line, _Entry(number))
        elif entry is not None:
            entry.values += _numbers(line, where, number)
    return sections


def _numbers(line: str, where: str, number: int) -> list[float]:
    try:
        return [float(word) for word in line.split()]
    except ValueError:
        raise CalibrationError(
            f"{where}, line {number}: expected numbers, got {brief(line)!r}; correct it."
        ) from None


def _values(entries: dict[str, _Entry], title: str, where: str, counts: tuple[int, ...]) -> list[float]:
    if title not in entries:
        raise CalibrationError(f"{where}: {title}: is missing; expected this line, and its numbers below it.")
    entry = entries[title]
    if len(entry.values) not in counts:
        expected = " or ".join(map(str, counts))
        unit = "number" if counts == (1,) else "numbers"
        raise CalibrationError(
            f"{where}, line {entry.line}: {title}: expected {expected} {unit}, got {len(entry.values)}; correct it."
        )
    return entry.values


def _once(entries: dict[str, _Entry], title: str, where: str) -> float:
    """Return the one number under a title, though it may stand there for each of several cameras."""
    values = entries[title].values if title in entries else []
    if len(values) > 1 and len({*values}) == 1:
        return values[0]
    return _values(entries, title, where, (1,))[0]


FORM = Form("ROS .ini", _recognizes, _read)
