"""OpenCV's FileStorage, under the keys of OpenCV's own calibration samples.

Pixels and coefficients are ours: an integer pixel coordinate is a pixel's center. OpenCV's models have no skew:
cv2.projectPoints reads fx, fy, cx, cy of the matrix and passes over the entry between them.
Source: samples/cpp/calibration.cpp (`image_width`, `camera_matrix`, `distortion_coefficients`), `fisheye_model` of
samples/cpp/tutorial_code/calib3d/camera_calibration, and the deviations of OpenCV's interactive calibration.
"""

from __future__ import annotations

import numpy as np

from circlepose.camera.camera import EXACT, Camera
from circlepose.camera.lens import PINHOLE_COUNTS
from circlepose.io.calibration.writers.storage_syntax import StorageEntries, json_text, xml_text, yaml_text
from circlepose.io.calibration.writers.writer import SIGMA, Contents, Lens, Writer

_HEADER = "%YAML:1.0"


def storage_entries(camera: Camera) -> StorageEntries:
    """Return what FileStorage holds of a camera."""
    entries: dict[str, int | str | np.ndarray[tuple[int, ...], np.dtype[np.float64]]] = {}
    if camera.image_size is not None:
        entries = {"image_width": camera.image_size[0], "image_height": camera.image_size[1]}
    sigma = camera.sigma
    if sigma != EXACT:
        entries["camera_matrix_std_dev"] = np.array([[sigma.focal_px] * 2 + [sigma.center_px] * 2]).T
    return {
        **entries,
        "fisheye_model": int(camera.model == "fisheye"),
        "camera_matrix": camera.camera_matrix,
        "distortion_coefficients": camera.dist_coeffs[None, :],
    }


def _text(contents: Contents) -> str:
    entries = storage_entries(contents.camera)
    ending = contents.ending.removesuffix(".gz")
    if ending == ".xml":
        return xml_text(entries)
    return json_text(entries) if ending == ".json" else yaml_text(entries, _HEADER)


def _lenses() -> tuple[Lens, ...]:
    counts = [count for count in PINHOLE_COUNTS if count]
    return *(Lens(f"pinhole of {count} coefficients", "pinhole", count) for count in counts), Lens(
        "fisheye", "fisheye", 4
    )


WRITER = Writer(
    "opencv",
    "OpenCV FileStorage",
    _lenses(),
    (".yaml", ".yml", ".xml", ".json", ".yaml.gz", ".yml.gz", ".xml.gz", ".json.gz"),
    _text,
    frozenset({SIGMA}),
    needs_size=False,
)
