"""Lines of standard input as they come."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import BinaryIO

from circlepose.errors import UsageError

_BLOCK = 65536
_LONGEST = 1 << 20


def lines(stream: BinaryIO) -> Iterator[bytes]:
    """Yield the lines of `stream`, without their ends, each as soon as it is there.

    A file object is locked while it reads, and the program could not end as long as its producer is silent; so
    this reads past it, where it is a real file.
    """
    try:
        number = stream.fileno()
    except OSError:
        yield from stream
        return
    rest = b""
    while block := os.read(number, _BLOCK):
        *whole, rest = (rest + block).split(b"\n")
        yield from whole
        if len(rest) > _LONGEST:
            raise UsageError("-: a line of standard input has no end; expected one path a line.")
    if rest:
        yield rest
