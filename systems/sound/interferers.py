"""Sounds that nobody is to follow."""

from __future__ import annotations

from pydantic import Field

from systems.base.carrier import CarrierParameters
from systems.framework.parameters import Waypoints
from systems.sound.waveforms import SoundParameters

__all__ = ["InterfererParameters"]


class InterfererParameters(CarrierParameters):
    """A loudspeaker without a body, at rest or driven as the source is."""

    name: str = Field(default="interferer", pattern=r"\A[a-z][a-z0-9_]*\z")
    """Name of its own, of small letters, digits and underscores."""
    waypoints_m: Waypoints = ((0.0, 2.0),)
    """Waypoints in W, m; one point is an interferer at rest."""
    sound: SoundParameters = SoundParameters()
    """What it plays."""
