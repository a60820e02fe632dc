"""Our own calibration YAML, which holds all that a camera has: skew, standard deviations, and the target."""

from __future__ import annotations

import yaml

from circlepose.camera.camera import EXACT
from circlepose.camera.lens import FISHEYE_COUNT, PINHOLE_COUNTS
from circlepose.io.calibration.number_text import number_list_text, number_text
from circlepose.io.calibration.writers.writer import SIGMA, SKEW, TARGET, Contents, Lens, Writer
from circlepose.io.marks import COMMENT


def _text(contents: Contents) -> str:
    camera = contents.camera
    lines = [COMMENT, f"model: {camera.model}"]
    if camera.camera_matrix[0, 1]:
        rows = (f"[{number_list_text(row)}]" for row in camera.camera_matrix.tolist())
        lines.append(f"camera_matrix: [{', '.join(rows)}]")
    else:
        values = zip(("fx", "fy", "cx", "cy"), contents.focal_and_center, strict=True)
        lines += [f"{key}: {number_text(value)}" for key, value in values]
    lines.append(f"dist_coeffs: [{number_list_text(camera.dist_coeffs.tolist())}]")
    if camera.image_size is not None:
        lines.append("image_size: [{}, {}]".format(*camera.image_size))
    if camera.sigma != EXACT:
        lines.append(f"focal_sigma_px: {number_text(camera.sigma.focal_px)}")
        lines.append(f"center_sigma_px: {number_text(camera.sigma.center_px)}")
    text = "\n".join(lines) + "\n"
    if contents.target is None:
        return text
    return text + yaml.safe_dump({"target": dict(contents.target)}, sort_keys=False, default_flow_style=None)


WRITER = Writer(
    "circlepose",
    "circlepose",
    (*(Lens("pinhole", "pinhole", count) for count in PINHOLE_COUNTS), Lens("fisheye", "fisheye", FISHEYE_COUNT)),
    (".yaml", ".yml", ".yaml.gz", ".yml.gz"),
    _text,
    frozenset({SKEW, SIGMA, TARGET}),
    needs_size=False,
)
