"""The library's messages on a camera or a target, with the option that was typed in place of the key of a file."""

from __future__ import annotations

from dataclasses import fields
from typing import get_args, get_type_hints

from typer.models import OptionInfo

from circlepose_cli.options.camera_target import CameraTargetOptions

_FIELD_OF_KEY = {
    "normal_hint": "normal",
    "normal_hint.direction": "normal",
    "normal_hint.spread_deg": "normal_spread_deg",
    "up_hint": "up",
    "up_hint.direction": "up",
    "up_hint.spread_deg": "up_spread_deg",
    "axis_intervals_px.major": "major_px",
    "axis_intervals_px.minor": "minor_px",
    "focal_sigma_px": "camera_sigma",
    "center_sigma_px": "camera_sigma",
}
"""the fields of `CameraTargetOptions` that have another name than the key"""


def option_of(field: str) -> str:
    """Return the option of a field of `CameraTargetOptions`, such as --same-plane of `same_plane`."""
    annotation = get_type_hints(CameraTargetOptions, include_extras=True)[field]
    info = next(each for each in get_args(annotation) if isinstance(each, OptionInfo))
    # In an annotation Typer keeps the first name as the default.
    return str(info.default).split("/")[0]


def with_options(message: str, known: CameraTargetOptions) -> str:
    """Return a message that begins with keys, `key, key: ...`, with the options of those that were typed."""
    keys, colon, rest = message.partition(": ")
    return ", ".join(_named(key, known) for key in keys.split(", ")) + colon + rest


def _named(key: str, known: CameraTargetOptions) -> str:
    field = "coplanar" if key == "same_plane" and known.coplanar is not None else _FIELD_OF_KEY.get(key, key)
    is_typed = field in {each.name for each in fields(known)} and getattr(known, field) is not None
    return option_of(field) if is_typed else key
