"""An inspection in plain words, and as JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator

from circlepose.detection.contour import Contour
from circlepose.diagnostics.inspection import Inspection
from circlepose.io.text.escaping import printable
from circlepose.targets.target import AxisIntervals


def report_text(name: str, inspection: Inspection) -> str:
    """Return the lines for a person."""
    return "\n".join(_lines(name, inspection))


def _lines(name: str, inspection: Inspection) -> Iterator[str]:
    width, height = inspection.image_size
    contours = inspection.extraction.contours
    yield f"{printable(name)}: {width} x {height} px, {len(contours)} found"
    if inspection.remark:
        yield f"remark: {inspection.remark}"
    if contours:
        yield f"{'#':>4}  {'center px':>16}  {'axes px':>15}  why kept"
    for number, contour in enumerate(contours):
        x, y = contour.ellipse.center
        major, minor = 2.0 * contour.ellipse.semi_major, 2.0 * contour.ellipse.semi_minor
        yield f"{number:>4}  {x:>7.1f}, {y:>7.1f}  {major:>6.1f} x {minor:>6.1f}  {contour.kept_because}"
    rejected = [(number, reason) for reason, number in inspection.extraction.rejected.items() if number]
    if rejected:
        yield "rejected:"
    for number, reason in sorted(rejected, reverse=True):
        yield f"{number:>6}  {reason}"
    if inspection.suggested is not None:
        yield f"suggested: {_options(inspection.suggested)}"


def _options(intervals: AxisIntervals) -> str:
    named = (("--major-px", intervals.major_px), ("--minor-px", intervals.minor_px))
    return " ".join(
        f"{option} {low:g}:{high:g}" for option, (low, high) in ((o, i) for o, i in named if i is not None)
    )


def report_json(name: str, inspection: Inspection) -> str:
    """Return the same as a JSON object, with the refused contours one by one."""
    found = inspection.extraction
    suggested = inspection.suggested
    record = {
        "schema": "circlepose.inspection/1",
        "image": name,
        "width": inspection.image_size[0],
        "height": inspection.image_size[1],
        "remark": inspection.remark,
        "found": [_contour(contour) for contour in found.contours],
        "refused": [
            {"reason": str(reason), **_ellipse(*values)}
            for reason, *values in zip(
                found.refused_why,
                found.refused.center.tolist(),
                found.refused.semi_major.tolist(),
                found.refused.semi_minor.tolist(),
                found.refused.angle.tolist(),
                strict=True,
            )
        ],
        "rejected": {str(reason): number for reason, number in sorted(found.rejected.items()) if number},
        "suggested": None if suggested is None else {"major_px": suggested.major_px, "minor_px": suggested.minor_px},
    }
    return json.dumps(record, indent=2, allow_nan=False)


def _contour(contour: Contour) -> dict[str, object]:
    ellipse = contour.ellipse
    return {
        **_ellipse(
            ellipse.center.tolist(), float(ellipse.semi_major), float(ellipse.semi_minor), float(ellipse.angle)
        ),
        "score": round(contour.score, 4),
        "rim_used": round(contour.rim_used, 4),
        "residual_px": round(contour.residual_px, 4),
        "step": round(contour.step, 2),
        "inside": "darker" if contour.polarity > 0 else "brighter",
        "color_mix": None if contour.color_mix is None else dict(contour.color_mix),
    }


def _ellipse(center: list[float], semi_major: float, semi_minor: float, angle: float) -> dict[str, object]:
    return {
        "center_px": [round(v, 3) for v in center],
        "semi_major_px": round(semi_major, 3),
        "semi_minor_px": round(semi_minor, 3),
        "angle_deg": round(math.degrees(angle), 3),
    }
