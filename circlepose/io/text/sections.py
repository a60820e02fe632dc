"""TOML and INI (.ini, .conf, .cfg) as keys and values: `[camera]`, then `fx = 900`."""

from __future__ import annotations

import re
import tomllib

from circlepose.errors import CircleposeError
from circlepose.io.text.validation import brief

_MOST_CHARACTERS = 300_000
_MOST_CHARACTERS_OF_TOML = 60_000
_MOST_DOTS = 30
"""in the keys of a line: `tomllib` takes the square of their number"""
_HEADER = re.compile(r"\[([^\]\[\"{}=,]{1,100})\]")
_LINE = re.compile(r"([A-Za-z_][\w.-]{0,80})[ \t]{0,40}[=:][ \t]{0,40}([^=].{0,5000}|)")
_ASSIGNMENT = re.compile(r"^[ \t]{0,40}[A-Za-z_][\w.-]{0,80}[ \t]{0,40}=(?!=)", re.MULTILINE)
_REMARK = re.compile(r"(?:^|[ \t])[#;][^\]\"']*$")
_NUMBER = re.compile(r"[-+]?(?:\d{1,400}\.?\d{0,400}|\.\d{1,400})(?:[eE][-+]?\d{1,9})?")
_NESTED = re.compile(r"=[ \t]{0,40}\[\s{0,40}\[")
"""a matrix as only TOML has it"""
_PLACE = re.compile(r"(.*) \(at line (\d+), column \d+\)", re.DOTALL)
_BRACKETS = {"[": "]", "(": ")", "{": "}"}
_BOOLEANS = {"true": True, "false": False, "yes": True, "no": False, "on": True, "off": False}
_LEAST_KNOWN = 0.7
"""Share of lines that are sections or keys from which a text is meant as INI."""


def load_sections(text: str, name: str, error: type[CircleposeError]) -> dict[str, object] | None:
    """Return the keys and values of TOML or INI, sections as groups; None for a text of another kind.

    Raises `error`, with the line, where a text is of this kind and has a slip.
    """
    if len(text) > _MOST_CHARACTERS or not _ASSIGNMENT.search(text):
        return None
    toml = _toml(text, name, error)
    if toml is not None:
        return toml
    return _ini(_kept(text), name, error) if looks_like_sections(text) else None


def looks_like_sections(text: str) -> bool:
    """Whether most lines of a text are those of INI."""
    if len(text) > _MOST_CHARACTERS or not _ASSIGNMENT.search(text):
        return False
    kept = _kept(text)
    known = [line for _, line in kept if _HEADER.fullmatch(_bare(line)) or _LINE.fullmatch(line)]
    return len(known) >= _LEAST_KNOWN * len(kept)


def _kept(text: str) -> list[tuple[int, str]]:
    """Return the lines that are no remarks, with their numbers."""
    lines = [(number, line.strip()) for number, line in enumerate(text.splitlines(), 1)]
    return [(number, line) for number, line in lines if line and line[0] not in "#;"]


def _toml(text: str, name: str, error: type[CircleposeError]) -> dict[str, object] | None:
    if len(text) > _MOST_CHARACTERS_OF_TOML or any(_has_deep_keys(line) for line in text.splitlines()):
        return None
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as reason:
        place = _PLACE.fullmatch(str(reason))
        if place is None or _NESTED.search(text) is None:
            return None
        raise error(f"{name}, line {place[2]}: is not valid TOML ({brief(place[1])}); correct this line.") from None
    except (ValueError, RecursionError):
        return None


def _has_deep_keys(line: str) -> bool:
    """Whether a key of a line has very many parts; a row of numbers has a comma for each of its points."""
    *keys, last = line.split("=")
    heading = 0 if keys else last.count(".") - last.count(",")
    return max([heading, *(key.count(".") for key in keys)]) > _MOST_DOTS


def _ini(lines: list[tuple[int, str]], name: str, error: type[CircleposeError]) -> dict[str, object]:
    entries: dict[str, object] = {}
    group = entries
    for number, line in lines:
        header = _HEADER.fullmatch(_bare(line))
        if header is not None:
            title = header[1].strip()
            if title in entries:
                raise error(f"{name}, line {number}: [{brief(title)}] is there twice; give each camera its section.")
            group = {}
            entries[title] = group
            continue
        match = _LINE.fullmatch(line)
        if match is None:
            raise error(
                f"{name}, line {number}: is neither `[section]` nor `key = value`, as the other lines of this INI "
                f"file, but {brief(line)!r}; correct it."
            )
        if match[1] in group:
            raise error(f"{name}, line {number}: {match[1]}: is given twice; remove one of them.")
        group[match[1]] = _value(match[2])
    return entries


def _bare(line: str) -> str:
    """Return a line without the remark at its end."""
    return _REMARK.sub("", line).strip()


def _value(text: str) -> object:
    """Return a number, several in brackets or not (rows end at `;`), true or false, or else the text."""
    inside = text.strip()
    closing = _BRACKETS.get(inside[:1])
    if closing is not None and closing in inside:
        inside = inside[1 : inside.rindex(closing)]
        rows = [_numbers(row) for row in inside.split(";") if row.strip()]
        if all(row is not None for row in rows):
            return rows if len(rows) > 1 else rows[0] if rows else []
        return text.strip()
    bare = _bare(inside).rstrip(";").strip()
    numbers = _numbers(bare)
    if numbers:
        return numbers[0] if len(numbers) == 1 else numbers
    if bare.lower() in _BOOLEANS:
        return _BOOLEANS[bare.lower()]
    return bare if bare else None


def _numbers(text: str) -> list[int | float] | None:
    words = text.replace(",", " ").split()
    if not all(_NUMBER.fullmatch(word) for word in words):
        return None
    return [int(word) if word.lstrip("+-").isdigit() else float(word) for word in words]
