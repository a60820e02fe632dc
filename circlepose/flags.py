"""The registry of statuses and flags: why there is no pose, and what is to be said of one that stands."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from enum import StrEnum


class Status(StrEnum):
    """Why an image or a circle has, or has not, a pose. The text of each is in `STATUS_MEANING`."""

    OK = "ok"
    UNREADABLE = "unreadable"
    NOT_AN_IMAGE = "not_an_image"
    TRUNCATED_IMAGE = "truncated_image"
    TOO_LARGE = "too_large"
    NOT_ALLOWED = "not_allowed"
    SIZE_MISMATCH = "size_mismatch"
    NO_CIRCLE = "no_circle"
    TOO_FEW_CIRCLES = "too_few_circles"
    LAYOUT_MISMATCH = "layout_mismatch"
    NO_WORLD_BOARD = "no_world_board"
    NO_POSE = "no_pose"
    TOO_FEW_POINTS = "too_few_points"
    POINTS_COINCIDE = "points_coincide"
    SELF_CROSSING = "self_crossing"
    TOUCHES_BORDER = "touches_border"
    TIMED_OUT = "timed_out"
    WORKER_DIED = "worker_died"
    INTERNAL_ERROR = "internal_error"


STATUS_MEANING: Mapping[Status, str] = {
    Status.OK: "measured",
    Status.UNREADABLE: "the file is missing or cannot be opened",
    Status.NOT_AN_IMAGE: "the file is no image of a known format",
    Status.TRUNCATED_IMAGE: "the image file ends early",
    Status.TOO_LARGE: "the image has more pixels, by its header, or bytes than are read",
    Status.NOT_ALLOWED: "the image's format is read only where the environment allows it",
    Status.SIZE_MISMATCH: "the image's size does not fit the calibration",
    Status.NO_CIRCLE: "nothing in the image is the image of the target",
    Status.TOO_FEW_CIRCLES: "fewer targets were found than were asked for; this row stands for those missing",
    Status.LAYOUT_MISMATCH: "the circles found are not those of the board's layout, or fit it in more than one place",
    Status.NO_WORLD_BOARD: "the world board, to which poses are relative, was not found, or more than once",
    Status.NO_POSE: "the contour was found but has no pose by this method",
    Status.TOO_FEW_POINTS: "the contour has fewer than 6 points",
    Status.POINTS_COINCIDE: "all points of the contour are the same",
    Status.SELF_CROSSING: "the contour crosses itself",
    Status.TOUCHES_BORDER: "the contour runs along the image's border, where the circle is cut off",
    Status.TIMED_OUT: "the image took longer than --timeout allows",
    Status.WORKER_DIED: "the process that measured the image died, twice: out of memory, or a crash in a decoder",
    Status.INTERNAL_ERROR: "a bug in circlepose; please report it",
}


@dataclass(frozen=True, slots=True)
class Failure:
    """Why a stage has no result: returned in place of the result, never raised."""

    status: Status
    reason: str
    """one sentence for a person"""


class Flag(StrEnum):
    """Remarks on a pose that stands. The text of each is in `FLAG_MEANING`."""

    AMBIGUOUS = "ambiguous"
    LONE_CIRCLE = "lone_circle"
    RING_MISFIT = "ring_misfit"
    NOT_FLAT = "not_flat"
    VANISHING_LINE_DISAGREES = "vanishing_line_disagrees"
    NEAR_RIGHT = "near_right"
    NEAR_DEGENERATE = "near_degenerate"
    POOR_FIT = "poor_fit"
    CHORD_MENDED = "chord_mended"
    PARTIAL_RIM = "partial_rim"
    EDGES_ONLY = "edges_only"
    DOUBTFUL = "doubtful"
    NESTED_RIMS = "nested_rims"
    OFF_PLANE = "off_plane"
    ROLL_AMBIGUOUS = "roll_ambiguous"
    RADIUS_MISFIT = "radius_misfit"
    NOT_IN_POSE = "not_in_pose"
    CIRCLES_MISFIT = "circles_misfit"
    RELATIVE_TO_BOARD = "relative_to_board"


FLAG_MEANING: Mapping[Flag, str] = {
    Flag.AMBIGUOUS: "the image does not settle which candidate is right; see ambiguity",
    Flag.LONE_CIRCLE: "only one circle of a ring target was found; its pose is that of a lone circle",
    Flag.RING_MISFIT: "the circles of the target are not seen where its radii, or its generatrix, put them",
    Flag.NOT_FLAT: "the rings are not in one plane but height_mm apart; measure the target as kind: coaxial",
    Flag.VANISHING_LINE_DISAGREES: "the normal from the vanishing line contradicts the chosen candidate",
    Flag.NEAR_RIGHT: "its image is a circle, within the precision of its axes; the tilt is ill-determined",
    Flag.NEAR_DEGENERATE: "seen almost edge-on; the image is a sliver",
    Flag.POOR_FIT: "the contour departs from the fitted ellipse by more than edge noise explains",
    Flag.CHORD_MENDED: "contour route: one of its four points lay on an outlier, which was left out",
    Flag.PARTIAL_RIM: "a tenth of the rim or more is hidden, cut off or without contrast; see rim_used",
    Flag.EDGES_ONLY: "measured from edges alone: no gray levels could be fitted; only a rough rim has a covariance",
    Flag.DOUBTFUL: "may be round by chance: its score is below the least by default; --min-score asked for it",
    Flag.NESTED_RIMS: "the circle's other concentric rims could be the target's, too; see nested_rims in JSON",
    Flag.OFF_PLANE: "all circles were declared to lie in one plane, but this one does not; it keeps its own pose",
    Flag.ROLL_AMBIGUOUS: "the layout maps on itself by a turn; of these poses the one whose x is nearest the image's",
    Flag.RADIUS_MISFIT: "the circles are larger or smaller than stated beside their distances, which were believed",
    Flag.NOT_IN_POSE: "the board's pose does not rest on this circle: it was not seen, or misfits",
    Flag.CIRCLES_MISFIT: "some circles are seen, but not where the layout or the size stated for them puts them",
    Flag.RELATIVE_TO_BOARD: "the pose is in the frame of the world board, not in that of the camera",
}


def in_order(flags: Collection[Flag]) -> tuple[Flag, ...]:
    """Return flags in the order of the registry, each once."""
    return tuple(flag for flag in Flag if flag in flags)


class SettledBy(StrEnum):
    """What settled which candidate of a circle is chosen. The text of each is in `SETTLED_BY_MEANING`."""

    VANISHING_LINE = "vanishing_line"
    GENERATRIX = "generatrix"
    JOINT_FIT = "joint_fit"
    COMMON_PLANE = "common_plane"
    HINT = "hint"
    NONE = "none"


SETTLED_BY_MEANING: Mapping[SettledBy, str] = {
    SettledBy.VANISHING_LINE: "the normal from the vanishing line of two coplanar circles settles it alone",
    SettledBy.GENERATRIX: "the generatrix of two coaxial circles, at both ends, settles it alone",
    SettledBy.JOINT_FIT: "one pose fitted to all rims of a ring target; neither of the above settles it alone",
    SettledBy.COMMON_PLANE: "the plane that several lone circles share",
    SettledBy.HINT: "a hint on a lone circle: a rough normal, the vertical or the side that it faces",
    SettledBy.NONE: "nothing does, or there is one candidate",
}
