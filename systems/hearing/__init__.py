"""From a frame to a place: estimators, sensors of the source, the tracker."""
