"""The native receiver passes the vectors, by the protocol for anybody's decoder."""

from cuecast.conformance.examine import examine
from cuecast.conformance.verdict import CLASSES
from tests.receiver.native.building import built

HEARD = 14
"""Sounds of `spec/vectors/hearing.json` that it hears, of 14: all, measured on 2026-11-22."""


def test_native_passes_all_vectors() -> None:
    report = examine([built("cue_conform")])
    assert [verdict for verdict in report.failed if verdict.group != "sound"] == []
    assert report.reached()[:4] == tuple(CLASSES)[:4]
    assert set(report.counts()) == {group for groups in CLASSES.values() for group in groups}
    assert report.counts()["sound"]["passed"] >= HEARD
    assert report.skipped == ()
