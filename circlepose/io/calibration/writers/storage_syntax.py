"""The syntax of OpenCV's FileStorage as text to write: YAML, XML and JSON of whole numbers, words and matrices.

Source: OpenCV's modules/core/src/persistence_yml.cpp, persistence_xml.cpp and persistence_json.cpp. YAML is taken
with `%YAML:1.` or `%YAML 1.` in its first line; versions before 3.2 know the first alone.
"""

from __future__ import annotations

import json
from collections.abc import Mapping

from circlepose._typing import FloatArray
from circlepose.io.calibration.number_text import number_list_text
from circlepose.io.marks import COMMENT, JSON_MARK, XML_COMMENT

StorageEntries = Mapping[str, int | str | FloatArray]
"""whole numbers, plain words and matrices (n, m); floats keep every bit"""


def yaml_text(entries: StorageEntries, header: str = "%YAML 1.2") -> str:
    """Return the entries as FileStorage YAML."""
    lines = [header, "---", COMMENT]
    for key, value in entries.items():
        if isinstance(value, int | str):
            lines.append(f"{key}: {value}")
            continue
        rows = [number_list_text(row) for row in value.tolist()]
        data = ",\n       ".join(row for row in rows if row)
        lines += [
            f"{key}: !!opencv-matrix",
            f"   rows: {value.shape[0]}",
            f"   cols: {value.shape[1]}",
            "   dt: d",
            f"   data: [ {data} ]" if data else "   data: []",
        ]
    return "\n".join(lines) + "\n"


def xml_text(entries: StorageEntries) -> str:
    """Return the entries as FileStorage XML."""
    lines = ['<?xml version="1.0"?>', XML_COMMENT, "<opencv_storage>"]
    for key, value in entries.items():
        if isinstance(value, int | str):
            lines.append(f"<{key}>{value}</{key}>")
            continue
        data = number_list_text(value.ravel().tolist()).replace(",", "")
        lines += [
            f'<{key} type_id="opencv-matrix">',
            f"  <rows>{value.shape[0]}</rows>",
            f"  <cols>{value.shape[1]}</cols>",
            "  <dt>d</dt>",
            f"  <data>{data}</data></{key}>",
        ]
    return "\n".join([*lines, "</opencv_storage>"]) + "\n"


def json_text(entries: StorageEntries) -> str:
    """Return the entries as FileStorage JSON."""
    lines = []
    for key, value in entries.items():
        if isinstance(value, int | str):
            lines.append(f'    "{key}": {json.dumps(value)}')
            continue
        data = number_list_text(value.ravel().tolist())
        matrix = f'"type_id": "opencv-matrix", "rows": {value.shape[0]}, "cols": {value.shape[1]}, "dt": "d"'
        lines.append(f'    "{key}": {{{matrix}, "data": [{data}]}}')
    return JSON_MARK + ",\n" + ",\n".join(lines) + "\n}\n"
