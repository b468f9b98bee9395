"""Blocks written in Python are never freed: processes must be renewed."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from benchmarks.process_tree import tree_usage
from benchmarks.sweeps import memory_growth_mb


def test_usage_counts_descendants():
    before = tree_usage(os.getpid())
    code = "x = bytes(range(256)) * 400_000; sum(x); print(flush=True); input()"
    with subprocess.Popen(
        [sys.executable, "-c", code],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    ) as process:
        assert process.stdout is not None
        process.stdout.readline()
        during = tree_usage(os.getpid())
        process.communicate(b"\n")
    assert during.resident_mb >= before.resident_mb + 95.0
    assert during.processor_s >= before.processor_s + 0.1


@pytest.mark.slow
def test_memory_of_a_sweep_stays_flat():
    # Without renewal the second half would hold 130 runs, 130 MB, more.
    assert memory_growth_mb(260, every=2) < 45.0
