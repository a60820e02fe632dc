"""The syntax of OpenCV's FileStorage: YAML 1.0 and 1.2, XML and JSON to plain values.

Not read through cv2: its FileStorage raises on YAML of other tools and gives 0 for a key that is not there.
"""

from __future__ import annotations

import json
import re
from xml.etree import ElementTree

from circlepose._arguments import shown
from circlepose.errors import CalibrationError
from circlepose.io.calibration.cameras import listed
from circlepose.io.text.validation import brief
from circlepose.io.text.yaml import MAX_DEPTH, MatrixNode, load_yaml, no_keys, value_problem

_DEPTH = 6
_MATRIX_TYPES = ("opencv-matrix", "opencv-nd-matrix")
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|[-+]?\.(?i:inf)|\.(?i:nan)")
# Strings are matched first, so that nothing inside one is touched; one without an end, so that none is sought again.
# cv2 reads `image_width:1280`, which YAML takes for a word; keys at the beginning of a line, before a value.
_NO_BLANK = re.compile(r"^([ \t]*[A-Za-z_][\w.-]*):(?=[-+.\d\"\[{!])", re.MULTILINE)
_EXAMPLE = "fx: 1200"
_JSON = re.compile(r"\s*(?:\{\s*[\"}]|\[\s*[\[{\"\d-])")
_JSON_QUIRK = re.compile(
    r'("(?:\\(?s:.)|[^"\\])*(?:"|\\?\Z))|//[^\n]*|(-?)\.(Nan|Inf)\b|(\d\.)(?=[^\d])|(,)(?=\s*[}\]])'
)


def parse_storage(text: str, name: str) -> tuple[dict[str, object], bool]:
    """Return the entries of a calibration file and whether its syntax is OpenCV's own.

    Matrices come out as `MatrixNode`. Raises `CalibrationError` naming the file, where it can with the line.
    """
    if text.lstrip().startswith("<"):
        return _parse_xml(text, name), True
    if _JSON.match(text):
        entries = _entries(_parse_json(text, name), name)
    else:
        is_opencv = text.lstrip().startswith("%YAML:1.0") or "!!opencv-" in text
        entries = _parse_yaml(_NO_BLANK.sub(r"\1: ", text), name) if is_opencv else _own_yaml(text, name)
    return entries, _has_matrix(entries, 0)


def _own_yaml(text: str, name: str) -> dict[str, object]:
    """Return keys and values; where a text would have some with a blank after each colon, the error says so."""
    try:
        return _parse_yaml(text, name)
    except CalibrationError as problem:
        key = _NO_BLANK.search(text)
        if key is None:
            raise
        try:
            _parse_yaml(_NO_BLANK.sub(r"\1: ", text), name)
        except CalibrationError:
            raise problem from None
        line = text.count("\n", 0, key.start(1)) + 1
        raise CalibrationError(
            f"{name}, line {line}: {brief(key[1])}: needs a blank after the colon; write `{brief(key[1])}: `."
        ) from None


def _parse_yaml(text: str, name: str) -> dict[str, object]:
    return _entries(load_yaml(text, name, CalibrationError), name)


def _has_matrix(value: object, depth: int) -> bool:
    """Whether a matrix of OpenCV's stands in a group of keys."""
    if isinstance(value, MatrixNode):
        return True
    return (
        isinstance(value, dict) and depth <= _DEPTH and any(_has_matrix(each, depth + 1) for each in value.values())
    )


def _entries(document: object, name: str) -> dict[str, object]:
    """Return the keys and values of a document; of a list of groups by their names, or numbers."""
    if isinstance(document, list) and document and all(isinstance(each, dict) for each in document):
        document = document[0] if len(document) == 1 else listed(document)
    if not isinstance(document, dict):
        raise CalibrationError(f"{name}: {no_keys(document, _EXAMPLE)}.")
    return {str(key): value for key, value in document.items()}


def _parse_json(text: str, name: str) -> object:
    try:
        document = json.loads(_JSON_QUIRK.sub(_plain_json, text), object_pairs_hook=_json_object)
    except RecursionError:
        raise CalibrationError(f"{name}: is nested too deeply.") from None
    except json.JSONDecodeError as reason:
        raise CalibrationError(
            f"{name}, line {reason.lineno}: is not valid JSON ({reason.msg}); correct this line."
        ) from None
    except ValueError as reason:
        raise CalibrationError(f"{name}: {value_problem(reason)}.") from None
    if _is_deep(document):
        raise CalibrationError(f"{name}: is nested too deeply.")
    return document


def _is_deep(document: object) -> bool:
    """Whether lists and mappings are nested deeper than those of YAML may be. Python's own limit varies."""
    level = [document]
    for _ in range(MAX_DEPTH):
        inner = [each.values() if isinstance(each, dict) else each for each in level if isinstance(each, dict | list)]
        level = [child for each in inner for child in each if isinstance(child, dict | list)]
        if not level:
            return False
    return True


def _plain_json(match: re.Match[str]) -> str:
    """Return JSON that Python reads for what OpenCV writes: comments, .Nan, .Inf, `1.`; and for a last comma."""
    string, sign, word, number, _ = match.groups()
    if string is not None:
        return string
    if word is not None:
        return "NaN" if word == "Nan" else f"{sign}Infinity"
    return f"{number}0" if number is not None else ""


def _json_object(pairs: list[tuple[str, object]]) -> dict[str, object]:
    entries: dict[str, object] = {}
    for key, value in pairs:
        if key in entries:
            raise ValueError(f"the key {shown(key)} is given twice")
        entries[key] = value
    return MatrixNode(entries) if entries.get("type_id") in _MATRIX_TYPES else entries


def _parse_xml(text: str, name: str) -> dict[str, object]:
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise CalibrationError(f"{name}: declares a document type or entities, which are not read; remove them.")
    try:
        root = ElementTree.fromstring(text)
        if root.tag != "opencv_storage":
            raise CalibrationError(
                f"{name}: is XML of another kind (<{root.tag}>); expected OpenCV's <opencv_storage>, "
                "or camera_matrix and dist_coeffs as YAML."
            )
        value = _xml_value(root)
    except ElementTree.ParseError as reason:
        raise CalibrationError(f"{name}: is not valid XML ({reason}).") from None
    except RecursionError:
        raise CalibrationError(f"{name}: is nested too deeply.") from None
    except ValueError as reason:
        raise CalibrationError(f"{name}: {value_problem(reason)}.") from None
    if not isinstance(value, dict):
        raise CalibrationError(f"{name}: <opencv_storage> holds no keys.")
    return value


def _xml_value(node: ElementTree.Element) -> object:
    if len(node) == 0:
        return _xml_scalars(node.text or "", is_list=node.tag == "data")
    if all(child.tag == "_" for child in node):
        return [_xml_value(child) for child in node]
    entries = _json_object([(child.tag, _xml_value(child)) for child in node])
    return MatrixNode(entries) if node.get("type_id") in _MATRIX_TYPES else entries


def _xml_scalars(text: str, *, is_list: bool) -> object:
    words = text.split()
    if text.strip().startswith('"') or not all(_NUMBER.fullmatch(word) for word in words):
        return text.strip().strip('"')
    numbers = [_scalar(word) for word in words]
    return numbers if is_list or len(numbers) != 1 else numbers[0]


def _scalar(word: str) -> int | float:
    if word.lstrip("+-").isdigit():
        return int(word)
    return float(word.lower().replace(".inf", "inf").replace(".nan", "nan"))
