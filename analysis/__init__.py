"""Analysis of runs and models: computations on data, with plots and reports on top."""
