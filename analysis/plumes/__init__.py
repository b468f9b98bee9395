"""Shows searches in pictures and replays: plumes, phases and sensor readings."""
