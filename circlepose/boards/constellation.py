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
from circlepose.boards.pose import RigidPose
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
    found: list[Assignment] = []
    counts: list[int] = []
    for begin in range(0, len(rotations), options.poses_at_once):
        part = slice(begin, begin + options.poses_at_once)
        members, near = _matched(seen, layout, camera, free, rotations[part], translations[part], options)
        number = near.sum(axis=1)
        for h in np.argsort(-number, kind="stable")[: options.most_assignments].tolist():
            if number[h] >= 2:
                circles = np.flatnonzero(near[h])
                pose = RigidPose(rotations[part][h], translations[part][h])
                found.append(Assignment(members[h][circles], circles, pose))
                counts.append(int(number[h]))
    distinct: dict[tuple[tuple[int, int], ...], Assignment] = {}
    for h in np.argsort(-np.array(counts), kind="stable").tolist():
        each = found[h]
        distinct.setdefault(tuple(zip(each.members.tolist(), each.circles.tolist(), strict=True)), each)
    return list(distinct.values())[: options.most_assignments]


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
    rotations, translations, misfits = [], [], []
    on_board = layout.centers_mm[b] - layout.centers_mm[a]
    length = np.linalg.norm(on_board, axis=1)
    along = np.einsum("pi,pi->p", on_board, layout.normals[a]) / length
    for candidate in (0, 1):
        for i, j in zip(first.tolist(), second.tolist(), strict=True):
            center = seen.centers[i, candidate] * layout.radius_mm[a, None]
            # The nearer of the second rim's candidates.
            others = seen.centers[j][None] * layout.radius_mm[b, None, None]
            offset = others - center[:, None]
            sizes = np.linalg.norm(offset, axis=2)
            tilt = np.einsum("pci,i->pc", offset, seen.normals[i, candidate]) / np.maximum(sizes, 1e-9)
            alike = np.einsum("ci,i->c", seen.normals[j], seen.normals[i, candidate])[None]
            wanted = np.einsum("pi,pi->p", layout.normals[a], layout.normals[b])[:, None]
            misfit = (
                (np.log(np.maximum(sizes, 1e-9) / length[:, None]) / options.pair_length) ** 2
                + ((tilt - along[:, None]) / options.pair_tilt) ** 2
                + ((alike - wanted) / options.pair_tilt) ** 2
            )
            best = np.argmin(misfit, axis=1)
            least = misfit[np.arange(len(a)), best]
            for p in np.flatnonzero(least < options.most_pair_misfit).tolist():
                rotation = _turned(layout.normals[a[p]], on_board[p], seen.normals[i, candidate], offset[p, best[p]])
                rotations.append(rotation)
                translations.append(center[p] - rotation @ layout.centers_mm[a[p]])
                misfits.append(float(least[p]))
    order = np.argsort(misfits, kind="stable")[: options.most_hypotheses]
    return np.array(rotations).reshape(-1, 3, 3)[order], np.array(translations).reshape(-1, 3)[order]


def _turned(normal: FloatArray, offset: FloatArray, seen_normal: FloatArray, seen_offset: FloatArray) -> FloatArray:
    """Return the rotation that takes `normal` to `seen_normal`, and `offset` as near to `seen_offset` as it can."""
    return _frame(seen_normal, seen_offset) @ _frame(normal, offset).T


def _frame(normal: FloatArray, offset: FloatArray) -> FloatArray:
    across = offset - (offset @ normal) * normal
    length = float(np.linalg.norm(across))
    if length < 1e-9 * float(np.linalg.norm(offset)):
        across = np.cross(normal, [1.0, 0.0, 0.0] if abs(normal[0]) < 0.9 else [0.0, 1.0, 0.0])
        length = float(np.linalg.norm(across))
    x = across / length
    return np.stack([x, np.cross(normal, x), normal], axis=1)


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
    sizes = np.sqrt(own.semi_major * own.semi_minor)
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
