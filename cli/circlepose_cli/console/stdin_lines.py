"""What comes on standard input: paths, one a line, as they come; or one image."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack
from itertools import chain
from pathlib import Path
from typing import BinaryIO

from circlepose.errors import UsageError
from circlepose.io.atomic import removed_at_end
from circlepose.io.images.content import MAX_FILE_BYTES
from circlepose.io.images.formats import HEAD_BYTES, known_format
from circlepose.io.inputs.images import InputImage
from circlepose_cli.options.declared import StdinChoice

NAME = "stdin"
"""of an image on standard input"""
_BLOCK = 65536
_LONGEST = 1 << 20


def standard_input(
    stream: BinaryIO, choice: StdinChoice, held: ExitStack, *, nul: bool, has_camera: bool = True
) -> Iterator[bytes | InputImage]:
    """Yield the lines of `stream` without their ends, each as soon as it is there, or else the one image that it is.

    The image is kept in a temporary folder until `held` is closed. With `nul`, lines end with a NUL character.
    Raises `UsageError` for a line without end, and for an image that is too large or for which no calibration is
    given.
    """
    blocks = _blocks(stream)
    begin = next(blocks, b"")
    if choice is StdinChoice.AUTO and not nul and len(begin) < HEAD_BYTES and known_format(begin) is None:
        # A pipe may bring the head of an image in parts; a line that is whole is no image.
        while len(begin) < HEAD_BYTES and b"\n" not in begin and (more := next(blocks, b"")):
            begin += more
    is_image = choice is StdinChoice.IMAGE or (
        choice is StdinChoice.AUTO and not nul and known_format(begin) is not None
    )
    if not is_image:
        yield from _lines(chain([begin], blocks), b"\0" if nul else b"\n")
        return
    if not has_camera:
        raise UsageError("-: an image on standard input has no calibration beside it; give --calib FILE.")
    folder = Path(held.enter_context(tempfile.TemporaryDirectory(prefix="circlepose-")))
    held.enter_context(removed_at_end(folder))
    _store(chain([begin], blocks), folder / NAME)
    yield InputImage(folder / NAME, NAME)


def _blocks(stream: BinaryIO) -> Iterator[bytes]:
    """Yield what comes, as it comes.

    A file object is locked while it reads, and the program could not end as long as its producer is silent; so this
    reads past it, where it is a real file.
    """
    try:
        number = stream.fileno()
    except OSError:
        while block := stream.read(_BLOCK):
            yield block
        return
    while block := os.read(number, _BLOCK):
        yield block


def _lines(blocks: Iterator[bytes], end: bytes) -> Iterator[bytes]:
    rest = b""
    for block in blocks:
        *whole, rest = (rest + block).split(end)
        yield from whole
        if len(rest) > _LONGEST:
            raise UsageError(
                "-: a line of standard input has no end; expected one path a line (with -0, a NUL after each)."
            )
    if rest:
        yield rest


def _store(blocks: Iterator[bytes], path: Path) -> None:
    size = 0
    with path.open("xb") as handle:
        for block in blocks:
            size += len(block)
            if size > MAX_FILE_BYTES:
                raise UsageError(f"-: the image has more than {MAX_FILE_BYTES} bytes, which are not read.")
            handle.write(block)
