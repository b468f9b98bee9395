"""What searches look like: plumes, phases, readings, in pictures and in replays."""
