"""Sound from a moving source to moving microphones in the free field.

Each microphone hears what left the source at the retarded time t_e, with
c (t - t_e) = |p_M(t) - p_S(t_e)|. Doppler shifts (Han 2019, eq. 1) come out of
that. Sound pressure falls as 1/R; the paper's text says with the square of the
distance, which is true of intensity.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.framework.input_error import InputError
from systems.framework.signals import Emission

#: Samples that the interpolation kernel touches on either side.
KERNEL_REACH = 6

#: 1/R grows no further below this distance, m: no microphone is a point.
MINIMUM_RANGE_M = 0.01

# Rates that differ by less than this share differ by rounding alone.
_SAME_RATE = 1e-9

# A Kaiser window of 12 taps and this beta leaves an error of 1e-5 up to 18 kHz:
# at 100 kHz the nearest image starts at 82 kHz, so the transition is wide.
_TAPS = 2 * KERNEL_REACH
_BETA = 10.0


def _interpolation_kernel() -> NDArray[np.float32]:
    """Windowed sinc as polynomials of the fraction of a sample, right to 1e-6.

    Returns:
        (pairs, 2, 4) for the taps n and 11 - n: with u = fraction - 1/2 their
        weights are E + O and E - O, E = sum_k e_k u^2k and O = u sum_k o_k u^2k.
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
    """Value and derivative at s in [0, 1] of the cubic between two knots."""
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
    """Places and velocities of the microphones of a moving robot.

    The pose follows the cubic Hermite polynomial between two ticks.

    Args:
        times: (m, k) instants of each microphone, s.
        begin: Time of the first pose, s.
        pose_0: (3,) x, y, theta in W, m and rad.
        velocity_0: (3,) vx, vy in W and omega, m/s and rad/s.
        end: Time of the second pose, s.
        pose_1: (3,) as pose_0; theta may be wrapped.
        velocity_1: (3,) as velocity_0.
        p_BM: (m, 2) microphones in B, m.

    Returns:
        p_WM, (m, k, 2) m, and v_WM, (m, k, 2) m/s.
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
    rise: float = 0.0,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:  # pragma: no cover  (compiled)
    """Travelling times of the sound that arrives at given instants.

    Solves c d = |p_M(t) - p_S(t - d)| by Newton's method; the source is slower
    than sound, hence the solution is unique.

    Args:
        times: (m, k) instants of arrival, s.
        p_WM: (m, k, 2) microphones at those instants, m.
        v_WM: (m, k, 2) their velocities, m/s.
        knot_times: (n,) knots of the source's path, ascending, s.
        p_WS: (n, 2) source at the knots, m.
        v_WS: (n, 2) its velocity, m/s.
        c: Speed of sound, m/s.
        rise: Height of the microphones above the source, m.

    Returns:
        d and its rate of change, each (m, k), s and s/s.
    """
    delays = np.empty(times.shape)
    rates = np.empty(times.shape)
    last = knot_times.size - 1
    for m in range(times.shape[0]):
        d = 0.0
        for k in range(times.shape[1]):
            for _ in range(20):
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
                r = max(math.sqrt(dx * dx + dy * dy + rise * rise), 1e-9)
                away = (dx * vx + dy * vy) / r
                step = (r - c * d) / (c - away)
                d += step
                if abs(step) < 1e-13:
                    break
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
    air: tuple[float, float],
    samples: tuple[float, float],
) -> tuple[
    NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], float
]:  # pragma: no cover  (compiled)
    """``retarded_delays`` as ``_interpolate`` takes them.

    Args:
        times: As there, and so on.
        p_WM: m.
        v_WM: m/s.
        knot_times: s.
        p_WS: m.
        v_WS: m/s.
        air: Speed of sound, m/s, and rise, m.
        samples: Time of the first emitted one, s, and their rate, Hz.

    Returns:
        Places of the first instants among the samples (m,), delays in samples and
        their rates (m, k), and the first place that is heard.
    """
    delays, rates = retarded_delays(
        times, p_WM, v_WM, knot_times, p_WS, v_WS, air[0], air[1]
    )
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


# Divisions that check for zero, as Python's do, would keep the loop from vectorising.
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
    """Fills out (m, length) with samples of the delayed sound over distance.

    In units of emitted samples: first (m,) is the place among the samples of each
    channel's first instant, delays and rates (m, k) stand at evenly spaced knots;
    units are the time from one instant to the next, c in m per sample, and the least
    distance in m.
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
            # The delay passes a whole sample now and then: runs in between.
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
    """Sound at another rate, by the kernel of ``propagate``.

    Args:
        sound: (m, n) samples.
        first: Place of the first one that is wanted; at least ``KERNEL_REACH``.
        step: From one that is wanted to the next, samples; ``KERNEL_REACH`` of them
            must follow the last one.
        count: Number of samples that are wanted.

    Returns:
        (m, count) samples.
    """
    out = np.empty((len(sound), count), dtype=np.float32)
    _sampled_at(sound, INTERPOLATION_KERNEL, float(first), step, out)
    return out


def check_reach(
    emission: Emission, time: float, p_WL: NDArray[np.float64], c: float
) -> None:
    """Refuses a listener for whom the emission does not reach back.

    Args:
        emission: What left the source, and where.
        time: When the listening begins, s.
        p_WL: (2,) listener, m.
        c: Speed of sound, m/s.

    Raises:
        InputError: What left before the emission begins may be heard.
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
    rise: float = 0.0,
) -> NDArray[np.float32]:
    """Sound pressure at moving microphones over one frame.

    The microphones' sample rate need not be that of the emission.

    The delay is exact at the knots and follows cubic polynomials between them.
    With knots every 2.5 ms and the bodies of this model, delays are right to
    1e-3 sample from 0.1 to 18 kHz, and amplitudes to 1e-4.

    Args:
        emission: What left the source, and where.
        times: (m, k) evenly spaced instants from the first sample of each
            channel to one sample past its last, s.
        p_WM: (m, k, 2) microphones at those instants, m.
        v_WM: (m, k, 2) their velocities, m/s.
        count: Samples a channel, a multiple of k - 1.
        c: Speed of sound, m/s.
        rise: Height of the microphones above the source, m.

    Returns:
        (m, count) Pa. Nearer than 1 cm, the amplitude is that at 1 cm.

    Raises:
        InputError: A microphone hears what left before the emission begins.
    """
    rate = emission.sample_rate_hz
    first, delays, rates, earliest = _sample_delays(
        times,
        p_WM,
        v_WM,
        emission.knot_times,
        emission.p_WS,
        emission.v_WS,
        (c, rise),
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
