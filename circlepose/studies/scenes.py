"""The papers' scenes, built from their printed poses; the same as those of `configs/scenes`.

What is not printed (radii, light, surroundings) is chosen here: see docs/papers.md.
"""

from __future__ import annotations

import math
from typing import Literal

from circlepose._typing import FloatArray, frozen
from circlepose.camera.camera import Camera
from circlepose.studies.published import GENERATRIX_MM, TABLE1, TABLES_1_AND_2
from circlepose.synthesis.scene import Box, CoaxialPart, Disc, Paint, Patch, Plane, Rings, Scene, Shading, Texture
from circlepose.targets.target import AxisIntervals, Target

CD_RADIUS_MM = 60.0
_RINGS_MM = (50.0, 30.0)
_BOSS_MM = (45.0, 30.0)

CD_TARGET = Target(
    "circle",
    (CD_RADIUS_MM,),
    polarity="bright",
    axis_intervals=AxisIntervals((250.0, 450.0), (0.0, 150.0)),
    facing="up",
)
COPLANAR_TARGET = Target("coplanar", _RINGS_MM, depth_range_mm=(400.0, 1200.0))
COAXIAL_TARGET = Target("coaxial", _BOSS_MM, generatrix_mm=GENERATRIX_MM, depth_range_mm=(400.0, 1200.0))


def chen_huang_camera(fx: float = 2607.0, fy: float = 2607.0) -> Camera:
    """Return the camera of Chen & Huang, 512 x 480; 2607 px = 31.6 mm / (0.01 mm x 1.212)."""
    return Camera.create([[fx, 0.0, 255.5], [0.0, fy, 239.5], [0.0, 0.0, 1.0]], [0.0] * 5, (512, 480))


def cd_pose(image: str) -> tuple[FloatArray, FloatArray]:
    """Return center (3,), mm, and normal (3,), as printed, of the compact disc in view a, b or c of Table I.

    The print has c at the center of a and the normal 0.01 off: it is the same view, touched by an object.
    """
    printed = next(row for row in TABLE1 if row.image == ("b" if image == "b" else "a"))
    return frozen(printed.center_mm), frozen(printed.normal)


def cd_scenes() -> tuple[Scene, ...]:
    """Return the three views of Table I: general, elongated, and touched by an object."""
    bar = Box((80.0, 12.0), (64.0, 72.0), math.radians(48.0))
    touching = Patch(bar, Paint(196.0), Plane.create(*cd_pose("c")))
    return tuple(
        Scene(
            camera=chen_huang_camera(),
            targets=(
                Disc(
                    *cd_pose(image),
                    CD_RADIUS_MM,
                    Paint(206.0, Texture(3.0, 18.0, 5)),
                    marks=((22.5, Paint(168.0)), (7.5, Paint(34.0))),
                ),
            ),
            background=Paint(30.0, Texture(2.5, 110.0, 11)),
            occluders=(touching,) if image == "c" else (),
            shading=Shading(-0.08, 0.12),
            noise_levels=1.5,
            noise_seed=100 + number,
            name=image,
        )
        for number, image in enumerate("abc")
    )


def coplanar_scenes() -> tuple[Scene, ...]:
    """Return the scenes of Table 1 of Fu & Zhou at their calibrated poses: rings on a plate."""
    plates = {
        "a": (Box((240.0, 190.0), (-38.0, 14.0), math.radians(2.0)), 196.0, 204.0),
        "b": (Box((240.0, 190.0), (18.0, 8.0), math.radians(-3.0)), 196.0, 204.0),
        "c": (Box((240.0, 190.0), (22.0, -6.0), math.radians(4.0)), 188.0, 196.0),
        "d": (Box((240.0, 190.0), (-26.0, 10.0), math.radians(-2.0)), 188.0, 196.0),
    }
    scenes = []
    for number, (image, (plate, level, inner_level)) in enumerate(plates.items()):
        plane = _calibrated_plane(f"1{image}")
        scenes.append(
            Scene(
                camera=fu_zhou_camera(),
                targets=(Rings(plane.center, plane.normal, _RINGS_MM, (Paint(34.0), Paint(inner_level))),),
                background=Paint(62.0, Texture(8.0, 90.0, 21)),
                shapes=(Patch(plate, Paint(level, Texture(7.0, 28.0, 31 + number)), plane),),
                shading=Shading(0.10, -0.08),
                noise_levels=1.5,
                noise_seed=200 + number,
                name=image,
            )
        )
    return tuple(scenes)


def coaxial_scenes() -> tuple[Scene, ...]:
    """Return the scenes of Table 2 of Fu & Zhou at their calibrated poses: a boss on a plate."""
    plates = {
        "a": Box((330.0, 290.0), (-12.0, 10.0), math.radians(5.0), 18.0),
        "b": Box((330.0, 290.0), (46.0, -8.0), math.radians(-4.0), 18.0),
    }
    scenes = []
    for number, (image, plate) in enumerate(plates.items()):
        plane = _calibrated_plane(f"2{image}")
        scenes.append(_on_a_plate("boss", plane, plate, 51 + number, 300 + number, image))
    return tuple(scenes)


def coaxial_part_scene(
    form: Literal["boss", "recess"], center_mm: FloatArray, normal: FloatArray, seed: int
) -> Scene:
    """Return a scene as those of Table 2, with the part at another pose: `center_mm` (3,) and `normal` (3,)."""
    return _on_a_plate(form, Plane.create(center_mm, normal), Box((330.0, 290.0), corner_radius=18.0), seed, seed, "")


def _on_a_plate(
    form: Literal["boss", "recess"], plane: Plane, plate: Box, texture_seed: int, noise_seed: int, name: str
) -> Scene:
    height = math.sqrt(GENERATRIX_MM**2 - (_BOSS_MM[0] - _BOSS_MM[1]) ** 2)
    return Scene(
        camera=fu_zhou_camera(),
        targets=(CoaxialPart(plane.center, plane.normal, _BOSS_MM, height, form, Paint(74.0), Paint(228.0)),),
        background=Paint(46.0, Texture(5.0, 120.0, 41)),
        shapes=(Patch(plate, Paint(168.0, Texture(4.0, 45.0, texture_seed)), plane),),
        shading=Shading(-0.08, -0.12),
        noise_levels=1.5,
        noise_seed=noise_seed,
        name=name,
    )


def fu_zhou_camera() -> Camera:
    """Return the camera of Fu & Zhou: 12 mm over pixels of 3.45 um, and 2456 x 2058 px, both halved."""
    focal = 1739.1304
    matrix = [[focal, 0.0, 613.5], [0.0, focal, 514.0], [0.0, 0.0, 1.0]]
    return Camera.create(matrix, [0.0] * 5, (1228, 1029))


def _calibrated_plane(scene: str) -> Plane:
    printed = next(each for each in TABLES_1_AND_2 if each.scene == scene)
    return Plane.create(printed.calibrated.center_mm, printed.calibrated.normal)
