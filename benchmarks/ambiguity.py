"""Ring targets: how often the right one of the two candidates is chosen, and whether `ambiguity` can be believed.

    python -m benchmarks.ambiguity [--trials 1000]

Rendered coplanar rings (radii 50 and 30 mm) and coaxial bosses and recesses (radii 45 and 30 mm, generatrix
45.21 mm), tilted 0 to 75 deg. `near`: 400 to 1500 mm away, noise 2 grey levels. `far`: 1.5 to 6 m away, so that the
largest circle has a radius of 9 to 40 px, noise 4 to 12 grey levels: little distinguishes the candidates.
Where the two candidates differ by less than a degree there is nothing to choose; those trials are counted apart,
and so are recesses of which less than a fifth of the floor's rim is in sight: the big rim hides it from those who
look in at a slant. *nees*: squared errors of centre and of normal relative to the covariance that is reported,
averaged, over 3 and 2: 1 where the covariance holds.
"""

from __future__ import annotations

import argparse
import itertools
from dataclasses import dataclass

import numpy as np

import circlepose
from benchmarks.support.scoring import Error, TrueCircle, error
from circlepose.camera.camera import Camera, circle_contour
from circlepose.geometry.cone import cone_from_circle, plane_basis
from circlepose.synthesis.render import render
from circlepose.synthesis.scene import CoaxialPart, Paint, Rings, Scene
from circlepose.targets.target import Target

CAMERA = Camera.create([[1200.0, 0, 639.5], [0, 1200.0, 479.5], [0, 0, 1]], (), (1280, 960))
HEIGHT_MM = float(np.sqrt(45.21**2 - 15.0**2))
KINDS = {
    "coplanar": Target("coplanar", (50.0, 30.0)),
    "coaxial": Target("coaxial", (45.0, 30.0), generatrix_mm=45.21),
}
LEAST_IN_SIGHT = 0.2
ALIKE_DEG = 1.0
DISTANCES_MM = {"near": (400.0, 1500.0), "far": (1500.0, 6000.0)}
NOISE_LEVELS = {"near": (2.0, 2.0), "far": (4.0, 12.0)}
BINS = (0.0, 1e-6, 1e-3, 0.01, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5001)


@dataclass(frozen=True, slots=True)
class Trial:
    """One view: the ambiguity reported, whether the choice was right, the error and its NEES (centre, normal)."""

    told: float
    measured: Error
    alike: bool
    nees: tuple[float, float] | None


def scene(kind: str, trial: int, variant: str = "near") -> tuple[Scene, np.ndarray, np.ndarray]:
    """A random view of a target, wholly in the image, and its pose."""
    generator = np.random.default_rng([trial, len(kind)])
    while True:
        ray = CAMERA.rays(generator.random(2) * [1279.0, 959.0])
        center = generator.uniform(*DISTANCES_MM[variant]) * ray
        tilt, lean = np.radians(generator.uniform(0.0, 75.0)), 2.0 * np.pi * generator.random()
        first, second = plane_basis(ray)
        normal = -np.cos(tilt) * ray + np.sin(tilt) * (np.cos(lean) * first + np.sin(lean) * second)
        rim = circle_contour(CAMERA, center, normal, 75.0, 60)
        if np.all((rim > 8.0) & (rim < [1271.0, 951.0])):
            break
    paints = (Paint(40.0), Paint(200.0))
    if kind == "coplanar":
        part: Rings | CoaxialPart = Rings(center, normal, (50.0, 30.0), paints)
    else:
        form = "boss" if generator.random() < 0.5 and normal @ (center + HEIGHT_MM * normal) < 0.0 else "recess"
        part = CoaxialPart(center, normal, (45.0, 30.0), HEIGHT_MM, form, Paint(80.0), Paint(230.0))
    noise = generator.uniform(*NOISE_LEVELS[variant])
    return Scene(CAMERA, (part,), Paint(170.0), noise_levels=noise, noise_seed=trial), center, normal


def in_sight(picture: Scene) -> float:
    """Share of the small circle's rim that the big one does not hide: all of it but for a recess."""
    part = picture.targets[0]
    if not (isinstance(part, CoaxialPart) and part.form == "recess"):
        return 1.0
    big, small = part.circles
    rays = CAMERA.rays(circle_contour(CAMERA, small.center, small.normal, small.radius, 360))
    cone = cone_from_circle(big.center, big.normal, big.radius)
    return float(np.mean(np.einsum("ni,ij,nj->n", rays, cone, rays) < 0.0))


def measure(picture: Scene, target: Target, center: np.ndarray, normal: np.ndarray) -> Trial | None:
    """Estimate the largest circle's pose; None where the target is not found as a whole."""
    result = circlepose.estimate(render(picture), CAMERA, target)
    if result.status != "ok":
        return None
    circle = result.circles[0]
    first, last = circle.candidates[0], circle.candidates[-1]
    measured = error(circle, TrueCircle(center, normal, None, None, circle.circle))
    alike = bool(first.normal @ last.normal > np.cos(np.radians(ALIKE_DEG)))
    best = max(circle.candidates, key=lambda candidate: float(candidate.normal @ normal))
    if best.covariance is None:
        return Trial(circle.ambiguity, measured, alike, None)
    away, tilts = center - best.center, np.stack(plane_basis(best.normal)) @ normal
    nees = (
        float(away @ np.linalg.solve(best.covariance[:3, :3], away)),
        float(tilts @ np.linalg.solve(best.covariance[3:, 3:], tilts)),
    )
    return Trial(circle.ambiguity, measured, alike, nees)


def run(variant: str, kind: str, trials: int) -> tuple[list[Trial], int]:
    """Return the trials in which the target was found, and how many of them had too little in sight."""
    done, hidden = [], 0
    for number in range(trials):
        picture, center, normal = scene(kind, number, variant)
        if in_sight(picture) < LEAST_IN_SIGHT:
            hidden += 1
            continue
        trial = measure(picture, KINDS[kind], center, normal)
        if trial is not None:
            done.append(trial)
    return done, hidden


def main() -> None:
    """Print the shares of right choices, the errors, and the calibration of `ambiguity`."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--trials", type=int, default=1000)
    trials = parser.parse_args().trials
    print("| variant | kind | trials | hidden | found | nothing to choose | right ", end="")
    print("| mm, 50 / 95 % | deg, 50 / 95 % | nees centre, normal |\n|---|---|---|---|---|---|---|---|---|---|")
    told: dict[str, list[Trial]] = {variant: [] for variant in DISTANCES_MM}
    for variant, kind in itertools.product(DISTANCES_MM, KINDS):
        done, hidden = run(variant, kind, trials)
        choices = [trial for trial in done if not trial.alike]
        told[variant] += choices
        position = np.percentile([t.measured.position_mm for t in done], [50, 95])
        angle = np.percentile([t.measured.normal_deg for t in done], [50, 95])
        nees = np.mean([t.nees for t in done if t.nees is not None], axis=0) / [3.0, 2.0]
        print(
            f"| {variant} | {kind} | {trials} | {hidden} | {len(done)} | {len(done) - len(choices)} "
            f"| {sum(t.measured.chosen for t in choices)}/{len(choices)} "
            f"| {position[0]:.3f} / {position[1]:.3f} | {angle[0]:.4f} / {angle[1]:.4f} "
            f"| {nees[0]:.2f}, {nees[1]:.2f} |",
            flush=True,
        )
    print("\n| variant | ambiguity reported | trials | wrong, expected | wrong, found |\n|---|---|---|---|---|")
    for variant, choices in told.items():
        chance = np.array([t.told for t in choices])
        wrong = np.array([not t.measured.chosen for t in choices])
        for low, high in itertools.pairwise(BINS):
            inside = (chance >= low) & (chance < high)
            print(f"| {variant} | {low:g} to {high:g} | {inside.sum()} | ", end="")
            print(f"{chance[inside].sum():.1f} | {wrong[inside].sum()} |")


if __name__ == "__main__":
    main()
