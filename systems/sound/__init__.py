"""From loudspeaker to counts: waveforms, propagation, rooms, microphones, converter."""
