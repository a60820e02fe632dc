from __future__ import annotations

import math
import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from circlepose.errors import TargetError, UsageError
from circlepose.io.target_file import find_beside, read_target, target_from_mapping, target_to_mapping, write_target
from circlepose.targets.hints import DirectionHint
from circlepose.targets.target import AxisIntervals, Target

LENGTH = st.floats(1e-3, 1e6)


@st.composite
def intervals(draw: st.DrawFn) -> tuple[float, float]:
    low, high = sorted((draw(LENGTH), draw(LENGTH)))
    return low, high + 1.0


@st.composite
def targets(draw: st.DrawFn) -> Target:
    kind = draw(st.sampled_from(["circle", "coplanar", "coaxial"]))
    number = {"circle": 1, "coplanar": draw(st.integers(2, 4)), "coaxial": 2}[kind]
    radii = tuple(sorted(draw(st.lists(LENGTH, min_size=number, max_size=number, unique=True)), reverse=True))
    generatrix = radii[0] + draw(LENGTH) if kind == "coaxial" and draw(st.booleans()) else None
    axes = st.none() | st.builds(AxisIntervals, st.none() | intervals(), st.none() | intervals())
    lone = kind == "circle"
    hint = st.builds(DirectionHint, st.just((0.3, -0.5, -2.0)), st.floats(60.0, 180.0)) if lone else st.none()
    side = st.sampled_from(["left", "right", "up", "down", (1.0, -0.5, 0.0)]) if lone else st.none()
    plane = draw(st.sampled_from(["auto", "no", "yes"] if lone else ["auto", "no"]))
    return Target(
        kind=kind,  # type: ignore[arg-type]
        radii_mm=radii,
        generatrix_mm=generatrix,
        count=draw(st.none() | st.integers(2, 99)) if plane == "yes" else draw(st.none() | st.integers(1, 99)),
        same_plane=plane,  # type: ignore[arg-type]
        polarity=draw(st.sampled_from(["any", "dark", "bright"])),
        axis_intervals=draw(axes),
        depth_range_mm=draw(st.none() | intervals()),
        normal_hint=draw(st.none() | hint),
        up_hint=draw(st.none() | hint),
        facing=draw(st.none() | side),
    )


@given(targets())
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)
def test_what_is_written_is_read_back(tmp_path: Path, target: Target) -> None:
    assert target_from_mapping(target_to_mapping(target), "f") == target
    write_target(target, tmp_path / "target.yaml")
    assert read_target(tmp_path / "target.yaml") == target


def test_every_key() -> None:
    text = (
        b"kind: coaxial\nradii_mm: [45, 30]\ngeneratrix_mm: 4.521e1\ncount: all\npolarity: dark\n"
        b"axis_intervals_px: {major: [40, 400], minor: [1e1, 400]}\ndepth_range_mm: [300, 2000]\n"
    )
    assert read_target(text) == Target(
        kind="coaxial",
        radii_mm=(45.0, 30.0),
        generatrix_mm=45.21,
        count=None,
        polarity="dark",
        axis_intervals=AxisIntervals((40.0, 400.0), (10.0, 400.0)),
        depth_range_mm=(300.0, 2000.0),
    )


def test_hints() -> None:
    text = (
        b"radius_mm: 60\nnormal_hint: {direction: [0, -1, -0.5], spread_deg: 15}\n"
        b"up_hint: {direction: [0, -3, 0]}\nfacing: [0, -1, 0]\n"
    )
    target = read_target(text)
    assert target.normal_hint == DirectionHint((0.0, -1.0, -0.5), 15.0)
    assert target.up_hint == DirectionHint((0.0, -3.0, 0.0), 10.0)
    assert target.facing == (0.0, -1.0, 0.0)
    assert read_target(b"radius_mm: 60\nnormal_hint: {direction: [0, -1, -0.5]}").normal_hint.spread_deg == 20.0
    assert read_target(b"radius_mm: 60\nfacing: up").facing == "up"


def test_a_radius_alone_is_one_circle() -> None:
    assert read_target(b"radius_mm: 60\n") == Target.circle(60.0)


def test_height_gives_the_generatrix() -> None:
    target = read_target(b"kind: coaxial\nradii_mm: [45, 30]\nheight_mm: 20\n")
    assert target.generatrix_mm == pytest.approx(math.sqrt(20**2 + 15**2), rel=1e-15)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("radius_mm: 60\ncolour: red", "colour: is no known key; the keys are kind, radius_mm"),
        ("radius_mm: 60\npolarty: dark", "polarty: is no known key; did you mean polarity?"),
        ("Radius_mm: 60", "Radius_mm: is no known key; did you mean radius_mm?"),
        ("radius: 60", "radius: does not say its unit; write radius_mm"),
        ("Radius: 60", "Radius: does not say its unit"),
        ("diameter: 120", "diameter: does not say its unit; write radius_mm"),
        ("diameter_mm: 120", "diameter_mm: the file takes a radius in mm; write radius_mm: 60."),
        ("radius_m: 0.06", "radius_m: the file takes a radius in mm; write radius_mm: 60."),
        ("radius_cm: 6", "write radius_mm: 60."),
        ("diameter_m: [0.1, 0.2]", "diameter_m: does not say"),
        ("radius_mm: -60", "radius_mm: expected a positive radius in mm (not a diameter), got -60"),
        ("radius_mm: 0", "radius_mm: expected a positive radius"),
        ("radius_mm: sixty", "radius_mm: expected one number, the radius (not the diameter) in mm, got 'sixty'"),
        ("radius_mm: 60 mm", "got '60 mm'"),
        ("radius_mm: 60,5", "got '60,5'"),
        ("radius_mm: true", "radius_mm: expected one number, the radius (not the diameter) in mm, got True"),
        ("radius_mm: .nan", "radius_mm: expected one number"),
        ("radius_mm: .inf", "radius_mm: expected one number"),
        ("radius_mm: [60]", "radius_mm: expected one number"),
        ("radius_mm:", "radius_mm: has no value; expected one number"),
        ("radius_mm: 50\nradii_mm: [50, 30]", "radius_mm, radii_mm: give one of them"),
        ("radii_mm: [50, 30]", "kind: is missing; radii_mm goes with kind: coplanar or kind: coaxial"),
        ("kind: circle", "radius_mm: is missing"),
        ("count: 2", "radius_mm: is missing"),
        ("kind: circle\nradii_mm: [50]", "radius_mm: is missing"),
        ("kind: coplanar\nradius_mm: 50", "radii_mm: is missing; a coplanar target needs its radii"),
        ("kind: coplanar\nradii_mm: [30, 50]", "radii_mm: expected the outer radius first"),
        ("kind: coplanar\nradii_mm: [50, 50]", "radii_mm: expected the outer radius first"),
        ("kind: coplanar\nradii_mm: [50]", "radii_mm: a target of kind coplanar has two or more radii, got 1"),
        ("kind: coaxial\nradii_mm: [50, 40, 30]", "radii_mm: a target of kind coaxial has two radii, got 3"),
        ("kind: coplanar\nradii_mm: [50, x]", "radii_mm: expected a list of radii in mm, the largest first"),
        ("kind: coplanar\nradii_mm: 50", "radii_mm: expected a list of radii"),
        ("kind: ring\nradius_mm: 50", "kind: expected one of circle, coplanar, coaxial, board, got 'ring'"),
        ("kind: coplanar\nradii_mm: [50, 30]\ngeneratrix_mm: 20", "generatrix_mm: only a coaxial target has one"),
        ("kind: coaxial\nradii_mm: [50, 30]\ngeneratrix_mm: 20", "generatrix_mm: must be longer than"),
        ("kind: coaxial\nradii_mm: [50, 30]\ngeneratrix_mm: 40\nheight_mm: 5", "give one of them, not both"),
        ("kind: coaxial\nradii_mm: [50, 30]\nheight_mm: 0", "height_mm: expected a positive height"),
        ("radius_mm: 50\nheight_mm: 5", "height_mm: expected a positive height in mm of a coaxial target"),
        ("radius_mm: 60\ncount: 0", "count: expected a whole number of at least 1 or 'all', got 0"),
        ("radius_mm: 60\ncount: 1.5", "count: expected a whole number of at least 1, or `all`, got 1.5"),
        ("radius_mm: 60\ncount: many", "count: expected a whole number of at least 1, or `all`, got 'many'"),
        ("radius_mm: 60\ncount: true", "count: expected a whole number"),
        ("radius_mm: 60\npolarity: black", "polarity: expected one of any, dark, bright, got 'black'"),
        ("radius_mm: 60\naxis_intervals_px: [1, 2]", "axis_intervals_px: expected a mapping with the keys major"),
        ("radius_mm: 60\naxis_intervals_px: {mayor: [1, 2]}", "axis_intervals_px.mayor: is no known key; did you"),
        ("radius_mm: 60\naxis_intervals_px: {major: [1]}", "axis_intervals_px.major: expected [shortest, longest]"),
        (
            "radius_mm: 60\naxis_intervals_px: {major: [9, 2]}",
            "axis_intervals_px.major: expected [smallest, largest]",
        ),
        ("radius_mm: 60\ndepth_range_mm: [2000, 300]", "depth_range_mm: expected [smallest, largest]"),
        ("radius_mm: 60\ndepth_range_mm: 2000", "depth_range_mm: expected [nearest, farthest] distance in mm, got"),
        (
            "radius_mm: 60\nnormal_hint: [0, 0, -1]",
            "normal_hint: expected a mapping with direction: a direction [x, y",
        ),
        (
            "radius_mm: 60\nnormal_hint: {spread_deg: 5}",
            "normal_hint.direction: is missing; expected a direction [x, y, z]",
        ),
        (
            "radius_mm: 60\nnormal_hint: {direction: [0, -1]}",
            "normal_hint.direction: expected a direction [x, y, z]",
        ),
        (
            "radius_mm: 60\nnormal_hint: {direction: [0, 0, 0]}",
            "normal_hint.direction: expected a direction [x, y, z] of",
        ),
        ("radius_mm: 60\nnormal_hint: {direction: [0, 0, 1]}", "normal_hint.direction: points away from the camera"),
        (
            "radius_mm: 60\nnormal_hint: {direction: [0, 0, -1], spread_deg: 0}",
            "normal_hint.spread_deg: expected a positive angle",
        ),
        ("radius_mm: 60\nnormal_hint: {up: [0, 0, 1]}", "normal_hint.up: is no known key; the keys are direction"),
        ("radius_mm: 60\nup_hint: {direction: [0, 0, 0]}", "up_hint.direction: expected a direction [x, y, z] of a"),
        (
            "radius_mm: 60\nup_hint: {direction: [0, 1, 0], spread_deg: -1}",
            "up_hint.spread_deg: expected a positive angle",
        ),
        (
            "radius_mm: 60\nup_hint: {direction: [0, 1, 0], spread_deg: 5}\n"
            "normal_hint: {direction: [1, 0, -0.2], spread_deg: 5}",
            "normal_hint, up_hint: exclude each other: the normal is 90 deg from the vertical",
        ),
        (
            "radius_mm: 60\nfacing: left\nnormal_hint: {direction: [1, 0, -0.2], spread_deg: 5}",
            "normal_hint, facing: exclude each other: the normal is 169 deg from the side that is faced",
        ),
        ("radius_mm: 60\nfacing: sideways", "facing: expected left, right, up, down, or a direction [x, y, z]"),
        ("radius_mm: 60\nfacing: [0, 0, 0]", "facing: expected a direction [x, y, z] of a length other than 0"),
        ("radius_mm: 60\nfacing: [1, 0]", "facing: expected left, right, up, down, or a direction"),
        ("kind: coplanar\nradii_mm: [50, 30]\nfacing: up", "facing: is a hint for lone circles, kind: circle; this"),
        (
            "kind: coaxial\nradii_mm: [50, 30]\nnormal_hint: {direction: [0, 0, -1]}",
            "normal_hint: is a hint for lone circles",
        ),
        ("radius_mm: 60\nradius_mm: 50", "'radius_mm' is given twice"),
        ("1: 2", "1: is no known key"),
        ("60", "expected keys and values, such as `radius_mm: 60`"),
    ],
)
def test_what_is_refused_names_the_key_and_what_is_expected(text: str, says: str) -> None:
    with pytest.raises(TargetError) as caught:
        read_target(text.encode())
    message = str(caught.value)
    assert says in message
    assert message.startswith("<bytes>")
    assert message[-1] in ".?"
    assert "\n" not in message


def test_the_place_of_a_mapping_leads_the_message() -> None:
    with pytest.raises(TargetError, match=r"^cam\.yaml: target: radius_mm: expected a positive radius"):
        target_from_mapping({"radius_mm": -1.0}, "cam.yaml: target")


def test_target_beside_the_images(tmp_path: Path) -> None:
    assert find_beside(tmp_path, "target") is None
    (tmp_path / "target.yml").write_text("radius_mm: 60\n")
    assert find_beside(tmp_path, "target") == tmp_path / "target.yml"
    (tmp_path / "target.yaml").write_text("radius_mm: 60\n")
    with pytest.raises(UsageError, match=r"holds both target\.yaml and target\.yml"):
        find_beside(tmp_path, "target")
    (tmp_path / "target.yml").unlink()
    assert find_beside(tmp_path, "target") == tmp_path / "target.yaml"
    assert find_beside(tmp_path / "none", "target") is None


def test_what_is_beside_the_images_and_is_no_file(tmp_path: Path) -> None:
    path = tmp_path / "camera.yaml"
    path.symlink_to(tmp_path / "elsewhere.yaml")
    with pytest.raises(UsageError, match=r"camera\.yaml: is a link to a file that is not there; put the file itself"):
        find_beside(tmp_path, "camera")
    path.unlink()
    path.mkdir()
    with pytest.raises(UsageError, match=r"camera\.yaml: is a folder"):
        find_beside(tmp_path, "camera")
    path.rmdir()
    os.mkfifo(path)
    with pytest.raises(UsageError, match=r"camera\.yaml: is a pipe or a device"):
        find_beside(tmp_path, "camera")


@pytest.mark.parametrize(
    ("text", "meaning"),
    [
        ("", "auto"),
        ("same_plane: auto", "auto"),
        ("same_plane: yes", "yes"),
        ("same_plane: 'yes'", "yes"),
        ("same_plane: true", "yes"),
        ("same_plane: no", "no"),
        ("same_plane: 'no'", "no"),
        ("same_plane: false", "no"),
        ("coplanar: true", "yes"),
        ("coplanar: false", "no"),
    ],
)
def test_what_is_said_of_a_common_plane(text, meaning):
    assert read_target(f"radius_mm: 5\ncount: all\n{text}\n".encode()).same_plane == meaning


def test_what_may_be_said_of_a_common_plane_is_named():
    with pytest.raises(TargetError, match="same_plane: expected one of auto, yes, no"):
        read_target(b"radius_mm: 5\ncount: all\nsame_plane: perhaps\n")
