"""Worlds: obstacles with a start and a goal, from the files of public benchmarks."""
