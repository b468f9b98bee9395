"""From a frame to a place: estimators, sensors of the source, the tracker."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from systems.hearing.far_field import locate_far_source
    from systems.hearing.ideal_source_sensor import (
        IdealSourceSensor,
        IdealSourceSensor_,
    )
    from systems.hearing.localise import HearingMemory, Localiser
    from systems.hearing.parameters import (
        IdealHearingParameters,
        TDOAParameters,
        TrackerParameters,
    )
    from systems.hearing.source_fix import SourceFix
    from systems.hearing.tdoa_estimator import TDOAEstimator
    from systems.hearing.tracking.source_tracker import SourceTracker, SourceTracker_
    from systems.hearing.tracking.tracker_model import TrackerModel
else:
    __getattr__, __dir__ = lazy_exports(__name__)

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
