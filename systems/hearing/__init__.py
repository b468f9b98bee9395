"""From a frame to a place: estimators, sensors of the source, the tracker."""

from systems.hearing.far_field import locate_far_source
from systems.hearing.ideal_source_sensor import (
    IdealHearingParameters,
    IdealSourceSensor,
    IdealSourceSensor_,
)
from systems.hearing.localise import HearingMemory, Localiser, TDOAParameters
from systems.hearing.source_fix import SourceFix
from systems.hearing.source_tracker import SourceTracker, SourceTracker_
from systems.hearing.tdoa_estimator import TDOAEstimator
from systems.hearing.tracker_model import TrackerModel, TrackerParameters

__all__ = [
    "HearingMemory",
    "IdealHearingParameters",
    "IdealSourceSensor",
    "IdealSourceSensor_",
    "Localiser",
    "SourceFix",
    "SourceTracker",
    "SourceTracker_",
    "TDOAEstimator",
    "TDOAParameters",
    "TrackerModel",
    "TrackerParameters",
    "locate_far_source",
]
