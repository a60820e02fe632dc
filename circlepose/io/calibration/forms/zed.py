"""Stereolabs' ZED cameras: the .conf of a serial number, a section for each side and resolution."""

from __future__ import annotations

import re
from collections.abc import Mapping

from circlepose.io.calibration.assembly import assemble
from circlepose.io.calibration.cameras import fields_of
from circlepose.io.calibration.document import Document
from circlepose.io.calibration.form import Form, Reading, choose

_SECTION = re.compile(r"(LEFT|RIGHT)_CAM_(\w+)")
_TERM = re.compile(r"[kps]\d")
_SIZES: Mapping[str, tuple[int, int]] = {
    "2K": (2208, 1242),
    "FHD1200": (1920, 1200),
    "FHD": (1920, 1080),
    "HD": (1280, 720),
    "SVGA": (960, 600),
    "VGA": (672, 376),
}
"""by the name of the resolution"""


def _recognizes(document: Document) -> bool:
    """Whether a section has the name that the ZED's have."""
    return bool(_cameras(document))


def _read(document: Document, camera_name: str | None) -> Reading:
    """Return the camera of a section, with the size that its name says; distortion may stand in one for each side."""
    where, cameras = document.name, _cameras(document)
    name, notes = choose(list(cameras), camera_name, where)
    match = _SECTION.fullmatch(name)
    size = _SIZES.get(match[2]) if match else None
    entries = dict(cameras[name])
    apart_key = f"{name.partition('_')[0]}_DISTO"
    apart = document.entries.get(apart_key)
    if isinstance(apart, Mapping):
        own = [key for key in entries if _TERM.fullmatch(key.lower())]
        if any(entries[key] != 0 for key in own):
            notes += (f"the distortion of [{name}] is used, not [{apart_key}]",)
        else:
            entries = {key: value for key, value in entries.items() if key not in own} | {"distortion": apart}
    if size is not None:
        entries |= {"width": size[0], "height": size[1]}
        notes += (f"the image size {size[0]} x {size[1]} px is that of the resolution {match[2] if match else ''}",)
    notes += ("it holds for raw images of the ZED, not for the rectified ones that its SDK gives",)
    reading = assemble(fields_of(entries), f"{where}: {name}")
    return Reading(reading.camera, notes + reading.notes, reading.keys)


def _cameras(document: Document) -> dict[str, Mapping[str, object]]:
    return {
        key: value
        for key, value in document.entries.items()
        if isinstance(key, str) and isinstance(value, Mapping) and _SECTION.fullmatch(key) and "fx" in value
    }


FORM = Form("ZED", _recognizes, _read)
