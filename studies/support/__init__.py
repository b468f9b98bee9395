"""What several studies, benchmarks and tests share."""
