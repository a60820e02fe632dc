"""Printed sheets: how true each form is drawn, and whether a mark settles the roll of a board.

    python -m benchmarks.print [--views 60]

Needs `pip install '.[test-print]'`. Forms: sheets of discs, rings and boards as SVG (rendered by resvg), PDF (by
PDFium) and DXF (by ezdxf and resvg) at 508 dpi; circlepose finds the circles in the pixels, and their ellipses are
compared with the circles that were meant. `others`: circles found that are none, in the letters, bars, code or seams.
Curves: how far the cubic curves of a PDF are from the circle.

Marks: random views of rendered boards, 1280 x 960, f = 1000 px, k1 = -0.1, tilt 0 to 65 deg, discs of 4 to 20 px,
blur 0.7 px, noise of 1 to 6 levels, up to a sixth of the circles hidden. `right`: rotation within 5 deg of the truth.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

import circlepose
from benchmarks.support.sheet_rasters import dxf_pixels, errors_of, pdf_pixels, svg_pixels
from circlepose._typing import FloatArray, Image
from circlepose.boards.pose import rotation_of
from circlepose.camera.camera import Camera
from circlepose.sheets.code import code_of
from circlepose.sheets.dxf import dxf_of
from circlepose.sheets.figure import figure_of
from circlepose.sheets.marking import with_roll_settled
from circlepose.sheets.pages import lay_out
from circlepose.sheets.paper import paper_mm
from circlepose.sheets.pdf import arc_error, arc_points, arcs_for, pdf_of
from circlepose.sheets.shapes import Page
from circlepose.sheets.svg import svg_of
from circlepose.sheets.words import small_print
from circlepose.synthesis.render import render
from circlepose.synthesis.scene import Disc, Paint, Scene
from circlepose.targets.board import BoardLayout, Grid
from circlepose.targets.target import Target

CAMERA = Camera.create([[1000.0, 0, 639.5], [0, 1000.0, 479.5], [0, 0, 1]], (-0.1, 0.02, 0.0, 0.0, 0.0), (1280, 960))


def _grid(pattern: str, rows: int, columns: int, spacing: float, radius: float) -> BoardLayout:
    return BoardLayout.on_grid(radius, Grid(pattern, rows, columns, spacing))  # type: ignore[arg-type]


TARGETS = {
    "disc, radius 60 mm": (Target.circle(60.0), None),
    "4 discs, radius 20 mm": (Target.circle(20.0, count=4), None),
    "ring, radii 50, 30, 12 mm": (Target.rings((50.0, 30.0, 12.0)), None),
    "board 7 x 9, radius 8 mm": (Target.board(with_roll_settled(_grid("symmetric", 7, 9, 30.0, 8.0))), None),
    "board 11 x 4, asymmetric, radius 7 mm": (Target.board(_grid("asymmetric", 11, 4, 18.0, 7.0)), None),
    "the board 7 x 9 on tiles of A4": (Target.board(with_roll_settled(_grid("symmetric", 7, 9, 30.0, 8.0))), "A4"),
}
BOARDS = {
    "symmetric 7 x 9, spacing 3.8 radii": _grid("symmetric", 7, 9, 30.0, 8.0),
    "symmetric 4 x 4, spacing 3.3 radii": _grid("symmetric", 4, 4, 30.0, 9.0),
    "symmetric 5 x 7, spacing 2.2 radii": _grid("symmetric", 5, 7, 20.0, 9.0),
    "symmetric 2 x 2, spacing 2.7 radii": _grid("symmetric", 2, 2, 40.0, 15.0),
    "hexagonal 6 x 6, spacing 2.5 radii": _grid("hexagonal", 6, 6, 20.0, 8.0),
}
RADII_MM = (1.0, 8.0, 60.0, 250.0, 1000.0, 2500.0)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--views", type=int, default=60)
    options = parser.parse_args()
    print("\n".join(forms()))
    print()
    print("\n".join(curves()))
    print()
    print("\n".join(marks(options.views)))


def forms() -> Iterator[str]:
    """Yield the table of the forms."""
    yield "| sheet | ground | form | circles | found | center, mm, largest | radius, mm, largest | others |"
    yield "|---|---|---|---|---|---|---|---|"
    for name, (target, paper) in TARGETS.items():
        for is_dark in (True, False):
            words = small_print(
                "target.yaml", target, 1, is_dark_on_light=is_dark, target_file="s.yaml", scale=(1, 1)
            )
            sheet = lay_out(
                figure_of(target),
                words,
                code_of("kind: circle\nradius_mm: 60.0\n" * 5),
                None if paper is None else paper_mm(paper),
                is_dark_on_light=is_dark,
            )
            for form in ("svg", "pdf", *(["dxf"] if len(sheet.pages) == 1 else [])):
                found = [errors_of(image, page) for image, page in _pixels(form, sheet.pages)]
                errors = np.concatenate([each for each, _ in found])
                seen = errors[np.isfinite(errors[:, 0])]
                center = np.linalg.norm(seen[:, :2], axis=1).max()
                yield (
                    f"| {name} | {'light' if is_dark else 'dark'} | {form} | {len(errors)} | {len(seen)} "
                    f"| {center:.4f} | {np.abs(seen[:, 2]).max():.4f} | {sum(others for _, others in found)} |"
                )


def _pixels(form: str, pages: tuple[Page, ...]) -> list[tuple[Image, Page]]:
    if form == "pdf":
        return list(zip(pdf_pixels(pdf_of(pages, "sheet")), pages, strict=True))
    if form == "dxf":
        return [(dxf_pixels(dxf_of(page)), page) for page in pages]
    return [(svg_pixels(svg_of(page, "sheet")), page) for page in pages]


def curves() -> Iterator[str]:
    """Yield the table of the curves of a PDF."""
    yield "| radius, mm | arcs | largest distance from the circle, um | the same with four arcs, um |"
    yield "|---|---|---|---|"
    for radius in RADII_MM:
        arcs = arcs_for(radius)
        yield f"| {radius:g} | {arcs} | {1e3 * _distance(radius, arcs):.5f} | {1e3 * arc_error(radius, 4):.2f} |"


def _distance(radius: float, arcs: int) -> float:
    """Return the largest distance of densely sampled curves from the circle."""
    points = np.array(arc_points(0.0, 0.0, radius, arcs))
    t = np.linspace(0.0, 1.0, 501)[:, None]
    a, b, c, d = points[:4]
    curve = (1 - t) ** 3 * a + 3 * (1 - t) ** 2 * t * b + 3 * (1 - t) * t**2 * c + t**3 * d
    return float(np.abs(np.linalg.norm(curve, axis=1) - radius).max())


def marks(views: int) -> Iterator[str]:
    """Yield the table of the marks."""
    yield "| board | mark | posed | right | flag `roll_ambiguous` |"
    yield "|---|---|---|---|---|"
    for name, plain in BOARDS.items():
        for layout in (plain, with_roll_settled(plain)):
            rng = np.random.default_rng(5)
            posed = right = flagged = 0
            for _ in range(views):
                image, rotation = _view(layout, rng)
                result = circlepose.estimate(image, CAMERA, Target.board(layout))
                board = result.boards[0] if result.boards else None
                if board is not None and board.pose is not None:
                    posed += 1
                    flagged += any(flag.value == "roll_ambiguous" for flag in board.flags)
                    turn = np.trace(board.pose.rotation @ rotation.T)
                    right += bool(np.degrees(np.arccos(np.clip((turn - 1.0) / 2.0, -1.0, 1.0))) < 5.0)
            mark = "one" if layout is not plain else "none"
            yield f"| {name} | {mark} | {posed} of {views} | {right} | {flagged} |"


def _view(layout: BoardLayout, rng: np.random.Generator) -> tuple[Image, FloatArray]:
    """Return a random view of a board, and its true rotation."""
    radius_px = np.exp(rng.uniform(np.log(4.0), np.log(20.0)))
    extent = float(np.linalg.norm(np.ptp(layout.centers_mm, axis=0)))
    distance = max(1000.0 * layout.usual_radius_mm / radius_px, 1000.0 * extent / 850.0)
    azimuth = rng.uniform(0.0, 2.0 * np.pi)
    tilt = np.radians(rng.uniform(0.0, 65.0)) * np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    rotation = rotation_of(tilt) @ rotation_of(np.array([0.0, 0.0, rng.uniform(-np.pi, np.pi)]))
    places = (layout.centers_mm - layout.centers_mm.mean(axis=0)) @ rotation.T + [0.0, 0.0, distance]
    most = len(layout) // 6 if len(layout) > 6 else 0
    hidden = set(rng.permutation(len(layout))[: rng.integers(0, most + 1)].tolist())
    normal = tuple((rotation @ [0.0, 0.0, -1.0]).tolist())
    discs = tuple(
        Disc(tuple(place), normal, circle.radii_mm[0], Paint(40.0))
        for i, (place, circle) in enumerate(zip(places.tolist(), layout.circles, strict=True))
        if i not in hidden
    )
    noise = float(rng.uniform(1.0, 6.0))
    scene = Scene(CAMERA, discs, Paint(200.0), blur_px=0.7, noise_levels=noise, noise_seed=int(rng.integers(1 << 30)))
    return render(scene), rotation


if __name__ == "__main__":
    main()
