"""Coplanar rings: the route of Fu & Zhou (equations 7 to 10) beside the pose that `estimate` gives.

    python -m benchmarks.papers_route [--trials 100]

The coplanar trials of `ambiguity.py`. The paper's route starts from the conics of both rings and has one solution:
imaged centre, vanishing line, imaged circular points, rotation and translation. It is fed the same edges as
`estimate`. *chooses*: share of trials in which its normal is nearer to the right one of the outer ring's candidates.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

import circlepose
from benchmarks.ambiguity import CAMERA, KINDS, scene
from circlepose._numerics import angle_between
from circlepose._typing import FloatArray
from circlepose.camera.camera import Camera
from circlepose.fitting.cone_fit import fit_cone
from circlepose.geometry.cone import SIGNATURE
from circlepose.results import CircleResult
from circlepose.solvers.fu_zhou_coplanar import imaged_center, normal_from_imaged_center, pose_from_coplanar_circles
from circlepose.synthesis.render import render

TILTS_DEG = ((0.0, 10.0), (10.0, 40.0), (40.0, 75.0))


@dataclass(frozen=True, slots=True)
class Trial:
    """Errors (mm, deg) of one view by both routes, and whether the paper's normal picks the right candidate."""

    tilt_deg: float
    ours: tuple[float, float]
    papers: tuple[float, float]
    chooses: bool


def papers_route(outer: CircleResult, inner: CircleResult, camera: Camera) -> tuple[FloatArray, FloatArray]:
    """Return centre (3,) mm and normal (3,) from the edges of two rings, by eq. 7 to 9.

    Eq. 10 gives the same normal, and is asserted to.
    """
    conics = []
    for ring in (outer, inner):
        assert ring.contour is not None
        fit = fit_cone(camera, ring.contour)
        assert fit is not None
        inverse = np.linalg.inv(fit.factor)
        conics.append(inverse.T @ (SIGNATURE[:, None] * inverse))
    center, normal = pose_from_coplanar_circles(conics[0], conics[1], outer.radius_mm)
    by_eq_10 = normal_from_imaged_center(conics[0], imaged_center(conics[0], conics[1]))
    np.testing.assert_allclose(normal, by_eq_10, atol=1e-9)
    return center, normal


def run(trials: int) -> Iterator[Trial]:
    """Yield the trials that are measured."""
    for number in range(trials):
        picture, center, normal = scene("coplanar", number)
        result = circlepose.estimate(render(picture), CAMERA, KINDS["coplanar"])
        if result.status != "ok":
            continue
        outer, inner = result.circles
        theirs = papers_route(outer, inner, CAMERA)
        chosen = outer.candidates[outer.chosen]
        nearest = max(outer.candidates, key=lambda candidate: float(candidate.normal @ theirs[1]))
        right = max(outer.candidates, key=lambda candidate: float(candidate.normal @ normal))
        tilt = float(np.degrees(angle_between(-normal, center / np.linalg.norm(center))))
        ours = chosen.center, chosen.normal
        yield Trial(tilt, _errors(*ours, center, normal), _errors(*theirs, center, normal), nearest is right)


def _errors(center: FloatArray, normal: FloatArray, true: FloatArray, true_normal: FloatArray) -> tuple[float, float]:
    return float(np.linalg.norm(center - true)), float(np.degrees(angle_between(normal, true_normal)))


def main() -> None:
    """Print the errors of both routes, by tilt."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--trials", type=int, default=100)
    done = list(run(parser.parse_args().trials))
    print("| tilt deg | views | route | position mm, 50 / 95 % | normal deg, 50 / 95 % | chooses |")
    print("|---|---|---|---|---|---|")
    for low, high in TILTS_DEG:
        some = [trial for trial in done if low <= trial.tilt_deg < high]
        picks = sum(trial.chooses for trial in some)
        rows = (
            ("estimate", [t.ours for t in some], ""),
            ("eq. 7 to 10", [t.papers for t in some], f"{picks}/{len(some)}"),
        )
        for route, errors, share in rows:
            position, angle = np.percentile(np.array(errors), [50, 95], axis=0).T
            print(
                f"| {low:g} to {high:g} | {len(some)} | {route} | {position[0]:.3f} / {position[1]:.3f} "
                f"| {angle[0]:.4f} / {angle[1]:.4f} | {share} |"
            )


if __name__ == "__main__":
    main()
