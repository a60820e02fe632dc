"""The samples, measured again: against the poses stored with them (`poses.csv`) and against the truth.

After a change that is meant, store the poses anew:

    for set in sample_images/*/; do circlepose estimate "$set" -o "$set/poses.csv"; done
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import pytest

from circlepose.evaluation.compare import Tolerance, compare
from circlepose.evaluation.matching import PoseTable
from circlepose.io.tables.reader import read_pose_file
from circlepose_cli.app import main


@dataclass(frozen=True)
class View:
    """How well an image determines its poses."""

    name: str
    stored: Tolerance
    """for poses that only another machine, OpenCV or NumPy has changed"""
    true: Tolerance
    """for the errors of the method; noise of the camera included"""


WELL = Tolerance(0.05, 0.02)
VIEWS = (
    View("cd/a.png", WELL, Tolerance(0.07, 0.02)),
    # Two degrees from edge-on: a rim of 335 x 22 px tells its distance by its far ends alone.
    View("cd/b.png", Tolerance(0.3, 0.02), Tolerance(1.5, 0.02)),
    # Something of the disc's own brightness touches it.
    View("cd/c.png", WELL, Tolerance(0.1, 0.02)),
    # Discs of 100 px at 0.9 m: 0.01 px of their size is 0.2 mm of distance.
    View("clutter/clutter.png", Tolerance(0.1, 0.02), Tolerance(0.25, 0.05)),
    # Fifteen degrees off the axis: the tilt moves the axes' ratio by little.
    View("coaxial/a.png", WELL, Tolerance(0.05, 0.1)),
    # The big circle hides a part of the small one, and the small one's edge a part of the big one's.
    View("coaxial/b.png", WELL, Tolerance(0.15, 0.05)),
    View("coplanar/a.png", WELL, WELL),
    # Five degrees off the axis: the tilt hardly moves the axes' ratio.
    View("coplanar/b.png", Tolerance(0.05, 0.05), Tolerance(0.05, 0.06)),
    View("coplanar/c.png", WELL, WELL),
    View("coplanar/d.png", WELL, WELL),
)
each_view = pytest.mark.parametrize("view", VIEWS, ids=lambda view: view.name)


@pytest.fixture(scope="module")
def measured(project_root, tmp_path_factory):
    """All samples as the README's command measures them; images are named after their set."""
    path = tmp_path_factory.mktemp("samples") / "poses.csv"
    with pytest.MonkeyPatch.context() as patch:
        for library in ("OPENBLAS", "OMP", "MKL"):
            patch.setenv(f"{library}_NUM_THREADS", "1")
        code = main(["estimate", "--recursive", str(project_root / "sample_images"), "-o", str(path), "--jobs", "1"])
    assert code == 0
    return read_pose_file(path.read_bytes(), str(path)).table


def of_view(table, view):
    """What `table` says of one image, without the name of its set."""
    image = view.name.split("/")[1]
    circles = tuple(c for c in table.circles if c.image in {view.name, image})
    return PoseTable(tuple(replace(c, image=image) for c in circles), {}, table.is_truth)


def read(project_root, view, name):
    path = project_root / "sample_images" / view.name.split("/")[0] / name
    return read_pose_file(path.read_bytes(), str(path), truth_allowed=True).table


def test_every_sample_is_a_view_here(measured):
    assert sorted(measured.images) == sorted(view.name for view in VIEWS)


@each_view
def test_poses_are_those_stored(measured, project_root, view):
    stored = of_view(read(project_root, view, "poses.csv"), view)
    comparison = compare(of_view(measured, view), stored, view.stored)
    assert comparison.differences == ()
    assert comparison.compared == len(stored.circles) > 0


@each_view
def test_poses_are_near_the_truth(measured, project_root, view):
    truth = of_view(read(project_root, view, "truth.csv"), view)
    comparison = compare(of_view(measured, view), truth, view.true, "chosen")
    assert comparison.differences == ()
    assert comparison.compared == len(truth.circles) > 0
