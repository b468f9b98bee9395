"""Laws that people would try first, after their sources, to compare with."""
