"""Which rim is which circle of which board: starts from lattices, or from pairs of rims, each followed to its end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from circlepose._typing import IntArray
from circlepose.boards.constellation import constellations
from circlepose.boards.diagnosis import why_no_lattice
from circlepose.boards.lattice import Patch, lattices
from circlepose.boards.options import DEFAULT, BoardOptions
from circlepose.boards.placement import neighbor_radii, place
from circlepose.boards.pose import pose_of_plane
from circlepose.boards.refinement import FoundBoard, settled
from circlepose.boards.scene import Scene
from circlepose.boards.symmetry import symmetries
from circlepose.targets.board import BoardLayout


@dataclass(frozen=True, slots=True, eq=False)
class Matches:
    """The boards of an image, and why others are not."""

    boards: tuple[FoundBoard, ...] = ()
    refusals: tuple[str, ...] = field(default=())
    """why what looks like the layout is not it, one sentence each"""
    left_on_lattice: int = 0
    """circles on a further lattice like the layout's, where as many boards as were asked for are found"""


def find_boards(scene: Scene, layout: BoardLayout, count: int | None, options: BoardOptions = DEFAULT) -> Matches:
    """Return the boards in an image, those of most circles first, `count` at most."""
    if len(scene.rims) < 2:
        return Matches()
    taken: set[int] = set()
    boards: list[FoundBoard] = []
    refusals: list[str] = []
    patches: list[Patch] = []
    if layout.grid is not None:
        patches = lattices(scene.ellipse, neighbor_radii(layout.grid, layout), layout.grid.order, options)
    for patch in patches:
        if count is not None and len(boards) >= count:
            break
        if taken & set(patch.members.tolist()) or len(patch.members) < options.least_on_lattice:
            continue
        placed = place(patch, scene.ellipse, layout, scene.image_size, scene.is_ring, options)
        if isinstance(placed, str):
            refusals.append(placed)
            continue
        start = pose_of_plane(layout.centers_mm[placed.circles], scene.rays[placed.members], layout.normals[0])
        if start is not None:
            board = settled(scene, layout, placed.members, placed.circles, start, taken, options)
            if isinstance(board, str):
                refusals.append(board)
            else:
                boards.append(board)
                taken |= set(board.members.tolist())
    if layout.grid is not None and not boards and len(layout) >= options.least_diagnosed:
        reason = why_no_lattice(scene.ellipse, layout, options)
        refusals = [reason, *refusals] if reason else refusals
    # Where there is a lattice it says which circle is which.
    while not patches or not (boards or refusals):
        if count is not None and len(boards) >= count:
            break
        free = scene.others(taken)
        again = _by_pairs(scene, layout, free, taken, options) if len(free) > 1 else None
        if again is None:
            break
        if isinstance(again, str):
            refusals.append(again)
            break
        boards.append(again)
        taken |= set(again.members.tolist())
    is_full = count is not None and len(boards) >= count
    return Matches(tuple(boards), tuple(refusals), _left(patches, layout, taken, options) if is_full else 0)


def _left(patches: list[Patch], layout: BoardLayout, taken: set[int], options: BoardOptions) -> int:
    """Return how many circles lie on the largest lattice that no board has, if they may be a board."""
    left = max((len(set(patch.members.tolist()) - taken) for patch in patches), default=0)
    return left if left >= max(options.least_on_lattice, options.least_share * len(layout)) else 0


def _by_pairs(
    scene: Scene, layout: BoardLayout, free: IntArray, taken: set[int], options: BoardOptions
) -> FoundBoard | str | None:
    """Return the board that most of the rims `free` are of, without a lattice."""
    layouts = [layout]
    if layout.grid is None and layout.is_planar and layout.side != "front":
        layouts = [layout.seen_from_behind] if layout.side == "back" else [layout, layout.seen_from_behind]
    best: FoundBoard | None = None
    refusals: list[str] = []
    for each in layouts:
        starts = constellations(scene.seen, each, scene.camera, free, options)
        boards = [settled(scene, each, s.members, s.circles, s.pose, taken, options) for s in starts]
        refusals += [board for board in boards if isinstance(board, str)]
        found = _best([board for board in boards if isinstance(board, FoundBoard)], options)
        if isinstance(found, str):
            # What it says of poses that fit comes before why others do not.
            refusals.insert(0, found)
        # Seen from behind only where that explains more: a list may map on its mirror image.
        elif found and (best is None or found.score(options) > best.score(options) + options.decisive_log):
            best = found
    return best or (refusals[0] if refusals else None)


def _best(boards: list[FoundBoard], options: BoardOptions) -> FoundBoard | str | None:
    """Return the board that explains its rims best, or why none does: another assignment is as good."""
    if not boards:
        return None
    ranked = sorted(boards, key=lambda each: -each.score(options))
    best = ranked[0]
    same = symmetries(best.layout)
    for other in ranked[1:]:
        is_as_good = other.score(options) > best.score(options) - options.decisive_log
        if is_as_good and not _is_same(best, other, same):
            what = "a mark" if best.layout.grid is not None else "one of another size"
            return (
                f"{len(other.members)} circles fit the layout in more than one way; more of its circles are needed, "
                f"or {what}"
            )
    return best


def _is_same(first: FoundBoard, second: FoundBoard, same: Sequence[IntArray]) -> bool:
    """Whether two assignments are one but for a symmetry of the layout, in what both assign."""
    own = dict(zip(first.members.tolist(), first.circles.tolist(), strict=True))
    other = dict(zip(second.members.tolist(), second.circles.tolist(), strict=True))
    both = sorted(own.keys() & other.keys())
    if not both:
        return False
    return any(all(permutation[own[i]] == other[i] for i in both) for permutation in same)
