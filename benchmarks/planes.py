"""Planes that circles are found to share, `same_plane: auto`: how often the candidate is right, and how surely.

    CIRCLEPOSE_DATA=... python -m benchmarks.planes [SCENES]

First photographed boards with truth: the discs whose candidates differ by more than two standard deviations. Then
simulated scenes (1500 unless SCENES is given) of 2 to 20 circles in none to three planes: is `ambiguity` the share of
wrong choices, and is a plane made up. Without the photographs the second part alone is run.
"""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path

import numpy as np

import circlepose
from benchmarks.support.plane_scenes import SimulatedScene, simulated
from benchmarks.support.scoring import data_folder, error, match, read_radius, read_truth
from circlepose._numerics import angle_between
from circlepose.disambiguation.settle import Settled, settled
from circlepose.io.images.reader import read_image
from circlepose.results import CircleResult, Flag
from circlepose.targets.target import Target

SETS = ("discocal_rgb_left", "discocal_tir", "boofcv_circle_hex_stills", "opencv_circles_a")
BINS = (0.0, 1e-4, 1e-3, 1e-2, 0.05, 0.2, 0.45)
CAMERA = circlepose.Camera.create([[1200.0, 0.0, 800.0], [0.0, 1200.0, 600.0], [0.0, 0.0, 1.0]], (), (1600, 1200))
TARGET = Target.circle(20.0, count="all")


def main(arguments: list[str]) -> int:
    """Print the tables of both parts."""
    data = data_folder()
    if data is None:
        print("no images with truth here; set CIRCLEPOSE_DATA for the first part", file=sys.stderr)
    else:
        _photographs(data)
    _simulations(int(arguments[0]) if arguments else 1500)
    return 0


def _photographs(data: Path) -> None:
    print("| set | images | planes | discs | settled | right | wrong, expected | left ambiguous |")
    print("|---|---|---|---|---|---|---|---|")
    for name in SETS:
        folder = data / name
        camera = circlepose.read_camera(folder / "camera.yml")
        target = Target.circle(read_radius(folder), count="all")
        images, planes, discs, right, said = 0, 0, 0, [], []
        for image, truth in read_truth(folder).items():
            result = circlepose.estimate(read_image(folder / "images" / image), camera, target, name=image)
            images += 1
            planes += len(result.planes)
            for circle, true in zip(match(result, truth), truth, strict=True):
                if circle is None or not _differ(circle):
                    continue
                discs += 1
                if Flag.AMBIGUOUS not in circle.flags:
                    right.append(error(circle, true).chosen)
                    said.append(circle.ambiguity)
        print(
            f"| {name} | {images} | {planes} | {discs} | {len(right)} | {sum(right)} ({sum(right) / len(right):.2%}) "
            f"| {sum(said):.1f} | {discs - len(right)} ({1.0 - len(right) / discs:.1%}) |",
            flush=True,
        )


def _differ(circle: CircleResult) -> bool:
    """Whether a circle has two candidates that differ by more than two standard deviations."""
    if len(circle.candidates) < 2 or any(candidate.covariance is None for candidate in circle.candidates):
        return False
    first, second = circle.candidates
    spread = np.sqrt(sum(float(np.trace(c.covariance[3:, 3:])) / 2.0 for c in circle.candidates))
    return float(angle_between(first.normal, second.normal)) > 2.0 * spread


def _simulations(scenes: int) -> None:
    rng = np.random.default_rng(0)
    said: list[float] = []
    wrong: list[bool] = []
    by_scene, planes, made_up, found, alone = [], 0, 0, 0, 0
    for _ in range(scenes):
        scene, real = _scene(rng)
        result = settled(scene.circles, TARGET, CAMERA)
        choice = [(c.ambiguity, _is_wrong(c, scene)) for c in result.circles if Flag.AMBIGUOUS not in c.flags]
        said.extend(each for each, _ in choice)
        wrong.extend(is_wrong for _, is_wrong in choice)
        by_scene.append(sum(each - is_wrong for each, is_wrong in choice))
        members = [_members(result, scene, number) for number in range(len(result.planes))]
        made_up += sum(number < 3 for number in members)
        planes += real
        found += sum(number >= 3 for number in members)
        alone += sum(own < 0 and c.plane is not None for c, own in zip(result.circles, scene.planes, strict=True))
    values, is_wrong = np.array(said), np.array(wrong)
    print(
        f"\n{scenes} scenes: {planes} planes, {found} found, {made_up} made up; {alone} circles of none put in one\n"
    )
    print("| ambiguity | circles | wrong, expected | wrong |\n|---|---|---|---|")
    for low, high in pairwise(BINS):
        among = (values >= low) & (values < high)
        print(f"| {low:g} to {high:g} | {among.sum()} | {values[among].sum():.1f} | {is_wrong[among].sum()} |")
    # The circles of a scene are right or wrong together.
    spread = float(np.sqrt(np.sum(np.square(by_scene))))
    print(f"| all | {len(values)} | {values.sum():.1f} ± {spread:.1f} | {is_wrong.sum()} |")


def _scene(rng: np.random.Generator) -> tuple[SimulatedScene, int]:
    """Return a scene, and how many of its planes have three circles in sight with two candidates."""
    left, in_planes = int(rng.integers(2, 21)), list[int]()
    for _ in range(int(rng.integers(0, 4))):
        if left >= 3:
            in_planes.append(int(rng.integers(3, left + 1)))
            left -= in_planes[-1]
    scene = simulated(
        rng,
        tuple(in_planes),
        left,
        noise_px=float(10.0 ** rng.uniform(-1.7, 0.0)),
        distance_mm=float(10.0 ** rng.uniform(2.5, 3.6)),
        extent_mm=float(10.0 ** rng.uniform(1.5, 2.5)),
    )
    return scene, int(np.sum(np.bincount(scene.planes[scene.planes >= 0], minlength=1) >= 3))


def _is_wrong(circle: CircleResult, scene: SimulatedScene) -> bool:
    number = next(i for i, each in enumerate(scene.circles) if each.instance == circle.instance)
    return circle.candidates[0] is not scene.circles[number].candidates[scene.right[number]]


def _members(result: Settled, scene: SimulatedScene, plane: int) -> int:
    """Return how many circles of a plane that was found lie in one plane in truth."""
    inside = scene.planes[[circle.plane == plane for circle in result.circles]]
    return int(np.bincount(inside[inside >= 0], minlength=1).max())


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
