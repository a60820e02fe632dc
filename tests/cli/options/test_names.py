"""Messages name what was typed: the option, not the key of a file or the parameter of the library."""

from __future__ import annotations

from dataclasses import fields

import pytest
import typer.main

from circlepose_cli.app import app
from circlepose_cli.options.camera_target import CameraTargetOptions
from circlepose_cli.options.names import option_of, with_options

DECLARED = {
    option
    for parameter in typer.main.get_command(app).commands["estimate"].params
    for option in (*parameter.opts, *parameter.secondary_opts)
}


@pytest.mark.parametrize("field", [field.name for field in fields(CameraTargetOptions)])
def test_the_option_of_a_field_is_one_of_the_command(field):
    assert option_of(field) in DECLARED


def test_only_what_was_typed_is_named():
    known = CameraTargetOptions(normal=(0.0, 0.0, 1.0))
    assert with_options("normal_hint, facing: a: b", known) == "--normal, facing: a: b"
    assert with_options("up_hint.direction: x", known) == "up_hint.direction: x"
    assert with_options("no key at all", known) == "no key at all"


@pytest.mark.parametrize(
    ("typed", "message"),
    [
        ("--coplanar", "needs several circles in each image, but one is looked for; give --count N or --count all."),
        ("--same-plane yes", "circlepose: --same-plane: needs several circles in each image"),
        ("--same-plane no --coplanar", "--same-plane, --coplanar: give one of them, not both."),
        ("--coplanar --count 1", "needs several circles in each image, but one is looked for"),
        ("--normal 0,0,1", "--normal: points away from the camera"),
        ("--normal 1e300,0,0", "--normal: expected a direction"),
        ("--normal 0,0,-1 --normal-spread-deg nan", "--normal-spread-deg: expected a positive angle"),
        ("--up 1e300,0,0", "--up: expected a direction"),
        ("--up 0,1,0 --up-spread-deg 900", "--up-spread-deg: expected a positive angle"),
        ("--facing 1e300,0,0", "--facing: expected a direction"),
        ("--normal 0,0,-1 --up 1,0,0 --normal-spread-deg 1", "--normal, --up: exclude each other"),
        ("--radius-sigma-mm 100", "--radius-sigma-mm: expected a standard deviation"),
        ("--camera-sigma 1e300,1", "--camera-sigma: expected a standard deviation"),
        ("--major-px 5:1e10", "--major-px: expected at most"),
        ("--minor-px 5:1e10", "--minor-px: expected at most"),
        ("--depth-range-mm 5:1e300", "--depth-range-mm: expected at most"),
        ("--radius-mm 20 --method fu-zhou", "circlepose: --method: fu-zhou needs a ring target"),
    ],
)
def test_a_message_names_the_option(run, folder, typed, message):
    code, out, err = run("estimate", folder, "-q", *typed.split())
    assert (code, out) == (2, "")
    assert message in err
    assert all(key not in err for key in ("_hint", "same_plane", "_sigma_px", "intervals_px", "_mm:"))


def test_a_ring_target_is_no_set_of_coplanar_circles(run, folder, tmp_path):
    (tmp_path / "ring.yaml").write_text("kind: coplanar\nradii_mm: [20, 10]\n")
    for option in ("--coplanar", "--same-plane=yes", "--normal=0,0,-1", "--facing=left"):
        code, _, err = run("estimate", folder, "-q", "--target", tmp_path / "ring.yaml", option)
        assert code == 2
        assert err.startswith(f"circlepose: {option.split('=')[0]}: ")
