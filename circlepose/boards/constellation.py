"""Which circle is which without a lattice: poses from pairs of circles, judged by all.

A rim gives two poses of its circle, but for the roll, which the direction to a second circle gives. Each pair of rims
is tried as each pair of the layout's circles that is as far apart and tilted alike; the pose that puts most circles
where rims are is kept.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circlepose._typing import FloatArray, IntArray
from circlepose.boards.options import DEFAULT, BoardOptions
from circlepose.boards.pose import RigidPose, rotation_between
from circlepose.boards.symmetry import symmetries
from circlepose.camera.camera import Camera
from circlepose.geometry.ellipse import Ellipse
from circlepose.targets.board import BoardLayout


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """Rims with the poses of a circle of radius 1 that each could be."""

    ellipse: Ellipse
    """(m,) raw image, px"""
    centers: FloatArray
    """(m, 2, 3) in radii, camera frame"""
    normals: FloatArray
    """(m, 2, 3) unit"""


@dataclass(frozen=True, slots=True, eq=False)
class Assignment:
    """Which rim is which circle of a layout, and about where the board is."""

    members: IntArray
    """(k,) rims"""
    circles: IntArray
    """(k,) circles of the layout"""
    pose: RigidPose


def constellations(
    seen: Sighting, layout: BoardLayout, camera: Camera, free: IntArray, options: BoardOptions = DEFAULT
) -> list[Assignment]:
    """Return assignments of the rims `free` to a layout, those of most rims first, each different."""
    rotations, translations = _hypotheses(seen, layout, free, options)
    if len(rotations) == 0:
        return []
    same = symmetries(layout)
    distinct: dict[frozenset[tuple[int, int]], Assignment] = {}
    for begin in range(0, len(rotations), options.poses_at_once):
        part = slice(begin, begin + options.poses_at_once)
        members, near = _matched(seen, layout, camera, free, rotations[part], translations[part], options)
        for h in np.flatnonzero(near.sum(axis=1) >= 2).tolist():
            circles = np.flatnonzero(near[h])
            own = members[h][circles]
            alike = [frozenset(zip(own.tolist(), each[circles].tolist(), strict=True)) for each in same]
            if not any(each in distinct for each in alike):
                pose = RigidPose(rotations[part][h], translations[part][h])
                distinct[alike[0]] = Assignment(own, circles, pose)
    return sorted(distinct.values(), key=lambda each: -len(each.members))[: options.most_assignments]


def _hypotheses(
    seen: Sighting, layout: BoardLayout, free: IntArray, options: BoardOptions
) -> tuple[FloatArray, FloatArray]:
    """Return rotations (h, 3, 3) and translations (h, 3) from pairs that may be pairs of the layout, best first."""
    rims = free[: options.most_rims]
    first, second = (each.ravel() for each in np.meshgrid(rims, rims, indexing="ij"))
    first, second = first[first != second], second[first != second]
    a, b = (each.ravel() for each in np.meshgrid(np.arange(len(layout)), np.arange(len(layout)), indexing="ij"))
    a, b = a[a != b], b[a != b]
    if len(a) > options.most_pairs:
        # Pairs far apart give the better roll, but those close together are seen together.
        apart = np.linalg.norm(layout.centers_mm[a] - layout.centers_mm[b], axis=1)
        kept = np.sort(np.argsort(apart, kind="stable")[: options.most_pairs])
        a, b = a[kept], b[kept]
    on_board = layout.centers_mm[b] - layout.centers_mm[a]
    length = np.linalg.norm(on_board, axis=1)
    along = np.einsum("pi,pi->p", on_board, layout.normals[a]) / length
    wanted = np.einsum("pi,pi->p", layout.normals[a], layout.normals[b])[:, None]
    found: list[FloatArray] = []
    for candidate in (0, 1):
        for i, j in zip(first.tolist(), second.tolist(), strict=True):
            # The nearer of the second rim's candidates.
            offset = seen.centers[j] * layout.radius_mm[b, None, None]
            offset = offset - seen.centers[i, candidate] * layout.radius_mm[a, None, None]
            sizes = np.maximum(np.linalg.norm(offset, axis=2), 1e-9)
            tilt = offset @ seen.normals[i, candidate] / sizes
            alike = (seen.normals[j] @ seen.normals[i, candidate])[None]
            misfit = (
                (np.log(sizes / length[:, None]) / options.pair_length) ** 2
                + ((tilt - along[:, None]) / options.pair_tilt) ** 2
                + ((alike - wanted) / options.pair_tilt) ** 2
            )
            best = np.argmin(misfit, axis=1)
            pairs = np.flatnonzero(misfit[np.arange(len(a)), best] < options.most_pair_misfit)
            rows = [np.full(len(pairs), value) for value in (i, candidate, j)]
            found.append(np.column_stack([*rows, best[pairs], pairs, misfit[pairs, best[pairs]]]))
    table = np.concatenate(found)
    table = table[np.argsort(table[:, 5], kind="stable")[: options.most_hypotheses]]
    rotations, translations = np.empty((len(table), 3, 3)), np.empty((len(table), 3))
    for h, (i, candidate, j, other, p) in enumerate(table[:, :5].astype(np.int64).tolist()):
        center = seen.centers[i, candidate] * layout.radius_mm[a[p]]
        offset = seen.centers[j, other] * layout.radius_mm[b[p]] - center
        rotations[h] = rotation_between(layout.normals[a[p]], on_board[p], seen.normals[i, candidate], offset)
        translations[h] = center - rotations[h] @ layout.centers_mm[a[p]]
    return rotations, translations


def _matched(
    seen: Sighting,
    layout: BoardLayout,
    camera: Camera,
    free: IntArray,
    rotations: FloatArray,
    translations: FloatArray,
    options: BoardOptions,
) -> tuple[IntArray, FloatArray]:
    """Return the rim (h, n) nearest to each circle of each pose, and whether it is close to it and as large."""
    centers = np.einsum("hij,nj->hni", rotations, layout.centers_mm) + translations[:, None]
    normals = np.einsum("hij,nj->hni", rotations, layout.normals)
    flat = centers.reshape(-1, 3)
    with np.errstate(all="ignore"):
        places = camera.project(flat).reshape(*centers.shape[:2], 2)
        focal = float(np.sqrt(camera.camera_matrix[0, 0] * camera.camera_matrix[1, 1]))
        distance = np.linalg.norm(centers, axis=2)
        facing = -np.einsum("hni,hni->hn", normals, centers) / distance
        # About the geometric mean of the semi-axes.
        size = focal * layout.radius_mm / centers[..., 2] * np.sqrt(np.maximum(facing, 0.02))
    members = np.zeros(centers.shape[:2], np.int64)
    near = np.zeros(centers.shape[:2], np.bool_)
    own = seen.ellipse[free]
    sizes = own.size
    for h in range(len(rotations)):
        offset = places[h][:, None] - own.center[None]
        apart = np.linalg.norm(offset, axis=2)
        apart = np.where(np.isfinite(apart), apart, np.inf)
        best = np.argmin(apart, axis=1)
        n = np.arange(len(best))
        ratio = sizes[best] / np.maximum(size[h], 1e-9)
        is_near = (apart[n, best] < options.rough_reach * own.semi_major[best]) & (centers[h, :, 2] > 0.0)
        is_near &= (facing[h] > 0.0) & (ratio > 1.0 / options.alike_ratio) & (ratio < options.alike_ratio)
        # A rim is one circle: the nearest.
        order = np.argsort(apart[n, best], kind="stable")
        order = order[is_near[order]]
        _, once = np.unique(best[order], return_index=True)
        near[h, order[once]] = True
        members[h] = free[best]
    return members, near
