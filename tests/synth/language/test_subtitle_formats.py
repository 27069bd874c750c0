"""Timed text in XML and EBU STL, and forty kinds of malformed files of all formats."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codec.errors import CueError
from synth.language.subtitles import Subtitle
from synth.language.subtitles.read import Terms, parse_subtitles

TTML = """<?xml version="1.0" encoding="UTF-8"?>
<tt:tt xmlns:tt="http://www.w3.org/ns/ttml" xmlns:ttp="http://www.w3.org/ns/ttml#parameter"
  xmlns:tts="http://www.w3.org/ns/ttml#styling" ttp:timeBase="media" ttp:cellResolution="50 30"
  xml:lang="fr"><tt:head><tt:styling><tt:style xml:id="s1" tts:color="#ffffff"/></tt:styling>
<tt:layout><tt:region xml:id="r1" tts:origin="10% 80%" tts:extent="80% 10%"/></tt:layout></tt:head>
<tt:body><tt:div>
<tt:p region="r1" begin="00:00:01.000" end="00:00:02.500"><tt:span style="s1">L'été</tt:span>
<tt:br/><tt:span>déjà !</tt:span></tt:p>
<tt:p region="r1" begin="00:00:03.000" end="00:00:04.000">Oui.</tt:p>
</tt:div></tt:body></tt:tt>
"""
SRT = "1\n00:00:01,000 --> 00:00:02,500\nOui.\n"
VTT = "WEBVTT\n\n00:01.000 --> 00:02.500\nOui.\n"


def stl(*blocks: tuple[bytes, bytes, bytes]) -> bytes:
    """Return an EBU STL file of (time in, time out, text) blocks that starts at ten o'clock."""
    header = bytearray(b" " * 1024)
    for offset, field in (
        (0, b"850STL25.01100000F"),
        (224, b"26112126112100"),
        (238, b"%05d" % len(blocks)),
        (243, b"%05d" % len(blocks)),
        (248, b"0014023110000000"),
        (264, b"1000000011FRA"),
    ):
        header[offset : offset + len(field)] = field
    data = bytes(header)
    for number, (begin, end, text) in enumerate(blocks):
        head = b"\0" + number.to_bytes(2, "little") + b"\xff\0" + begin + end + b"\x14\x02\0"
        data += head + text.ljust(112, b"\x8f")
    return data


IN, OUT = bytes((10, 0, 1, 0)), bytes((10, 0, 2, 12))
STL = stl((IN, OUT, b"L'\xc2et\xc2e"))


def test_ttml() -> None:
    found = parse_subtitles(TTML.encode())
    assert [(s.start_s, s.end_s, s.line) for s in found] == [(1.0, 2.5, 7), (3.0, 4.0, 9)]
    assert found[0].text.split() == ["L'été", "déjà", "!"]


def test_ttml_in_utf16_and_timed_spans() -> None:
    timed = TTML.replace("UTF-8", "UTF-16").replace(
        ">Oui.<", '><tt:span end="0.5s">Oui,</tt:span><tt:span begin="0.5s">non.</tt:span><'
    )
    found = parse_subtitles(timed.encode("utf-16"))
    assert [(s.start_s, s.end_s, s.text) for s in found[1:]] == [
        (3.0, 3.5, "Oui,"),
        (3.5, 4.0, "non."),
    ]


def test_stl_counts_from_the_programme_start() -> None:
    assert parse_subtitles(STL) == [Subtitle(1.0, 2.48, "L'été", 1)]


MALFORMED: dict[str, tuple[bytes, str]] = {
    "empty": (b"", "line 1: the file is empty"),
    "blank": (b" \n\n ", "line 1: the file is empty"),
    "plain text": (b"bonjour\n", "line 1: 'bonjour' stands where times should"),
    "zip": (b"PK\x03\x04\x14\0\0\0", "line 1: control character 0x14"),
    "png": (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", "line 1: not valid utf-8"),
    "zeros": (b"\0" * 64, "line 1: control character 0x00"),
    "wav": (b"RIFF\x24\0\0\0WAVEfmt ", "line 1: control character 0x00"),
    "odd utf-16": (b"\xff\xfe" + SRT.encode("utf-16-le")[:-1], "line 3: not valid utf-16"),
    "lone surrogate": (b"\xff\xfe\x00\xd8\x00\x00", "line 1: not valid utf-16"),
    "bad utf-8 after mark": (b"\xef\xbb\xbf1\n\xe9", "line 2: not valid utf-8-sig"),
    "control": (SRT.replace("Oui", "O\x01i").encode(), "line 3: control character 0x01"),
    # SubRip
    "short arrow": (SRT.replace("-->", "->").encode(), "line 2: malformed times"),
    "broken arrow": (SRT.replace("-->", "-- >").encode(), "line 2: malformed times"),
    "long arrow": (SRT.replace("-->", "--->").encode(), "line 2: malformed times"),
    "no arrow": (SRT.replace("-->", "").encode(), "line 2: malformed times"),
    "no end": (SRT.replace("00:00:02,500", "").encode(), "line 2: malformed times"),
    "no start": (b"1\n --> 00:00:02,500\nOui.\n", "line 2: malformed times"),
    "letters": (SRT.replace("01,000", "O1,000").encode(), "line 2: malformed times"),
    "negative": (SRT.replace("00:00:01", "-00:00:01").encode(), "line 2: malformed times"),
    "minutes": (SRT.replace("00:00:02", "00:61:02").encode(), "line 2: 61 min 2 s: a field"),
    "seconds": (SRT.replace("00:00:02", "00:00:62").encode(), "line 2: 0 min 62 s: a field"),
    "end first": (SRT.replace("02,500", "00,500").encode(), "line 2: subtitle ends at 0.500 s"),
    "no length": (SRT.replace("02,500", "01,000").encode(), "line 2: subtitle ends at 1.000 s"),
    "later": ((SRT + "\n2\n00:00:05,000 -> 0\n").encode(), "line 6: malformed times"),
    "only numbers": (b"1\n2\n3\n", "line 3: the file has no subtitles"),
    "heading": (b"Mon film\n\n" + SRT.encode(), "line 1: 'Mon film' stands where times should"),
    "hours": (SRT.replace("00:00:02", "999:00:02").encode(), "line 2: subtitle ends at 3596402"),
    # WebVTT
    "vtt header": (VTT.replace("WEBVTT", "WEBVTTX").encode(), "line 1: 'WEBVTTX' is not the"),
    "vtt alone": (b"WEBVTT\n", "line 1: the file has no subtitles"),
    "vtt times": (VTT.replace("00:02.500", "zz").encode(), "line 3: malformed times"),
    "vtt arrow": (VTT.replace("-->", "->").encode(), "line 3: '00:01.000 -> 00:02.500' stands"),
    "vtt seconds": (VTT.replace("02.500", "72.500").encode(), "line 3: 0 min 72 s: a field"),
    "vtt end first": (VTT.replace("02.500", "00.500").encode(), "line 3: subtitle ends at"),
    "vtt loose text": (b"WEBVTT\n\nbonjour\nbonsoir\n", "line 3: 'bonjour' stands where"),
    # XML
    "xml truncated": (TTML[:600].encode(), "line 9: malformed XML: unclosed"),
    "xml crossed": (TTML.replace("</tt:div>", "").encode(), "line 10: malformed XML: mismatched"),
    "entity bomb": (
        b'<?xml version="1.0"?>\n<!DOCTYPE tt [<!ENTITY a "ha"><!ENTITY b "&a;">]>\n<tt>&b;</tt>',
        "line 2: a document type declaration",
    ),
    "external entity": (
        b'<!DOCTYPE tt SYSTEM "file:///etc/passwd"><tt/>',
        "line 1: a document type declaration",
    ),
    "undefined entity": (TTML.replace("Oui", "&x;").encode(), "line 9: malformed XML: undefined"),
    "not timed text": (b"<html><body/></html>", "line 1: the document's root is 'html'"),
    "xml encoding": (TTML.replace("UTF-8", "klingon").encode(), "line 1: unknown encoding"),
    "xml latin-1 as utf-8": (TTML.encode("latin-1"), "line 7: malformed XML: not well-formed"),
    "xml time": (TTML.replace("00:00:03.000", "3").encode(), "line 9: malformed begin '3'"),
    "xml minutes": (TTML.replace("00:00:04", "00:77:04").encode(), "line 9: malformed end"),
    "xml end first": (TTML.replace("04.000", "02.000").encode(), "line 9: subtitle ends at 2.000"),
    "xml no end": (TTML.replace(' end="00:00:04.000"', "").encode(), "line 9: a subtitle without"),
    "xml no text": (b'<tt xmlns="http://www.w3.org/ns/ttml"/>', "line 1: the file has no subtitle"),
    "xml deep": (b"<tt>" + b"<a>" * 500, "line 1: more than 100 elements inside each other"),
    # EBU STL
    "stl header only": (STL[:500], "line 1: an EBU STL header of 500 bytes, not 1024"),
    "stl no blocks": (STL[:1024], "line 1: the file has no subtitles"),
    "stl truncated": (STL[:-1], "line 1: the last block has 127 bytes, not 128"),
    "stl end first": (stl((OUT, IN, b"Oui")), "line 1: subtitle ends at (10, 0, 1, 0)"),
    "stl time": (stl((IN, b"\x0a\x4d\0\0", b"Oui")), "line 1: malformed time 10:77:0:0 in its"),
    "stl fields": (STL[:238] + b"\xff" * 30 + STL[268:], "line 1: malformed EBU STL"),
}


def test_there_are_forty_kinds() -> None:
    assert len(MALFORMED) >= 40


@pytest.mark.parametrize("kind", MALFORMED)
def test_malformed_files_say_their_line(kind: str) -> None:
    data, message = MALFORMED[kind]
    with pytest.raises(CueError) as caught:
        parse_subtitles(data, terms=Terms(strict=True))
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)


@given(st.data())
def test_damaged_files_raise_nothing_else(data: st.DataObject) -> None:
    whole = data.draw(st.sampled_from([SRT.encode(), VTT.encode(), TTML.encode(), STL]))
    damaged = bytearray(whole)
    for _ in range(data.draw(st.integers(1, 4))):
        position = data.draw(st.integers(0, len(damaged) - 1))
        damaged[position] = data.draw(st.integers(0, 255))
    assert outcome(bytes(damaged[: data.draw(st.integers(0, len(damaged)))])).startswith("line ")


def outcome(data: bytes) -> str:
    """Return the message of the error, or that there is a number of lines."""
    try:
        return f"line count {len(parse_subtitles(data))}"
    except CueError as error:
        return str(error)
