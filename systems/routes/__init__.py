"""Routes through a known map: found before a run, and anew where a robot stalls."""
