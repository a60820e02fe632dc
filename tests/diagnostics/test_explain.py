"""One image, stage by stage, and the picture of it."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.spatial import cKDTree

from circlepose.camera.camera import Camera, CameraSigma, circle_contour
from circlepose.diagnostics.explain import explain, rim_places, segments_left_out
from circlepose.diagnostics.residuals import edge_offsets, level_residuals
from circlepose.drawing.explanation import MOST_CIRCLES, draw_explanation
from circlepose.drawing.overlay import draw_overlay
from circlepose.drawing.plots import diverging, means
from circlepose.drawing.style import UNUSED
from circlepose.geometry.cone import factor_from_circle
from circlepose.geometry.ellipse import Ellipse
from circlepose.io.tables.json_records import image_record
from circlepose.measurement import edge_fit, intensity_fit, selection
from circlepose.measurement.options import MeasurementOptions
from circlepose.pipeline import EstimateOptions, estimate
from circlepose.results import Flag, Status
from circlepose.studies.scenes import coaxial_part_scene
from circlepose.synthesis.render import render
from circlepose.synthesis.scene import Paint, Rings, Scene
from circlepose.targets.target import Target
from circlepose_cli.app import main
from circlepose_cli.reports.explain.record import report_record
from circlepose_cli.reports.explain.text import report_text
from tests.support.discs import CAMERA, CENTER_MM, NORMAL, RADIUS_MM, disc_folder, disc_image, found_notes
from tests.support.drawn import drawn_by_opencv_5

TARGET = Target.circle(RADIUS_MM)


def explained_part(form, height_mm, tilt_deg):
    """A part of radii 45 and 30 mm, rendered 714 mm away and explained."""
    tilt = np.radians(tilt_deg)
    normal = np.array([0.0, -np.sin(tilt), -np.cos(tilt)])
    scene = coaxial_part_scene(form, np.array([0.0, 0.0, 714.0]), normal, seed=1)
    scene = replace(scene, targets=(replace(scene.targets[0], height_mm=height_mm),))
    target = Target("coaxial", (45.0, 30.0), generatrix_mm=float(np.hypot(height_mm, 15.0)))
    return explain(render(scene), scene.camera, target)


def test_the_view_in_which_both_pairs_fit_is_named():
    explanation = explained_part("recess", 1.0, 50.75)
    big = explanation.result.circles[0]
    assert big.ambiguity > 0.3
    text = report_text(explanation, "camera", "target")
    assert "0.0 deg from the view in which both pairs of candidates fit equally: 50.8 deg at this distance of" in text
    by_circle = {stage["circle"]: stage["mirror_view"] for stage in report_record(explanation)["stages"]}
    assert by_circle["big"]["tilt_deg"] == pytest.approx(50.75, abs=0.1)
    assert by_circle["big"]["both_pairs_fit_at_deg"] == pytest.approx(50.75, abs=0.1)
    assert by_circle["small"] is None


def test_a_boss_has_no_such_view():
    explanation = explained_part("boss", 20.0, 30.0)
    assert explanation.result.status is Status.OK
    assert "both pairs" not in report_text(explanation, "camera", "target")
    assert all(stage["mirror_view"] is None for stage in report_record(explanation)["stages"])


def barred(image):
    """The same picture, with something across the rim on the right."""
    image = image.copy()
    image[96:116, 200:260] = 120
    return image


def rim_of(center=CENTER_MM, radius=RADIUS_MM, camera=CAMERA):
    pixels = circle_contour(camera, center, NORMAL, radius, 20000)
    middle, axes, angle = cv2.fitEllipse(pixels.astype(np.float32))
    ellipse = Ellipse.from_axes(middle, np.array(axes) / 2.0, np.radians(angle))
    return ellipse, factor_from_circle(center, NORMAL, radius), pixels


def offset_of(growth_px):
    ellipse, _, _ = rim_of()
    grown = 1.0 + growth_px / float(np.sqrt(ellipse.semi_major * ellipse.semi_minor))
    moved, factor, _ = rim_of(radius=RADIUS_MM * grown)
    (levels,) = level_residuals(disc_image(), CAMERA, [moved], [factor])
    offset, error = edge_offsets(levels, rim_places(moved, levels.pixels) / 360.0, 24)
    assert np.all(error < 0.05)
    return float(np.median(offset))


@pytest.mark.parametrize("growth_px", [0.1, -0.1, 0.25])
def test_the_edge_is_found_as_far_from_the_rim_as_the_rim_was_moved(growth_px):
    # The drawn disc is a little larger than its truth: its polygon is filled with its edge pixels.
    drawn = offset_of(0.0)
    assert 0.0 <= drawn < 0.1
    assert offset_of(growth_px) - drawn == pytest.approx(-growth_px, rel=0.15)


def test_distances_are_those_from_the_rim_and_the_model_is_the_blurred_edge():
    ellipse, factor, pixels = rim_of()
    (levels,) = level_residuals(disc_image(), CAMERA, [ellipse], [factor])
    nearest = cKDTree(pixels).query(levels.pixels)[0]
    np.testing.assert_allclose(np.abs(levels.distance_px), nearest, atol=0.05)
    inside = np.linalg.norm(levels.pixels - ellipse.center, axis=1) < float(ellipse.semi_minor) - 1.0
    assert np.all(levels.distance_px[inside] < 0.0)
    assert levels.contrast_levels == pytest.approx(-160.0, abs=3.0)
    assert levels.noise_levels < 3.0
    assert 0.6 < levels.sigma_px < 0.95
    far = np.abs(levels.distance_px) > 2.5
    np.testing.assert_allclose(levels.model[far], np.where(levels.distance_px[far] > 0.0, 200.0, 40.0), atol=2.5)
    assert levels.converged
    assert levels.in_use.all()


@drawn_by_opencv_5
def test_a_disc_close_by_is_taken_off_and_not_left_out():
    first, second = (CENTER_MM + np.array([x, 0.0, 0.0]) for x in (-15.0, 18.6))
    image = disc_image(first).astype(int) + disc_image(second) - 200
    rims = [rim_of(center) for center in (first, second)]
    gap = cKDTree(rims[0][2]).query(rims[1][2])[0].min()
    assert 1.0 < gap < 3.0
    found = level_residuals(
        np.clip(image, 0, 255).astype(np.uint8), CAMERA, [rim[0] for rim in rims], [rim[1] for rim in rims]
    )
    for levels in found:
        assert levels.noise_levels < 3.5
        assert np.mean(levels.in_use) > 0.97
        assert levels.measured.max() < 220.0


def test_what_crosses_the_rim_is_left_out_where_it_is():
    explanation = explain(barred(disc_image()), CAMERA, TARGET)
    (circle,) = explanation.circles
    levels, ellipse = circle.levels, circle.result.ellipse
    covered = (
        (levels.pixels[:, 0] >= 200) & (np.abs(levels.pixels[:, 1] - 105.5) < 10) & (np.abs(levels.distance_px) < 1.0)
    )
    assert covered.sum() > 10
    assert np.mean(levels.in_use[covered]) < 0.1
    assert np.all(levels.crosses[covered] | levels.in_use[covered])
    ((first, last),) = segments_left_out(circle)
    places = rim_places(ellipse, levels.pixels[covered])
    assert first - 5.0 < places.min()
    assert places.max() < last + 5.0
    assert last - first < 75.0
    assert levels.rim_used < 1.0


def test_nothing_is_left_out_of_a_disc_that_is_whole():
    (circle,) = explain(disc_image(), CAMERA, TARGET).circles
    assert segments_left_out(circle) == []
    assert not (circle.levels.crosses | circle.levels.beside | circle.levels.clipped).any()


def test_pixels_that_are_clipped_are_told_from_those_that_are_odd():
    image = np.clip(disc_image().astype(float) * 1.4, 0, 255).astype(np.uint8)
    (circle,) = explain(image, CAMERA, TARGET).circles
    levels = circle.levels
    assert levels.clipped.sum() > 100
    assert np.all(levels.measured[levels.clipped] == 255.0)
    assert not (levels.clipped & levels.in_use).any()
    assert not levels.crosses.any()


def test_it_is_what_estimate_measures():
    explanation = explain(disc_image(), CAMERA, TARGET, name="a")
    assert image_record(explanation.result) == image_record(estimate(disc_image(), CAMERA, TARGET, name="a"))
    (circle,) = explanation.circles
    assert circle.contour is not None
    assert circle.edges.rim_used > 0.9
    assert explanation.contours == 1
    assert explanation.rejected == explanation.result.rejected


def rings_image():
    rings = Rings(np.array([3.0, -2.0, 300.0]), NORMAL, (30.0, 18.0), (Paint(30.0), Paint(220.0)))
    return render(Scene(camera=CAMERA, targets=(rings,), noise_levels=1.0, noise_seed=3))


@pytest.mark.parametrize("kind", ["lone", "hidden in part", "rings", "edges"])
def test_the_numbers_are_those_of_the_estimate(kind):
    image, target = disc_image(), TARGET
    if kind == "hidden in part":
        image = barred(image)
    if kind == "rings":
        image, target = rings_image(), Target("coplanar", (30.0, 18.0))
    explanation = explain(image, CAMERA, target, refine=kind != "edges")
    assert len(explanation.circles) == len(explanation.result.circles) == (2 if kind == "rings" else 1)
    for circle, result in zip(explanation.circles, explanation.result.circles, strict=True):
        record = report_record(replace(explanation, circles=(circle,)))["stages"][0]
        assert circle.result is result
        assert circle.rim.ellipse is result.ellipse
        assert circle.contour.score == result.score
        if kind == "edges":
            assert record["edges"]["residual_px"] == result.residual_px
            assert record["edges"]["rim_used"] == result.rim_used
        else:
            assert circle.levels.is_used
            assert record["levels"]["rim_used"] == result.rim_used
            # The fit that left the residuals is the one that the covariance is of.
            assert circle.rim.modes_covariance is not None


@pytest.mark.parametrize("kind", ["lone", "rings"])
def test_an_image_is_searched_and_fitted_as_often_as_by_estimate(kind, monkeypatch):
    image, target = (disc_image(), TARGET) if kind == "lone" else (rings_image(), Target("coplanar", (30.0, 18.0)))
    calls = Counter()

    def counted(module, name):
        function = getattr(module, name)

        def call(*arguments, **named):
            calls[name] += 1
            return function(*arguments, **named)

        monkeypatch.setattr(module, name, call)

    counted(selection, "find_contours")
    counted(intensity_fit, "fit_to_levels")
    counted(edge_fit, "locate_edges")
    estimate(image, CAMERA, target)
    by_estimate = calls.copy()
    calls.clear()
    explain(image, CAMERA, target)
    assert calls == by_estimate
    assert calls["find_contours"] == 1


def test_places_along_a_rim_go_round_as_its_points_do():
    ellipse, _, _ = rim_of()
    off = rim_places(ellipse, ellipse.points(12)) - np.arange(12) * 30.0
    np.testing.assert_allclose((off + 180.0) % 360.0 - 180.0, 0.0, atol=1e-6)
    assert rim_places(replace(ellipse, semi_minor=np.array(0.0)), ellipse.points(4)).shape == (4,)


def test_a_resized_image_is_explained_with_its_own_camera():
    half = cv2.resize(disc_image(), (160, 120), interpolation=cv2.INTER_AREA)
    explanation = explain(half, CAMERA, TARGET, scale_calibration=True)
    (circle,) = explanation.circles
    assert circle.levels.noise_levels < 8.0
    assert draw_explanation(half, explanation, CAMERA).shape[1] > 1000
    refused = explain(half, CAMERA, TARGET)
    assert refused.result.status is Status.SIZE_MISMATCH
    assert refused.circles == ()


def test_one_measured_by_edges_alone_is_looked_at_all_the_same():
    explanation = explain(disc_image(), CAMERA, TARGET, refine=False)
    assert explanation.circles[0].levels.noise_levels < 4.0
    assert "not used: --no-refine" in report_text(explanation, "", "")


def test_why_the_levels_were_not_used_is_named():
    options = EstimateOptions(MeasurementOptions(worst_noise_share=0.0))
    explanation = explain(disc_image(), CAMERA, TARGET, options=options)
    (circle,) = explanation.circles
    assert Flag.EDGES_ONLY in circle.result.flags
    assert circle.edges is circle.rim
    assert not circle.levels.is_used
    text = report_text(explanation, "", "")
    assert "not used: the residuals are too large for the contrast" in text
    assert "located along the predicted rim" in text


@pytest.mark.parametrize(("sigma", "radius", "words"), [(3.0, 0.0, "the camera"), (0.1, 0.3, "the radius")])
def test_the_dominating_term_is_named(sigma, radius, words):
    camera = replace(CAMERA, sigma=CameraSigma(sigma, 0.0))
    explanation = explain(disc_image(), camera, replace(TARGET, radius_sigma_mm=radius))
    assert f"position: mostly {words} " in report_text(explanation, "", "")
    assert report_record(explanation)["stages"][0]["dominating"]["position"] == words.split()[1]
    alone = explain(disc_image(), CAMERA, TARGET)
    assert "the image's noise alone" in report_text(alone, "", "")
    assert report_record(alone)["stages"][0]["dominating"] is None


def test_the_picture_shows_what_is_left_out_and_only_then():
    image = disc_image()
    plain, marked = (
        draw_explanation(each, explain(each, CAMERA, TARGET, name="a"), CAMERA) for each in (image, barred(image))
    )
    assert plain.dtype == np.uint8
    assert not np.all(plain == UNUSED, axis=-1).any()
    assert np.all(marked == UNUSED, axis=-1).sum() > 100


def test_of_many_circles_the_first_are_drawn():
    explanation = explain(disc_image(), CAMERA, TARGET)
    one = draw_explanation(disc_image(), explanation, CAMERA)
    many = replace(explanation, circles=explanation.circles * (MOST_CIRCLES + 2))
    drawn = draw_explanation(disc_image(), many, CAMERA)
    assert len(drawn) < MOST_CIRCLES * len(one)
    assert len(drawn) > (MOST_CIRCLES - 1) * len(one)


@pytest.mark.parametrize("change", ["sixteen", "color"])
def test_pictures_of_other_kinds_of_images(change):
    image = disc_image()
    image = image.astype(np.uint16) * 16 if change == "sixteen" else np.dstack([image] * 3)
    explanation = explain(image, CAMERA, TARGET)
    assert explanation.circles[0].levels is not None
    assert draw_explanation(image, explanation, CAMERA).dtype == np.uint8


def test_without_a_circle_the_picture_is_the_overlay():
    image = np.full((240, 320), 128, np.uint8)
    explanation = explain(image, CAMERA, TARGET, name="a")
    assert explanation.result.status is Status.NO_CIRCLE
    np.testing.assert_array_equal(
        draw_explanation(image, explanation, CAMERA), draw_overlay(image, explanation.result, CAMERA)
    )


def test_a_circle_nearly_outside_of_the_image_is_no_error():
    camera = Camera.create([[400.0, 0, 159.5], [0, 400.0, 119.5], [0, 0, 1]], (), (320, 240))
    ellipse, factor, _ = rim_of(np.array([-400.0, 0.0, 200.0]), camera=camera)
    assert level_residuals(disc_image(), camera, [ellipse], [factor]) == [None]
    assert level_residuals(disc_image(), camera, [], []) == []


def test_colors_and_means():
    blue, white, red = diverging(np.array([-1.0, 0.0, 1.0])).tolist()
    assert white == [255, 255, 255]
    assert blue[0] > blue[2]
    assert red[2] > red[0]
    mean = means(np.array([0.5, 0.6, 1.5, 9.0]), np.array([1.0, 3.0, 5.0, 7.0]), np.ones(4, bool), np.arange(4.0))
    np.testing.assert_array_equal(mean, [2.0, 5.0, np.nan])


def test_the_command_prints_the_stages_and_writes_the_picture(capsys, tmp_path):
    folder = disc_folder(tmp_path / "a", 2)
    cv2.imwrite(str(folder / "disc0.png"), barred(disc_image()))
    picture = tmp_path / "seen.png"
    assert main(["explain", str(folder / "disc0.png"), "--picture", str(picture), "--camera-sigma", "2,1"]) == 0
    printed = capsys.readouterr()
    assert printed.err == found_notes(folder)
    for words in ("contours    1 worth a pose", "edges  ", "blur 0.", "left out    ", "pose 1 ", "mostly the camera"):
        assert words in printed.out
    assert cv2.imread(str(picture)).shape[1] > 1000


def test_json_is_one_strict_document(capsys, tmp_path):
    folder = disc_folder(tmp_path / "a", 1)
    assert main(["explain", str(folder), "--format", "json", "--radius-sigma-mm", "0.1"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["schema"] == "circlepose.explain/1"
    assert record["circles"][0]["solutions"][0]["covariance_terms"]["radius"]
    (stages,) = record["stages"]
    assert stages["levels"]["converged"]
    assert stages["dominating"]["position"] == "radius"
    assert stages["contour"]["rim_used"] > 0.9


def test_no_circle_is_told_with_its_reasons_and_ends_with_3(capsys, tmp_path):
    folder = disc_folder(tmp_path / "a", 1)
    picture = tmp_path / "none.png"
    assert main(["explain", str(folder / "disc0.png"), "--polarity", "bright", "--picture", str(picture)]) == 3
    printed = capsys.readouterr()
    assert "no_circle" in printed.out
    assert "brighter or darker inside than asked for" in printed.out
    assert picture.exists()


@pytest.mark.parametrize(
    ("name", "code", "words"),
    [
        ("gone.png", 3, "no such file"),
        ("text.png", 3, "no image"),
        ("-", 2, "one image"),
        (".", 2, "takes one image"),
    ],
)
def test_what_is_no_single_image_is_refused(capsys, tmp_path, monkeypatch, name, code, words):
    folder = disc_folder(tmp_path / "a", 2)
    (folder / "text.png").write_text("no picture")
    monkeypatch.chdir(folder)
    assert main(["explain", name, "--picture", "x.png"]) == code
    printed = capsys.readouterr()
    assert printed.out == ""
    assert words in printed.err
    assert not (folder / "x.png").exists()


def test_a_picture_that_cannot_be_written_ends_with_2(capsys, tmp_path):
    folder = disc_folder(tmp_path / "a", 1)
    for name in ("none/x.png", "x.txt"):
        assert main(["explain", str(folder), "--picture", str(tmp_path / name)]) == 2
        assert capsys.readouterr().out == ""
