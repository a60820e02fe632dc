"""The tunable numbers of the measurement: from a contour to a rim, and from the rim to poses with flags.

The source of each number is named: `statistical` is a quantile of a normal distribution in standard deviations,
`numerical` follows from the arithmetic, `empirical` was set by trial on rendered images and photographs, and no
derivation is recorded.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Self

from circlepose.detection.options import DetectionOptions
from circlepose.photometry.options import PhotometryOptions


@dataclass(frozen=True, slots=True)
class MeasurementOptions:
    """Numbers of the measurement. Lengths are px of the raw image; a share is from 0 to 1."""

    detection: DetectionOptions = field(default_factory=DetectionOptions)
    """those of the detection, and in `detection.photometry` of the fits to gray levels"""

    # Edges along a predicted rim.
    edge_half_width_px: float = 2.5
    """px; half-width of the search for an edge across the rim; empirical"""
    edge_spacing_px: float = 1.5
    """px; distance of neighboring samples along the rim; empirical"""
    least_samples: int = 48
    """samples; at least along one rim; empirical"""
    most_samples: int = 360
    """samples; at most along one rim; empirical"""
    outlier_sigmas: float = 4.0
    """robust standard deviations; an edge farther from the rim is an outlier; statistical"""
    least_outlier_px: float = 0.05
    """px; an edge closer to the rim is never an outlier; empirical"""
    outlier_rounds: int = 3
    """rounds of removing outliers; empirical"""
    least_edge_noise_px: float = 0.005
    """px; scatter of edges in an image without noise, from pixels and whole levels; empirical"""
    whole_rim_share: float = 0.93
    """share of the rim; a rim with more of it on edges is seen whole; empirical"""
    smooth_ratio: float = 1.6
    """rms distance of the edges over the scatter of neighboring edges, up to which nothing is hidden; empirical"""
    smooth_px: float = 0.12
    """px; rms distance of the edges up to which nothing is hidden, and a contour needs no new edges; empirical"""
    least_samples_for_parts: int = 60
    """samples; with fewer, a hidden part cannot be distinguished from the rest; empirical"""
    agreeing_sigmas: float = 3.5
    """scatters of neighboring edges; an edge within this distance agrees with the rim; statistical"""
    least_agreeing_share: float = 0.3
    """share of the samples that must agree on one ellipse; empirical"""

    # Rims so thin that blur joins their two sides, and rims with sharp tips.
    hidden_rim_share: float = 0.8
    """share of the rim; a thin rim with less of it seen is partly hidden; empirical"""
    sharp_semi_major_px: float = 30.0
    """px; semi-major axis from which tips may be sharp; empirical"""
    sharp_axis_ratio: float = 0.3
    """semi-minor over semi-major axis, below which tips may be sharp; empirical"""
    sharp_radius_px: float = 5.0
    """px; radius of curvature at the tips, below which edges there are biased; empirical"""
    worst_length_share: float = 0.02
    """standard deviation of the semi-major axis over it, up to which the length is determined; empirical"""
    worst_hidden_length_share: float = 0.005
    """the same of a thin rim that is partly hidden; empirical"""
    worst_edge_length_share: float = 0.0005
    """the same of edges with independent errors of `sharp_edge_error_px`; empirical"""
    sharp_edge_error_px: float = 0.05
    """px; assumed error of each edge of a rim with sharp tips; empirical"""
    worst_thin_rms_share: float = 0.25
    """rms residual over the peak level, up to which the fit of a thin ellipse is accepted; empirical"""
    segment_sigmas: float = 3.0
    """standard deviations; a thin ellipse with a smaller semi-minor axis may be a segment; statistical"""

    # The fit to the gray levels.
    most_pixels: int = 22_000
    """pixels fitted at once; limits memory and keeps the caches; empirical"""
    least_rims_for_blur: int = 5
    """rims of one image from which a blur that they share is estimated; empirical"""
    shared_blur_sigma: float = 0.03
    """standard deviation of the inequality of a shared blur; empirical"""
    least_blur_inequality: float = 0.1
    """inequality of the blur by direction, below which it cannot be distinguished from texture; empirical"""
    least_refit_px: float = 5.0
    """px; semi-minor axis from which a thin rim is fitted again with levels on both sides; empirical: on narrower
    rendered slivers lengths are off by more than three sigmas too often, from 3 px at 1.5 levels of noise, 4 at 8"""
    small_px: float = 20.0
    """px; semi-minor axis below which unequal blur looks like a tilt; empirical"""

    # Whether such a fit is accepted.
    worst_noise_share: float = 0.3
    """standard deviation of the residuals over the contrast, up to which a fit is accepted, whatever they are;
    empirical"""
    explained_noise_ratio: float = 1.3
    """residuals over the noise of the image, up to which they are noise; empirical"""
    worst_explained_share: float = 1.0
    """the same as `worst_noise_share` where the residuals are noise; empirical"""
    unexplained_noise_ratio: float = 3.0
    """residuals over the noise of the image, above which the model does not explain a tiny disc; empirical"""
    tiny_px: float = 7.0
    """px; semi-minor axis below which a disc is tiny; empirical"""
    tiny_crowded_px: float = 4.5
    """px; the same where neighbors enter the band, whose light is known only in part; empirical"""
    textured_noise_share: float = 0.12
    """residuals over the contrast, above which a disc of any size needs `unexplained_noise_ratio`; empirical"""
    focused_px: float = 1.2
    """px; blur up to which an image is in focus; empirical"""
    least_width_sigmas: float = 2.8
    """blurs; semi-minor axis below which width and blur are alike, unless the levels settle both; empirical"""
    least_settled_sigmas: float = 1.5
    """blurs; the same below which they are alike in any case: there a disc is a Gaussian; numerical"""
    worst_growth_share: float = 0.05
    """standard deviation of the width over it, up to which the levels settle both; empirical"""
    least_rim_share: float = 0.2
    """share of the rim that a fit must use; empirical"""
    least_kept_share: float = 0.75
    """share of the rim in use before, that a fit must use again; empirical"""
    visible_rim_share: float = 0.9
    """share of the rim; with less in use a part of it is hidden, flag `partial_rim`; empirical"""
    farthest_px: float = 2.5
    """px; distance that a fit may move a rim from its edges; empirical"""
    farthest_hidden_px: float = 0.05
    """px; the same where a part of the rim is hidden; empirical"""

    farthest_from_edges: float = 3.0
    """scatters of the edges about their own ellipse, that they may be from the fitted rim; empirical"""
    least_edge_error_px: float = 0.1
    """px; that scatter at least, as edges are biased by so much; empirical"""
    most_shift: float = 0.5
    """blurs by which clipping may shift all edges of a rim alike; empirical"""

    least_ragged: float = 0.5
    """scatter of the edges over the largest of a smooth rim, from which their residuals give a covariance where the
    levels do not; empirical"""
    # Circles that several views show: gray and color mixes.
    gray_preference: float = 2.0
    """factor on the contrast over noise in gray; colors are displaced against each other by lens and compression;
    empirical"""
    least_mix_score: float = 0.5
    """score of a contour in a color mix from which it counts without a fit to the levels; empirical: few leaves in
    rendered foliage reach it, discs do"""
    same_rim_share: float = 0.5
    """share of a rim that runs along another from which both are one edge; empirical"""
    same_overlap_share: float = 0.5
    """distance of the centers over the smaller semi-minor axis up to which two views show one thing; empirical"""
    same_size_ratio: float = 0.7
    """size ratio from which they do; empirical"""

    largest_of_circle: float = 1.25
    """size of a rim over that of a circle around its center, above which it is another thing's; empirical"""

    # Degenerate cones and flags.
    settle_sigmas: float = 3.0
    """standard deviations by which the semi-axes must differ from each other, and the minor from 0; statistical"""
    segment_px: float = 0.35
    """px; semi-minor axis below which a thin disc cannot be distinguished from a segment; empirical"""
    near_right_sigmas: float = 8.0
    """standard deviations; semi-axes that differ by less leave the tilt ill-determined; empirical"""
    sliver_px: float = 2.0
    """px; semi-minor axis below which noise may be all the width, flag `near_degenerate`; empirical"""
    poor_fit_px: float = 0.35
    """px; rms distance of the edges above which the flag `poor_fit` is set; empirical"""
    most_residual_px: float = math.inf
    """px; rms distance of the edges above which a rim is not used; the caller's"""

    # A contour that the caller extracted.
    border_px: float = 1.0
    """px; a point closer to the image's border lies on it; numerical"""
    worst_border_share: float = 0.05
    """share of a contour that may lie on the border; empirical"""
    least_start_px: float = 0.5
    """px; semi-minor axis, at least, from which a fit to the gray levels along a contour starts; empirical"""

    def with_bounds(self, min_score: float | None, max_residual_px: float | None) -> Self:
        """Return the numbers with the bounds that a caller sets on what counts as round; None leaves one."""
        if min_score is None and max_residual_px is None:
            return self
        most_residual_px = self.most_residual_px if max_residual_px is None else max_residual_px
        detection = self.detection.with_least_score(min_score)
        return replace(self, detection=detection, most_residual_px=most_residual_px)

    @property
    def photometry(self) -> PhotometryOptions:
        """Those of the fits to gray levels, which the detection of slivers shares."""
        return self.detection.photometry


DEFAULT = MeasurementOptions()
