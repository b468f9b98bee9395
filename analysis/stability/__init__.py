"""The stability report, which combines models, margins, certificates, and verdicts."""
