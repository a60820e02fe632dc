"""Random views over all tilts, with rims partly hidden: how often the answer is right, and how often quietly wrong.

    python -m benchmarks.sweep [--views 1000] [--seed 1999] [--jobs 2] [--wrong]
    python -m benchmarks.sweep --show VIEW --hidden 30 [-o view.png]

A dark disc of radius 60 mm on white (grey 40 on 200), 1280 x 960, f = 1200 px, blur 0.7 px, noise 2 grey levels, 400
to 1500 mm away and wholly in the image. Its normal is uniform over the sphere (in solid angle), up to 89 deg from
the line of sight. Each view is measured five times: as it is, and with 10, 20, 30 and 40 % of the rim's length in the
image hidden under 1 to 3 straight-edged cards of one of four grey levels.

answered
    a circle with a pose came out.
wrong
    share of those answered whose better candidate is off by more than 5 mm or 2 deg.
quietly wrong
    share of those answered that are wrong and have no flag but `ambiguous`, which every lone circle has.

Errors are of the better candidate, picked with the truth, of all that was answered. View k with h % hidden depends on
(seed, k, h) alone: `--wrong` lists those wrong or unanswered, `--show` measures one and writes its image.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

# Cores are shared out by process; before NumPy loads its linear algebra.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import cv2
import numpy as np

import circlepose
from benchmarks.support.scoring import Error, TrueCircle, error
from circlepose._numerics import angle_between
from circlepose._typing import FloatArray
from circlepose.camera.camera import Camera, circle_contour
from circlepose.geometry.cone import plane_basis
from circlepose.io.images.reader import write_image
from circlepose.results import Flag, ImageResult
from circlepose.synthesis.render import render
from circlepose.synthesis.scene import Disc, Paint, Patch, Polygon, Scene

HIDDEN_PERCENT = (0, 10, 20, 30, 40)
BANDS_DEG = ((0, 30), (30, 60), (60, 80), (80, 89))
WRONG_MM, WRONG_DEG = 5.0, 2.0
RADIUS_MM = 60.0
CAMERA = Camera.create([[1200.0, 0.0, 639.5], [0.0, 1200.0, 479.5], [0.0, 0.0, 1.0]], (), (1280, 960))
# Slivers are looked for where their length is known; all views lie within.
TARGET = circlepose.Target.circle(RADIUS_MM, axis_intervals=circlepose.AxisIntervals(major_px=(80.0, 440.0)))
_BORDER_PX = 12.0
_RIM_POINTS = 1440
_CARD_LEVELS = (30.0, 90.0, 140.0, 230.0)


@dataclass(frozen=True, slots=True)
class Outcome:
    """One measurement; `error` is None where there was no answer."""

    view: int
    hidden_percent: int
    tilt_deg: float
    error: Error | None
    flags: tuple[str, ...]

    @property
    def is_wrong(self) -> bool:
        return self.error is not None and (self.error.position_mm > WRONG_MM or self.error.normal_deg > WRONG_DEG)

    @property
    def is_quietly_wrong(self) -> bool:
        return self.is_wrong and set(self.flags) <= {Flag.AMBIGUOUS}


def scene(seed: int, view: int, hidden_percent: int) -> tuple[Scene, float]:
    """Return the scene and the angle (deg) of the disc's normal to the line of sight."""
    generator = np.random.Generator(np.random.PCG64([seed, view]))
    center, normal = _pose(generator)
    noise_seed = int(generator.random() * 2.0**32)
    cards = _cards(center, normal, hidden_percent / 100.0, np.random.Generator(np.random.PCG64([seed, view, 1])))
    tilt = np.degrees(angle_between(-normal, center / np.linalg.norm(center)))
    disc = Disc(center, normal, RADIUS_MM, Paint(40.0))
    drawn = Scene(
        CAMERA, (disc,), Paint(200.0), occluders=cards, noise_levels=2.0, noise_seed=noise_seed + hidden_percent
    )
    return drawn, float(tilt)


def _pose(generator: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Draw until the whole rim is in the image."""
    size = np.array(CAMERA.image_size)
    while True:
        ray = CAMERA.rays(generator.random(2) * (size - 1.0))
        distance = 400.0 + 1100.0 * generator.random()
        # Uniform in solid angle: the cosine is uniform.
        cos_tilt = 1.0 - generator.random() * (1.0 - np.cos(np.radians(89.0)))
        azimuth = 2.0 * np.pi * generator.random()
        first, second = plane_basis(ray)
        across = np.cos(azimuth) * first + np.sin(azimuth) * second
        center, normal = distance * ray, -cos_tilt * ray + np.sqrt(1.0 - cos_tilt**2) * across
        rim = circle_contour(CAMERA, center, normal, RADIUS_MM, 90)
        if np.all((rim >= _BORDER_PX) & (rim <= size - 1.0 - _BORDER_PX)):
            return center, normal


def _cards(center: FloatArray, normal: FloatArray, share: float, generator: np.random.Generator) -> tuple[Patch, ...]:
    """Return cards that hide `share` of the rim's length in the image, in 1 to 3 arcs of equal length.

    The edge of each goes through both ends of its arc. The rim's image is convex, so the card, which lies beyond
    that edge, hides this arc and no other part of the rim.
    """
    if share == 0.0:
        return ()
    rim = circle_contour(CAMERA, center, normal, RADIUS_MM, _RIM_POINTS)
    along = np.cumsum(np.linalg.norm(np.roll(rim, -1, axis=0) - rim, axis=1))
    number = int(generator.integers(1, 4))
    gaps = generator.dirichlet(np.ones(number)) * (1.0 - share)
    starts = generator.random() + np.cumsum(gaps) + share / number * np.arange(number)
    return tuple(_card(rim, along / along[-1], start, share / number, generator) for start in starts)


def _card(rim: FloatArray, along: FloatArray, start: float, share: float, generator: np.random.Generator) -> Patch:
    at = np.mod(start + share * np.linspace(0.0, 1.0, 50), 1.0)
    arc = rim[np.searchsorted(along, at) % len(rim)]
    edge = arc[-1] - arc[0]
    edge = edge / np.linalg.norm(edge)
    outwards = np.array([edge[1], -edge[0]])
    outwards = outwards * (1.0 if outwards @ (arc[0] - rim.mean(axis=0)) > 0.0 else -1.0)
    reach = float(((arc - arc[0]) @ outwards).max())
    ends = (arc - arc[0]) @ edge
    left, right = float(ends.min()) - generator.uniform(0.0, 40.0), float(ends.max()) + generator.uniform(0.0, 40.0)
    depth = reach + generator.uniform(10.0, 80.0, size=2)
    corners = [(left, 0.0), (right, 0.0), (right, depth[0]), (left, depth[1])]
    points = tuple(tuple((arc[0] + x * edge + y * outwards).tolist()) for x, y in corners)
    return Patch(Polygon(points), Paint(float(generator.choice(_CARD_LEVELS))))


def measure(seed: int, view: int) -> list[Outcome]:
    """Return the outcomes of one view, a measurement for each share hidden."""
    cv2.setNumThreads(1)
    return [_outcome(view, percent, *scene(seed, view, percent)) for percent in HIDDEN_PERCENT]


def _outcome(view: int, percent: int, drawn: Scene, tilt: float) -> Outcome:
    return outcome_of(circlepose.estimate(render(drawn), CAMERA, TARGET), view, percent, drawn, tilt)


def outcome_of(result: ImageResult, view: int, percent: int, drawn: Scene, tilt: float) -> Outcome:
    """Return how a result compares with the scene's truth."""
    found = next((circle for circle in result.circles if circle.candidates), None)
    if found is None:
        return Outcome(view, percent, tilt, None, ())
    true = drawn.targets[0].circles[0]
    off = error(found, TrueCircle(true.center, true.normal, None, None, true.name))
    return Outcome(view, percent, tilt, off, tuple(found.flags))


def table(outcomes: Iterable[Outcome]) -> Iterator[str]:
    """Yield the lines of the Markdown table."""
    everything = list(outcomes)
    yield (
        "| hidden % | tilt deg | views | answered % | wrong % | quietly wrong % "
        "| position mm, median / 95th / worst | normal deg, median / 95th / worst |"
    )
    yield "|---|---|---|---|---|---|---|---|"
    for percent in HIDDEN_PERCENT:
        hidden = [each for each in everything if each.hidden_percent == percent]
        for low, high in ((0, 89), *BANDS_DEG):
            chosen = [each for each in hidden if low <= each.tilt_deg <= high]
            if chosen:
                yield _row(
                    f"| {percent or 'none'} | {'all' if (low, high) == (0, 89) else f'{low} to {high}'}", chosen
                )


def _row(head: str, outcomes: list[Outcome]) -> str:
    answered = [each for each in outcomes if each.error is not None]
    number = max(len(answered), 1)
    wrong = 100.0 * sum(each.is_wrong for each in answered) / number
    quietly = 100.0 * sum(each.is_quietly_wrong for each in answered) / number
    position = _spread([each.error.position_mm for each in answered if each.error], 2)
    normal = _spread([each.error.normal_deg for each in answered if each.error], 3)
    share = 100.0 * len(answered) / len(outcomes)
    return f"{head} | {len(outcomes)} | {share:.1f} | {wrong:.1f} | {quietly:.1f} | {position} | {normal} |"


def _spread(values: list[float], decimals: int) -> str:
    if not values:
        return "--"
    return " / ".join(f"{value:.{decimals}f}" for value in np.percentile(values, [50, 95, 100]))


def _failures(outcomes: Iterable[Outcome]) -> Iterator[str]:
    for each in outcomes:
        where = f"view {each.view} hidden {each.hidden_percent} tilt {each.tilt_deg:.1f}"
        if each.error is None:
            yield f"{where}: no answer"
        elif each.is_wrong:
            flags = ", ".join(each.flags)
            yield f"{where}: {each.error.position_mm:.1f} mm {each.error.normal_deg:.2f} deg ({flags})"


def _show(options: argparse.Namespace) -> None:
    drawn, tilt = scene(options.seed, options.show, options.hidden)
    image = render(drawn)
    if options.output is not None:
        write_image(options.output, image)
    result = circlepose.estimate(image, CAMERA, TARGET)
    outcome = outcome_of(result, options.show, options.hidden, drawn, tilt)
    print(f"truth: center {drawn.targets[0].center_mm} mm, normal {drawn.targets[0].normal}, tilt {tilt:.2f} deg")
    print(f"error: {outcome.error}, flags: {', '.join(outcome.flags) or 'none'}")
    print(f"status: {result.status} {result.reason}")
    for circle in result.circles:
        print(f"ellipse: {circle.ellipse}")
    print(f"contours not used: {dict(result.rejected)}")


def main() -> int:
    """Print the table, or one view."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--views", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1999)
    parser.add_argument("--jobs", type=int, choices=(1, 2), default=2)
    parser.add_argument("--wrong", action="store_true", help="list the views that are wrong or unanswered")
    parser.add_argument("--show", type=int, metavar="VIEW", help="measure one view only")
    parser.add_argument("--hidden", type=int, choices=HIDDEN_PERCENT, default=0, help="with --show")
    parser.add_argument("-o", "--output", type=Path, help="with --show: write its image there")
    options = parser.parse_args()
    if options.show is not None:
        _show(options)
        return 0
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(options.jobs, mp_context=spawn) as pool:
        views = pool.map(partial(measure, options.seed), range(options.views), chunksize=4)
        outcomes = [outcome for outcomes_of_view in views for outcome in outcomes_of_view]
    print("\n".join(table(outcomes)))
    if options.wrong:
        print("\n".join(_failures(outcomes)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
