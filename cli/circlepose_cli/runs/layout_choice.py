"""Which layout an estimate has: the one asked for, or else the one that fits the targets found."""

from __future__ import annotations

from collections.abc import Iterator

from circlepose.errors import UsageError
from circlepose.io.tables import Layout
from circlepose_cli.options.setup import Setup

USUAL: tuple[Layout, ...] = ("poses", "boards")
"""the layouts that are taken unasked, by the targets"""
_PAPERS = ("table1", "table2")


class LayoutChoice:
    """Takes in the setup of each folder; `choose` before the first row is written.

    Of a stream the first target decides, as the others are not known when its rows are written.
    """

    def __init__(self, asked: Layout | None, method: str, *, is_stream: bool) -> None:
        """Take the options --layout and --method; raises `UsageError` where they do not go together."""
        if asked == "pairs" and method == "all":
            raise UsageError("--layout pairs: goes with one --method, not with all.")
        self._asked = asked
        self._is_stream = is_stream
        self._chosen: Layout | None = None
        self._kinds: set[str] = set()

    def accept(self, setup: Setup) -> None:
        """Take note of a target; raises `UsageError` where the layout cannot show it."""
        kind = setup.target.kind
        self._kinds.add(kind)
        if self._is_stream:
            self.choose()
        if kind == "board" and self._asked in _PAPERS:
            raise UsageError(
                f"--layout {self._asked}: shows lone circles and ring targets; {setup.target_origin} is a board: "
                "give --layout boards, poses or pairs."
            )
        if kind != "board" and self._asked == "boards":
            raise UsageError(
                f"--layout boards: needs a target of kind board; {setup.target_origin} is of kind {kind}: give "
                "--layout poses or pairs."
            )
        if kind != "board" and self._asked is None and self._chosen == "boards":
            raise UsageError(
                f"{setup.target_origin}: is of kind {kind}, but the targets before were boards; give --layout poses."
            )

    def choose(self) -> Layout:
        """Return the layout: `boards` where all targets are boards, else `poses`, unless one was asked for."""
        if self._chosen is None:
            self._chosen = self._asked or ("boards" if self._kinds == {"board"} else "poses")
        return self._chosen

    def notes(self) -> Iterator[str]:
        """Yield a sentence where another layout might have been expected."""
        if self._asked is None and "board" in self._kinds and len(self._kinds) > 1:
            yield "some targets are boards, others not: each circle has a row, as by --layout poses"
        if self._asked == "pairs" and "board" in self._kinds:
            yield (
                "distances within a board are those of its layout, not measured: all its circles have one pose; to "
                "measure them take a target of kind circle with count: all"
            )
