"""From loudspeaker to counts: waveforms, propagation, rooms, microphones, converter."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from systems.sound.acoustics import AcousticParameters, sound_speed
    from systems.sound.adc import convert
    from systems.sound.array_shape import ArrayShape
    from systems.sound.array_tolerances import RealArray, Tolerances
    from systems.sound.ego_noise import EgoNoise
    from systems.sound.mic_array import MicArray
    from systems.sound.parameters import (
        MicArrayParameters,
        RoomParameters,
        SoundParameters,
    )
    from systems.sound.propagation import propagate
    from systems.sound.recorder import record_frame
    from systems.sound.reverberation import Reverberation
    from systems.sound.room import room_images
    from systems.sound.sound_emitter import SoundEmitter, make_emission
    from systems.sound.sound_file import read_sound
    from systems.sound.waveforms import make_waveform
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = [
    "AcousticParameters",
    "ArrayShape",
    "EgoNoise",
    "MicArray",
    "MicArrayParameters",
    "RealArray",
    "Reverberation",
    "RoomParameters",
    "SoundEmitter",
    "SoundParameters",
    "Tolerances",
    "convert",
    "make_emission",
    "make_waveform",
    "propagate",
    "read_sound",
    "record_frame",
    "room_images",
    "sound_speed",
]
