from __future__ import annotations

import pytest

from circlepose.io.calibration.reader import read_camera_file
from tests.support.lens_formulas import SIZE, check_terms
from tests.support.refusals import refused_calibration

TERMS = {"k1": -0.215, "k2": 0.094, "p1": 4.5e-4, "p2": -2.5e-4, "k3": 0.013}
CAMERA = """S_00: 1.280000e+03 9.600000e+02
K_00: 1.180500e+03 0.000000e+00 6.557500e+02 0.000000e+00 1.176250e+03 4.705000e+02 0.0 0.0 1.0
D_00: -2.150000e-01 9.400000e-02 4.500000e-04 -2.500000e-04 1.300000e-02
R_00: 1.000000e+00 0.000000e+00 0.000000e+00 0.000000e+00 1.000000e+00 0.000000e+00 0.0 0.0 1.0
S_rect_00: 1.242000e+03 3.750000e+02
"""
HEAD = "calib_time: 05-May-2012 10:00:00\ncorner_dist: 9.950000e-02\n"


def test_the_raw_cameras() -> None:
    other = CAMERA.replace("_00", "_02").replace("-2.150000e-01", "-1.150000e-01")
    text = f"{HEAD}{CAMERA}{other}".encode()
    first = read_camera_file(text)
    assert (first.form, first.camera.image_size, first.doubts) == ("KITTI", SIZE, ())
    assert any("rectified ones (of S_rect_00) write fx, fy, cx, cy of P_rect_00" in note for note in first.notes)
    check_terms(first, TERMS)
    for name in ("02", "2", "image_02", "K_02"):
        check_terms(read_camera_file(text, name), {**TERMS, "k1": -0.115})


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("D_00: -2.15", "D_00: -2,15", "line 5: D_00: expected 4 or 5 or 8 numbers, got '-2,15"),
        (" 1.300000e-02", "", None),
        ("S_00: 1.280000e+03 9.600000e+02", "S_00: 1", "line 3: S_00: expected 2 numbers, got 1"),
        ("K_00: 1.180500e+03", "K_00:", "K_00: expected 9 numbers, got 8"),
        ("R_00:", "K_00:", "line 6: K_00: is given twice"),
    ],
)
def test_slips_are_named_with_their_line(old: str, new: str, says: str | None) -> None:
    text = f"{HEAD}{CAMERA}".replace(old, new)
    if says is None:
        check_terms(read_camera_file(text.encode()), {**TERMS, "k3": 0.0})
    else:
        assert says in refused_calibration(text)
    assert "holds no camera '09'; its cameras are 00" in refused_calibration(f"{HEAD}{CAMERA}", "9")
