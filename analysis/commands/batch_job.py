"""The job of the commands ``sweep`` and ``compare``."""

from __future__ import annotations

from typing import Any

from analysis.commands.command import Job
from analysis.sweeps.batch import Batch, PreparedBatch


def batch_job(prepared: PreparedBatch) -> Job[Batch]:
    """Makes the job that runs a batch and writes its report."""
    from analysis.sweeps.page import write_batch
    from analysis.sweeps.report import batch_document, batch_text

    def write(batch: Batch, document: dict[str, Any]) -> None:
        write_batch(batch, document)
        batch.require_runs()

    return Job(
        run=prepared.run,
        summary=batch_document,
        text=batch_text,
        out=prepared.out,
        write=write,
        where="\nresults in {out}, report in {out}/report.html",
        total=prepared.runs,
        unit="runs",
        kept=lambda: prepared.done,
    )
