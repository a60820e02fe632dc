"""Calibrations of every form to be fuzzed: the templates, the examples of the pages, and those that are no text."""

from __future__ import annotations

import io
import json
import re
import struct
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from scipy.io import savemat

from circlepose.camera.camera import Camera
from circlepose.io.calibration.reader import CameraFile
from circlepose.io.calibration.writers.storage_syntax import yaml_text
from circlepose_cli.reports.camera import describe, report_record

_ROOT = Path(__file__).resolve().parents[3]
_FENCE = re.compile(r"^```(json|matlab|text|xml|ini|toml|yaml)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_MATRIX = [600.0, 0.0, 319.5, 0.0, 600.0, 239.5, 0.0, 0.0, 1.0]
_DIST = [-0.2, 0.1, 0.0, 0.0, 0.0]
_K, _D = np.reshape(_MATRIX, (3, 3)), np.array([_DIST])


def text_calibrations() -> Mapping[str, bytes]:
    """Return calibrations that are text, by a name."""
    templates = sorted((_ROOT / "configs" / "calibration").iterdir())
    found = {path.stem: path.read_bytes() for path in templates}
    for page in sorted((_ROOT / "docs" / "calibrations").glob("*.md")):
        for number, (language, text) in enumerate(_FENCE.findall(page.read_text(encoding="utf-8"))):
            found[f"{page.stem} {language}{f' {number}' if number else ''}"] = text.encode()
    return {**found, **_storages(), **_without_template(), "report whole": _report()}


def binary_calibrations() -> Mapping[str, bytes]:
    """Return calibrations that are no text, by a name."""
    structure = {"RadialDistortion": [-0.2, 0.1], "IntrinsicMatrix": _K.T, "ImageSize": [480.0, 640.0], "Units": "mm"}
    bouguet = {"fc": [[600.0], [600.0]], "cc": [[319.5], [239.5]], "kc": _D.T, "nx": 640, "ny": 480}
    return {
        "mat": _mat(K=_K, D=_D, width=640, height=480),
        "mat compressed": _mat(is_compressed=True, mtx=_K, dist=_D, width=640, height=480),
        "mat structure": _mat(params=structure),
        "mat bouguet": _mat(**bouguet),
        "npz": _npz(np.savez),
        "npz packed": _npz(np.savez_compressed),
        "colmap": struct.pack("<QiiQQ8d", 1, 1, 4, 640, 480, 600.0, 600.0, 320.0, 240.0, -0.2, 0.1, 0.0, 0.0),
    }


def _npz(save: Callable[..., None]) -> bytes:
    handle = io.BytesIO()
    save(handle, mtx=_K, dist=_D, image_size=np.array([640, 480]))
    return handle.getvalue()


def _mat(*, is_compressed: bool = False, **variables: object) -> bytes:
    handle = io.BytesIO()
    savemat(handle, variables, do_compression=is_compressed)
    # It states when it was written, and a case is to be the same each time.
    return b"MATLAB 5.0 MAT-file".ljust(116) + handle.getvalue()[116:]


def _report() -> bytes:
    """Return what `circlepose camera --format json` prints."""
    camera = Camera.create(_K, _D, (640, 480))
    return json.dumps(report_record(describe(CameraFile(camera, "circlepose", Path("a")))), indent=2).encode()


def _storages() -> dict[str, bytes]:
    node = {"type_id": "opencv-matrix", "rows": 3, "cols": 3, "dt": "d", "data": _MATRIX}
    dist = {"type_id": "opencv-matrix", "rows": 1, "cols": 5, "dt": "d", "data": _DIST}
    document = {"image_width": 640, "image_height": 480, "camera_matrix": node, "distortion_coefficients": dist}
    xml = ['<?xml version="1.0"?>', "<opencv_storage>", "<image_width>640</image_width>"]
    xml += ["<image_height>480</image_height>", *_xml_matrix("camera_matrix", 3, 3, _MATRIX)]
    xml += [*_xml_matrix("distortion_coefficients", 1, 5, _DIST), "</opencv_storage>", ""]
    return {
        "opencv json": json.dumps(document, indent=1).encode(),
        "opencv xml": "\n".join(xml).encode(),
        "written": yaml_text(
            {"camera_matrix": _K, "distortion_coefficients": np.zeros((1, 5)), "fisheye_model": 0}
        ).encode(),
    }


def _without_template() -> dict[str, bytes]:
    """Return calibrations in forms without a template or an example."""
    rows = "\n".join(" ".join(map(repr, _MATRIX[3 * row : 3 * row + 3])) for row in range(3))
    ini = f"[image]\n\nwidth\n640\n\nheight\n480\n\n[left]\n\ncamera matrix\n{rows}\n\ndistortion\n-0.2 0.1 0 0 0\n"
    message = f"height: 480\nwidth: 640\ndistortion_model: plumb_bob\nd: {_DIST}\nk: {_MATRIX}\nbinning_x: 0\n---\n"
    left = {
        "intrinsics": {"fx": 600.0, "fy": 600.0, "cx": 319.5, "cy": 239.5},
        "distortion": {"k1": -0.2, "k2": 0.1, "model": "radtan"},
        "image_shape": [480, 640, 3],
    }
    right = {"K": _MATRIX, "distCoef": _DIST, "resolution": "640x480"}
    keys = {"left": left, "right": right, "rms": 0.2, "date": "today"}
    return {
        "ros ini": ini.encode(),
        "ros messages": (message * 2).encode(),
        "keys and values": json.dumps(keys, indent=1).encode(),
    }


def _xml_matrix(name: str, rows: int, cols: int, numbers: list[float]) -> list[str]:
    data = " ".join(map(repr, numbers))
    size = [f"<rows>{rows}</rows>", f"<cols>{cols}</cols>", "<dt>d</dt>"]
    return [f'<{name} type_id="opencv-matrix">', *size, f"<data>{data}</data>", f"</{name}>"]
