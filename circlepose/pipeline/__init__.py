"""One image through all stages: detection, measurement, poses, disambiguation, uncertainty."""

from circlepose.pipeline.options import ESTIMATE_OPTIONS, EstimateOptions
from circlepose.pipeline.stages import estimate, estimate_with_trace

__all__ = ["ESTIMATE_OPTIONS", "EstimateOptions", "estimate", "estimate_with_trace"]
