"""The rows of the studies as sheets: the papers' columns, then what the papers could not say."""

from __future__ import annotations

from collections.abc import Sequence

from circlepose.io.tables.paper_layouts import TABLE1_COLUMNS
from circlepose.studies.gcc import PRINTED_LIMIT_MM, GccRow
from circlepose.studies.noise import NoiseRow
from circlepose.studies.published import GENERATRIX_MM
from circlepose.studies.table1 import OUTLIER_REACH_PX, Table1Row
from circlepose.studies.table2 import Table2Row
from circlepose_cli.output.sheets import Sheet


def table1_sheet(rows: Sequence[Table1Row]) -> Sheet:
    """Return Table I of Chen & Huang."""
    method, image, center, position, normal, orientation = TABLE1_COLUMNS
    decimals = {method: 0, "Source": 0, image: 0, center: 2, position: 2, normal: 2, orientation: 2}
    return Sheet(
        "study.table1",
        {**decimals, "Position error (mm)": 2, "Orientation error (deg)": 2},
        tuple(
            (
                row.method,
                row.source,
                f"({row.image})",
                row.center_mm,
                row.position_difference_mm,
                row.normal,
                row.orientation_difference_deg,
                row.position_error_mm,
                row.orientation_error_deg,
            )
            for row in rows
        ),
        (
            "A compact disc of radius 60 mm, at the printed poses of `Our method`; (c) is (a), touched by a bar.",
            "print: the paper's numbers, of its own photographs. circlepose: this program's contours and fits.",
            "plain contour: the whole-pixel border of the thresholded image, with the bar on it up to "
            f"{OUTLIER_REACH_PX:.0f} px from the rim; chen-huang-contour takes four points of it, the others an "
            "algebraic ellipse fit to all of it.",
            "Each row is the candidate nearest to the truth. Differences are to Chen & Huang's method, of the same "
            "source and image; errors are to the exact pose that was rendered.",
        ),
    )


def noise_sheet(rows: Sequence[NoiseRow], repeats: int, seed: int) -> Sheet:
    """Return the noise experiment of Chen & Huang."""
    columns = ("Reading", "Perturbed", "Noise (px)")
    spreads = ("SD of centre (mm)", "SD of normal (deg)", "Bias of centre (mm)", "Bias of normal (deg)")
    return Sheet(
        "study.noise",
        {**dict.fromkeys(columns, 0), **dict.fromkeys(spreads, 2), "No pose": 0},
        tuple(
            (
                row.reading,
                row.points,
                row.noise_px,
                row.center_sd_mm,
                row.normal_sd_deg,
                row.center_bias_mm,
                row.normal_bias_deg,
                row.no_pose,
            )
            for row in rows
        ),
        (
            "Noise: Gaussian, of that standard deviation in x and in y of each perturbed point, all independent; "
            f"{repeats} repeats, seed {seed}.",
            "p, q, b, c: the paper's four feature points. whole contour: a point per px of the rim's image, to which "
            "`fit_cone` fits the viewing cone. chords found anew: those points, and p, q, b, c are picked from them.",
            "SD of centre: root mean square distance to the mean centre, all three coordinates together. SD of "
            "normal: root mean square angle to the mean direction. Bias: of these means, to the truth. No pose: "
            "perturbations left out because they had none.",
            "The paper states neither the view nor how its SD is defined. Pixels are squares of 0.01212 mm unless "
            "said; the last reading is a view picked here, as its numbers are near the printed ones.",
        ),
    )


def gcc_sheet(rows: Sequence[GccRow], seed: int) -> Sheet:
    """Return the deviations of GCC over many scenes, Fig. 9 of Fu & Zhou."""
    deviations = ("Right pair, median (mm)", "Right pair, largest (mm)", "Other pair, smallest (mm)")
    return Sheet(
        "study.gcc",
        {
            **dict.fromkeys(("Part", "Tilt (deg)", "Scenes", "No pose"), 0),
            **dict.fromkeys(deviations, 2),
            **dict.fromkeys(("Right by GCC", "Right by estimate"), 0),
        },
        tuple(
            (
                row.part,
                row.tilts,
                row.scenes,
                row.no_pose,
                row.median_mm,
                row.most_mm,
                row.least_other_mm,
                row.gcc_right,
                row.chosen_right,
            )
            for row in rows
        ),
        (
            f"A part of radii 45 and 30 mm and generatrix {GENERATRIX_MM:g} mm, 0.6 to 0.85 m away, at random poses; "
            f"rendered in half the paper's resolution, seed {seed}. Tilt: of the normal from the line of sight.",
            "Right pair, other pair: absolute deviation of GCC from the part's, for the candidates of the true pose "
            "and for the other ones, measured at the end of the diameters that is nearer to the camera.",
            "Right by GCC: scenes in which the right pair's deviation is the smaller one. Right by estimate: scenes "
            "in which `estimate` chose the right candidate.",
            "print: the scenes of Table 2, whose deviation is from the calibrated GCC of the scene. The paper's text "
            f"gives less than {PRINTED_LIMIT_MM:g} mm for the right pair over different scenes.",
        ),
    )


def table2_sheet(rows: Sequence[Table2Row]) -> Sheet:
    """Return Tables 1 and 2 of Fu & Zhou."""
    texts = dict.fromkeys(("Scene", "Source", "Candidate"), 0)
    return Sheet(
        "study.table2",
        {**texts, "UN": 4, "TV": 4, "GCC": 2, "TV error (mm)": 3, "TV distance (mm)": 3, "UN error (deg)": 3},
        tuple(
            (
                row.scene,
                row.source,
                row.candidate,
                row.normal,
                row.center_mm,
                row.generatrix_mm,
                row.center_error_mm,
                row.position_error_mm,
                row.orientation_error_deg,
            )
            for row in rows
        ),
        (
            "1a to 1d: Table 1, coplanar rings of radii 50 and 30 mm. 2a, 2b: Table 2, a boss of radii 45 and 30 mm. "
            "Rendered at the calibrated poses, in half the paper's resolution; the paper does not print its radii.",
            "UN: unit normal, towards the camera (printed ones are turned round). TV: centre of the largest circle, "
            "mm. GCC: generatrix between the two circles, mm; the part's is 45.21.",
            "Errors are to the calibrated pose: for circlepose the exact truth, for the paper its measuring arm. "
            "That of TV is printed by component and without signs, as in Table 1.",
        ),
    )
