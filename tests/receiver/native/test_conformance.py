"""The native receiver passes the vectors, by the protocol for anybody's decoder."""

from cuecast.conformance.examine import examine
from cuecast.conformance.verdict import CLASSES
from tests.receiver.native.building import built


def test_native_passes_all_vectors() -> None:
    report = examine([built("cue_conform")])
    assert report.failed == ()
    assert report.reached() == ("keys", "motion")
    assert set(report.counts()) == {*CLASSES["keys"], *CLASSES["motion"]}
