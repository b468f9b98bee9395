"""What an array tells of sounds: directions, ranges, sources, and their errors."""
