"""From a start to a board whose rims and pose agree: with the pose, which rims are its circles is decided anew."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from circlepose._numerics import STUDENT_FREEDOM
from circlepose._typing import BoolArray, FloatArray, IntArray
from circlepose.boards.diagnosis import why_misfit
from circlepose.boards.fit import BoardFit, chance_of_second, chi_squares, fit_at, fit_board, minimum_near
from circlepose.boards.options import DEFAULT, BoardOptions
from circlepose.boards.pose import BoardRims, RigidPose, circles_at, mirrored
from circlepose.boards.scene import Scene
from circlepose.boards.symmetry import symmetries
from circlepose.camera.camera import Camera
from circlepose.fitting.cone_projection import image_ellipses
from circlepose.geometry.cone import factor_from_circle
from circlepose.geometry.cone_perturbation import MODES
from circlepose.geometry.ellipse import Ellipse
from circlepose.targets.board import BoardLayout


@dataclass(frozen=True, slots=True, eq=False)
class FoundBoard:
    """A board in an image."""

    layout: BoardLayout
    """its own, or that seen from behind"""
    members: IntArray
    """(k,) the rims of its circles"""
    circles: IntArray
    """(k,) which circle of the layout each is"""
    fits: tuple[BoardFit, ...]
    """of the pose, and of the other one where it is another, the better first"""
    ambiguity: float
    """probability that the first is the wrong one"""
    is_roll_open: bool
    """whether the layout maps on itself by a turn"""
    offsets_px: tuple[FloatArray, ...]
    """of each fit: (k, 2) from where it puts the centers of the circles' images to where these are"""
    misfits: tuple[int, ...]
    """circles of the layout that are seen, but not where the pose puts them, or not as large"""

    def score(self, options: BoardOptions) -> float:
        """Return how well the layout explains its rims: log likelihoods with heavy tails, a gain for each rim."""
        costs = 0.5 * (STUDENT_FREEDOM + MODES) * np.log1p(self.fits[0].chi_square / STUDENT_FREEDOM)
        return float(np.maximum(options.rim_log - costs, 0.0).sum())

    @property
    def rms_px(self) -> tuple[float, ...]:
        """Of each fit: rms distance of the centers, of the rims that count."""
        return tuple(
            float(np.sqrt(np.mean(np.sum(offset[fit.used] ** 2, axis=1)))) if fit.used.any() else np.inf
            for fit, offset in zip(self.fits, self.offsets_px, strict=True)
        )


def settled(
    scene: Scene,
    layout: BoardLayout,
    members: IntArray,
    circles: IntArray,
    start: RigidPose,
    taken: set[int],
    options: BoardOptions = DEFAULT,
) -> FoundBoard | str:
    """Return the board whose rims and pose agree, or why they do not."""
    by_circle = np.argsort(circles, kind="stable")
    members, circles = members[by_circle], circles[by_circle]
    rims = scene.board_rims(layout, members, circles)
    fit = fit_board(rims, start, options)
    for _ in range(options.rounds):
        if fit is None:
            break
        again, its_circles = _where_expected(scene, layout, fit.pose, fit.growth, taken, options)
        if len(again) < 2:
            return "no second circle is where the pose of the others puts it"
        if np.array_equal(again, members) and np.array_equal(its_circles, circles):
            break
        members, circles = again, its_circles
        rims = scene.board_rims(layout, members, circles)
        fit = fit_board(rims, fit.pose, options)
    if fit is None or np.count_nonzero(fit.used) < 2:
        return "the rims determine no pose of the layout"
    if layout.grid is None:
        # Two circles make a pose; each further one speaks for it, each that is missing against. One that is seen, but
        # off its place, does neither: coordinates may be wrong.
        number, found = _number_inside(scene, layout, fit), int(np.count_nonzero(fit.used))
        further = found - 2 if fit.excess < options.telling_sigmas**2 else 0
        if options.hidden_log * max(number - len(members), 0) < options.chance_log * further:
            return f"{found} of {number} circles that should be in the image fit the layout"
    offsets = _offsets(scene, rims, members, fit)
    size = float(np.median(scene.ellipse.semi_minor[members]))
    rms = float(np.sqrt(np.mean(np.sum(offsets[fit.used] ** 2, axis=1))))
    most = max(options.least_mismatch_px, options.mismatch_share * size)
    if rms > most or abs(fit.growth) > options.most_growth or fit.used.mean() < options.least_used:
        return why_misfit(layout, circles, fit.growth, rms, fit.used)
    fit, circles, is_open = _with_roll(scene, layout, members, circles, fit)
    rims = scene.board_rims(layout, members, circles)
    fits, ambiguity = _both_tilts(rims, layout, fit, options)
    return FoundBoard(
        layout=layout,
        members=members,
        circles=circles,
        fits=fits,
        ambiguity=float(ambiguity),
        is_roll_open=is_open,
        offsets_px=tuple(_offsets(scene, rims, members, each) for each in fits),
        misfits=_misfits(scene, layout, members, circles, fits[0], taken, options),
    )


def _misfits(
    scene: Scene,
    layout: BoardLayout,
    members: IntArray,
    circles: IntArray,
    fit: BoardFit,
    taken: set[int],
    options: BoardOptions,
) -> tuple[int, ...]:
    """Return the circles of a layout for which a rim is seen that is visibly off its place, or of another size."""
    places, seen = _expected(scene.camera, layout, fit.pose, fit.growth)
    rim_of = dict(zip(circles[fit.used].tolist(), members[fit.used].tolist(), strict=True))
    others = taken | set(rim_of.values())
    free = scene.others(others)
    own = scene.ellipse[free]
    sizes = own.size
    found = []
    for circle in np.flatnonzero(seen).tolist():
        if circle in rim_of or len(free) == 0:
            continue
        # The rim that stands for it, if any: the nearest one that no other circle has.
        apart = np.linalg.norm(own.center - places.center[circle], axis=1)
        nearest = int(np.argmin(apart))
        major, minor = float(places.semi_major[circle]), float(places.semi_minor[circle])
        size = float(places[circle].size)
        ratio = float(sizes[nearest]) / size
        is_off = apart[nearest] > max(options.visibly_off_px, options.mismatch_share * minor)
        is_off |= abs(ratio - 1.0) * size > max(options.visibly_off_px, options.visibly_larger * size)
        if apart[nearest] < options.misfit_reach * major and max(ratio, 1.0 / ratio) < options.alike_ratio and is_off:
            found.append(circle)
    return tuple(found)


def _where_expected(
    scene: Scene, layout: BoardLayout, pose: RigidPose, growth: float, taken: set[int], options: BoardOptions
) -> tuple[IntArray, IntArray]:
    """Return the rims (k,) that lie where a pose puts circles of the layout, and these (k,)."""
    ellipse, seen = _expected(scene.camera, layout, pose, growth)
    free = scene.others(taken)
    visible = np.flatnonzero(seen)
    own, expected = scene.ellipse[free], ellipse[visible]
    pairs: list[tuple[float, int, int]] = []
    sizes = own.size
    for at, circle in enumerate(visible.tolist()):
        reach = options.reach_radii * float(expected.semi_major[at]) + options.least_reach_px
        apart = np.linalg.norm(own.center - expected.center[at], axis=1)
        size = float(expected[at].size)
        near = np.flatnonzero((apart < reach) & (np.abs(np.log(sizes / size)) < np.log(options.alike_ratio)))
        pairs += [(float(apart[i]), int(free[i]), circle) for i in near.tolist()]
    members: dict[int, int] = {}
    used: set[int] = set()
    for _, rim, circle in sorted(pairs):
        if rim not in used and circle not in members:
            members[circle] = rim
            used.add(rim)
    circles = np.array(sorted(members), np.int64)
    return np.array([members[circle] for circle in circles.tolist()], np.int64), circles


def _number_inside(scene: Scene, layout: BoardLayout, fit: BoardFit) -> int:
    """Return how many circles of a layout lie wholly within the image, on their visible side."""
    ellipse, seen = _expected(scene.camera, layout, fit.pose, fit.growth)
    low, high = ellipse.center - ellipse.semi_major[:, None], ellipse.center + ellipse.semi_major[:, None]
    inside = seen & np.all(low >= 0.0, axis=1) & np.all(high <= np.array(scene.image_size) - 1.0, axis=1)
    return int(np.count_nonzero(inside))


def _expected(camera: Camera, layout: BoardLayout, pose: RigidPose, growth: float) -> tuple[Ellipse, BoolArray]:
    """Return where a pose puts the circles of a layout, (n,) px, and which of them are seen from their side."""
    centers = layout.centers_mm @ pose.rotation.T + pose.translation
    normals = layout.normals @ pose.rotation.T
    seen = (centers[:, 2] > 0.0) & (np.einsum("ni,ni->n", centers, normals) < 0.0)
    safe = np.where(seen[:, None], centers, [0.0, 0.0, 1e6])
    factors = factor_from_circle(
        safe, np.where(seen[:, None], normals, [0.0, 0.0, -1.0]), layout.radius_mm * (1.0 + growth)
    )
    ellipse, found = image_ellipses(camera, factors)
    return ellipse, seen & found


def _offsets(scene: Scene, rims: BoardRims, members: IntArray, fit: BoardFit) -> FloatArray:
    """Return (k, 2) px from where a fit puts the centers of the circles' images to where these are."""
    center, normal, radius = circles_at(rims, fit.pose, fit.growth)
    expected, found = image_ellipses(scene.camera, factor_from_circle(center, normal, radius))
    return np.where(found[:, None], scene.ellipse.center[members] - expected.center, np.inf)


def _with_roll(
    scene: Scene, layout: BoardLayout, members: IntArray, circles: IntArray, fit: BoardFit
) -> tuple[BoardFit, IntArray, bool]:
    """Return the fit whose x axis is nearest the image's, of those that the layout's symmetries leave open."""
    same = symmetries(layout)
    if len(same) == 1:
        return fit, circles, False
    best: tuple[tuple[float, float], RigidPose, IntArray] | None = None
    for permutation in same:
        turn = rigid(layout.centers_mm[permutation], layout.centers_mm)
        pose = RigidPose(
            fit.pose.rotation @ turn.rotation, fit.pose.rotation @ turn.translation + fit.pose.translation
        )
        _, jacobian = scene.camera.project_with_jacobian(pose.translation[None])
        along = jacobian[0] @ pose.rotation[:, 0]
        along = along / max(float(np.linalg.norm(along)), 1e-12)
        # Down where two are equally near.
        key = (round(float(along[0]), 6), float(along[1]))
        if best is None or key > best[0]:
            best = key, pose, permutation[circles]
    assert best is not None
    _, pose, own = best
    again = fit_at(scene.board_rims(layout, members, own), pose, fit.growth, fit.used, grows=fit.growth != 0.0)
    return (fit, circles, True) if again is None else (again, own, True)


def rigid(source: FloatArray, target: FloatArray) -> RigidPose:
    """Return the rigid motion that takes `source` (n, 3) to `target` (n, 3). Source: Kabsch (1976)."""
    from_middle, to_middle = source.mean(axis=0), target.mean(axis=0)
    left, _, right = np.linalg.svd((source - from_middle).T @ (target - to_middle))
    # Of points in a plane the third direction is free: no reflection.
    turn = right.T @ np.diag([1.0, 1.0, np.linalg.det(right.T @ left.T)]) @ left.T
    return RigidPose(turn, to_middle - turn @ from_middle)


def _is_other(first: BoardFit, second: BoardFit, options: BoardOptions) -> bool:
    """Whether two fits are two minima."""
    away = np.linalg.norm(first.pose.rotation - second.pose.rotation)
    sigma = float(np.sqrt(np.trace(first.covariance[3:, 3:]) * first.excess))
    return bool(away > max(options.same_sigmas * sigma, 1e-6))


def _both_tilts(
    rims: BoardRims, layout: BoardLayout, fit: BoardFit, options: BoardOptions
) -> tuple[tuple[BoardFit, ...], float]:
    """Return the fit and, of a planar board, the one with the other tilt, if it is a minimum; and the chance of that.

    Both are judged on the rims that count in the first, with radii as in the first.
    """
    if not layout.is_planar:
        return (fit,), 0.0
    counted = rims[fit.used].grown(fit.growth)
    center = layout.centers_mm.mean(axis=0)
    first = minimum_near(counted, fit.pose)
    second = minimum_near(counted, mirrored(fit.pose, center, layout.normals[0]))
    if first is None or second is None or not _is_other(first, second, options):
        return (fit,), 0.0
    ambiguity = chance_of_second(first, second)
    if ambiguity < options.least_ambiguity:
        return (fit,), ambiguity
    other = replace(second, growth=fit.growth, chi_square=chi_squares(rims, second.pose, fit.growth), used=fit.used)
    return ((fit, other), ambiguity) if ambiguity <= 0.5 else ((other, fit), 1.0 - ambiguity)
