"""What the report on one image says of boards: the pose, and a line for each circle."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from circlepose.board_result import BoardCircleFit, BoardPose, BoardResult
from circlepose.camera.camera import Camera
from circlepose.diagnostics.boards import BoardView, Unseen, unseen
from circlepose.flags import Flag
from circlepose_cli.reports.explain.poses import small

_FEW = 12
"""With more circles the worst are written first."""
_WORST = 5
_MOST_LISTED = 4
_NAME_WIDTH = 10
_TERMS = {"image": "the image's noise", "camera": "the camera", "radius": "the layout's scale"}


def listed(names: Sequence[str]) -> str:
    """Return names, or the first and the last of many."""
    return ", ".join(names) if len(names) <= _MOST_LISTED else f"{names[0]}, {names[1]} ... {names[-1]}"


def board_rows(
    view: BoardView, camera: Camera, image_size: tuple[int, int], *, has_table: bool
) -> Iterator[tuple[str, str | None]]:
    """Yield the rows of a board in an image of `camera`, and with `has_table` those of its circles."""
    board = view.board
    number = board.circles_in_layout
    yield f"#{board.instance} board", f"{board.circles_used} of {number} circles used, {len(board.circles)} seen"
    for i, pose in enumerate(board.candidates):
        for name, words in zip((f"pose {i}", ""), _pose_lines(pose, chosen=i == board.chosen), strict=True):
            yield name, words
    if len(board.candidates) > 1:
        yield "ambiguity", f"{small(board.ambiguity)}, the probability that the chosen pose is the wrong one"
    else:
        yield "ambiguity", "none: one tilt fits"
    yield "roll", _roll(board)
    yield "radii", _growth(board)
    for name, words in zip(("uncertainty", ""), _uncertainty(board.pose), strict=False):
        yield name, words
    if board.flags:
        yield "flags", ", ".join(board.flags)
    if board.misfits:
        yield "off place", f"{len(board.misfits)}: {listed(board.misfits)}: seen, but not where the layout puts them"
    if len(board.circles) < number:
        fits = zip(view.circles, view.fits, strict=True)
        names = [circle.circle for circle, fit in fits if fit is None and circle.circle not in board.misfits]
        if names:
            yield "not seen", f"{len(names)}: {listed(names)}"
            yield "", _where(unseen(view, camera, image_size))
    if has_table:
        yield from _table(view)


def board_records(boards: Sequence[BoardResult]) -> list[dict[str, Any]]:
    """Return boards as plain values for JSON."""
    return [
        {
            "instance": board.instance,
            "circles_used": board.circles_used,
            "circles_in_layout": board.circles_in_layout,
            "ambiguity": board.ambiguity,
            "growth": board.growth,
            "flags": [str(flag) for flag in board.flags],
            "misfits": list(board.misfits),
            "solutions": [_pose_record(pose, i, board) for i, pose in enumerate(board.candidates)],
            "circles": [
                {
                    "circle": fit.name,
                    "used": fit.is_used,
                    "residual_x_px": float(fit.residual_px[0]),
                    "residual_y_px": float(fit.residual_px[1]),
                    "sigmas": fit.sigmas,
                }
                for fit in board.circles
            ],
        }
        for board in boards
    ]


def _pose_lines(pose: BoardPose, *, chosen: bool) -> tuple[str, str]:
    origin = "({:.3f}, {:.3f}, {:.3f}) mm +- ({:.2g}, {:.2g}, {:.2g})".format(*pose.translation, *pose.sigma_mm)
    turn = "({:.6f}, {:.6f}, {:.6f}, {:.6f})".format(*pose.quaternion)
    sigmas = "({:.2g}, {:.2g}, {:.2g}) deg about the camera's x, y, z".format(*pose.sigma_deg)
    return (
        f"origin {origin}, rms {pose.rms_px:.3g} px{', chosen' if chosen else ''}",
        f"rotation (w, x, y, z) {turn} +- {sigmas}",
    )


def _roll(board: BoardResult) -> str:
    if Flag.ROLL_AMBIGUOUS not in board.flags:
        return "settled: no turn maps the layout on itself"
    return "open: a turn maps the layout on itself; its x axis is taken nearest to the image's right"


def _where(places: Unseen) -> str:
    """Return where the circles that were not seen are."""
    parts = {
        "outside the image": len(places.outside),
        "cut by its border": len(places.cut),
        "within the image, so hidden or not found": len(places.within),
    }
    return "by the pose " + ", ".join(
        f"{number} {'is' if number == 1 else 'are'} {where}" for where, number in parts.items() if number
    )


def _growth(board: BoardResult) -> str:
    """Return by how much the radii seem to differ from those stated."""
    if board.growth == 0.0:
        return "as stated"
    side = "larger" if board.growth > 0.0 else "smaller"
    return f"{abs(board.growth):.2%} {side} than stated, against the distances of the circles"


def _uncertainty(pose: BoardPose) -> tuple[str, ...]:
    """Return which term of the covariance dominates."""
    terms = {"image": pose.terms.image, "camera": pose.terms.camera, "radius": pose.terms.radius}
    known = {name: term for name, term in terms.items() if term is not None}
    if len(known) == 1:
        return ("the image's noise alone; --camera-sigma and --radius-sigma-mm add what dominates in practice",)
    lines = []
    for what, part in (("position", slice(0, 3)), ("rotation", slice(3, 6))):
        variance = {name: float(np.trace(term[part, part])) for name, term in known.items()}
        total = sum(variance.values())
        shares = {name: value / total if total > 0.0 else 0.0 for name, value in variance.items()}
        said = ", ".join(f"{name} {share:.1%}" for name, share in shares.items() if share > 0.0)
        most = _TERMS[max(shares, key=lambda name: shares[name])]
        lines.append(f"{what}: mostly {most} (share of the variance: {said})")
    return tuple(lines)


def _table(view: BoardView) -> Iterator[tuple[str, str | None]]:
    """Yield a row for each circle that was seen, of many the worst first; and how to see more of one."""
    names = [circle.circle for circle in view.circles]
    fits = [(i, fit) for i, fit in enumerate(view.fits) if fit is not None]
    width = max(_NAME_WIDTH, *(len(names[i]) for i, _ in fits))
    yield "circles", f"{'circle':<{width}} used  residual x, y px   sigmas"
    worst = view.worst(_WORST) if len(fits) > _FEW else []
    by_index = dict(fits)
    decimals = _decimals(view.board.pose.rms_px)
    for i in worst:
        yield "" if i != worst[0] else "the worst", _fit_line(names[i], by_index[i], width, decimals)
    others = [i for i, _ in fits if i not in worst]
    for i in others:
        yield "" if i != others[0] or not worst else "the others", _fit_line(names[i], by_index[i], width, decimals)
    yield (
        "",
        "sigmas: by how much the whole rim, its size and shape too, misfits the pose, in its standard deviations",
    )
    yield "", f"--circle NAME, such as {names[(worst or others)[0]]}, writes what is known of one of them"


def _fit_line(name: str, fit: BoardCircleFit, width: int, decimals: int) -> str:
    # A sum with 0 has no -0.000.
    x, y = (np.round(fit.residual_px, decimals) + 0.0).tolist()
    used = "yes" if fit.is_used else "no"
    return f"{name:<{width}} {used:<4}  {x:8.{decimals}f} {y:8.{decimals}f}   {fit.sigmas:6.1f}"


def _decimals(rms_px: float) -> int:
    """Return how many decimals show two digits of residuals, from 3 to 5."""
    return int(np.clip(1 - math.floor(math.log10(rms_px)), 3, 5)) if 0.0 < rms_px < math.inf else 3


def _pose_record(pose: BoardPose, number: int, board: BoardResult) -> dict[str, Any]:
    return {
        "solution": number,
        "chosen": number == board.chosen,
        **dict(zip(("x_mm", "y_mm", "z_mm"), pose.translation.tolist(), strict=True)),
        **dict(zip(("qw", "qx", "qy", "qz"), pose.quaternion.tolist(), strict=True)),
        "rms_px": pose.rms_px,
        **dict(zip(("sigma_x_mm", "sigma_y_mm", "sigma_z_mm"), pose.sigma_mm.tolist(), strict=True)),
        **dict(zip(("sigma_rx_deg", "sigma_ry_deg", "sigma_rz_deg"), pose.sigma_deg.tolist(), strict=True)),
        "covariance": pose.covariance.tolist(),
    }
