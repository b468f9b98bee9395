"""Many runs: sweeps, comparisons of laws, the papers' claims."""
