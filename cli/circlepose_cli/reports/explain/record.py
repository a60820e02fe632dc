"""The report on one image as plain values for JSON."""

from __future__ import annotations

import math
from typing import Any

from circlepose.diagnostics.explain import ExplainedCircle, Explanation, segments_left_out
from circlepose.diagnostics.residuals import LevelResiduals
from circlepose.io.tables.json_records import image_record
from circlepose.solvers.mirror_view import MirrorView
from circlepose_cli.reports.explain.boards import board_records
from circlepose_cli.reports.explain.poses import dominating, mirror_view_of

SCHEMA = "circlepose.explain/1"


def report_record(explanation: Explanation) -> dict[str, Any]:
    """Return the report as plain values for JSON."""
    return {
        "schema": SCHEMA,
        **image_record(explanation.result),
        # Only of boards, so that what else is written is as it was.
        **({"boards": board_records(explanation.result.boards)} if explanation.result.boards else {}),
        "contours": explanation.contours,
        "rejected": dict(explanation.rejected),
        "stages": [
            {**_stages(circle), "mirror_view": _view_record(mirror_view_of(circle.result, explanation.circles))}
            for circle in explanation.circles
        ],
    }


def _stages(circle: ExplainedCircle) -> dict[str, Any]:
    contour, edges, levels, result = circle.contour, circle.edges, circle.levels, circle.result
    terms = result.candidates[result.chosen].covariance_terms if result.candidates else None
    return {
        "instance": result.instance,
        "circle": result.circle,
        "contour": None
        if contour is None
        else {
            "rim_used": contour.rim_used,
            "step_levels": contour.step,
            "residual_px": contour.residual_px,
            "evidence": contour.evidence,
        },
        "edges": {
            "places": len(edges.points),
            "rim_used": edges.rim_used,
            "residual_px": edges.cone.rms_px,
            "axis_error_px": edges.axis_error_px,
        },
        "levels": None if levels is None else _levels_record(circle, levels),
        "dominating": None if terms is None else {"position": dominating(terms, 0), "normal": dominating(terms, 1)},
    }


def _view_record(view: MirrorView | None) -> dict[str, float] | None:
    if view is None:
        return None
    return {"tilt_deg": math.degrees(view.tilt_rad), "both_pairs_fit_at_deg": math.degrees(view.mirror_tilt_rad)}


def _levels_record(circle: ExplainedCircle, levels: LevelResiduals) -> dict[str, Any]:
    return {
        "converged": levels.converged,
        "blur_px": levels.sigma_px,
        "blur_unequal": list(levels.unequal),
        "noise_levels": levels.noise_levels,
        "contrast_levels": levels.contrast_levels,
        "correlation": levels.correlation,
        "rim_used": levels.rim_used,
        "reach_px": levels.half_width_px,
        "pixels": len(levels.pixels),
        "pixels_at_rim_left_out": int(levels.crosses.sum()),
        "pixels_beside_left_out": int(levels.beside.sum()),
        "pixels_clipped": int(levels.clipped.sum()),
        "stretches_left_out_deg": [list(each) for each in segments_left_out(circle)],
    }
