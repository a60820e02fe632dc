"""Discs seen edge-on, or nearly, with default options: are they found, and does the error keep to the covariance?

    python -m benchmarks.edge_on [--step 0.05] [--only NAME] [--slivers [NUMBER]]

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


@dataclass(frozen=True)
class Slivers:
    """One row of slivers: the semi-major axis of their images, their tilt, and the camera's noise."""

    semi_major_px: float
    tilt_deg: float
    noise_levels: float

    def scene(self, number: int, seed: int = 11) -> Scene:
        """Return one of the discs, in an image that just holds it."""
        generator = np.random.default_rng([seed, number, int(100.0 * self.tilt_deg), int(self.semi_major_px)])
        side = int(2.4 * self.semi_major_px) + 40
        sight = np.array([*generator.uniform(-0.04, 0.04, 2), 1.0])
        cx, cy = side / 2.0 - FOCAL_PX * sight[:2] + generator.uniform(-0.5, 0.5, 2)
        camera = Camera.create([[FOCAL_PX, 0.0, cx], [0.0, FOCAL_PX, cy], [0.0, 0.0, 1.0]], (), (side, side))
        sight = sight / np.linalg.norm(sight)
        first, second = plane_basis(sight)
        tilt, lean = np.radians(self.tilt_deg), generator.uniform(0.0, 2.0 * np.pi)
        normal = -np.cos(tilt) * sight + np.sin(tilt) * (np.cos(lean) * first + np.sin(lean) * second)
        center = SLIVER_RADIUS_MM * FOCAL_PX / self.semi_major_px * sight
        return Scene(
            camera=camera,
            targets=(Disc(center, normal, SLIVER_RADIUS_MM, Paint(float(generator.uniform(20.0, 90.0)))),),
            background=Paint(float(generator.uniform(170.0, 230.0))),
            blur_px=float(generator.uniform(0.5, 0.9)),
            noise_levels=self.noise_levels,
            noise_seed=number,
            name=f"{number}",
        )


SLIVER_RADIUS_MM = 50.0
SLIVERS = tuple(
    Slivers(semi_major, tilt, noise)
    for noise in (0.0, 1.5)
    for semi_major in (60.0, 130.0)
    for tilt in (85.0, 87.0, 87.5, 88.0, 88.5)
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


def sliver_row(slivers: Slivers, number: int) -> str:
    """Measure one row of the table of slivers."""
    long_by, along, sigmas, normals = [], [], [], []
    for view in range(number):
        scene = slivers.scene(view)
        disc = scene.targets[0]
        assert isinstance(disc, Disc)
        target = circlepose.Target("circle", (disc.radius_mm,))
        circles = circlepose.estimate(render(scene), scene.camera, target).circles
        if not circles or not circles[0].candidates:
            continue
        candidate = better(circles[0].candidates, disc)
        off = in_sigmas(candidate, disc) or (np.inf, np.inf)
        distance = float(np.linalg.norm(disc.center_mm))
        sight = disc.center_mm / distance
        farther = float((candidate.center - disc.center_mm) @ sight)
        long_by.append(-slivers.semi_major_px * farther / distance)
        if candidate.covariance is not None:
            along.append(farther / np.sqrt(float(sight @ candidate.covariance[:3, :3] @ sight)))
        sigmas.append(off[0])
        normals.append(off[1])
    return (
        f"| {slivers.semi_major_px:.0f} | {slivers.tilt_deg:.1f} | {slivers.noise_levels:g} "
        f"| {len(long_by)}/{number} | {np.mean(long_by):+.4f} / {rms(long_by):.4f} | {rms(along):.2f} "
        f"| {rms(sigmas) ** 2:.1f} | {sum(each > 3.0 for each in sigmas)} "
        f"| {sum(each > SIGMAS for each in sigmas)} | {rms(normals) ** 2:.1f} |"
    )


def rms(values: list[float]) -> float:
    """Return the root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--step", type=float, default=0.05)
    parser.add_argument("--only")
    parser.add_argument("--slivers", type=int, nargs="?", const=60, metavar="NUMBER")
    options = parser.parse_args()
    if options.slivers is not None:
        print(
            "| semi-major px | tilt deg | noise | found | long by px, mean / rms | z / sigma, rms | NEES "
            "| beyond 3 | beyond 5 | NEES normal |"
        )
        print("|---|---|---|---|---|---|---|---|---|---|", flush=True)
        for slivers in SLIVERS:
            print(sliver_row(slivers, options.slivers), flush=True)
        return 0
    print("| disc | found, wide | found, narrower | centre mm, median / largest | beyond | normal beyond | NEES |")
    print("|---|---|---|---|---|---|---|", flush=True)
    for views in ROWS:
        if options.only in (None, views.name):
            print(row(views, options.step), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
