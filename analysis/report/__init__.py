"""Shared code of reports: HTML, tables, plain values, intervals, result directories."""
