"""Data in, data out; plots and reports on top, in files of their own."""
