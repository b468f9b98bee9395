"""Speed of sound, shared by the audio chain and the ultrasonic sensors."""

from __future__ import annotations

from pydantic import Field

from systems.framework.parameters import Parameters, SoundSpeed


def sound_speed(temperature_c: float) -> float:
    """Speed of sound in m/s at a temperature in deg C (Han 2019, eq. 23)."""
    return 331.5 + 0.6 * temperature_c


class AcousticParameters(Parameters):
    """Properties of the air."""

    sound_speed_m_s: SoundSpeed = 340.0
    """Speed of sound if no temperature is set, m/s (Han 2019, 2.1)."""
    temperature_c: float | None = Field(default=None, ge=-50.0, le=60.0)
    """Temperature, deg C; when set, the speed of sound follows from it."""

    @property
    def c(self) -> float:
        """Speed of sound, m/s; the temperature, if set, takes precedence."""
        if self.temperature_c is None:
            return self.sound_speed_m_s
        return sound_speed(self.temperature_c)
