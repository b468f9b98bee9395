"""The audio chain: waveforms, propagation, rooms, microphones, and converter."""
