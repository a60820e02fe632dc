"""NumPy's `.npz` and `.npy` from their bytes, not by `np.load`: nothing is unpickled, and sizes are bounded."""

from __future__ import annotations

import io
import math
import re
import struct
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeGuard, cast

import numpy as np

from circlepose._arguments import shown
from circlepose.errors import CalibrationError
from circlepose.io.text.literal import python_literal
from circlepose.io.text.validation import brief

ARRAY = b"\x93NUMPY"
ZIP, _ZIP_ENTRY = b"PK\x03\x04", b"PK\x01\x02"
# Damaged archives fail in many ways.
_ZIP_ERRORS = (
    *(zipfile.BadZipFile, zlib.error, struct.error, EOFError, OSError, ValueError, KeyError, RuntimeError),
    *(NotImplementedError, OverflowError),
)
MOST_BYTES = 100_000
"""Of one array: a camera matrix has 72."""
_MOST_MEMBERS = 1000
_MOST_HEADER = 10_000
_MOST_NAME = 100
_KIND = re.compile(r"[<>|=]?(?:f[248]|[iu][1248]|b1|U[0-9]{1,3})")
SAVE_ANEW = "save it anew as plain arrays: np.savez('camera.npz', K=K, D=D, image_size=[width, height])"
_OBJECTS = "which circlepose never unpickles, as that can run code"


@dataclass(frozen=True)
class Archive:
    """The arrays of a file, each read when it is asked for."""

    where: str
    content: bytes
    names: Mapping[str, str] = field(default_factory=dict)
    """by array: the member of the archive"""

    def array(self, name: str) -> np.ndarray:
        """Return one array of numbers or text; raises `CalibrationError`."""
        try:
            member = self._zip.getinfo(self.names[name])
            if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
                raise zipfile.BadZipFile("it is not packed as NumPy packs")
            with self._zip.open(member) as stream:
                content = stream.read(MOST_BYTES + 1)
        except _ZIP_ERRORS as reason:
            text = brief(str(reason))
            raise CalibrationError(
                f"{self.where}: {name}: cannot be unpacked ({text}); copy the file again."
            ) from None
        return array_of(content, f"{self.where}: {name}")

    @cached_property
    def _zip(self) -> zipfile.ZipFile:
        # Opened once: each time its whole list of members is read.
        return zipfile.ZipFile(io.BytesIO(self.content))


def members(content: bytes) -> dict[str, str]:
    """Return the members of a zip archive that are arrays, by the array's name; {"": ""} of a damaged one."""
    # An archive of more is none of NumPy's, and would take long to list.
    if content.count(_ZIP_ENTRY) > _MOST_MEMBERS:
        return {}
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            names = archive.namelist()
    except _ZIP_ERRORS:
        # A damaged archive: by the name that stands at its beginning.
        return {"": ""} if b".npy" in content[:300] else {}
    return {name.removesuffix(".npy"): name for name in names if name.endswith(".npy") and len(name) <= _MOST_NAME}


def array_of(content: bytes, where: str) -> np.ndarray:
    """Return the array of a `.npy`; raises `CalibrationError` on Python objects, on damage and on a large one."""
    if len(content) > MOST_BYTES:
        raise CalibrationError(
            f"{where}: holds more than {MOST_BYTES // 1000} kB; expected a camera matrix or coefficients."
        )
    header, data = _header(content)
    if not isinstance(header, dict):
        raise CalibrationError(f"{where}: is a damaged NumPy array; save it again.")
    kind, shape, is_fortran = header.get("descr"), header.get("shape"), header.get("fortran_order")
    if isinstance(kind, str) and kind.endswith("O"):
        what = "a Python object (a dict or list saved as a pickle)" if shape == () else "Python objects (a pickle)"
        raise CalibrationError(f"{where}: holds {what}, {_OBJECTS}; {SAVE_ANEW}.")
    if not isinstance(kind, str) or not _KIND.fullmatch(kind) or not _is_shape(shape):
        raise CalibrationError(
            f"{where}: expected an array of numbers, got {shown(kind)}, {shown(shape)}; save it again."
        )
    dtype, count = np.dtype(kind), math.prod(shape)
    if count * dtype.itemsize != len(data):
        raise CalibrationError(
            f"{where}: is damaged: {count} values of {dtype.itemsize} bytes stand in {len(data)}; save it again."
        )
    return np.frombuffer(data, dtype, count).reshape(shape, order="F" if is_fortran else "C")


def _header(content: bytes) -> tuple[object, bytes]:
    """Return the header, a Python literal after its length (2 bytes, or 4 from version 2), and what follows it."""
    width = 2 if content[6:7] == b"\1" else 4
    start = len(ARRAY) + 2 + width
    end = start + int.from_bytes(content[start - width : start], "little")
    try:
        literal = python_literal(content[start : min(end, start + _MOST_HEADER)].decode("latin-1"))
    except ValueError:
        return None, b""
    return literal, content[end:]


def _is_shape(shape: object) -> TypeGuard[tuple[int, ...]]:
    is_short = isinstance(shape, tuple) and len(shape) <= 3
    return is_short and all(type(each) is int and 0 <= each <= MOST_BYTES for each in cast(tuple[object, ...], shape))
