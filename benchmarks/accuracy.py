"""Errors of rendered discs against the bound that image noise sets, and whether the reported covariance holds.

    python -m benchmarks.accuracy [--only sets|grid] [--cell NAME] [--views 16] [--draws N] [--worst NUMBER]

Sets: a disc of radius 60 mm, grey 40 on 200, blur 0.7 px, noise 2 grey levels, 400 to 1500 mm away,
tilted 0 to 75 deg. `lo`: 1280 x 960, f = 1200 px, 100 images; `hi`: 2456 x 2058, f = 3480 px, 30 images; `lo k1=-0.3`
is lo through a lens with barrel distortion. Grid: discs of radius 50 px, tilted 5 to 75 deg, in images that just
hold them; blur, noise, contrast, radius, shading and texture are varied, one at a time.

Errors are of the better candidate. The bound is that of `bound.py`; where it puts the tilt's standard deviation above
half the tilt, first order does not hold, and the view counts in no ratio. NEES is e' C^-1 e with the covariance that
the estimate reports, of the centre (3 expected) and of centre and tilts (5).
"""

from __future__ import annotations

import argparse
import zlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

import circlepose
from benchmarks.support.bound import pose_bound, share_derivatives
from circlepose._numerics import angle_between
from circlepose._typing import FloatArray, Image
from circlepose.camera.camera import Camera
from circlepose.geometry.cone import plane_basis
from circlepose.results import Candidate, Flag, ImageResult
from circlepose.synthesis.disc_sets import RADIUS_MM, disc_views
from circlepose.synthesis.render import render_float
from circlepose.synthesis.scene import Disc, Paint, Scene, Shading, Texture
from circlepose.synthesis.texture import add_noise

SETS = {"lo": ("lo", 100, ()), "lo k1=-0.3": ("lo", 100, (-0.3, 0.1, 0.0, 0.0)), "hi": ("hi", 30, ())}
SEED = 1999
SET_DRAWS, GRID_DRAWS = 2, 4
FOCAL_PX, BORDER_PX, TILT_DEG = 1200.0, 20.0, (5.0, 75.0)
LEAST_SIGMAS = 2.0
MEAN_LEVEL = 120.0


@dataclass(frozen=True, slots=True)
class Condition:
    """A cell of the grid; lengths in px, levels in grey levels."""

    blur: float = 0.7
    noise: float = 2.0
    contrast: float = 160.0
    radius: float = 50.0
    shading: float = 0.0
    """change of the light from border to border, as a share"""
    texture: float = 0.0
    """standard deviation of the levels, on the disc and behind it"""


BASE = Condition()
GRID: dict[str, Condition] = {
    "base": BASE,
    **{f"blur {x:g} px": replace(BASE, blur=x) for x in (0.5, 1.0, 2.0)},
    **{f"noise {x:g}": replace(BASE, noise=x) for x in (0.5, 8.0)},
    **{f"contrast {x:g}": replace(BASE, contrast=x) for x in (30.0, 100.0, 200.0)},
    **{f"radius {x:g} px": replace(BASE, radius=x) for x in (4.0, 8.0, 10.0, 20.0, 100.0, 300.0)},
    "shading 0.4": replace(BASE, shading=0.4),
    **{f"texture {x:g}": replace(BASE, texture=x) for x in (2.0, 6.0)},
}


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """One view."""

    name: str
    answered: bool
    position_mm: float
    normal_deg: float
    bound: FloatArray
    """(5, 5)"""
    is_linear: bool
    """whether first order holds, by the bound"""
    nees: tuple[float, float] | None
    """of the centre, and with the tilts"""
    told: float
    """standard deviation of the centre that is reported, over its bound; NaN where none is"""
    flags: tuple[Flag, ...]

    @property
    def excess(self) -> FloatArray:
        """(2,) the errors of position and normal over their bounds."""
        least = np.sqrt([np.trace(self.bound[:3, :3]), np.trace(self.bound[3:, 3:])])
        return np.array([self.position_mm, np.radians(self.normal_deg)]) / least


def condition_views(condition: Condition, number: int) -> Iterator[Scene]:
    """Yield views of a disc about in the middle of an image that just holds it; all conditions share their poses."""
    side = int(2.0 * (condition.radius + BORDER_PX))
    middle = (side - 1) / 2
    camera = Camera.create([[FOCAL_PX, 0.0, middle], [0.0, FOCAL_PX, middle], [0.0, 0.0, 1.0]], (), (side, side))
    for view in range(number):
        generator = np.random.Generator(np.random.PCG64([SEED, view]))
        tilt = np.radians(TILT_DEG[0] + (TILT_DEG[1] - TILT_DEG[0]) * generator.random())
        azimuth, off = 2.0 * np.pi * generator.random(), generator.random(2) - 0.5
        distance = FOCAL_PX * RADIUS_MM / condition.radius
        ray = np.array([*(off / FOCAL_PX), 1.0])
        first, second = plane_basis(ray / np.linalg.norm(ray))
        normal = -np.cos(tilt) * ray + np.sin(tilt) * (np.cos(azimuth) * first + np.sin(azimuth) * second)
        dark, light = MEAN_LEVEL - condition.contrast / 2.0, MEAN_LEVEL + condition.contrast / 2.0
        mottle = (
            Texture(condition.texture, 20.0, view),
            Texture(condition.texture, condition.radius / 3.0, view + 1),
        )
        on_disc, behind = mottle if condition.texture > 0.0 else (None, None)
        yield Scene(
            camera=camera,
            targets=(Disc(distance * ray, normal, RADIUS_MM, Paint(dark, on_disc)),),
            background=Paint(light, behind),
            shading=Shading(right=condition.shading),
            blur_px=condition.blur,
            noise_levels=condition.noise,
            noise_seed=zlib.crc32(repr((condition, view)).encode()),
            name=f"{view:04d}",
        )


def noisy(levels: FloatArray, scene: Scene, draw: int) -> Image:
    """Return the image of `scene` from its noise-free `levels`; draw 0 is that of `render`."""
    image = levels.copy()
    add_noise(image, scene.noise_levels, scene.noise_seed + draw)
    return np.clip(np.rint(image), 0.0, 255.0).astype(np.uint8)


def measured(scene: Scene, image: Image, derivatives: FloatArray, method: str, refine: bool) -> Measured:
    """Measure an image of a scene; `derivatives` are those of `share_derivatives`."""
    disc = scene.targets[0]
    assert isinstance(disc, Disc)
    result = circlepose.estimate(
        image, scene.camera, circlepose.Target.circle(RADIUS_MM), method=method, refine=refine
    )
    bound = pose_bound(derivatives, scene.background.level - disc.paint.level, scene.noise_levels)
    sight = disc.center_mm / np.linalg.norm(disc.center_mm)
    tilt = float(angle_between(-disc.normal, sight))
    is_linear = bool(np.sqrt(np.linalg.eigvalsh(bound[3:, 3:])[-1]) < tilt / LEAST_SIGMAS)
    candidate = better(result, disc)
    if candidate is None:
        return Measured(scene.name, False, np.nan, np.nan, bound, is_linear, None, np.nan, ())
    off, turn = errors(candidate, disc)
    return Measured(
        name=scene.name,
        answered=True,
        position_mm=float(np.linalg.norm(off)),
        normal_deg=float(np.degrees(np.linalg.norm(turn))),
        bound=bound,
        is_linear=is_linear,
        nees=nees(candidate, off, turn),
        told=np.nan
        if candidate.covariance is None
        else float(np.sqrt(np.trace(candidate.covariance[:3, :3]) / np.trace(bound[:3, :3]))),
        flags=result.circles[0].flags,
    )


def better(result: ImageResult, disc: Disc) -> Candidate | None:
    """Return the candidate whose normal is the nearer to the truth."""
    candidates = result.circles[0].candidates if result.circles else ()
    return max(candidates, key=lambda c: float(c.normal @ disc.normal), default=None)


def errors(candidate: Candidate, disc: Disc) -> tuple[FloatArray, FloatArray]:
    """Return the errors of centre (3,) mm and tilts (2,) rad, these towards the candidate's `plane_basis`."""
    chord = candidate.normal - disc.normal
    angle = float(angle_between(candidate.normal, disc.normal))
    turn = np.array([chord @ axis for axis in plane_basis(candidate.normal)])
    return candidate.center - disc.center_mm, turn * angle / max(float(np.linalg.norm(turn)), 1e-300)


def nees(candidate: Candidate, off: FloatArray, turn: FloatArray) -> tuple[float, float] | None:
    """Return the squared errors in the covariance's own measure, of the centre and with the tilts."""
    covariance = candidate.covariance
    if covariance is None:
        return None
    both = np.concatenate([off, turn])
    return float(off @ np.linalg.solve(covariance[:3, :3], off)), float(both @ np.linalg.solve(covariance, both))


def row(label: str, views: Iterable[Measured]) -> str:
    """Return a row of the table."""
    every = list(views)
    found = [view for view in every if view.answered]
    linear = [view for view in found if view.is_linear]
    told = [view.nees for view in found if view.nees is not None]
    ratio = np.sqrt(np.mean([view.excess**2 for view in linear], axis=0)) if linear else (np.nan, np.nan)
    position = np.percentile([view.position_mm for view in found], [50, 95])
    normal = np.percentile([view.normal_deg for view in found], [50, 95])
    consistent = np.mean(told, axis=0) if told else (np.nan, np.nan)
    claimed = np.nanmedian([view.told for view in linear]) if linear else np.nan
    return (
        f"| {label} | {len(found)}/{len(every)} | {position[0]:.4f} / {position[1]:.3f} "
        f"| {normal[0]:.4f} / {normal[1]:.3f} | {ratio[0]:.2f} | {ratio[1]:.2f} | {claimed:.2f} "
        f"| {consistent[0]:.2f} | {consistent[1]:.2f} | {len(found) - len(linear)} | {len(found) - len(told)} |"
    )


COLUMNS = (
    "views",
    "answered",
    "position mm, median / 95th",
    "normal deg, median / 95th",
    "position / bound",
    "normal / bound",
    "sigma / bound",
    "NEES center",
    "NEES pose",
    "beyond first order",
    "no covariance",
)


def worst(views: Iterable[Measured], number: int) -> str:
    """List the views whose errors are largest beside the bound."""

    found = [view for view in views if view.answered]
    listed = sorted(found, key=lambda view: float(view.excess[0]), reverse=True)[:number]
    return "\n".join(
        f"  view {view.name}: {view.position_mm:.3f} mm ({view.excess[0]:.1f} x bound), "
        f"{view.normal_deg:.4f} deg ({view.excess[1]:.1f} x), "
        f"NEES {'none' if view.nees is None else f'{view.nees[0]:.1f} {view.nees[1]:.1f}'}, {', '.join(view.flags)}"
        for view in listed
    )


def main() -> None:
    """Print a row per set and per condition."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", choices=("sets", "grid"))
    parser.add_argument("--cell", help="only the set or condition of this name")
    parser.add_argument("--views", type=int, default=16, help="of each condition of the grid")
    parser.add_argument("--draws", type=int, help="of the noise, for each view; 2 of the sets', 4 of the grid's")
    parser.add_argument("--method", default="chen-huang")
    parser.add_argument("--no-refine", action="store_true")
    parser.add_argument("--worst", type=int, default=0, metavar="NUMBER", help="list as many of each row's views")
    options = parser.parse_args()
    cells: dict[str, Callable[[], Iterator[Scene]]] = {}
    if options.only != "grid":
        cells |= {
            label: lambda size=size, number=number, lens=lens: disc_views(size, number, SEED, lens)
            for label, (size, number, lens) in SETS.items()
        }
    if options.only != "sets":
        cells |= {
            label: lambda condition=condition: condition_views(condition, options.views)
            for label, condition in GRID.items()
        }
    # Conditions that differ in noise or contrast have the same derivatives.
    known: dict[tuple[float, float, str], FloatArray] = {}
    print(f"| {' | '.join(COLUMNS)} |")
    print(f"|{'---|' * len(COLUMNS)}")
    for label, scenes in cells.items():
        if options.cell not in (None, label):
            continue
        views = []
        for scene in scenes():
            condition = GRID.get(label)
            if condition is None:
                derivatives = share_derivatives(scene)
            else:
                key = (condition.blur, condition.radius, scene.name)
                if key not in known:
                    known[key] = share_derivatives(scene)
                derivatives = known[key]
            levels = render_float(scene)
            draws = options.draws or (SET_DRAWS if condition is None else GRID_DRAWS)
            for draw in range(draws):
                image = noisy(levels, scene, draw)
                views.append(measured(scene, image, derivatives, options.method, not options.no_refine))
        print(row(label, views), flush=True)
        if options.worst:
            print(worst(views, options.worst), flush=True)


if __name__ == "__main__":
    main()
