"""`print_scale` in a target file: all lengths as they were printed, and what no circle can stand for."""

from __future__ import annotations

import numpy as np
import pytest

from circlepose.errors import TargetError
from circlepose.io.target_file import read_drawn_target, read_target, target_from_mapping, target_to_mapping

GRID = {"pattern": "symmetric", "rows": 3, "columns": 4, "spacing_mm": 30.0}
BOARD = {"kind": "board", "radius_mm": 8.0, "grid": GRID, "marks": [{"at": [1, 2], "radius_mm": 6.0}]}
LIST = {
    "kind": "board",
    "circles": [
        {"name": "a", "x_mm": 0.0, "y_mm": 0.0, "radius_mm": 10.0},
        {"name": "b", "x_mm": 80.0, "y_mm": 15.0, "radius_mm": 6.0},
        {"name": "c", "x_mm": 20.0, "y_mm": 60.0, "radii_mm": [8.0, 4.0]},
    ],
}


def target(mapping, scale):
    return target_from_mapping({**mapping, "print_scale": scale}, "t.yaml")


def plain(mapping):
    return target_from_mapping(mapping, "t.yaml")


@pytest.mark.parametrize("scale", [0.99, 1, 1.002])
@pytest.mark.parametrize(
    "mapping", [{"radius_mm": 60.0}, {"kind": "coplanar", "radii_mm": [50.0, 30.0]}, BOARD, LIST]
)
def test_one_number_multiplies_all_lengths(mapping, scale):
    scaled = target(mapping, scale)
    assert scaled.radii_mm == pytest.approx([scale * radius for radius in plain(mapping).radii_mm])
    if scaled.layout is not None:
        assert np.allclose(scaled.layout.centers_mm, scale * plain(mapping).layout.centers_mm)
        assert np.allclose(scaled.layout.radius_mm, scale * plain(mapping).layout.radius_mm)
    # It is written with the lengths that it has.
    assert plain(target_to_mapping(scaled)) == scaled


def test_a_scaled_grid_remains_one():
    scaled = target(BOARD, 1.0037)
    assert target_to_mapping(scaled)["grid"]["spacing_mm"] == pytest.approx(30.0 * 1.0037)
    assert [mark["at"] for mark in target_to_mapping(scaled)["marks"]] == [[1, 2]]


@pytest.mark.parametrize("mapping", [BOARD, LIST])
def test_two_numbers_move_places_along_each_axis_and_radii_by_their_mean(mapping):
    scaled, nominal = target(mapping, {"x": 1.0006, "y": 0.9998}).layout, plain(mapping).layout
    assert np.allclose(scaled.centers_mm, nominal.centers_mm * [1.0006, 0.9998, 1.0])
    assert np.allclose(scaled.radius_mm, nominal.radius_mm * np.sqrt(1.0006 * 0.9998))


def test_the_axes_of_a_list_are_those_of_its_sheet():
    tilt = np.radians(30.0)
    rotation = np.array([[1, 0, 0], [0, np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), np.cos(tilt)]])
    circles = []
    for circle in LIST["circles"]:
        x, y, z = (rotation @ [circle["x_mm"], circle["y_mm"], 0.0]).tolist()
        normal = (rotation @ [0.0, 0.0, -1.0]).tolist()
        circles.append({**circle, "x_mm": x, "y_mm": y, "z_mm": z, "normal": normal})
    scaled = target({"kind": "board", "circles": circles}, {"x": 1.0006, "y": 0.9998}).layout
    flat = target(LIST, {"x": 1.0006, "y": 0.9998}).layout
    assert np.allclose(scaled.centers_mm @ rotation, flat.centers_mm)


@pytest.mark.parametrize("scale", [1.0005, {"x": 1.0005, "y": 1.0005}])
def test_both_forms_say_the_same(scale):
    assert target(BOARD, scale) == target(BOARD, 1.0005)


@pytest.mark.parametrize(
    ("mapping", "scale", "said"),
    [
        (BOARD, {"x": 1.002, "y": 0.998}, "print_scale: x and y differ by 0.401 %, so the discs are ellipses"),
        ({"radius_mm": 60.0}, {"x": 1.0, "y": 0.9988}, "x and y differ by 0.12 %"),
        (BOARD, 100.2, "print_scale: expected measured length / stated length .* from 0.5 to 2, got 100.2"),
        (BOARD, 0, "from 0.5 to 2, got 0"),
        (BOARD, {"x": 1.002}, "print_scale: y: "),
        (BOARD, {"x": 1.002, "y": 1.0, "z": 1.0}, "print_scale: z: is no known key"),
        (BOARD, {"x": "1.002", "y": 1.0}, "print_scale: x: expected one number"),
        (BOARD, "1.002", "print_scale: expected measured length / stated length"),
        (BOARD, [1.0, 1.0], "print_scale: expected measured length / stated length"),
        (BOARD, True, "print_scale: expected measured length / stated length"),
        (
            {"kind": "coaxial", "radii_mm": [45.0, 30.0]},
            1.0,
            "print_scale: is of a sheet, and a coaxial target is none",
        ),
        ({**BOARD, "shape_file": "c.json"}, 1.0, "print_scale, shape_file: give one of them"),
        (
            {
                "kind": "board",
                "circles": [*LIST["circles"], {"x_mm": 50.0, "y_mm": 80.0, "z_mm": 9.0, "radius_mm": 5.0}],
            },
            1.0,
            "print_scale: is of a sheet, and these circles do not lie in one plane",
        ),
    ],
)
def test_what_cannot_be_meant_is_refused(mapping, scale, said):
    with pytest.raises(TargetError, match=f"^t.yaml: .*{said}"):
        target(mapping, scale)


def test_up_to_a_thousandth_the_discs_are_taken_for_circles():
    assert target({"radius_mm": 60.0}, {"x": 1.0005, "y": 0.9996}).radii_mm[0] == pytest.approx(60.0, abs=0.003)


def test_what_is_drawn_does_not_depend_on_what_was_printed(tmp_path):
    path = tmp_path / "t.yaml"
    path.write_text("radius_mm: 60\nprint_scale: {x: 1.02, y: 0.99}\n")
    drawn, scale = read_drawn_target(path)
    assert drawn == plain({"radius_mm": 60.0})
    assert (scale.x, scale.y) == (1.02, 0.99)
    with pytest.raises(TargetError, match="circlepose print"):
        read_target(path)
