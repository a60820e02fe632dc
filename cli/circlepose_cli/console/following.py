"""A bar on the terminal while rows are made one by one."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from typing import TypeVar

T = TypeVar("T")


def followed(rows: Iterable[T], total: int, doing: str) -> Iterator[T]:
    """Yield the `rows`, with a bar meanwhile where standard error is a terminal."""
    if not sys.stderr.isatty():
        yield from rows
        return
    from rich.console import Console  # noqa: PLC0415
    from rich.progress import track  # noqa: PLC0415

    yield from track(rows, doing, total=total, console=Console(stderr=True), transient=True)
