"""Laws side by side on the same layouts, and the papers' claims judged."""
