"""Bearing and range of the source from the frames of the microphones."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator
from pydrake.common.value import Value
from pydrake.systems.framework import LeafSystem

from systems.acoustics import AcousticParameters
from systems.delay_plan import DelayPlan
from systems.delays import DelayEstimate, estimate_delays
from systems.near_field import locate_source
from systems.parameters import Fraction, Parameters, Positive
from systems.robot import RobotParameters
from systems.signals import FRAME_PERIOD_S, SAMPLE_RATE_HZ, AudioFrame
from systems.source_fix import SourceFix

__all__ = ["TDOAEstimator", "TDOAParameters", "is_heard", "localise", "row_spacing"]


class TDOAParameters(Parameters):
    """How delays are measured, and when they are believed."""

    method: Literal["gcc", "gcc_phat", "amdf"] = "gcc"
    """Cross-correlation, the same with whitened spectrum, or the papers' AMDF."""
    low_hz: Positive = 300.0
    """Lower end of the band, Hz."""
    high_hz: float = Field(default=15_000.0, gt=0.0, le=SAMPLE_RATE_HZ / 2)
    """Upper end of the band, Hz."""
    sound_speed_m_s: Positive | None = None
    """Speed of sound that the estimator believes in, m/s; unset: the true one."""
    minimum_correlation: Fraction = 0.75
    """Least correlation coefficient, within the band, of every pair."""
    maximum_closure_s: Positive = 1.5e-5
    """Largest disagreement |tau_12 + tau_23 - tau_13|, s."""
    maximum_ambiguity: Fraction = 0.8
    """Largest second peak over the first one."""
    maximum_bearing_std_deg: Positive = 3.0
    """Largest standard deviation of a bearing, deg."""
    maximum_relative_range_std: Positive = 0.25
    """A range is valid where its standard deviation is below this share."""

    @model_validator(mode="after")
    def _check(self) -> TDOAParameters:
        if self.low_hz >= self.high_hz:
            raise ValueError(
                f"low_hz: {self.low_hz:g} must be below high_hz = {self.high_hz:g}"
            )
        return self


def row_spacing(robot: RobotParameters) -> float:
    """Distance between neighbours of three microphones across the robot, m.

    Raises:
        ValueError: The microphones are no such row from left to right.
    """
    places = robot.microphones_m
    spacing = (places[0][1] - places[-1][1]) / 2.0
    row = ((0.0, spacing), (0.0, 0.0), (0.0, -spacing))
    if len(places) != 3 or spacing <= 0.0 or not np.allclose(places, row, 0.0, 1e-9):
        raise ValueError(
            f"robot.microphones_m: {places} is not a row of three from "
            "left to right with P in its middle; TDOAEstimator needs one"
        )
    return spacing


def is_heard(delays: DelayEstimate | None, parameters: TDOAParameters) -> bool:
    """Whether a frame's delays belong to one sound in one place."""
    return (
        delays is not None
        and delays.correlation >= parameters.minimum_correlation
        and delays.closure <= parameters.maximum_closure_s
        and delays.ambiguity <= parameters.maximum_ambiguity
    )


def localise(
    frame: NDArray[np.float32],
    plan: DelayPlan,
    parameters: TDOAParameters,
    spacing: float,
    c: float,
) -> SourceFix | None:
    """Where the sound of a frame comes from.

    Args:
        frame: (3, n) channels from left to right, any unit.
        plan: Made for these frames, this band and this array.
        parameters: Method and thresholds.
        spacing: Distance between neighbouring microphones, m.
        c: Speed of sound, m/s.

    Returns:
        The source in the front half plane, or None where nothing is heard.
    """
    delays = estimate_delays(
        frame,
        plan,
        parameters.method,
        maximum_ambiguity=parameters.maximum_ambiguity,
    )
    if delays is None or not is_heard(delays, parameters):
        return None
    fix = locate_source(delays.tau_12, delays.tau_13, delays.covariance, spacing, c)
    if fix.bearing_std > math.radians(parameters.maximum_bearing_std_deg):
        return None
    if fix.range_std > parameters.maximum_relative_range_std * fix.range:
        return fix.without_range()
    return fix


class TDOAEstimator(LeafSystem):
    """Hears where the source is.

    .. pydrake_system::

        name: TDOAEstimator
        input_ports:
        - audio [AudioFrame]
        output_ports:
        - source_bearing [rad]
        - source_range [m]
        - p_PS_B [m, m]
        - covariance [m^2]
        - detected [0 or 1]
        - range_valid [0 or 1]

    Delays come from ``systems.delays``, range and bearing from
    ``systems.near_field``. Microphones in a row cannot tell front from back:
    the source is reported in the front half plane. Where nothing is heard all
    outputs are zero. Where ``range_valid`` is 0 the range is 0, p_PS_B is the
    unit vector along the bearing and the covariance is that of this vector.
    The covariance (row major, of p_PS_B) counts noise only, not errors of the
    microphones' places or of the speed of sound.

    State: the outputs, one group a port.
    Rate and latency: updated every 25 ms from the frame that ends then, and
    visible after it: one tick, the time that a processor takes.

    Args:
        parameters: Method, band and thresholds.
        robot: Spacing of the microphones.
        acoustics: Speed of sound, where the parameters set none.

    Reference: Han 2019, 2.2-2.3; Kim 2017, eq. 3-8.
    """

    def __init__(
        self,
        *,
        parameters: TDOAParameters | None = None,
        robot: RobotParameters | None = None,
        acoustics: AcousticParameters | None = None,
    ) -> None:
        super().__init__()
        self._parameters = parameters or TDOAParameters()
        self._spacing = row_spacing(robot or RobotParameters())
        air = acoustics or AcousticParameters()
        self._c = self._parameters.sound_speed_m_s or air.c
        self._plan = DelayPlan(
            sample_rate_hz=SAMPLE_RATE_HZ,
            frame_samples=round(FRAME_PERIOD_S * SAMPLE_RATE_HZ),
            max_delay_s=self._spacing / self._c,
            low_hz=self._parameters.low_hz,
            high_hz=self._parameters.high_hz,
        )
        self.set_name("tdoa_estimator")
        self._audio = self.DeclareAbstractInputPort(
            name="audio", model_value=Value(object())
        )
        for name, size in (
            ("source_bearing", 1),
            ("source_range", 1),
            ("p_PS_B", 2),
            ("covariance", 4),
            ("detected", 1),
            ("range_valid", 1),
        ):
            self.DeclareStateOutputPort(name, self.DeclareDiscreteState(size))
        self.DeclarePeriodicDiscreteUpdateEvent(
            period_sec=FRAME_PERIOD_S, offset_sec=0.0, update=self._listen
        )

    def _listen(self, context, discrete_state) -> None:
        audio = self._audio.Eval(context)
        if not isinstance(audio, AudioFrame):
            raise TypeError(
                f"TDOAEstimator: port audio carries a {type(audio).__name__}; connect "
                "the audio of a MicArray"
            )
        if audio.sample_rate_hz != SAMPLE_RATE_HZ:
            raise ValueError(
                f"TDOAEstimator: audio has a rate of {audio.sample_rate_hz:g} Hz; "
                f"record at {SAMPLE_RATE_HZ} Hz"
            )
        frame = audio.counts.astype(np.float32)
        fix = localise(frame, self._plan, self._parameters, self._spacing, self._c)
        if fix is None and not context.get_discrete_state(_DETECTED).value()[0]:
            return  # silence goes on, and the state is zero already
        for group, values in enumerate(_port_values(fix)):
            discrete_state.set_value(group, values)


#: Index of the state group behind the port ``detected``.
_DETECTED = 4

#: Values of the output ports where nothing is heard.
_NOTHING = tuple(np.zeros(size) for size in (1, 1, 2, 4, 1, 1))


def _port_values(fix: SourceFix | None) -> tuple[NDArray[np.float64], ...]:
    """Values of the output ports, in order."""
    if fix is None:
        return _NOTHING
    return (
        np.array([fix.bearing]),
        np.array([fix.range]),
        np.array(fix.p_AS),
        fix.covariance.ravel(),
        np.ones(1),
        np.array([float(fix.range_valid)]),
    )
