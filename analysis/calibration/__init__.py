"""Calibrates microphone arrays from sounds: microphone positions and speed of sound."""
