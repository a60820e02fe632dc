"""The examples of docs/python.md run, one after the other, as a reader would type them."""

from __future__ import annotations

import re
import shutil
from importlib.util import find_spec
from pathlib import Path

import pytest

import circlepose
from circlepose.targets import KINDS
from tests.support.paths import ROOT

MANUAL = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")
EXAMPLES = re.findall(r"^```python( pandas)?\n(.*?)^```$", MANUAL, re.DOTALL | re.MULTILINE)
README = (ROOT / "README.md").read_text(encoding="utf-8")


@pytest.fixture
def beside_samples(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    shutil.copytree(ROOT / "sample_images", tmp_path / "sample_images")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_examples_of_the_manual_run_in_order(beside_samples: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert len(EXAMPLES) >= 10
    names: dict[str, object] = {}
    for needs_pandas, example in EXAMPLES:
        if not needs_pandas or find_spec("pandas") is not None:
            exec(compile(example, "docs/python.md", "exec"), names)
    printed = capsys.readouterr().out
    assert "ImageResult('a.png', 512 x 480 px, ok, 1 circle)\n" in printed
    assert "[('a.png', 'ok'), ('b.png', 'ok'), ('c.png', 'ok'), ('d.png', 'ok')]\n" in printed
    assert (beside_samples / "overlay.png").exists()
    # Where the manual says that an ellipse or a rim is that of the photograph, it is.
    result = names["result"]
    assert isinstance(result, circlepose.ImageResult)
    (circle,) = result.circles
    by_ellipse = circlepose.estimate_from_ellipse(names["ellipse"], names["camera"], 60.0)  # type: ignore[arg-type]
    nearest = min(abs(candidate.center - circle.candidates[0].center).max() for candidate in by_ellipse.candidates)
    assert nearest < 0.02


def test_the_example_of_the_readme_runs(beside_samples: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (example,) = re.findall(r"^```python\n(.*?)^```$", README, re.DOTALL | re.MULTILINE)
    shutil.copy("sample_images/cd/camera.yml", "cam.yaml")
    shutil.copy("sample_images/cd/a.png", "photo.png")
    exec(compile(example, "README.md", "exec"), {})
    assert "902.3" in capsys.readouterr().out


def test_every_public_function_is_in_the_manual() -> None:
    functions = {name for name in circlepose.__all__ if name[0].islower()}
    assert {name for name in functions if f"{name}(" not in MANUAL} == set()


def test_every_kind_of_target_and_the_world_board_are_in_the_manual() -> None:
    makers = {"rings" if kind == "coplanar" else kind for kind in KINDS}
    assert {name for name in makers if f"Target.{name}(" not in MANUAL} == set()
    for function in ("estimate", "measure"):
        assert f"{function}(..., world_board=" in MANUAL


def test_every_link_of_the_manual_leads_somewhere() -> None:
    for page, anchor in re.findall(r"\]\(([\w-]+\.md)(?:#([\w-]+))?\)", MANUAL):
        text = (ROOT / "docs" / page).read_text(encoding="utf-8")
        headings = {
            re.sub(r"[^\w -]", "", heading).strip().lower().replace(" ", "-")
            for heading in re.findall(r"^#+ (.*)$", text, re.MULTILINE)
        }
        assert not anchor or anchor in headings, (page, anchor)
