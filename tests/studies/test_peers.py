"""Ours and pyroomacoustics' estimators on the same frames."""

from __future__ import annotations

import pytest

from studies.peers import compare, table

PLACES = [(1.0, 30.0), (3.0, 60.0)]
TRIALS = 6


@pytest.fixture(scope="module")
def results():
    return {result.name: result for result in compare("chirp", PLACES, TRIALS)}


@pytest.mark.parametrize("method", ["gcc", "ml"])
def test_ours_are_nearer_than_every_peer(results, method):
    peers = [name for name in results if name.startswith("pra ")]
    assert len(peers) == 6
    for name in peers:
        for own, peer in zip(results[method].cells, results[name].cells, strict=True):
            assert own.outliers == 0
            if peer.bearing_rmse_deg is not None:
                assert own.bearing_rmse_deg < peer.bearing_rmse_deg
            if peer.range_rmse_m is not None:
                assert own.range_rmse_m < peer.range_rmse_m


def test_peers_are_used_as_they_work(results):
    """Far-field peers find a source that is far for the row within 1 deg."""
    for name in ("pra SRP, 0.1 deg", "pra NormMUSIC, 0.1 deg"):
        far = results[name].cells[1]
        assert far.outliers == 0
        assert far.bearing_rmse_deg < 1.0
        assert far.range_rmse_m is None
    for name in ("pra tdoa, PHAT", "pra tdoa, plain"):
        near = results[name].cells[0]
        assert near.outliers == 0
        assert near.bearing_rmse_deg < 1.0
        assert near.range_rmse_m < 0.1


def test_table_has_every_cell_and_time(results):
    rows = str(table(list(results.values()))).splitlines()
    assert len(rows) == 2 + len(results) * 2  # two bearings
    for result in results.values():
        assert (result.time_ms > 0.0) == (result.name != "bound")
    assert rows[0].count(" m |") == 2
