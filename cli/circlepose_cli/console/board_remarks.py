"""What the closing lines say of boards: how many there are, and what to do about the doubtful ones."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from circlepose.results import BoardResult, Flag, ImageResult, Status
from circlepose.targets.board import BoardLayout

_ALL = "boards"


class BoardTally:
    """Counts the boards of all images, by flag."""

    def __init__(self) -> None:
        self._number: Counter[str] = Counter()
        self._growths: list[float] = []
        self._mismatches = 0
        self._without_world = 0
        self._turned_worlds = 0
        self._are_grids = True

    def expect(self, layout: BoardLayout) -> None:
        """Take note of a layout: of a list there are no rows and no spacing to speak of."""
        self._are_grids &= layout.grid is not None

    def count(self, result: ImageResult) -> None:
        """Take note of the boards of one image."""
        self._mismatches += result.status is Status.LAYOUT_MISMATCH
        self._without_world += result.status is Status.NO_WORLD_BOARD
        self._turned_worlds += result.world is not None and Flag.ROLL_AMBIGUOUS in result.world.flags
        for board in result.boards:
            self._number[_ALL] += 1
            self._number.update(_flags(board))
            if Flag.RADIUS_MISFIT in board.flags:
                self._growths.append(board.growth)

    @property
    def number(self) -> int:
        """Number of all boards."""
        return self._number[_ALL]

    def lines(self) -> Iterator[str]:
        """Yield what to do, a sentence for each kind of doubt."""
        ambiguous, turned = self._number[Flag.AMBIGUOUS], self._number[Flag.ROLL_AMBIGUOUS]
        if self._mismatches:
            what = (
                "pattern, rows, columns and spacing_mm of the target"
                if self._are_grids
                else "places and radii of the target's circles"
            )
            yield (
                f"{_images(self._mismatches)} layout_mismatch: compare {what} with the board, have more of it in "
                "view; circlepose inspect shows which circles are found"
            )
        if self._without_world:
            yield (
                f"{_images(self._without_world)} no_world_board: have the whole board in view, once; circlepose "
                "explain IMAGE with it as --target shows what was found of it"
            )
        if self._turned_worlds:
            yield (
                f"{_images(self._turned_worlds)} whose world board looks the same when it is turned: poses may be "
                "turned with it; put a circle of another size on it and name it in marks of its file"
            )
        if ambiguous:
            yield (
                f"{self._of_all(ambiguous)} ambiguous: either tilt may be the right one; photograph the board from "
                "nearer or tilted more"
            )
        if turned:
            place = "marks of the target" if self._are_grids else "the target"
            yield (
                f"{self._of_all(turned)} roll_ambiguous: the layout looks the same when it is turned; if the turn "
                f"matters, put a circle of another size on the board and name it in {place}"
            )
        misfits = self._number[Flag.CIRCLES_MISFIT]
        if misfits:
            yield (
                f"{self._of_all(misfits)} circles_misfit: some are seen, but not where the layout puts them, or "
                "are of another size; circlepose explain shows which; correct them in the target"
            )
        if self._growths:
            percent = 100.0 * sorted(self._growths, key=abs)[len(self._growths) // 2]
            word = "larger" if percent > 0.0 else "smaller"
            by = (
                "radius_mm, measured by spacing_mm, which was believed"
                if self._are_grids
                else "stated, measured by their distances, which were believed"
            )
            yield (
                f"{self._of_all(len(self._growths))} radius_misfit: the circles are {abs(percent):.2g} % {word} than "
                f"{by}; measure both on the board"
            )

    def _of_all(self, number: int) -> str:
        return f"{number} of {self.number} board{'' if self.number == 1 else 's'}"


def _flags(board: BoardResult) -> Iterator[str]:
    return (str(flag) for flag in board.flags)


def _images(number: int) -> str:
    return f"{number} image{'' if number == 1 else 's'}"
