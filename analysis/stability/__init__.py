"""Stability of the loop: models, margins, maps, certificates, the report."""
