"""Computes sound from a moving source at moving microphones in the free field.

At the time t, a microphone hears the sound that left the source at an earlier time t_e
(the retarded time). The equation for t_e is c (t - t_e) = |p_M(t) - p_S(t_e)|. Here c
is the speed of sound, and p_M and p_S are the positions of microphone and source. The
Doppler shifts (Han 2019, eq. 1) follow from this equation. Sound pressure falls as 1/R,
where R is the distance. The text of the paper says that it falls with the square of the
distance, which is true only of intensity.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.framework.input_error import InputError
from systems.framework.signals import Emission

#: Number of samples that the interpolation kernel uses on either side.
KERNEL_REACH = 6

#: Distance below which the factor 1/R no longer grows, m. The reason is that a
#: microphone is not a point.
MINIMUM_RANGE_M = 0.01

# If a step differs from a whole number of samples by less than this, it is rounded.
_SAME_RATE = 1e-9

# A Kaiser window of 12 taps with this beta has an error of 1e-5 up to 18 kHz. At
# 100 kHz the nearest spectral image starts at 82 kHz, so the transition band is wide.
_TAPS = 2 * KERNEL_REACH
_BETA = 10.0


def _interpolation_kernel() -> NDArray[np.float32]:
    """Fits polynomials to the weights of a windowed sinc function (error 1e-6).

    The interpolation between samples uses 12 taps. Let u be the fractional part of the
    position among the samples, minus 1/2. For n = 0 to 5, the taps n and 11 - n have
    the weights E + O and E - O, with E = sum_k e_k u^2k and O = u sum_k o_k u^2k.

    Returns:
        (6, 2, 4) coefficients: for each n, the four e_k and the four o_k.
    """
    u = np.linspace(-0.5, 0.5, 257)
    x = np.arange(_TAPS) - (KERNEL_REACH - 0.5) - u[:, None]
    fine = np.linspace(-KERNEL_REACH, KERNEL_REACH, 4801)
    weights = np.sinc(x) * np.interp(x, fine, np.kaiser(4801, _BETA))
    weights /= weights.sum(axis=1, keepdims=True)
    powers = np.vander(u * u, 4, increasing=True)
    near, far = weights[:, :KERNEL_REACH], weights[:, : KERNEL_REACH - 1 : -1]
    even = np.linalg.lstsq(powers, (near + far) / 2.0)[0]
    odd = np.linalg.lstsq(u[:, None] * powers, (near - far) / 2.0)[0]
    return np.stack([even.T, odd.T], axis=1).astype(np.float32)


#: See ``_interpolation_kernel``.
INTERPOLATION_KERNEL = _interpolation_kernel()


@njit(cache=True)
def _hermite(
    s: float, h: float, a: float, b: float, da: float, db: float
) -> tuple[float, float]:  # pragma: no cover  (compiled)
    """Returns the value and the slope of a cubic Hermite polynomial between two knots.

    The knots have the values a and b and the slopes da and db, and are h seconds apart.
    The position ``s`` is a share of this interval.
    """
    s2, s3 = s * s, s * s * s
    value = (
        (2 * s3 - 3 * s2 + 1) * a
        + (s3 - 2 * s2 + s) * h * da
        + (3 * s2 - 2 * s3) * b
        + (s3 - s2) * h * db
    )
    slope = (
        6 * (s2 - s) * (a - b) / h + (3 * s2 - 4 * s + 1) * da + (3 * s2 - 2 * s) * db
    )
    return value, slope


@njit(cache=True)
def microphone_paths(
    times: NDArray[np.float64],
    begin: float,
    pose_0: NDArray[np.float64],
    velocity_0: NDArray[np.float64],
    end: float,
    pose_1: NDArray[np.float64],
    velocity_1: NDArray[np.float64],
    p_BM: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:  # pragma: no cover  (compiled)
    """Computes positions and velocities of the microphones of a moving robot.

    Between two given poses, the robot moves along a cubic Hermite polynomial.

    Args:
        times: (m, k) times, s. Row i belongs to microphone i.
        begin: Time of the first pose, s.
        pose_0: (3,) first pose x, y, theta in the world frame W, m and rad.
        velocity_0: (3,) vx, vy in W and omega at the first pose, m/s and rad/s.
        end: Time of the second pose, s.
        pose_1: (3,) second pose, in the form of pose_0. Its theta may be wrapped.
        velocity_1: (3,) velocity at the second pose, in the form of velocity_0.
        p_BM: (m, 2) positions of the microphones in the body frame B, m.

    Returns:
        Two (m, k, 2) arrays: positions in W, m, and velocities in W, m/s.
    """
    h = end - begin
    turn = pose_1[2] - pose_0[2]
    turn -= 2 * math.pi * round(turn / (2 * math.pi))
    count, knots = times.shape
    p_WM = np.empty((count, knots, 2))
    v_WM = np.empty((count, knots, 2))
    for m in range(count):
        for k in range(knots):
            s = (times[m, k] - begin) / h
            x, vx = _hermite(s, h, pose_0[0], pose_1[0], velocity_0[0], velocity_1[0])
            y, vy = _hermite(s, h, pose_0[1], pose_1[1], velocity_0[1], velocity_1[1])
            theta, omega = _hermite(
                s, h, pose_0[2], pose_0[2] + turn, velocity_0[2], velocity_1[2]
            )
            c, sn = math.cos(theta), math.sin(theta)
            dx = c * p_BM[m, 0] - sn * p_BM[m, 1]
            dy = sn * p_BM[m, 0] + c * p_BM[m, 1]
            p_WM[m, k, 0], p_WM[m, k, 1] = x + dx, y + dy
            v_WM[m, k, 0], v_WM[m, k, 1] = vx - omega * dy, vy + omega * dx
    return p_WM, v_WM


@njit(cache=True)
def retarded_delays(
    times: NDArray[np.float64],
    p_WM: NDArray[np.float64],
    v_WM: NDArray[np.float64],
    knot_times: NDArray[np.float64],
    p_WS: NDArray[np.float64],
    v_WS: NDArray[np.float64],
    c: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:  # pragma: no cover  (compiled)
    """Computes the travel times of sound that arrives at given times.

    Newton's method solves c d = |p_M(t) - p_S(t - d)| for the travel time d. Here t is
    the time of arrival, p_M is the position of the microphone, and p_S is that of the
    source. The solution is unique because the source is slower than sound. The solution
    for one time of arrival is the start value for the next.

    Args:
        times: (m, k) times of arrival, s.
        p_WM: (m, k, 2) positions of the microphones at the times of arrival, m.
        v_WM: (m, k, 2) velocities of the microphones at the times of arrival, m/s.
        knot_times: (n,) knots of the motion of the source, ascending, s.
        p_WS: (n, 2) positions of the source at the knots, m.
        v_WS: (n, 2) velocities of the source at the knots, m/s.
        c: Speed of sound, m/s.

    Returns:
        Two (m, k) arrays: travel times d, s, and their rates of change, s/s.
    """
    delays = np.empty(times.shape)
    rates = np.empty(times.shape)
    last = knot_times.size - 1
    for m in range(times.shape[0]):
        d = 0.0
        for k in range(times.shape[1]):
            for _ in range(20):
                # Position and velocity of the source when the sound left it.
                t_e = times[m, k] - d
                n = min(max(np.searchsorted(knot_times, t_e) - 1, 0), last - 1)
                h = knot_times[n + 1] - knot_times[n]
                s = (t_e - knot_times[n]) / h
                x, vx = _hermite(
                    s, h, p_WS[n, 0], p_WS[n + 1, 0], v_WS[n, 0], v_WS[n + 1, 0]
                )
                y, vy = _hermite(
                    s, h, p_WS[n, 1], p_WS[n + 1, 1], v_WS[n, 1], v_WS[n + 1, 1]
                )
                dx, dy = p_WM[m, k, 0] - x, p_WM[m, k, 1] - y
                # Newton step; ``away`` is the speed of the source toward the
                # microphone.
                r = max(math.sqrt(dx * dx + dy * dy), 1e-9)
                away = (dx * vx + dy * vy) / r
                step = (r - c * d) / (c - away)
                d += step
                if abs(step) < 1e-13:
                    break
            # Rate of the delay; ``closing`` is the speed of the microphone away
            # from the source.
            closing = (dx * v_WM[m, k, 0] + dy * v_WM[m, k, 1]) / r
            delays[m, k] = d
            rates[m, k] = (closing - away) / (c - away)
    return delays, rates


@njit(cache=True)
def _sample_delays(
    times: NDArray[np.float64],
    p_WM: NDArray[np.float64],
    v_WM: NDArray[np.float64],
    knot_times: NDArray[np.float64],
    p_WS: NDArray[np.float64],
    v_WS: NDArray[np.float64],
    c: float,
    samples: tuple[float, float],
) -> tuple[
    NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], float
]:  # pragma: no cover  (compiled)
    """Computes the delays of ``retarded_delays`` in units of emitted samples.

    ``samples`` has the time of the first emitted sample, s, and the sample rate, Hz.

    Returns:
        Four values: (m,) time from the first emitted sample to the first knot of each
        channel, samples; (m, k) delays, samples; (m, k) rates of change of the delays;
        and the position of the earliest heard sound among the emitted samples.
    """
    delays, rates = retarded_delays(times, p_WM, v_WM, knot_times, p_WS, v_WS, c)
    first, earliest = np.empty(len(times)), np.inf
    for m in range(len(times)):
        first[m] = (times[m, 0] - samples[0]) * samples[1]
        for k in range(times.shape[1]):
            delays[m, k] *= samples[1]
        earliest = min(earliest, first[m] - delays[m, 0])
    return first, delays, rates, earliest


@njit(cache=True)
def _delayed(
    samples: NDArray[np.float32],
    first: int,
    u: NDArray[np.float32],
    kernel: NDArray[np.float32],
    out: NDArray[np.float32],
) -> None:  # pragma: no cover  (compiled)
    """Fills out (n,) with samples[first + i + 1/2 + u_i], interpolated."""
    begin, last = first - KERNEL_REACH + 1, 2 * KERNEL_REACH - 1
    near = samples[begin : begin + u.size + last]
    for i in range(u.size):
        y = u[i] * u[i]
        total = np.float32(0.0)
        for n in range(KERNEL_REACH):
            e, o = kernel[n, 0], kernel[n, 1]
            even = ((e[3] * y + e[2]) * y + e[1]) * y + e[0]
            odd = u[i] * (((o[3] * y + o[2]) * y + o[1]) * y + o[0])
            total += (even + odd) * near[i + n] + (even - odd) * near[i + last - n]
        out[i] = total


# Python's divisions check for zero, which would prevent vectorization of the loop.
@njit(cache=True, error_model="numpy")
def _interpolate(
    samples: NDArray[np.float32],
    kernel: NDArray[np.float32],
    first: NDArray[np.float64],
    delays: NDArray[np.float64],
    rates: NDArray[np.float64],
    units: tuple[float, float, float],
    out: NDArray[np.float32],
) -> None:  # pragma: no cover  (compiled)
    """Fills ``out`` (m, length) with the delayed sound, divided by the distance.

    All times are in units of emitted samples. Between two knots, the delay d is a cubic
    polynomial of time. For each output sample, the function computes the position among
    the emitted samples and the amplitude 1 / (c d). It then interpolates one run of
    output samples at a time. A run is a sequence in which the integer part of the
    position increases by one from each output sample to the next.

    Args:
        samples: Emitted samples.
        kernel: ``INTERPOLATION_KERNEL``.
        first: (m,) time from the first emitted sample to the first output sample of
            each channel.
        delays: (m, k) delays at evenly spaced knots.
        rates: (m, k) rates of change of the delays.
        units: Three numbers: time from one output sample to the next; speed of sound, m
            per sample; and smallest distance, m.
        out: (m, length) output, where length is a multiple of k - 1.
    """
    step, c, nearest = units
    spans = delays.shape[1] - 1
    h = out.shape[1] // spans
    span_samples = h * step
    u = np.empty(h, dtype=np.float32)
    amplitude = np.empty(h, dtype=np.float32)
    begin = np.empty(h, dtype=np.int32)
    for m in range(out.shape[0]):
        for k in range(spans):
            a, b = delays[m, k], delays[m, k + 1]
            da, db = span_samples * rates[m, k], span_samples * rates[m, k + 1]
            # Quadratic and cubic coefficient of the delay.
            bend, curl = 3.0 * (b - a) - 2.0 * da - db, 2.0 * (a - b) + da + db
            for i in range(h):
                s = i / h
                d = a + s * (da + s * (bend + s * curl))
                position = first[m] + k * span_samples + i * step - d
                whole = math.floor(position)
                u[i] = np.float32(position - whole - 0.5)
                begin[i] = np.int32(whole - i)
                amplitude[i] = np.float32(1.0) / np.float32(max(c * d, nearest))
            span = out[m, k * h : (k + 1) * h]
            # A run ends where the delay passes a whole number of samples.
            i = 0
            while i < h:
                end = i + 1
                while end < h and begin[end] == begin[i]:
                    end += 1
                _delayed(samples, begin[i] + i, u[i:end], kernel, span[i:end])
                i = end
            span *= amplitude


@njit(cache=True)
def _sampled_at(
    sound: NDArray[np.float32],
    kernel: NDArray[np.float32],
    first: float,
    step: float,
    out: NDArray[np.float32],
) -> None:  # pragma: no cover  (compiled)
    """Fills out (m, count) with sound[:, first + i step], interpolated."""
    u = np.empty(1, dtype=np.float32)
    for i in range(out.shape[1]):
        position = first + i * step
        whole = math.floor(position)
        u[0] = np.float32(position - whole - 0.5)
        for m in range(out.shape[0]):
            _delayed(sound[m], whole, u, kernel, out[m, i : i + 1])


def sampled_at(
    sound: NDArray[np.float32], first: int, step: float, count: int
) -> NDArray[np.float32]:
    """Resamples a sound to another rate, with the interpolation of ``propagate``.

    Args:
        sound: (m, n) samples.
        first: Position of the first output sample among the samples of the sound; at
            least ``KERNEL_REACH``.
        step: Distance from one output sample to the next, in samples of the sound. At
            least ``KERNEL_REACH`` samples of the sound must follow the last output
            sample.
        count: Number of output samples.

    Returns:
        (m, count) samples.
    """
    out = np.empty((len(sound), count), dtype=np.float32)
    _sampled_at(sound, INTERPOLATION_KERNEL, float(first), step, out)
    return out


def check_reach(
    emission: Emission, time: float, p_WL: NDArray[np.float64], c: float
) -> None:
    """Raises an error if a listener is too far away for the stored emission.

    Args:
        emission: Stored sound and motion of the source.
        time: Time at which the listening begins, s.
        p_WL: (2,) position of the listener, m.
        c: Speed of sound, m/s.

    Raises:
        InputError: The listener may hear sound that left the source before the stored
            emission begins.
    """
    distance = math.dist(p_WL.tolist(), emission.p_WS[0].tolist())
    reach = time - emission.start_time - KERNEL_REACH / emission.sample_rate_hz
    if distance > c * reach:
        raise _out_of_reach(distance)


def _out_of_reach(distance: float) -> InputError:
    return InputError(
        "MicArray",
        f"the source is {distance:.2f} m away, farther than the stored emission "
        "reaches; raise maximum_range_m of SoundEmitter",
    )


def propagate(
    emission: Emission,
    times: NDArray[np.float64],
    p_WM: NDArray[np.float64],
    v_WM: NDArray[np.float64],
    count: int,
    c: float,
) -> NDArray[np.float32]:
    """Computes the sound pressure at moving microphones over one audio frame.

    The microphones and the emission may have different sample rates. The travel time of
    the sound is exact at certain times (knots), and a cubic polynomial between them.
    With knots every 2.5 ms and the speeds and yaw rates of this model, the errors of
    the travel times are at most 1e-3 sample from 0.1 to 18 kHz. The errors of
    amplitudes are at most 1e-4.

    Args:
        emission: Stored sound and motion of the source.
        times: (m, k) evenly spaced times of the knots, s. For each channel, they begin
            at its first sample and end one sample after its last sample.
        p_WM: (m, k, 2) positions of the microphones at the knots, m.
        v_WM: (m, k, 2) velocities of the microphones at the knots, m/s.
        count: Number of samples per channel, a multiple of k - 1.
        c: Speed of sound, m/s.

    Returns:
        (m, count) sound pressure, Pa. At distances below 1 cm, the amplitude is that at
        1 cm.

    Raises:
        InputError: A microphone hears sound that left the source before the stored
            emission begins.
    """
    rate = emission.sample_rate_hz
    first, delays, rates, earliest = _sample_delays(
        times,
        p_WM,
        v_WM,
        emission.knot_times,
        emission.p_WS,
        emission.v_WS,
        c,
        (emission.start_time, rate),
    )
    if earliest < KERNEL_REACH:
        raise _out_of_reach(delays[:, 0].max() * c / rate)
    step = float(times[0, -1] - times[0, 0]) * rate / count
    if abs(step - round(step)) < _SAME_RATE:
        step = float(round(step))
    out = np.empty((len(times), count), dtype=np.float32)
    _interpolate(
        emission.samples,
        INTERPOLATION_KERNEL,
        first,
        delays,
        rates,
        (step, c / rate, MINIMUM_RANGE_M),
        out,
    )
    return out
