"""Hearing: estimators and ideal sensor of the source, and the tracker."""
