"""Images full of edges and without circles: few reports, and the work stays bounded whatever the edges are."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from circlepose.detection import hypotheses, location
from circlepose.detection.detect import find_contours
from circlepose.detection.options import DEFAULT
from circlepose.targets.target import AxisIntervals
from tests.support.drawn import drawn_by_opencv_5

WIDTH, HEIGHT = 640, 480
_Y, _X = np.mgrid[0:HEIGHT, 0:WIDTH]


def noise() -> np.ndarray:
    return np.random.default_rng(0).integers(0, 256, (HEIGHT, WIDTH)).astype(np.uint8)


def chessboard(side: int) -> np.ndarray:
    return (((_X // side + _Y // side) % 2) * 200 + 20).astype(np.uint8)


def text(words: str) -> np.ndarray:
    page = np.full((HEIGHT, WIDTH), 235, np.uint8)
    for row, y in enumerate(range(18, HEIGHT, 18)):
        cv2.putText(page, (words * 9)[row:], (5, y), cv2.FONT_HERSHEY_SIMPLEX, 0.5, 20, 1, cv2.LINE_AA)
    return page


def leaves() -> np.ndarray:
    """Pointed ovals that overlap, each with a vein."""
    generator = np.random.default_rng(1)
    image = np.full((HEIGHT, WIDTH), 60, np.uint8)
    along = np.linspace(-1.0, 1.0, 20)
    outline = np.stack([np.r_[along, along[::-1]], np.r_[1.0 - along**2, along**2 - 1.0]], axis=-1)
    for _ in range(900):
        length, angle = generator.uniform(8.0, 60.0), generator.uniform(0.0, np.pi)
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        middle = generator.uniform(0.0, [WIDTH, HEIGHT])
        leaf = (outline * [length, generator.uniform(0.25, 0.6) * length]) @ turn + middle
        vein = np.array([[-length, 0.0], [length, 0.0]]) @ turn + middle
        level = int(generator.integers(30, 220))
        cv2.fillPoly(image, [np.rint(16.0 * leaf).astype(np.int32)], level, cv2.LINE_AA, 4)
        cv2.polylines(image, [np.rint(16.0 * vein).astype(np.int32)], False, level - 25, 1, cv2.LINE_AA, 4)
    return np.clip(image + generator.normal(0.0, 3.0, image.shape), 0, 255).astype(np.uint8)


IMAGES = {
    "noise": noise(),
    "flat": np.full((HEIGHT, WIDTH), 90, np.uint8),
    "ramp": (_X * 255 // WIDTH).astype(np.uint8),
    "stripes": ((_X // 5 % 2) * 200).astype(np.uint8),
    "chessboard": chessboard(40),
    "small chessboard": chessboard(12),
    "text": text("lazy fix him vexing kilt at wintry mint yew "),
    "leaves": leaves(),
}


TEXT = pytest.param("text", marks=drawn_by_opencv_5)


@pytest.mark.parametrize("name", [TEXT if name == "text" else name for name in IMAGES])
def test_hardly_anything_is_reported(name):
    assert len(find_contours(IMAGES[name], AxisIntervals()).contours) <= 5


@pytest.mark.parametrize("name", ["chessboard", "small chessboard", TEXT, "leaves"])
def test_few_of_the_edges_are_looked_at_closely(name, monkeypatch):
    """Of all chains only so many are worth placing edges along, and of these few a second time."""
    looked_at: list[int] = []

    def counted(levels, ellipse, *args, **kwargs):
        looked_at.append(len(ellipse))
        return original(levels, ellipse, *args, **kwargs)

    original = location.edges_along
    monkeypatch.setattr(location, "edges_along", counted)
    extraction = find_contours(IMAGES[name], AxisIntervals())
    assert sum(extraction.rejected.values()) > 100
    assert sum(looked_at) < 800


def test_the_number_of_hypotheses_has_a_limit(monkeypatch):
    """However many arcs there are, the longest are joined."""
    seen: list[int] = []

    def counted(arcs, *args):
        seen.append(len(arcs))
        return original(arcs, *args)

    original = hypotheses.joined_arcs
    monkeypatch.setattr(hypotheses, "joined_arcs", counted)
    find_contours(IMAGES["leaves"], AxisIntervals(major_px=(20.0, 400.0)))
    assert max(seen) > 20
    assert max(seen) <= DEFAULT.edges.most_arcs


@pytest.mark.parametrize(("sigma", "quality"), [(1.0, 80), (1.5, 70), (2.0, 60), (3.0, 40)])
def test_what_compression_leaves_of_noise_is_no_circle(sigma, quality):
    """It leaves smooth blobs of 1 to 6 levels, 8 px across, and no noise that excuses an edge."""
    levels = 180.0 + np.random.default_rng(0).normal(0.0, sigma, (HEIGHT, WIDTH))
    stored = cv2.imencode(".jpg", np.round(levels).astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
    assert not find_contours(cv2.imdecode(stored, cv2.IMREAD_GRAYSCALE), AxisIntervals()).contours
