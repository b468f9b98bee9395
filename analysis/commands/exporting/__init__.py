"""Export of runs to MCAP and CSV files, and the meanings of the table's columns."""
