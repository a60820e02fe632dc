"""Scene descriptions: a YAML file -> the scenes to render. The form is explained in docs/rendering.md."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from circlepose._arguments import shown
from circlepose.camera.camera import Camera
from circlepose.errors import SceneError
from circlepose.io.board_file import layout_to_mapping
from circlepose.io.calibration.forms import native
from circlepose.io.calibration.reader import read_camera
from circlepose.io.scenes.boards import LAYOUT_KEYS
from circlepose.io.scenes.parts import paint, plane, shape_patch
from circlepose.io.scenes.targets import target_part
from circlepose.io.target_file import target_from_mapping
from circlepose.io.text.source import read_source
from circlepose.io.text.validation import Strict, parse, unknown_key
from circlepose.io.text.yaml import parse_yaml
from circlepose.synthesis.scene import BoardPart, CoaxialPart, Patch, Scene, Shading, TargetPart
from circlepose.targets.target import Target

_TARGET_KEYS = ("count", "polarity", "axis_intervals_px", "depth_range_mm", "normal_hint", "up_hint", "facing")
_BOARD_KEYS = ("kind", *LAYOUT_KEYS)
"""Keys of `target` in a file of boards, for all of them."""
_Mappings = list[dict[str, Any]]
_NotNegative = Annotated[float, Field(ge=0.0)]


class _Shading(Strict):
    right: float = Field(0.0, description="the relative change of brightness from left to right, such as 0.2")
    down: float = Field(0.0, description="the relative change of brightness from top to bottom, such as 0.2")


class _View(Strict):
    image: str | None = Field(None, description="the image's name, without folder and suffix")
    background: dict[str, Any] = Field({"level": 200.0}, description="a mapping such as {level: 200}")
    shapes: _Mappings = Field([], description="a list of shapes, each a mapping with a kind")
    targets: _Mappings = Field([], description="a list of targets, each a mapping with a kind")
    occluders: _Mappings = Field([], description="a list of shapes, each a mapping with a kind")
    shading: _Shading = Field(_Shading(), description="a mapping with the keys right and down")
    blur_px: _NotNegative = Field(0.7, description="a number of at least 0, the sigma of the blur in px")
    noise_levels: _NotNegative = Field(0.0, description="a number of at least 0, the noise in gray levels")
    noise_seed: Annotated[int, Field(ge=0)] = Field(0, description="a whole number of at least 0")
    bit_depth: Literal[8, 16] = Field(8, description="8 or 16")


class _File(_View):
    camera: str | dict[str, Any] = Field(description="a mapping with fx, fy, cx, cy and image_size, or a file's name")
    target: dict[str, Any] = Field({}, description=f"a mapping with some of the keys {', '.join(_TARGET_KEYS)}")
    planes: dict[str, dict[str, Any]] = Field({}, description="a mapping from names to planes")
    views: Annotated[_Mappings, Field(min_length=1)] | None = Field(
        None, description="a list of images, each a mapping with `image` and what differs from the rest of the file"
    )


@dataclass(frozen=True, slots=True, eq=False)
class SceneFile:
    """What a scene file describes."""

    camera: Camera
    scenes: tuple[Scene, ...]
    """one per image, in the file's order"""
    target: Target | None
    """what its targets are to a measurement; None for a file without any"""


def read_scenes(path: str | os.PathLike[str]) -> SceneFile:
    """Read a scene file.

    Parameters
    ----------
    path
        The YAML file.

    Returns
    -------
    The camera, the target and a scene for each view.

    Raises
    ------
    SceneError, CalibrationError, TargetError
        One sentence: the file, the key and what is expected; by the part of the file.
    """
    text, name = read_source(path, SceneError)
    entries = parse_yaml(text, name, SceneError, "camera: camera.yaml")
    form = parse(_File, entries, name, SceneError)
    camera = _camera(form.camera, name)
    scenes: list[Scene] = []
    for number, (where, view) in enumerate(_views(form, entries, name)):
        image = view.image or (Path(name).stem if form.views is None else None)
        if image is None:
            raise SceneError(f"{where}: image: is missing; expected {_View.model_fields['image'].description}.")
        if Path(image).name != image or image.startswith(".") or image.endswith(".png"):
            raise SceneError(f"{where}: image: expected a name without folder and suffix, got {shown(image)}.")
        if image in (scene.name for scene in scenes):
            raise SceneError(f"{where}: image: {image!r} is the name of an earlier view; give each view its own.")
        # Two images with the same noise would be no independent ones.
        seed = view.noise_seed if "noise_seed" in view.model_fields_set else form.noise_seed + number
        scenes.append(_scene(view, where, camera, image, seed, form, Path(name).parent))
    return SceneFile(camera, tuple(scenes), _target(form, scenes, name))


def _camera(given: str | dict[str, Any], name: str) -> Camera:
    if isinstance(given, str):
        camera = read_camera(Path(name).parent / given)
    else:
        camera = native.camera_of(given, f"{name}: camera")
    if camera.image_size is None:
        raise SceneError(f"{name}: camera: image_size: is missing; expected [width, height] in px.")
    return camera


def _views(form: _File, entries: Mapping[str, object], name: str) -> Iterator[tuple[str, _View]]:
    """Yield each view with its place in the file; what a view does not say is taken from the file's top."""
    shared = {key: value for key, value in entries.items() if key in _View.model_fields and key != "image"}
    if form.views is None:
        yield name, form
        return
    if form.image is not None:
        raise SceneError(f"{name}: image: belongs into each of the views, not above them.")
    shared.pop("noise_seed", None)
    for number, own in enumerate(form.views):
        where = f"{name}: views[{number}]"
        yield where, parse(_View, {**shared, **own}, where, SceneError)


def _scene(view: _View, where: str, camera: Camera, image: str, seed: int, form: _File, folder: Path) -> Scene:
    known = {key: plane(entries, f"{where}: planes.{key}") for key, entries in form.planes.items()}
    layout = {key: value for key, value in form.target.items() if key in LAYOUT_KEYS}

    def patches(key: str, listed: _Mappings) -> tuple[Patch, ...]:
        return tuple(
            shape_patch(entries, f"{where}: {key}[{number}]", known) for number, entries in enumerate(listed)
        )

    targets = tuple(
        target_part(_of_board(entries, layout), f"{where}: targets[{number}]", known, folder)
        for number, entries in enumerate(view.targets)
    )
    return Scene(
        camera=camera,
        targets=targets,
        background=paint(view.background, f"{where}: background", "px"),
        shapes=patches("shapes", view.shapes),
        occluders=patches("occluders", view.occluders),
        shading=Shading(view.shading.right, view.shading.down),
        blur_px=view.blur_px,
        noise_levels=view.noise_levels,
        noise_seed=seed,
        bit_depth=view.bit_depth,
        name=image,
    )


def _of_board(entries: Mapping[str, Any], layout: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the entries of a target; a board that has no layout of its own has the file's."""
    is_plain = entries.get("kind") == "board" and not any(key in entries for key in LAYOUT_KEYS)
    return {**layout, **entries} if is_plain else entries


def _target(form: _File, scenes: list[Scene], name: str) -> Target | None:
    parts = [part for scene in scenes for part in scene.targets]
    is_board = any(isinstance(part, BoardPart) for part in parts)
    known = (*_TARGET_KEYS, *_BOARD_KEYS) if is_board else _TARGET_KEYS
    for key in form.target:
        if key not in known:
            raise SceneError(f"{name}: target.{unknown_key(key, known)}")
    if form.target.get("kind", "board") != "board":
        raise SceneError(
            f"{name}: target.kind: expected board, the kind of the targets, got {form.target['kind']!r}."
        )
    if not parts:
        return None
    described = _described(parts[0])
    if any(_described(part) != described for part in parts):
        raise SceneError(
            f"{name}: targets: expected targets of one kind and size, as one target.yaml describes them."
        )
    counts = {len(scene.targets) for scene in scenes}
    count = counts.pop() if len(counts) == 1 else "all"
    said = {key: value for key, value in form.target.items() if key not in _BOARD_KEYS}
    return target_from_mapping({**described, "count": count, **said}, f"{name}: target")


def _described(part: TargetPart) -> dict[str, object]:
    if isinstance(part, BoardPart):
        return {"kind": part.kind, **layout_to_mapping(part.layout)}
    radii = [circle.radius for circle in part.circles]
    if part.kind == "circle":
        return {"kind": part.kind, "radius_mm": radii[0]}
    described: dict[str, object] = {"kind": part.kind, "radii_mm": radii}
    if isinstance(part, CoaxialPart):
        # Its square root may have left 45.21 a little off 45.21.
        described["generatrix_mm"] = round(math.hypot(part.height_mm, radii[0] - radii[1]), 9)
    return described
