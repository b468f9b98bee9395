"""Describes the body that carries the microphones of a recording."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydantic import Field

from systems.framework.input_error import InputError
from systems.framework.parameters import Parameters
from systems.sound.rigid_sphere import RigidSphere

# Largest distance of a microphone from the surface of its body, as a share of the
# radius.
_OFF_BODY = 0.1


class ArrayBody(Parameters):
    """A body that carries the microphones on its surface."""

    sphere_m: float = Field(ge=0.005, le=1.0)
    """Radius of a rigid sphere, m. Its center is the origin of the positions."""

    def check(self, microphones: Sequence[Sequence[float]]) -> None:
        """Raises ``InputError`` if a microphone is not on the surface."""
        off = np.abs(np.linalg.norm(microphones, axis=1) - self.sphere_m)
        k = int(off.argmax())
        if off[k] > _OFF_BODY * self.sphere_m:
            raise InputError(
                "body",
                f"microphone {k + 1} is {1e3 * off[k]:.3g} mm off a sphere of "
                f"{1e3 * self.sphere_m:.4g} mm around the origin; give positions from "
                "the center of the sphere, in m",
            )

    def sphere(
        self,
        microphones: Sequence[Sequence[float]],
        band_hz: tuple[float, float],
        c: float,
    ) -> RigidSphere:
        """Makes the sphere with microphones at (n, d) positions, m."""
        toward = np.array(microphones)
        toward /= np.linalg.norm(toward, axis=1, keepdims=True)
        return RigidSphere(toward, self.sphere_m, band_hz, c)
