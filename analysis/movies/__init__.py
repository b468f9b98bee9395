"""Makes a movie of a run from above, with the sound at the robot's microphones."""
