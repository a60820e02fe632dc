from __future__ import annotations

import pytest

from circlepose.camera.camera import Camera
from circlepose.io.calibration.writers.lens_choice import exact_lens
from circlepose.io.calibration.writers.registry import WRITERS
from tests.support.written_cameras import MATRIX, SIZE


@pytest.mark.parametrize(
    ("form", "coefficients", "name"),
    [
        # As many as there are, if the form has a model of so many.
        ("colmap", [0.1, 0.0, 0.0, 0.0], "OPENCV"),
        ("colmap", [0.0] * 8, "FULL_OPENCV"),
        ("mrcal", [0.1] * 5, "LENSMODEL_OPENCV5"),
        # Zeros at the end are left out, and filled in.
        ("mrcal", [0.1] * 4 + [0.0] * 10, "LENSMODEL_OPENCV4"),
        ("ros", [0.1] * 4, "plumb_bob"),
        ("ros", [0.1] * 6 + [0.0] * 6, "rational_polynomial"),
        ("ros", [], "plumb_bob"),
        # A term that is not 0 is never left out.
        ("ros", [0.0] * 8 + [0.1, 0.0, 0.0, 0.0], None),
        ("kalibr", [0.0, 0.0, 0.0, 0.0, 1e-300], None),
    ],
)
def test_the_model_of_a_form_that_holds_a_camera(form: str, coefficients: list[float], name: str | None) -> None:
    lens = exact_lens(Camera.create(MATRIX, coefficients, SIZE), WRITERS[form])  # type: ignore[index]
    assert (lens and lens.name) == name
