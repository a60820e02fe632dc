"""Ring targets that are declared flat and have a step: is a wrong choice of the candidate ever silent?

    python -m benchmarks.flatness [--trials 1000] [--rendered 0] [--figure docs/figures/flatness.svg]

Two circles on one axis, the inner one off the plane of the outer one by a step of 0 to 5 mm to either side,
measured as `kind: coplanar`; tilts 0 to 75 deg, distances 400 to 1500 mm, three sizes. The rims have random errors,
those of edges of 0.03 px, independent from pixel to pixel, and their covariance; so no image is rendered.
`--rendered N`: so many pictures a size, of recesses and bosses with real walls. *silent*: a wrong choice without a
flag. By chance as many as the ambiguities of those choices add up to are wrong. `--figure` draws which candidate
looks flatter, and no trial is run.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import circlepose
from circlepose._numerics import angle_between
from circlepose.camera.camera import Camera, circle_contour
from circlepose.fitting.cone_fit import ConeFit
from circlepose.geometry.cone import factor_from_circle, plane_basis, principal_frame
from circlepose.geometry.cone_perturbation import grown, mode_shapes
from circlepose.measurement.rim import EdgeRim, FittedRim, Rim, modes_covariance, rim_from_fit
from circlepose.results import CircleResult, Flag
from circlepose.rings.evidence import from_levels
from circlepose.rings.joint_pose import AxisPose, JointPose, RingProblem
from circlepose.rings.matching import match_rings
from circlepose.rings.results import find_ring_targets
from circlepose.solvers.chen_huang import poses_from_frame
from circlepose.synthesis.render import render
from circlepose.synthesis.scene import CoaxialPart, Paint, Scene
from circlepose.targets.target import Target

CAMERA = Camera.create([[1200.0, 0, 639.5], [0, 1200.0, 479.5], [0, 0, 1]], (), (1280, 960))
SIZES_MM = ((25.0, 15.0), (45.0, 30.0), (80.0, 50.0))
DISTANCES_MM = (400.0, 1500.0)
HIGHEST_MM = 5.0
STEEPEST_DEG = 75.0
EDGE_PX = 0.03
ALIKE_DEG = 1.0
CONFIDENT = 0.01
PLACES = 240


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """A target in view: the outer circle's pose, and how far the inner one is in front of it."""

    center: np.ndarray
    normal: np.ndarray
    radii: tuple[float, float]
    step: float

    @property
    def tilt_deg(self) -> float:
        """The angle of the normal to the line of sight."""
        return float(np.degrees(angle_between(-self.normal, self.center / np.linalg.norm(self.center))))


def views(radii: tuple[float, float], trials: int, *, flat: bool) -> Iterator[tuple[View, np.random.Generator]]:
    """Yield random views, wholly in the image."""
    for trial in range(trials):
        generator = np.random.default_rng([trial, int(radii[0]), int(flat)])
        step = 0.0 if flat else HIGHEST_MM * generator.uniform(-1.0, 1.0)
        while True:
            ray = CAMERA.rays(generator.random(2) * [1279.0, 959.0])
            center = generator.uniform(*DISTANCES_MM) * ray
            tilt, lean = np.radians(generator.uniform(0.0, STEEPEST_DEG)), 2.0 * np.pi * generator.random()
            first, second = plane_basis(ray)
            normal = -np.cos(tilt) * ray + np.sin(tilt) * (np.cos(lean) * first + np.sin(lean) * second)
            rim = circle_contour(CAMERA, center, normal, radii[0], 60)
            if np.all((rim > 8.0) & (rim < [1271.0, 951.0])):
                break
        yield View(center, normal, radii, step), generator


def rims_of(view: View, generator: np.random.Generator | None, edge_px: float = EDGE_PX) -> list[Rim]:
    """Return the rims of both circles as they are measured, with errors where there is a `generator`."""
    rims = []
    for radius, height in zip(view.radii, (0.0, view.step), strict=True):
        factor = factor_from_circle(view.center + height * view.normal, view.normal, radius)
        shapes = mode_shapes(np.linspace(0.0, 2.0 * np.pi, PLACES, endpoint=False))
        semi_major_px = 1200.0 * radius / float(np.linalg.norm(view.center))
        edges = 2.0 * np.pi * semi_major_px
        covariance = (edge_px / semi_major_px) ** 2 * np.linalg.inv(shapes.T @ shapes / PLACES * edges)
        if generator is not None:
            factor = grown(factor, np.linalg.cholesky(covariance) @ generator.normal(size=5))
        pixels = CAMERA.project((factor @ np.stack([*_unit_circle(), np.ones(PLACES)])).T)
        rim = rim_from_fit(CAMERA, ConeFit(factor, np.full(PLACES, edge_px)), pixels)
        assert isinstance(rim, EdgeRim)
        rims.append(
            FittedRim(
                rim.cone,
                pixels,
                rim.ellipse,
                1.0,
                1,
                axis_error_px=edge_px / float(np.sqrt(edges / 4.0)),
                modes_covariance=covariance,
            )
        )
    return rims


def _unit_circle() -> np.ndarray:
    angle = np.linspace(0.0, 2.0 * np.pi, PLACES, endpoint=False)
    return np.stack([np.cos(angle), np.sin(angle)])


def targets_among(rims: list[Rim], target: Target, method: str = "chen-huang") -> tuple[CircleResult, ...]:
    """Return the circles of the ring targets among the rims."""
    return find_ring_targets(rims, match_rings(rims, CAMERA, target), CAMERA, target, (method,)).circles


def measured(view: View, generator: np.random.Generator | None, method: str = "chen-huang") -> CircleResult | None:
    """Return the outer circle of the target as measured with kind: coplanar; None where no target is found."""
    target = Target("coplanar", view.radii)
    circles = targets_among(rims_of(view, generator), target, method)
    return None if not circles or Flag.LONE_CIRCLE in circles[0].flags else circles[0]


def rendered(view: View, generator: np.random.Generator) -> CircleResult | None:
    """The same, of a picture of a recess or of a boss."""
    form = "boss" if view.step > 0.0 else "recess"
    paints = (Paint(200.0), Paint(60.0))
    part = CoaxialPart(view.center, view.normal, view.radii, max(abs(view.step), 1e-3), form, *paints)
    picture = Scene(CAMERA, (part,), Paint(120.0), noise_levels=2.0, noise_seed=int(generator.integers(1 << 30)))
    result = circlepose.estimate(render(picture), CAMERA, Target("coplanar", view.radii))
    return result.circles[0] if result.status == "ok" else None


@dataclass(slots=True)
class Tally:
    """What came out over many views."""

    views: int = 0
    found: int = 0
    alike: int = 0
    wrong: int = 0
    not_flat: int = 0
    disagrees: int = 0
    silent: int = 0
    silent_sure: int = 0
    sure_expected: float = 0.0
    without_not_flat_sure: int = 0

    def add(self, view: View, circle: CircleResult | None) -> None:
        """Count one view."""
        self.views += 1
        if circle is None:
            return
        self.found += 1
        self.not_flat += Flag.NOT_FLAT in circle.flags
        self.disagrees += Flag.VANISHING_LINE_DISAGREES in circle.flags
        first, last = circle.candidates[0], circle.candidates[-1]
        if first.normal @ last.normal > np.cos(np.radians(ALIKE_DEG)):
            self.alike += 1
            return
        is_wrong = bool(last.normal @ view.normal > first.normal @ view.normal)
        sure = circle.ambiguity < CONFIDENT
        self.wrong += is_wrong
        self.silent += is_wrong and not circle.flags
        self.without_not_flat_sure += is_wrong and sure and Flag.NOT_FLAT not in circle.flags
        if sure and not circle.flags:
            self.silent_sure += is_wrong
            self.sure_expected += circle.ambiguity

    def cells(self) -> str:
        """The counts as the cells of a table."""
        return (
            f"{self.views} | {self.found} | {self.alike} | {self.wrong} | {self.not_flat} | "
            f"{self.disagrees} | {self.silent} | {self.silent_sure} ({self.sure_expected:.2f}) | "
            f"{self.without_not_flat_sure}"
        )


def law(radii: tuple[float, float], distance: float, tilt: np.ndarray) -> np.ndarray:
    """Return the depth of a recess from which on the wrong candidate looks flatter."""
    return np.asarray((radii[0] ** 2 - radii[1] ** 2) * np.cos(tilt) / distance)


def flips_at(radii: tuple[float, float], distance: float, tilt: float) -> float:
    """Return that depth by the fits to exact rims with a height fixed to zero, without any of the safeguards."""

    def lead(depth: float) -> float:
        ray = np.array([0.0, 0.0, 1.0])
        normal = np.array([np.sin(tilt), 0.0, -np.cos(tilt)])
        rims = rims_of(View(distance * ray, normal, radii, -depth), None)
        problem = RingProblem(
            tuple(
                from_levels(rim.cone.factor, radius, np.asarray(modes_covariance(rim)))
                for rim, radius in zip(rims, radii, strict=True)
            )
        )
        poses = zip(*poses_from_frame(principal_frame(rims[0].cone.factor), radii[0]), strict=True)
        solved = [problem.solve(AxisPose(center, own)) for center, own in poses]
        right, wrong = sorted(
            (each for each in solved if isinstance(each, JointPose)), key=lambda s: -float(s.pose.normal @ normal)
        )
        return wrong.misfit - right.misfit

    low, high = 0.0, 2.0 * float(law(radii, distance, np.array(0.0)))
    for _ in range(30):
        middle = (low + high) / 2.0
        low, high = (middle, high) if lead(middle) > 0.0 else (low, middle)
    return low


def draw(path: Path) -> None:
    """Draw the law, with points by fits to exact rims."""
    import matplotlib as mpl  # noqa: PLC0415 - of an extra
    from matplotlib.figure import Figure  # noqa: PLC0415

    # Drawn again the file is the same.
    mpl.rcParams.update({"svg.hashsalt": "flatness", "svg.fonttype": "none"})
    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    axes = figure.add_subplot()
    tilts = np.linspace(0.0, 85.0, 200)
    for radii, distance in (((45.0, 30.0), 714.0), ((45.0, 30.0), 1500.0), ((80.0, 50.0), 1500.0)):
        label = f"radii {radii[0]:g} and {radii[1]:g} mm, {distance:g} mm away"
        (line,) = axes.plot(tilts, law(radii, distance, np.radians(tilts)), label=label)
        points = np.arange(5.0, 80.0, 10.0)
        depths = [flips_at(radii, distance, float(np.radians(tilt))) for tilt in points]
        axes.plot(points, depths, "o", color=line.get_color(), markersize=4)
    axes.set_xlabel("tilt to the line of sight (deg)")
    axes.set_ylabel("depth of the recess (mm)")
    axes.set_title("Above its line the wrong candidate looks flatter", fontsize="medium")
    axes.set_ylim(bottom=0.0)
    axes.legend()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, metadata={"Date": None} if path.suffix == ".svg" else None)


def main() -> None:
    """Print the counts, or draw the figure."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--trials", type=int, default=1000)
    parser.add_argument("--rendered", type=int, default=0)
    parser.add_argument("--figure", type=Path)
    arguments = parser.parse_args()
    if arguments.figure is not None:
        draw(arguments.figure)
        return
    print("| target | radii mm | views | found | nothing to choose | wrong | not_flat ", end="")
    print("| vanishing_line_disagrees | silent | silent, ambiguity < 0.01 (by chance) | wrong, < 0.01, no not_flat |")
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    runs = [("rims", arguments.trials, measured), ("pictures", arguments.rendered, rendered)]
    for name, trials, measure in runs:
        for flat in (False, True):
            for radii in SIZES_MM:
                tally = Tally()
                for view, generator in views(radii, trials, flat=flat):
                    tally.add(view, measure(view, generator))
                if trials:
                    what = f"{name}, {'flat' if flat else 'stepped'}"
                    print(f"| {what} | {radii[0]:g}, {radii[1]:g} | {tally.cells()} |", flush=True)


if __name__ == "__main__":
    main()
