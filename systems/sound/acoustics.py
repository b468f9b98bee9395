"""Speed of sound, shared by the audio chain and the ultrasonic sensors."""

from __future__ import annotations

#: Speed of sound by default, m/s (Han 2019, 2.1).
SOUND_SPEED_M_S = 340.0


def sound_speed(temperature_c: float) -> float:
    """Returns the speed of sound, m/s, at a temperature in deg C (Han 2019, eq. 23)."""
    return 331.5 + 0.6 * temperature_c
