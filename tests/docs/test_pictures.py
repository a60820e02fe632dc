"""The pictures of the pages are those that docs/make_pictures.py makes."""

from __future__ import annotations

from importlib import import_module

import cv2
import numpy as np
import pytest

from tests.support.paths import ROOT

PICTURES = ROOT / "docs" / "pictures"
_LEVELS, _SHARE = 16, 0.1
"""Difference that is seen, share of such pixels: last digits depend on the processor, and move a caption."""


def test_the_pictures_are_those_of_the_scenes(tmp_path, monkeypatch):
    if int(cv2.__version__.split(".")[0]) < 5:
        pytest.skip(f"the pictures have the letters of OpenCV 5, this is {cv2.__version__}")
    pytest.importorskip("pypdfium2")
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    pictures = import_module("sitegen.pictures")
    made = pictures.write_pictures(tmp_path)
    assert sorted(path.name for path in made) == sorted(path.name for path in PICTURES.iterdir())
    for path in made:
        kept = PICTURES / path.name
        assert kept.stat().st_size <= pictures.LARGEST_BYTES
        new, old = (cv2.imread(str(each)).astype(np.int64) for each in (path, kept))
        assert new.shape == old.shape, path.name
        share = float((np.abs(new - old).max(axis=2) > _LEVELS).mean())
        assert share < _SHARE, f"{path.name}: run docs/make_pictures.py"


def test_every_scene_of_the_pages_is_drawn(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    scenes = import_module("sitegen.pictures").SCENES
    assert sorted(scenes) == sorted(path.stem for path in (ROOT / "docs" / "scenes").glob("*.yaml"))
