"""Boards in the words of a picture: as many digits as the standard deviations allow."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from circlepose.board_result import BoardResult
from circlepose.drawing import words
from circlepose.flags import Flag

ROW_NAMES = ("instance", "circles", "rms, px", "origin, mm", "sigma, mm", "of rotation, deg", "choice")


def is_doubtful(board: BoardResult) -> bool:
    """Whether the pose may well be the other one."""
    return Flag.AMBIGUOUS in board.flags or board.ambiguity >= words.DOUBTFUL_FROM


def choice(board: BoardResult) -> str:
    """Return what is known of the choice between the candidates."""
    if len(board.candidates) == 1:
        return "one pose possible"
    doubt = f"{words.percent(board.ambiguity)} chance of the other pose"
    if Flag.AMBIGUOUS in board.flags:
        return f"ambiguous: two poses possible, {doubt}"
    return doubt if board.ambiguity >= words.SURE else "settled by the joint fit"


def circles_used(board: BoardResult) -> str:
    """Return how many circles the pose rests on."""
    return f"{board.circles_used} of {board.circles_in_layout}"


def origin(board: BoardResult) -> str:
    """Return the board's origin, mm, with two digits of its largest standard deviation."""
    most = float(board.pose.sigma_mm.max())
    return words.vector(board.pose.translation, decimals=words.decimals(most))


def quaternion(board: BoardResult) -> str:
    """Return the rotation w, x, y, z with two digits of its largest standard deviation."""
    sigma = float(np.radians(board.pose.sigma_deg.max())) / 2.0
    return words.vector(board.pose.quaternion, decimals=max(3, words.decimals(sigma, usual=4, most=6)))


def sigma_mm(board: BoardResult) -> str:
    """Return the standard deviations of the origin, mm."""
    return words.vector(board.pose.sigma_mm, significant=2)


def sigma_deg(board: BoardResult) -> str:
    """Return the standard deviations of the rotation about the camera's axes, deg."""
    return words.vector(board.pose.sigma_deg, significant=2)


def flags(board: BoardResult) -> str:
    """Return the flags of a board, but for `ambiguous`, which `choice` says."""
    names = [str(flag) for flag in board.flags if flag is not Flag.AMBIGUOUS]
    return f"flags: {', '.join(names)}" if names else ""


def growth(board: BoardResult) -> str:
    """Return by how much the radii differ from those stated, where they do."""
    if Flag.RADIUS_MISFIT not in board.flags:
        return ""
    return f"radii {words.percent(abs(board.growth))} {'larger' if board.growth > 0.0 else 'smaller'} than stated"


def marks(board: BoardResult) -> str:
    """Return what is special of a board's pose."""
    return "; ".join(part for part in (choice(board), growth(board), flags(board)) if part)


def rms_px(board: BoardResult) -> str:
    """Return the rms distance of the rims' centers from the pose, px."""
    rms = board.pose.rms_px
    return f"{rms:.{words.decimals(rms)}f}"


def misfit(board: BoardResult) -> str:
    """Return by how much the rims misfit the pose, against what their noise would do."""
    sigmas = float(np.sqrt(np.mean([circle.sigmas**2 for circle in board.circles if circle.is_used])))
    return f"the rims are {sigmas:.{1 if sigmas < 9.95 else 0}f} standard deviations off, noise alone gives about 1"


def sentences(boards: Sequence[BoardResult]) -> tuple[str, ...]:
    """Return what a heading says of boards; of several the poses are in `rows`."""
    if len(boards) > 1:
        used = sum(board.circles_used for board in boards)
        return (f"{len(boards)} boards, {used} of {sum(board.circles_in_layout for board in boards)} circles",)
    (board,) = boards
    return (
        f"1 board, {circles_used(board)} circles, rms {rms_px(board)} px; {marks(board)}",
        f"origin {origin(board)} mm, sigma {sigma_mm(board)} mm; rotation, sigma {sigma_deg(board)} deg",
    )


def rows(boards: Sequence[BoardResult]) -> tuple[tuple[str, ...], ...]:
    """Return the poses of several boards as a table, its column names first."""
    return (
        ROW_NAMES,
        *(
            (
                f"{board.instance}",
                circles_used(board),
                rms_px(board),
                origin(board),
                sigma_mm(board),
                sigma_deg(board),
                marks(board),
            )
            for board in boards
        ),
    )
