"""Which camera and which target hold for an image: from the command line, or from the files beside it."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from pathlib import Path

from circlepose.camera.camera import CameraSigma
from circlepose.errors import ArgumentError, CalibrationError, TargetError, UsageError
from circlepose.io.calibration.reader import CameraFile, read_camera_file
from circlepose.io.remote.images import Place, RemoteFile
from circlepose.io.target_file import find_beside, read_target, target_from_mapping
from circlepose.io.text.escaping import printable
from circlepose.pipeline.world import check_world_board
from circlepose.targets import Direction
from circlepose.targets.hints import NORMAL_SPREAD_DEG, UP_SPREAD_DEG, DirectionHint
from circlepose.targets.target import AxisIntervals, Target
from circlepose_cli.options.camera_target import CameraTargetOptions
from circlepose_cli.options.names import option_of, with_options

_FOUND = "found beside the images and used"
_SAME_NAME = sorted({field.name for field in fields(Target)} & {field.name for field in fields(CameraTargetOptions)})
"""options that replace the target's field of the same name"""


@dataclass(frozen=True, slots=True)
class Setup:
    """What is known before an image is opened."""

    camera_file: CameraFile
    target: Target
    target_origin: str
    """where the target came from, for a person"""
    target_path: Path | None = None
    """the target file, where there is one"""
    world_board: Target | None = None
    """the board in the images to which poses are relative, if any"""
    world_path: Path | None = None
    """its file"""
    notes: tuple[str, ...] = ()
    """sentences to say once: remarks on the calibration, and which files were found rather than named"""


class Setups:
    """The setup of each folder: found once, and given once to `on_new`."""

    def __init__(
        self,
        known: CameraTargetOptions,
        on_new: Callable[[Place, Setup], None],
        *,
        force_calibration: bool = False,
        world_board: str | None = None,
    ) -> None:
        """Take what the command line says; `force_calibration` uses a calibration that no camera has.

        `world_board` is the file of a board, or its name beside the images.
        """
        if known.target_file is not None and known.radius_mm is not None:
            raise UsageError("--target, --radius-mm: give one of them, not both.")
        if known.same_plane is not None and known.coplanar is not None:
            raise UsageError("--same-plane, --coplanar: give one of them, not both.")
        self._known = known
        self._on_new = on_new
        self._force_calibration = force_calibration
        self._world_board = world_board
        self._by_folder: dict[Place, Setup] = {}
        self._cameras: dict[Path, CameraFile] = {}
        self._said: set[str] = set()

    def for_image(self, path: Place) -> Setup:
        """Return the setup for an image's folder; raises when it has no camera or no target."""
        folder = path.parent
        if folder not in self._by_folder:
            try:
                setup = self._find(folder)
            except UsageError:
                # A slip in a name is the likelier cause.
                _check_exists(path)
                raise
            self._by_folder[folder] = setup
            self._on_new(folder, setup)
        return self._by_folder[folder]

    def _find(self, folder: Place) -> Setup:
        path = self._known.calib or _beside(folder, "camera")
        if path is None:
            beside = "" if isinstance(folder, RemoteFile) else " or put a camera.yaml beside them"
            raise UsageError(
                f"{printable(str(folder))}: no calibration for the images there; give --calib FILE{beside}."
            )
        if path not in self._cameras:
            camera_file = read_camera_file(path, self._known.camera_name)
            if not self._force_calibration:
                camera_file.refuse_grave("give --force-calib")
            self._cameras[path] = camera_file
        camera_file = self._cameras[path]
        target, origin, target_path = self._find_target(folder, camera_file)
        target = _overridden(target, self._known)
        notes = [] if self._known.calib is not None else [f"{printable(str(path))}: {_FOUND} as calibration"]
        notes += [
            f"{printable(str(path))}: {note}{'' if note.endswith('?') else '.'}"
            for note in (*camera_file.notes, *(d.text for d in camera_file.doubts))
        ]
        if self._known.radius_mm is None and self._known.target_file is None:
            used = "used" if origin == f"{camera_file.path}: target" else _FOUND
            notes.append(f"{origin}: {used} as target, {_described(target)}")
        if self._known.camera_sigma is not None:
            try:
                sigma = CameraSigma(*self._known.camera_sigma)
            except CalibrationError as error:
                raise UsageError(with_options(str(error), self._known)) from None
            camera_file = replace(camera_file, camera=replace(camera_file.camera, sigma=sigma))
        world_board, world_path = self._find_world(folder, target)
        if world_path is not None:
            notes.append(f"{printable(str(world_path))}: poses are in the frame of this board")
        new = tuple(note for note in notes if note not in self._said)
        self._said.update(new)
        return Setup(camera_file, target, origin, target_path, world_board, world_path, new)

    def _find_target(self, folder: Place, camera_file: CameraFile) -> tuple[Target, str, Path | None]:
        if self._known.radius_mm is not None:
            return _circle(self._known.radius_mm), "--radius-mm", None
        path = self._known.target_file or _beside(folder, "target")
        if path is not None:
            return read_target(path), str(path), path
        if camera_file.target is not None:
            origin = f"{camera_file.path}: target"
            return target_from_mapping(camera_file.target, origin), origin, None
        raise UsageError(_no_target(folder, camera_file.path))

    def _find_world(self, folder: Place, target: Target) -> tuple[Target | None, Path | None]:
        typed = self._world_board
        if typed is None:
            return None, None
        if not typed:
            raise UsageError("--world-board: expected a target file, or its name beside the images, got nothing.")
        is_name = Path(typed).name == typed and not Path(typed).suffix
        path = _beside(folder, typed) if is_name else Path(typed)
        if path is None:
            raise UsageError(
                f"--world-board {printable(typed)}: there is no {printable(typed)}.yaml in "
                f"{printable(str(folder))}; put the board's target file there, or give its path."
            )
        if not is_name and not path.suffix and path.with_suffix(".yaml").is_file() and not path.exists():
            raise UsageError(f"--world-board: {printable(typed)}: there is no such file; {path.name}.yaml is there.")
        _check_not_beside(path, folder)
        world = read_target(path)
        try:
            check_world_board(world, target)
        except ArgumentError as error:
            reason = str(error).removeprefix("world_board: ")
            raise UsageError(f"--world-board: {printable(str(path))}: {reason}") from None
        return world, path


def _check_not_beside(path: Path, folder: Place) -> None:
    """Raise `UsageError` where the file of a board is not there, but one of its name is beside the images."""
    if isinstance(folder, RemoteFile) or os.path.lexists(path) or not os.path.lexists(folder / path.name):
        return
    # What a name without an ending stands for.
    is_named = path.suffix in (".yaml", ".yml") and not Path(path.stem).suffix
    given = path.stem if is_named else str(folder / path.name)
    raise UsageError(
        f"--world-board {printable(str(path))}: there is no such file, but one of this name beside the images; give "
        f"--world-board {printable(given)}."
    )


def _check_exists(path: Place) -> None:
    """Raise `UsageError` where a file of this machine is not there."""
    if not isinstance(path, RemoteFile) and not os.path.lexists(path):
        raise UsageError(f"{printable(str(path))}: there is no such file or folder; check the path.")


def _described(target: Target) -> str:
    """Return what sets the scale of all results, and what settles their ambiguity."""
    radii = ", ".join(f"{radius:g}" for radius in target.radii_mm)
    scale = f"radius_mm {radii}" if target.kind == "circle" else f"{target.kind}, radii_mm {radii}"
    settling = [key for key in ("normal_hint", "up_hint", "facing") if getattr(target, key)]
    plane = [] if target.same_plane == "auto" else [f"same_plane {target.same_plane}"]
    return ", ".join([scale, *plane, *settling])


def _beside(folder: Place, stem: str) -> Path | None:
    # What images at a URL are measured with is said here, not there.
    return None if isinstance(folder, RemoteFile) else find_beside(folder, stem)


def _circle(radius_mm: float) -> Target:
    try:
        return Target.circle(radius_mm)
    except TargetError as error:
        raise UsageError(str(error).replace("radius_mm:", "--radius-mm:")) from None


def _overridden(target: Target, known: CameraTargetOptions) -> Target:
    """Return the target with what was typed; raises `UsageError` that names the options."""
    if known.plane == "yes" and target.kind == "circle" and (known.count or target.count) == 1:
        option = option_of("same_plane" if known.coplanar is None else "coplanar")
        raise UsageError(
            f"{option}: needs several circles in each image, but one is looked for; give --count N or --count all."
        )
    try:
        return _replaced(target, known)
    except TargetError as error:
        raise UsageError(with_options(str(error), known)) from None


def _replaced(target: Target, known: CameraTargetOptions) -> Target:
    changes = {key: value for key in _SAME_NAME if (value := getattr(known, key)) is not None}
    if known.plane is not None:
        changes["same_plane"] = known.plane
    if known.major_px is not None or known.minor_px is not None:
        axes = target.axis_intervals or AxisIntervals()
        changes["axis_intervals"] = AxisIntervals(known.major_px or axes.major_px, known.minor_px or axes.minor_px)
    for option, spread_deg in (("normal", NORMAL_SPREAD_DEG), ("up", UP_SPREAD_DEG)):
        hint = _hint(
            option,
            getattr(target, f"{option}_hint"),
            getattr(known, option),
            getattr(known, f"{option}_spread_deg"),
            spread_deg,
        )
        if hint is not None:
            changes[f"{option}_hint"] = hint
    return replace(target, **changes)


def _hint(
    option: str, known: DirectionHint | None, direction: Direction | None, spread_deg: float | None, usual_deg: float
) -> DirectionHint | None:
    """Return the hint of --`option` and its spread, each from the target where it is left out."""
    if direction is None and known is not None:
        direction = known.direction
    if direction is None:
        if spread_deg is not None:
            raise UsageError(f"--{option}-spread-deg: needs --{option} X,Y,Z.")
        return None
    if spread_deg is None:
        spread_deg = usual_deg if known is None else known.spread_deg
    return DirectionHint(direction, spread_deg)


def _no_target(folder: Place, camera_file: Path) -> str:
    ways = [
        ("--radius-mm 60", "one circle of radius 60 mm"),
        ("--target rings.yaml", "a target file, such as: {kind: coplanar, radii_mm: [50, 30]}"),
        ("target: {radius_mm: 60}", f"a key in the calibration file {camera_file}"),
    ]
    if isinstance(folder, Path):
        ways.insert(2, (str(folder / "target.yaml"), "a target file beside the images"))
    width = max(len(way) for way, _ in ways)
    lines = "\n".join(f"  {way:<{width}}  {meaning}" for way, meaning in ways)
    number = {3: "three", 4: "four"}[len(ways)]
    return f"{folder}: no target for the images there; give it in one of {number} ways:\n{lines}"
