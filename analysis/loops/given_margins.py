"""Margins of loops that users give: models, frequency responses, or diagrams."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from analysis.loops.given_loops import (
    Loop,
    as_linear_model,
    check_delay,
    delayed_model,
    is_response,
    refuse_place_without_diagram,
)
from analysis.loops.loop_margins import loop_margins
from analysis.loops.margin_results import LoopMargins
from analysis.loops.multiloop_disk import (
    MultiloopDiskMargin,
    multiloop_disk_margin,
    samples_disk_margin,
)
from analysis.loops.response_margins import (
    LoopResponse,
    delayed_response,
    measured_response,
    measured_samples,
    response_disk,
    response_margins,
)
from systems.framework.input_error import InputError


def margins(
    loop: Loop,
    context: Any = None,
    port: Any = None,
    *,
    delay_s: float = 0.0,
    unstable_poles: int = 0,
) -> LoopMargins:
    """Computes the stability margins of a loop with negative feedback.

    Args:
        loop: Loop transfer function L with one input and one output: a
            ``control.StateSpace`` or ``control.TransferFunction``, continuous or
            sampled; a ``control.FrequencyResponseData``; the result of ``loop_at`` or
            ``linearize``; or a Drake ``Diagram``, which is opened at ``port``.
        context: Root context of the diagram at the operating point; None: the default
            context. Only for diagrams.
        port: Input port inside the diagram, as for ``loop_at``. Only for diagrams.
        delay_s: Pure delay of the loop in addition to that of ``loop``, s, >= 0. In a
            sampled loop, it is a whole number of periods.
        unstable_poles: Number of growing poles of L. It is needed only for frequency
            responses, which do not tell it.

    Returns:
        Gain, phase, delay, modulus and disk margins, and peaks of S and T. Those of a
        frequency response hold for its interpolation between the given frequencies.

    Raises:
        InputError: ``loop`` is not a model, or has several inputs or outputs.
        InputError: A frequency response has too few points, or does not decide whether
            the closed loop is stable.
        InputError: The delay is negative, or no whole number of periods.
    """
    check_delay(loop, delay_s)
    if is_response(loop):
        refuse_place_without_diagram(loop, context, port)
        given, stable = measured_response(loop, unstable_poles, delay_s)
        return response_margins(given, stable=stable)
    model = as_linear_model(loop, context, port)
    if delay_s and not model.period_s:
        given, stable = delayed_response(model, delay_s)
        return response_margins(given, stable=stable)
    return loop_margins(delayed_model(model, delay_s) if delay_s else model)


def disk_margin(
    loop: Loop,
    context: Any = None,
    port: Any = None,
    *,
    skew: float = 0.0,
    delay_s: float = 0.0,
    unstable_poles: int = 0,
) -> MultiloopDiskMargin:
    """Computes the disk margin of one loop, or of several loops at the same time.

    Args:
        loop: Loop transfer function L with as many outputs as inputs, of the types of
            ``margins``. The feedback is negative.
        context: Root context of the diagram; None: the default context. Only for
            diagrams.
        port: Input port inside the diagram, as for ``loop_at``. Only for diagrams.
        skew: Skew of the disk, -1 to 1. With 0, gain increase and gain reduction count
            alike.
        delay_s: Pure delay of all outputs of ``loop``, s, as for ``margins``.
        unstable_poles: Number of growing poles of L. It is needed only for frequency
            responses.

    Returns:
        Largest disk of gain and phase changes in all loops for which stability is
        guaranteed, and the smallest disk with a destabilizing change that was found.
        For one loop, a frequency response is interpolated. For several loops, the disks
        hold at its frequencies only. Whether the closed loop of a frequency response is
        stable follows from the Nyquist criterion with ``unstable_poles``.

    Raises:
        InputError: ``loop`` is not a model, or is not square.
        InputError: A frequency response has too few points, or does not decide whether
            the closed loop is stable.
        InputError: The delay is negative, no whole number of periods, or one of several
            continuous loops.
    """
    if not -1.0 <= skew <= 1.0:
        raise InputError("skew", f"is {skew:g}; give a number from -1 to 1")
    check_delay(loop, delay_s)
    if is_response(loop):
        refuse_place_without_diagram(loop, context, port)
        if loop.frdata.shape[:2] == (1, 1):
            return _of_response(measured_response(loop, unstable_poles, delay_s), skew)
        omega, L = measured_samples(loop)
        late = L * np.exp(-1j * omega * delay_s)
        return samples_disk_margin(omega, late, skew, unstable_poles)
    model = as_linear_model(loop, context, port)
    if not delay_s or model.period_s:
        late = delayed_model(model, delay_s) if delay_s else model
        return multiloop_disk_margin(late, skew)
    if model.D.shape != (1, 1):
        raise InputError(
            "delay_s",
            f"is {delay_s:g} s in a continuous model of several loops, which this "
            "function cannot delay; give control.frequency_response(loop, omega) with "
            "unstable_poles",
        )
    return _of_response(delayed_response(model, delay_s), skew)


def _of_response(judged: tuple[LoopResponse, bool], skew: float) -> MultiloopDiskMargin:
    """Disk margin of a response of which is known whether its loop is stable."""
    response, stable = judged
    if not stable:
        return MultiloopDiskMargin(skew, 0.0, math.nan, 0.0)
    disk = response_disk(response, skew)
    return MultiloopDiskMargin(skew, disk.alpha, disk.frequency_rad_s, disk.alpha)
