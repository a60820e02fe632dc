from __future__ import annotations

import pytest

from circlepose.io.calibration.reader import read_camera_file
from tests.support.lens_formulas import POINTS, brown, check_pixels
from tests.support.refusals import refused_calibration

FOUR = [905.5, 907.0, 640.25, 355.75]
TWELVE = [-0.21, 0.09, 0.0004, -0.0002, 0.013, 0.02, -0.003, 0.001]


def model(name: str, coefficients: list[float], more: str = "") -> str:
    numbers = "".join(f" {each!r}," for each in [*FOUR, *coefficients])
    return (
        "# generated on 2024-05-01 10:11:12 with   mrcal-calibrate-cameras --lensmodel ...\n"
        "# this file was made by hand, as mrcal writes it\n"
        f"{{\n    'lensmodel':  '{name}',\n\n    # intrinsics are fx,fy,cx,cy,distortion0,distortion1,....\n"
        f"    'intrinsics': [{numbers}],\n\n    'valid_intrinsics_region': [\n    [ 0, 0 ],\n    [ 1279, 0 ],\n],\n\n"
        "    # extrinsics are rt_fromref\n    'extrinsics': [ 0.01, -0.2, 3e-1, 0, 0, 0,],\n\n"
        f"    'imagersize': [ 1280, 720,],\n{more}}}\n"
    )


@pytest.mark.parametrize("count", [0, 4, 5, 8])
def test_models_of_opencv(count: int) -> None:
    name = f"LENSMODEL_OPENCV{count}" if count else "LENSMODEL_PINHOLE"
    k = TWELVE[:count] + [0.0] * (8 - count)
    file = read_camera_file(model(name, TWELVE[:count]).encode())
    assert file.form == "mrcal cameramodel"
    assert file.camera.image_size == (1280, 720)
    radial, tangential = [k[0], k[1], *k[4:8]], (k[2], k[3])
    check_pixels(file.camera, [brown(p, (905.5, 907.0), (640.25, 355.75), radial, tangential) for p in POINTS])


def test_the_thin_prism_terms_of_opencv12() -> None:
    prism = [0.001, -0.0003, 0.0005, 0.0002]
    camera = read_camera_file(model("LENSMODEL_OPENCV12", TWELVE + prism).encode()).camera
    expected = []
    for p in POINTS:
        u, v = brown(
            p, (905.5, 907.0), (640.25, 355.75), [-0.21, 0.09, 0.013, 0.02, -0.003, 0.001], (0.0004, -0.0002)
        )
        r2 = (p[0] ** 2 + p[1] ** 2) / p[2] ** 2
        expected.append((u + 905.5 * (0.001 * r2 - 0.0003 * r2 * r2), v + 907.0 * (0.0005 * r2 + 0.0002 * r2 * r2)))
    check_pixels(camera, expected)


def test_the_inputs_of_the_optimization_are_passed_over() -> None:
    packed = "b'" + "P)h>@6aWAK2mk;8" * 20_000 + "'"
    content = model(
        "LENSMODEL_OPENCV4", TWELVE[:4], f"    'optimization_inputs': {packed},\n    'icam_intrinsics': 0,\n"
    )
    assert read_camera_file(content.encode()).camera.image_size == (1280, 720)


@pytest.mark.parametrize(
    ("name", "meant"),
    [
        ("LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=30_Ny=18_fov_x_deg=150", "mrcal-convert-lensmodel"),
        ("LENSMODEL_CAHVOR", "mrcal-convert-lensmodel"),
        ("LENSMODEL_CAHVORE_linearity=0.34", "mrcal-convert-lensmodel"),
        ("LENSMODEL_LATLON", "map of directions"),
        ("LENSMODEL_LONLAT", "map of directions"),
        ("LENSMODEL_STEREOGRAPHIC", "map of directions"),
        ("LENSMODEL_OPENCV6", "lensmodel"),
    ],
)
def test_a_model_that_we_lack_is_named(name: str, meant: str) -> None:
    assert meant in refused_calibration(model(name, TWELVE))


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (model("LENSMODEL_OPENCV8", TWELVE[:5]), "has 12 numbers"),
        (model("LENSMODEL_OPENCV4", TWELVE[:4]).replace("'imagersize'", "'imagesize'"), "imagersize"),
        (model("LENSMODEL_OPENCV4", TWELVE[:4]).replace("905.5", "nan"), "no dict of plain values"),
        (model("LENSMODEL_OPENCV4", TWELVE[:4]).replace("907.0", "'907'"), "intrinsics"),
        (model("LENSMODEL_OPENCV4", TWELVE[:4])[:-30], "no dict of plain values"),
        (model("LENSMODEL_OPENCV4", TWELVE[:4]).replace("[ 0, 0 ]", "[" * 3000), "no dict of plain values"),
        (
            model("LENSMODEL_OPENCV4", TWELVE[:4]).replace("[ 0, 0 ]", "__import__('os').getcwd()"),
            "no dict of plain values",
        ),
        (model("LENSMODEL_OPENCV4", TWELVE[:4]) + "#" * 200_000, "too long"),
    ],
)
def test_what_is_wrong_is_named(content: str, said: str) -> None:
    assert said in refused_calibration(content)


def test_it_has_no_names() -> None:
    assert "leave out the name" in refused_calibration(model("LENSMODEL_PINHOLE", []), "cam0")
