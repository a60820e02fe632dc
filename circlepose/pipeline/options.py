"""The tunable numbers of all stages."""

from __future__ import annotations

from dataclasses import dataclass, field

from circlepose import _arguments
from circlepose.boards.options import BoardOptions
from circlepose.disambiguation.options import DisambiguationOptions
from circlepose.imaging.color_mixes import ColorMixOptions
from circlepose.measurement.options import MeasurementOptions
from circlepose.rings.options import RingOptions


@dataclass(frozen=True, slots=True)
class EstimateOptions:
    """The tunable numbers of each stage: `options=` of `estimate`. The defaults suit all but odd images."""

    measurement: MeasurementOptions = field(default_factory=MeasurementOptions)
    """in it also those of the detection and of the fits to gray levels"""
    rings: RingOptions = field(default_factory=RingOptions)
    disambiguation: DisambiguationOptions = field(default_factory=DisambiguationOptions)
    color_mixes: ColorMixOptions = field(default_factory=ColorMixOptions)
    boards: BoardOptions = field(default_factory=BoardOptions)

    def __post_init__(self) -> None:
        _arguments.instance_of(ColorMixOptions, "color_mixes", self.color_mixes, "ColorMixOptions(...)")
        _arguments.instance_of(BoardOptions, "boards", self.boards, "BoardOptions(...)")
        _arguments.instance_of(MeasurementOptions, "measurement", self.measurement, "MeasurementOptions(...)")
        _arguments.instance_of(RingOptions, "rings", self.rings, "RingOptions(...)")
        _arguments.instance_of(
            DisambiguationOptions, "disambiguation", self.disambiguation, "DisambiguationOptions(...)"
        )


ESTIMATE_OPTIONS = EstimateOptions()
