"""Predictions as a sheet: a row per view."""

from __future__ import annotations

from collections.abc import Sequence

from circlepose.camera.camera import EXACT, Camera
from circlepose.planning.predict import Planned
from circlepose.planning.search import Wanted
from circlepose.planning.views import Look
from circlepose.targets.target import Target
from circlepose_cli.options.plan import Sought
from circlepose_cli.output.sheets import Cell, Sheet

COLUMNS = {
    "place": 0,
    "tilt_deg": 1,
    "distance_mm": 1,
    "radius_mm": 3,
    "sigma_position_mm": 4,
    "sigma_normal_deg": 4,
    "wrong": 4,
    "found": 2,
    "major_px": 1,
    "sigma_x_mm": 4,
    "sigma_y_mm": 4,
    "sigma_z_mm": 4,
    "sigma_roll_deg": 4,
    "camera_share": 2,
    "radius_share": 2,
    "apart_deg": 2,
    "u_px": 1,
    "v_px": 1,
    "flags": 0,
    "reason": 0,
}
_DETAILS = (
    "u_px",
    "v_px",
    "apart_deg",
    "sigma_x_mm",
    "sigma_y_mm",
    "sigma_z_mm",
    "sigma_roll_deg",
    "radius_share",
    "camera_share",
    "flags",
    "major_px",
    "reason",
)
_SOUGHT = {Sought.DISTANCE: "farthest distance of the range", Sought.RADIUS: "smallest radius"}


def plan_sheet(
    rows: Sequence[Planned], camera: Camera, target: Target, look: Look, search: tuple[Sought, Wanted] | None
) -> Sheet:
    """Return the sheet of a plan; `search` is what was sought for which accuracy, if anything."""
    return Sheet("plan", COLUMNS, tuple(map(_cells, rows)), tuple(_notes(camera, target, look, search)), _DETAILS)


def _cells(row: Planned) -> tuple[Cell, ...]:
    found = row.prediction
    if found is None:
        reason = "nowhere in the range both found and as accurate as wanted"
        head: list[Cell] = [row.place, row.tilt_deg, row.distance_mm]
        return (*head, *[None] * (len(COLUMNS) - len(head) - 2), "", reason)
    sigma = (None,) * 3 if found.sigma_mm is None else tuple(found.sigma_mm.tolist())
    return (
        row.place,
        row.tilt_deg,
        found.view.distance_mm,
        row.target.radii_mm[0],
        found.position_mm,
        found.sigma_normal_deg,
        found.wrong,
        found.found,
        found.major_px,
        *sigma,
        found.sigma_roll_deg,
        found.camera_share,
        found.radius_share,
        found.apart_deg,
        *found.view.place_px,
        ";".join(found.flags),
        found.reason,
    )


def _notes(camera: Camera, target: Target, look: Look, search: tuple[Sought, Wanted] | None) -> list[str]:
    notes = [
        f"Noise {look.noise_levels:g} levels, blur {look.blur_px:g} px, contrast {look.contrast_levels:g} levels.",
        "sigma_*: standard deviations as estimate reports them. wrong: probability that the wrong one of two poses "
        "is chosen. found: share of the pictures in which the target was measured. camera_share, radius_share: of "
        "the variance of the position.",
    ]
    if search is not None:
        sought, wanted = search
        parts = [
            f"{value:g} {unit}"
            for value, unit in ((wanted.position_mm, "mm"), (wanted.normal_deg, "deg"))
            if value is not None
        ]
        notes.append(f"Wanted: {' and '.join(parts)}; each row is the {_SOUGHT[sought]} for it.")
    if camera.sigma == EXACT:
        notes.append("The camera is taken as exact: give --camera-sigma to have its errors counted.")
    if target.radius_sigma_mm == 0.0:
        notes.append("The radius is taken as exact: give --radius-sigma-mm to have its error counted.")
    if target.kind == "circle":
        notes.append("A lone circle has two poses: which of them it is takes a hint, a plane, rings or a board.")
    notes.append("Next: circlepose print makes the sheet of a target file.")
    return notes
