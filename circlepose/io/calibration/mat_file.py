"""MATLAB's .mat files of version 5 to plain numbers: matrices and structures of them.

Not read through SciPy, which allocates what a file claims before it looks for the numbers. Text, cells, sparse and
complex matrices are left out. Of objects only the class is given: how MATLAB stores them is not documented.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from circlepose.io.calibration.matlab_text import Rows

_HEADER_SIZE = 128
_MAX_UNPACKED = 20_000_000
_MAX_VALUES = 10_000
"""of a matrix; larger ones are images or points and are left out"""
_MAX_DEPTH = 8
_MATRIX, _COMPRESSED = 14, 15
_STRUCT, _OPAQUE = 2, 17
_NUMERIC_CLASSES = range(6, 16)
_COMPLEX = 0x08
_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}


@dataclass(frozen=True, slots=True)
class MatObject:
    """An object of a MATLAB class, whose values cannot be read."""

    class_name: str


Value: TypeAlias = "Rows | Mapping[str, Value] | MatObject"


class MatError(Exception):
    """The file is damaged; the text says how."""


def is_mat_file(content: bytes) -> bool:
    """Whether the bytes are a .mat file of version 5, 6 or 7."""
    return len(content) > _HEADER_SIZE and content[124:128] in (b"\x00\x01IM", b"\x01\x00MI")


def is_newer_mat_file(content: bytes) -> bool:
    """Whether the bytes are a .mat file of version 7.3: HDF5 behind a header of MATLAB's."""
    return content.startswith(b"MATLAB 7.3 MAT-file")


def mat_variables(content: bytes) -> Mapping[str, Value]:
    """Return the variables of a .mat file that hold numbers, by name; raises `MatError` on a damaged file."""
    order = "<" if content[126:128] == b"IM" else ">"
    found: dict[str, Value] = {}
    left = _MAX_UNPACKED
    try:
        for element in _elements(content[_HEADER_SIZE:], order):
            kind, data = element
            if kind == _COMPRESSED:
                unpacked = _unpacked(data, left)
                left -= len(unpacked)
                kind, data = next(_elements(unpacked, order))
            if kind == _MATRIX:
                name, value = _matrix(data, order, 0)
                if value is not None:
                    found[name] = value
    except (struct.error, StopIteration, ValueError, zlib.error) as reason:
        raise MatError(f"it is damaged ({reason})" if str(reason) else "it ends early") from None
    return found


def _unpacked(data: bytes, most: int) -> bytes:
    unpack = zlib.decompressobj()
    content = unpack.decompress(data, most + 1)
    if len(content) > most:
        raise MatError(f"it unpacks to more than {_MAX_UNPACKED // 1_000_000} MB")
    return content


def _elements(data: bytes, order: str) -> Iterator[tuple[int, bytes]]:
    """Yield (type, data) of the elements that follow one another; small ones hold four bytes in their tag."""
    at = 0
    while at + 8 <= len(data):
        word, size = struct.unpack_from(f"{order}II", data, at)
        if word >> 16:
            kind, size, begin, after = word & 0xFFFF, word >> 16, at + 4, at + 8
        else:
            kind, begin = word, at + 8
            after = begin + size + (-size % 8 if kind != _COMPRESSED else 0)
        if begin + size > len(data) or (word >> 16 and size > 4):
            raise ValueError("an element is longer than the file")
        yield kind, data[begin : begin + size]
        at = after
    if at < len(data):
        raise ValueError("it ends within an element")


def _matrix(data: bytes, order: str, depth: int) -> tuple[str, Value | None]:
    """Return the name and the value of a matrix element; None for what is no numbers."""
    parts = _elements(data, order)
    _, flags = next(parts)
    (word,) = struct.unpack_from(f"{order}I", flags)
    kind = word & 0xFF
    if kind == _OPAQUE:
        names = [part.decode("latin-1") for _, (_, part) in zip(range(3), parts, strict=False)]
        return names[0] if names else "", MatObject(names[2] if len(names) == 3 else "")
    _, sizes = next(parts)
    shape = tuple(int(size) for size in np.frombuffer(sizes, f"{order}i4"))
    name = next(parts)[1].decode("latin-1")
    if any(size < 0 for size in shape):
        raise ValueError(f"{name[:40]} has a negative number of rows or columns")
    count = math.prod(shape)
    if kind == _STRUCT and count == 1 and depth < _MAX_DEPTH:
        return name, _fields(parts, order, depth)
    if kind not in _NUMERIC_CLASSES or (word >> 8) & _COMPLEX or len(shape) != 2 or not 0 <= count <= _MAX_VALUES:
        return name, None
    if count == 0:
        return name, []
    stored, numbers = next(parts)
    if stored not in _TYPES:
        raise ValueError(f"{name[:40]} is stored in an unknown type")
    values = np.frombuffer(numbers, order + _TYPES[stored]).astype(np.float64)
    return name, values.reshape(shape, order="F").tolist()


def _fields(parts: Iterator[tuple[int, bytes]], order: str, depth: int) -> Mapping[str, Value]:
    (length,) = struct.unpack_from(f"{order}i", next(parts)[1])
    names = next(parts)[1]
    if length <= 0:
        raise ValueError("a structure has names without length")
    found: dict[str, Value] = {}
    for at in range(0, len(names), length):
        kind, body = next(parts)
        value = _matrix(body, order, depth + 1)[1] if kind == _MATRIX and body else None
        if value is not None:
            found[names[at : at + length].split(b"\0", 1)[0].decode("latin-1")] = value
    return found
