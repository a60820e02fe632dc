"""Discs seen edge-on, or nearly, with default options: are they found, and does the error keep to the covariance?

    python -m benchmarks.edge_on [--step 0.05] [--only NAME]

Rendered discs, tilted 85 to 90 deg in steps of `--step`, in 1280 x 960 px with f = 1200 px, off the axis and at
another lean and noise in each. `wide` counts the views whose segment is at least 1 px wide. A pose is `beyond` where
the better candidate's centre is off by more than 5 of its standard deviations (the root of e' C^-1 e of three), or
where it has no covariance. `normal` is in its own two standard deviations. NEES expects 3.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass

import numpy as np

import circlepose
from circlepose.camera.camera import Camera
from circlepose.geometry.cone import factor_from_circle, plane_basis, principal_frame
from circlepose.results import Candidate
from circlepose.synthesis.render import render
from circlepose.synthesis.scene import Disc, Paint, Scene

FOCAL_PX = 1200.0
CAMERA = Camera.create([[FOCAL_PX, 0.0, 639.5], [0.0, FOCAL_PX, 479.5], [0.0, 0.0, 1.0]], (), (1280, 960))
SIGMAS = 5.0


@dataclass(frozen=True)
class Views:
    """One row: a disc and the camera's noise."""

    name: str
    radius_mm: float
    distance_mm: float
    ink: float
    noise_levels: float

    def scene(self, tilt_deg: float, number: int) -> Scene:
        """Return the disc tilted so, at a place and lean of its own."""
        generator = np.random.default_rng([self.name.encode()[0], number])
        sight = np.array([*generator.uniform(-0.2, 0.2, 2), 1.0])
        sight = sight / np.linalg.norm(sight)
        first, second = plane_basis(sight)
        tilt, lean = np.radians(tilt_deg), generator.uniform(0.0, 2.0 * np.pi)
        normal = -np.cos(tilt) * sight + np.sin(tilt) * (np.cos(lean) * first + np.sin(lean) * second)
        disc = Disc(self.distance_mm * sight, normal, self.radius_mm, Paint(self.ink))
        return Scene(
            camera=CAMERA,
            targets=(disc,),
            background=Paint(200.0),
            blur_px=0.7,
            noise_levels=self.noise_levels,
            noise_seed=number,
            name=f"{tilt_deg:.2f}",
        )


ROWS = (
    Views("240 px", 60.0, 600.0, 40.0, 2.0),
    Views("noisy, 240 px", 60.0, 600.0, 40.0, 8.0),
    Views("faint, 240 px", 60.0, 600.0, 130.0, 4.0),
    Views("84 px", 35.0, 1000.0, 40.0, 2.0),
    Views("40 px", 25.0, 1500.0, 40.0, 2.0),
)


def width_px(disc: Disc) -> float:
    """Return the full minor axis of the disc's image, about."""
    frame = principal_frame(factor_from_circle(disc.center_mm, disc.normal, disc.radius_mm))
    return 2.0 * FOCAL_PX * float(frame.tan_half_minor)


def better(candidates: tuple[Candidate, ...], disc: Disc) -> Candidate:
    """Return the candidate whose normal is nearest to the truth."""
    return max(candidates, key=lambda candidate: float(candidate.normal @ disc.normal))


def in_sigmas(candidate: Candidate, disc: Disc) -> tuple[float, float] | None:
    """Return the errors of centre and normal in standard deviations; None without a covariance."""
    if candidate.covariance is None:
        return None
    off = candidate.center - disc.center_mm
    turn = np.stack(plane_basis(candidate.normal)) @ (disc.normal - candidate.normal)
    center, tilts = candidate.covariance[:3, :3], candidate.covariance[3:, 3:]
    return float(np.sqrt(off @ np.linalg.solve(center, off))), float(np.sqrt(turn @ np.linalg.solve(tilts, turn)))


def row(views: Views, step: float) -> str:
    """Measure one row of the table."""
    wide = found_wide = found = beyond = beyond_normal = narrow = 0
    sigmas, errors = [], []
    for number, tilt in enumerate(np.arange(85.0, 90.0 + step / 2.0, step)):
        scene = views.scene(float(tilt), number)
        disc = scene.targets[0]
        assert isinstance(disc, Disc)
        is_wide = width_px(disc) >= 1.0
        result = circlepose.estimate(render(scene), CAMERA, circlepose.Target("circle", (views.radius_mm,)))
        poses = [circle for circle in result.circles if circle.candidates]
        wide, narrow = wide + is_wide, narrow + (not is_wide)
        if not poses:
            continue
        found, found_wide = found + 1, found_wide + is_wide
        candidate = better(poses[0].candidates, disc)
        errors.append(float(np.linalg.norm(candidate.center - disc.center_mm)))
        off = in_sigmas(candidate, disc)
        beyond += off is None or off[0] > SIGMAS
        beyond_normal += off is None or off[1] > SIGMAS
        if off is not None:
            sigmas.append(off[0] ** 2)
    return (
        f"| {views.name} | {found_wide}/{wide} | {found - found_wide}/{narrow} | {np.median(errors):.2f} / "
        f"{np.max(errors):.2f} | {beyond} | {beyond_normal} | {np.mean(sigmas):.1f} |"
    )


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--step", type=float, default=0.05)
    parser.add_argument("--only")
    options = parser.parse_args()
    print("| disc | found, wide | found, narrower | centre mm, median / largest | beyond | normal beyond | NEES |")
    print("|---|---|---|---|---|---|---|", flush=True)
    for views in ROWS:
        if options.only in (None, views.name):
            print(row(views, options.step), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
