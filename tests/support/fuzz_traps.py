"""Formats whose reading fails in each of the ways that the fuzzer is there to see."""

from __future__ import annotations

import os
import sys
import time

from benchmarks.support.fuzz.formats import Format


def formats() -> dict[str, Format]:
    """Return a format for each way; every third case of it fails."""
    ways = {"bug": _bug, "printed": _print, "hang": _hang, "crash": _crash}
    return {name: Format(b"", lambda content, _: content, way) for name, way in ways.items()}


def _bug(_: bytes, case: int) -> str:
    if case % 3 == 1:
        raise ZeroDivisionError("of one")
    return "read"


def _print(_: bytes, case: int) -> str:
    if case % 3 == 1:
        os.write(2, b"libfoo: warning\n")
        print("and more", file=sys.stderr)
    return "read"


def _hang(_: bytes, case: int) -> str:
    if case % 3 == 1:
        time.sleep(60.0)
    return "read"


def _crash(_: bytes, case: int) -> str:
    if case % 3 == 1:
        os.abort()
    return "read"
