"""What every block rests on: parameters, checks, noise, scalars, compiled code."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from systems.framework.cache import declare_cache
    from systems.framework.finite import check_finite
    from systems.framework.input_error import InputError
    from systems.framework.noise import frame_noise
    from systems.framework.parameters import Parameters
    from systems.framework.scalar_types import define_for_scalars
    from systems.framework.signals import (
        FRAME_SAMPLES,
        SAMPLE_RATE_HZ,
        TICK_S,
        AudioFrame,
        Emission,
    )
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = [
    "FRAME_SAMPLES",
    "SAMPLE_RATE_HZ",
    "TICK_S",
    "AudioFrame",
    "Emission",
    "InputError",
    "Parameters",
    "check_finite",
    "declare_cache",
    "define_for_scalars",
    "frame_noise",
]
