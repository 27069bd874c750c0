"""What `dub` says of the margin that a rehearsal found."""

from cuecast.dubbing.margin_report import in_words, margin_figures
from watermark.audio.embed.report import SuperframeMargin


def figures(margins: list[float], profile: str = "standard") -> dict[str, object]:
    found = [SuperframeMargin(k, m, "aac:128k") for k, m in enumerate(margins)]
    return margin_figures(found, 1.28, through="aac:128k", profile=profile, grade=-0.4)


def test_ample_margins_are_listed_without_a_warning() -> None:
    report = figures([1.9, 2.4, 1.6])
    assert report["superframes"] == [[1.28, 1.9], [1.92, 2.4], [2.56, 1.6]]
    assert (report["least"], report["median"], report["low"], report["helps"]) == (1.6, 1.9, [], [])
    assert in_words(report) == []


def test_low_passages_are_joined_and_remedied() -> None:
    report = figures([1.9, 1.4, 1.6, 1.06, *[1.9] * 5, 1.49])
    assert report["low"] == [
        {"start_s": 1.92, "end_s": 3.84, "least": 1.06, "coder": "aac:128k"},
        {"start_s": 7.04, "end_s": 7.68, "least": 1.49, "coder": "aac:128k"},
    ]
    assert in_words(report) == [
        "margin below 1.5 from 00:01 to 00:04: 1.06 through aac:128k",
        "margin below 1.5 from 00:07 to 00:08: 1.49 through aac:128k",
        # Half a doubling is one level: .28 of grade.
        "would help: --grade -0.69, a louder mark; or --profile audio=robust, about 2.1 with a "
        "coarser motion; or a higher bit rate than aac:128k",
    ]


def test_what_cannot_help_is_not_advised() -> None:
    helps = figures([0.3], profile="robust")["helps"]
    assert helps == ["a higher bit rate than aac:128k"]
    loudest = [SuperframeMargin(0, 1.4, "aac:128k", loudest=True)]
    report = margin_figures(loudest, 0.0, through="aac:128k", profile="standard", grade=-0.4)
    assert [one.split(",")[0] for one in report["helps"]] == [
        "--profile audio=robust",
        "a higher bit rate than aac:128k",
    ]


def test_many_passages_are_counted() -> None:
    lines = in_words(figures([1.4, 1.9, 1.9, 1.9, 1.9] * 9))
    assert len(lines) == 8
    assert lines[6] == "margin below 1.5 in 3 more passages"
