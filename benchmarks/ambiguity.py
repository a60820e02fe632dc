"""Ring targets: how often the right one of the two candidates is chosen, and whether `ambiguity` can be believed.

    python benchmarks/ambiguity.py [--trials 1000]

Rendered coplanar rings (radii 50 and 30 mm) and coaxial bosses and recesses (radii 45 and 30 mm, generatrix
45.21 mm), 400 to 1500 mm away, tilted 0 to 75 deg, noise 2 grey levels. Where the two candidates differ by less
than a degree there is nothing to choose; those trials are counted apart, and so are recesses of which less than a
fifth of the floor's rim is in sight: the big rim hides it from those who look in at a slant.
"""

from __future__ import annotations

import argparse
import itertools

import numpy as np

import circlepose
from circlepose.camera import Camera, circle_contour
from circlepose.cone import cone_from_circle, plane_basis
from circlepose.synthesis.render import render
from circlepose.synthesis.scene import CoaxialPart, Paint, Rings, Scene
from circlepose.target import Target
from scoring import TrueCircle, error

CAMERA = Camera.create([[1200.0, 0, 639.5], [0, 1200.0, 479.5], [0, 0, 1]], (), (1280, 960))
HEIGHT_MM = float(np.sqrt(45.21**2 - 15.0**2))
KINDS = {
    "coplanar": Target("coplanar", (50.0, 30.0)),
    "coaxial": Target("coaxial", (45.0, 30.0), generatrix_mm=45.21),
}
LEAST_IN_SIGHT = 0.2
BINS = (0.0, 1e-6, 1e-3, 0.01, 0.1, 0.3, 0.5001)


def scene(kind: str, trial: int) -> tuple[Scene, np.ndarray, np.ndarray]:
    """A random view of a target, wholly in the image, and its pose."""
    generator = np.random.default_rng([trial, len(kind)])
    while True:
        ray = CAMERA.rays(generator.random(2) * [1279.0, 959.0])
        center = generator.uniform(400.0, 1500.0) * ray
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
    noisy = Scene(CAMERA, (part,), Paint(170.0), noise_levels=2.0, noise_seed=trial)
    return noisy, center, normal


def in_sight(picture: Scene) -> float:
    """Share of the small circle's rim that the big one does not hide: all of it but for a recess."""
    part = picture.targets[0]
    if not (isinstance(part, CoaxialPart) and part.form == "recess"):
        return 1.0
    big, small = part.circles
    rays = CAMERA.rays(circle_contour(CAMERA, small.center, small.normal, small.radius, 360))
    cone = cone_from_circle(big.center, big.normal, big.radius)
    return float(np.mean(np.einsum("ni,ij,nj->n", rays, cone, rays) < 0.0))


def main() -> None:
    """Print the shares of right choices, the errors, and the calibration of `ambiguity`."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--trials", type=int, default=1000)
    trials = parser.parse_args().trials
    print("| kind | trials | hidden | complete | nothing to choose | right | mm, 50 / 95 % | deg, 50 / 95 % |")
    print("|---|---|---|---|---|---|---|---|")
    told: list[tuple[float, bool]] = []
    for kind, target in KINDS.items():
        errors, choices, alike, hidden = [], [], 0, 0
        for trial in range(trials):
            picture, center, normal = scene(kind, trial)
            if in_sight(picture) < LEAST_IN_SIGHT:
                hidden += 1
                continue
            result = circlepose.estimate(render(picture), CAMERA, target)
            if result.status != "ok":
                continue
            circle = result.circles[0]
            measured = error(circle, TrueCircle(center, normal, None, None, circle.circle))
            errors.append(measured)
            first, last = circle.candidates[0], circle.candidates[-1]
            if first.normal @ last.normal > np.cos(np.radians(1.0)):
                alike += 1
                continue
            choices.append(measured.chosen)
            told.append((circle.ambiguity, measured.chosen))
        position = np.percentile([e.position_mm for e in errors], [50, 95])
        angle = np.percentile([e.normal_deg for e in errors], [50, 95])
        print(
            f"| {kind} | {trials} | {hidden} | {len(errors)} | {alike} | {sum(choices)}/{len(choices)} "
            f"| {position[0]:.3f} / {position[1]:.3f} | {angle[0]:.4f} / {angle[1]:.4f} |",
            flush=True,
        )
    print("\n| ambiguity told | trials | wrong, expected | wrong, found |\n|---|---|---|---|")
    chance, right = np.array([t[0] for t in told]), np.array([t[1] for t in told])
    for low, high in itertools.pairwise(BINS):
        inside = (chance >= low) & (chance < high)
        print(f"| {low:g} to {high:g} | {inside.sum()} | {chance[inside].sum():.2f} | {(~right[inside]).sum()} |")


if __name__ == "__main__":
    main()
