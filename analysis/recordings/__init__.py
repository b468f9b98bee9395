"""Sounds in recordings of arrays that people have."""
