"""Predictions of `circlepose plan` against rendered trials.

    python -m benchmarks.plan [--trials 200]

30 cells of a target, a distance, a tilt and a look. Predicted: from four pictures of the view (`planning.predict`).
Found: `estimate` of as many other pictures, each with noise and place in the pixel of its own. *position*, *normal*:
root mean square error of the candidate nearest to the truth over the predicted standard deviation. *wrong*: how often
the other candidate was chosen.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from circlepose._typing import FloatArray
from circlepose.camera.camera import Camera
from circlepose.pipeline import estimate
from circlepose.planning.predict import predict
from circlepose.planning.views import USUAL, Look, PlacedTarget, View, picture_of, placed
from circlepose.results import ImageResult
from circlepose.synthesis.render import render
from circlepose.targets.board import BoardLayout, Grid
from circlepose.targets.target import Target

CAMERA = Camera.create(
    [[1200.0, 0.0, 639.5], [0.0, 1200.0, 479.5], [0.0, 0.0, 1.0]], (-0.1, 0.02, 0.0, 0.0), (1280, 960)
)
DISC, RINGS, BOSS = Target.circle(20.0), Target.rings((30.0, 20.0)), Target.coaxial((30.0, 20.0), height_mm=12.0)
BOARD = Target.board(BoardLayout.on_grid(8.0, Grid("symmetric", 5, 7, 30.0), marks={(0, 0): (5.0,)}))
SMALL = Target.board(BoardLayout.on_grid(8.0, Grid("symmetric", 2, 3, 30.0), marks={(0, 0): (5.0,)}))


@dataclass(frozen=True)
class Cell:
    """One view of one target."""

    name: str
    target: Target
    view: View
    look: Look = USUAL


@dataclass(frozen=True)
class Outcome:
    """What was predicted and what was found."""

    cell: Cell
    found: tuple[float, float]
    """share predicted and found"""
    position: float
    """found over predicted"""
    normal: float
    trials: int
    wrong: tuple[float, int] | None
    """probability predicted, and number found"""


def cells() -> Iterator[Cell]:
    """Yield all cells."""
    middle, corner = (639.5, 479.5), (1100.0, 800.0)
    for radius_px in (8.0, 15.0, 30.0, 60.0, 120.0):
        for tilt in (20.0, 50.0):
            distance = 1200.0 * 20.0 / radius_px
            yield Cell(f"disc, {radius_px:g} px, {tilt:g} deg", DISC, View(distance, tilt, middle))
    usual = View(800.0, 35.0, middle)
    yield Cell("disc, 30 px, blur 1.5 px", DISC, usual, Look(blur_px=1.5))
    yield Cell("disc, 30 px, noise 6", DISC, usual, Look(noise_levels=6.0))
    yield Cell("disc, 30 px, contrast 40", DISC, usual, Look(contrast_levels=40.0))
    yield Cell("disc, 30 px, in the corner", DISC, replace(usual, place_px=corner))
    for radius_px in (60.0, 30.0, 20.0, 15.0, 10.0):
        yield Cell(f"rings, {radius_px:g} px, 40 deg", RINGS, View(1200.0 * 30.0 / radius_px, 40.0, middle))
    yield Cell("rings, 20 px, 15 deg, noise 6", RINGS, View(1800.0, 15.0, middle), Look(noise_levels=6.0))
    for radius_px, tilt in ((90.0, 20.0), (60.0, 20.0), (45.0, 20.0), (30.0, 20.0)):
        yield Cell(f"boss, {radius_px:g} px, {tilt:g} deg", BOSS, View(1200.0 * 30.0 / radius_px, tilt, middle))
    for distance, tilt in ((500.0, 15.0), (500.0, 45.0), (1200.0, 30.0)):
        yield Cell(f"35 discs, {distance:g} mm, {tilt:g} deg", BOARD, View(distance, tilt, middle))
    for distance, tilt in ((800.0, 30.0), (1500.0, 30.0), (1500.0, 15.0)):
        yield Cell(
            f"6 discs, {distance:g} mm, {tilt:g} deg", SMALL, View(distance, tilt, middle), Look(noise_levels=6.0)
        )


def outcome(cell: Cell, trials: int) -> Outcome:
    """Return what is predicted and what is found in a cell."""
    expected = predict(CAMERA, cell.target, cell.view, cell.look)
    rng = np.random.default_rng(11)
    errors: list[tuple[float, float]] = []
    wrong = 0
    for trial in range(trials):
        u, v = np.array(cell.view.place_px) + rng.uniform(-0.5, 0.5, 2)
        place = placed(cell.target, CAMERA, replace(cell.view, place_px=(float(u), float(v))), cell.look)
        assert not isinstance(place, str)
        scene = picture_of(place, CAMERA, cell.look)
        assert not isinstance(scene, str)
        image = render(replace(scene, noise_levels=cell.look.noise_levels, noise_seed=1000 + trial))
        poses, chosen = _poses(estimate(image, scene.camera, cell.target, force_calibration=True), place)
        if not poses:
            continue
        best = min(range(len(poses)), key=lambda i: poses[i][1])
        errors.append(poses[best])
        wrong += best != chosen
    position, normal = np.sqrt(np.mean(np.square(errors), axis=0)) if errors else (np.nan, np.nan)
    return Outcome(
        cell,
        (expected.found, len(errors) / trials),
        float(position) / (expected.position_mm or np.nan),
        float(normal) / (expected.sigma_normal_deg or np.nan),
        len(errors),
        None if expected.wrong is None or cell.target.kind == "circle" else (expected.wrong, wrong),
    )


def _poses(result: ImageResult, place: PlacedTarget) -> tuple[list[tuple[float, float]], int]:
    """Return the errors of the candidates in mm and deg, and which is chosen."""
    if result.boards:
        board = result.boards[0]
        layout = place.part.layout  # type: ignore[union-attr]
        middle = layout.centers_mm.mean(axis=0)
        poses = [(pose.rotation @ middle + pose.translation, -pose.rotation[:, 2]) for pose in board.candidates]
        return [_errors(*pose, place) for pose in poses], board.chosen
    if not result.circles or not result.circles[0].candidates:
        return [], 0
    circle = result.circles[0]
    return [_errors(pose.center, pose.normal, place) for pose in circle.candidates], circle.chosen


def _errors(middle: FloatArray, normal: FloatArray, place: PlacedTarget) -> tuple[float, float]:
    angle = 2.0 * np.arcsin(min(1.0, 0.5 * float(np.linalg.norm(normal - place.normal))))
    return float(np.linalg.norm(middle - place.middle)), float(np.degrees(angle))


def lines(outcomes: list[Outcome]) -> Iterator[str]:
    """Yield the table."""
    yield "| cell | found, predicted / found | position | normal | wrong, predicted | wrong, found |"
    yield "|---|---|---|---|---|---|"
    for each in outcomes:
        predicted, number = ("--", "--")
        if each.wrong is not None:
            chance, number_ = each.wrong
            spread = np.sqrt(each.trials * chance * (1.0 - chance))
            predicted, number = f"{each.trials * chance:.1f} +- {spread:.1f}", str(number_)
        yield (
            f"| {each.cell.name} | {each.found[0]:.2f} / {each.found[1]:.2f} | {each.position:.2f} | "
            f"{each.normal:.2f} | {predicted} | {number} |"
        )
    ratios = np.array([[each.position, each.normal] for each in outcomes])
    ratios = ratios[np.isfinite(ratios).all(axis=1)]
    position, normal = (np.abs(np.log(ratios)) <= np.log(1.15)).sum(axis=0)
    medians = " and ".join(f"{ratio:.2f}" for ratio in np.median(ratios, axis=0))
    yield ""
    yield f"Within 15 %: position {position} and normal {normal} of {len(ratios)}; medians {medians}."


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=200)
    trials = parser.parse_args().trials
    every = list(cells())
    with ProcessPoolExecutor() as pool:
        outcomes = list(pool.map(outcome, every, [trials] * len(every)))
    print("\n".join(lines(outcomes)))


if __name__ == "__main__":
    main()
