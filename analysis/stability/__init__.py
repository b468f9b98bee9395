"""The stability report, which gathers models, margins, certificates and verdicts."""
