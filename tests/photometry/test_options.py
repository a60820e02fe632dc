"""The options of photometry: every number has a source, is read, and changes what it says."""

from __future__ import annotations

import ast
from dataclasses import fields, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import circlepose.photometry
from circlepose.camera.camera import Camera
from circlepose.fitting.cone_projection import factor_from_ellipse
from circlepose.geometry.ellipse import Ellipse
from circlepose.photometry.fit import fit_to_levels
from circlepose.photometry.initialization import first_information, start_blur
from circlepose.photometry.levels_fit import BlurPrior, LevelsFit
from circlepose.photometry.options import DEFAULT, PhotometryOptions
from circlepose.photometry.pixel_band import bands_around
from circlepose.photometry.segments import mean_squares, segment_sums
from circlepose.photometry.thin.fit import are_thin, fit_thin_ellipse
from circlepose.photometry.thin.options import ThinOptions

ROOM = Path(circlepose.photometry.__file__).parent
SOURCES = ("statistical", "numerical", "empirical", "cost", "measured on rendered discs")
CAMERA = Camera.create([[400.0, 0.0, 31.5], [0.0, 400.0, 23.5], [0.0, 0.0, 1.0]], (), (64, 48))
RIM = Ellipse.from_axes([31.3, 23.6], [16.0, 12.0], 0.3)


def image() -> np.ndarray:
    """A disc with an edge some px wide, and noise."""
    y, x = np.mgrid[:48, :64]
    u, v = x - 31.3, y - 23.6
    along, across = u * np.cos(0.3) + v * np.sin(0.3), v * np.cos(0.3) - u * np.sin(0.3)
    distance = (np.hypot(along / 16.0, across / 12.0) - 1.0) * 14.0
    noise = np.random.default_rng(0).normal(0.0, 1.5, distance.shape)
    return np.clip(np.rint(40.0 + 150.0 / (1.0 + np.exp(-2.0 * distance)) + noise), 0, 255).astype(np.uint8)


def fitted(options: PhotometryOptions) -> LevelsFit:
    bands = bands_around(image(), CAMERA, [RIM], np.array([options.band_half_width_px]))
    factor = factor_from_ellipse(CAMERA, RIM)
    assert factor is not None
    blur = start_blur(np.zeros(1), options=options)
    prior = BlurPrior(blur * [1.0, 0.0, 0.0], first_information(1, options=options))
    return fit_to_levels(bands, factor[None], blur, prior, np.array([88.0]), options=options)


@pytest.mark.parametrize(("kind", "path"), [(PhotometryOptions, "options.py"), (ThinOptions, "thin/options.py")])
def test_every_number_has_a_source_and_is_read(kind: type, path: str) -> None:
    tree = ast.parse((ROOM / path).read_text())
    (body,) = (node.body for node in tree.body if isinstance(node, ast.ClassDef))
    notes = {
        field.target.id: note.value.value
        for field, note in pairwise(body)
        if isinstance(field, ast.AnnAssign) and isinstance(note, ast.Expr)
    }
    numbers = [field.name for field in fields(kind) if field.name != "thin"]
    assert [name for name in numbers if not notes[name].rstrip(".").endswith(SOURCES)] == []
    others = [each for each in ROOM.rglob("*.py") if each.name != "options.py"]
    nodes = [node for each in others for node in ast.walk(ast.parse(each.read_text()))]
    read = {node.attr for node in nodes if isinstance(node, ast.Attribute)}
    # Two numbers of the band are read by its callers.
    assert set(numbers) - read <= {"band_half_width_px", "band_half_width_sigmas"}


def test_the_fit_follows_its_options() -> None:
    default = fitted(DEFAULT)
    assert default.converged.all()
    assert not fitted(replace(DEFAULT, least_pixels=1e6)).converged.any()
    assert not fitted(replace(DEFAULT, steps=0)).converged.any()
    wider = fitted(replace(DEFAULT, band_half_width_px=4.0))
    assert wider.weight.sum() > default.weight.sum()


def test_thin_rims_follow_their_options() -> None:
    thin = replace(DEFAULT, thin=replace(DEFAULT.thin, thin_px=100.0, thin_ratio=1.0))
    assert not are_thin(RIM)
    assert are_thin(RIM, options=thin)
    few = replace(DEFAULT, thin=replace(DEFAULT.thin, most_pixels=20))
    assert fit_thin_ellipse(image(), RIM) is not None
    assert fit_thin_ellipse(image(), RIM, options=few) is None


def test_sums_over_segments_add_up_and_means_are_those_of_each_segment() -> None:
    generator = np.random.default_rng(1)
    values, weights = generator.random((3, 50)), generator.random((3, 50)) + 1.0
    index = generator.integers(0, 12, (3, 50))
    sums = segment_sums(values, index, (3, 4))
    assert sums.sum() == pytest.approx(values.sum())
    means, totals = mean_squares(values * weights, weights, index, (3, 4))
    chosen = index == 7
    assert means[1, 3] == pytest.approx(np.average(values[chosen], weights=weights[chosen]))
    assert totals[1, 3] == pytest.approx(weights[chosen].sum())
