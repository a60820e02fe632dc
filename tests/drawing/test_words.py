from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from circlepose.drawing import words
from circlepose.results import Flag, SettledBy, Status
from tests.support.discs import made_circle

MADE = replace(made_circle(), flags=(), settled_by=SettledBy.HINT, ambiguity=0.0)
SIGMA = replace(made_circle(covariance=np.diag([1e-4, 4e-4, 0.04, 1e-8, 1e-8])), flags=())


@pytest.mark.parametrize(
    ("ambiguity", "flags", "said"),
    [
        (0.0, (), "settled by the hint"),
        (0.02, (), "settled by the hint, 2 % chance of the other pose"),
        (0.004, (), "settled by the hint, 0.4 % chance of the other pose"),
        (0.24, (), "24 % chance of the other pose, by the hint"),
        (0.5, (Flag.AMBIGUOUS,), "ambiguous: two poses possible"),
        (0.3, (Flag.AMBIGUOUS,), "ambiguous: two poses possible, 30 % chance of the other"),
    ],
)
def test_the_choice_is_said_as_a_person_reads_it(ambiguity, flags, said):
    assert words.choice(replace(MADE, ambiguity=ambiguity, flags=flags)) == said


def test_one_candidate_and_none():
    assert words.choice(replace(MADE, candidates=MADE.candidates[:1])) == "one pose possible"
    failed = replace(MADE, candidates=(), status=Status.NO_POSE, reason="edge-on")
    assert words.choice(failed) == "no_pose: edge-on"
    assert "edge-on" in " ".join(words.caption([failed]))
    assert len(words.row([failed])) == len(words.ROW_NAMES)


def test_a_pose_has_as_many_digits_as_its_sigma_allows():
    assert words.center(SIGMA.pose) == "(10.00, -5.00, 200.00)"
    assert words.normal(SIGMA.pose).count(".") == 3
    assert "sigma (0.01, 0.02, 0.2) mm" in words.sigmas(SIGMA.pose)
    assert words.sigmas(MADE.pose) == "sigma unknown"


def test_a_caption_says_what_rings_share_once():
    lines = words.caption([SIGMA, replace(SIGMA, circle="inner", radius_mm=10.0)])
    assert lines[0] == "instance 0: disc of radius 20 mm, inner of radius 10 mm"
    assert sum(line.startswith("center ") for line in lines) == 1
    moved = replace(SIGMA, circle="small", candidates=made_circle(center=np.array([0.0, 0.0, 210.0])).candidates)
    assert sum("center (" in line for line in words.caption([SIGMA, moved])) == 2


def test_the_summary_counts_targets_by_their_choice():
    unsure = replace(MADE, instance=1, flags=(Flag.AMBIGUOUS,), ambiguity=0.5)
    doubtful = replace(MADE, instance=2, ambiguity=0.24)
    assert words.summary([MADE]) == "1 target, measured by chen-huang: settled by the hint"
    assert words.summary([MADE, unsure, doubtful]) == (
        "3 targets, measured by chen-huang: 1 settled by the hint, 1 ambiguous (two poses possible), "
        "1 with a chance of 5 % or more of the other pose"
    )
