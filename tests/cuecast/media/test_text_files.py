"""Texts of a track's packets as a file of their own format: colours, voices and styles stay."""

import struct

import pytest

from cuecast.media.text_files import file_of, timed_text
from cuecast.media.timed_text import subtitles_of_packet
from synth.language.subtitles.findings import LeftOut
from synth.language.subtitles.read import Terms, cued_subtitles, parse_subtitles

SPOKEN, NOISE = "Il arrive demain.", "Coup de feu au loin"
ASS = (
    "[V4+ Styles]\r\nFormat: Name, PrimaryColour\r\nStyle: Main,&Hffffff\r\nStyle: Bruit,&H0000ff"
    "\r\n\r\n[Events]\r\nFormat: Layer, Start, End, Style, Text\r\n"
)


def coloured(text: str) -> bytes:
    record = struct.pack(">HHHBB4B", 0, len(text), 1, 0, 18, 255, 0, 0, 255)
    box = struct.pack(">I4sH", 10 + len(record), b"styl", 1) + record
    return struct.pack(">H", len(text.encode())) + text.encode() + box


def plain(text: str) -> bytes:
    return struct.pack(">H", len(text.encode())) + text.encode()


@pytest.mark.parametrize(
    ("coding", "spoken", "noise", "header"),
    [
        ("mov_text", plain(SPOKEN), coloured(NOISE), b""),
        ("SubRip", SPOKEN.encode(), f'<font color="#ff0000">{NOISE}</font>'.encode(), b""),
        ("WebVTT", SPOKEN.encode(), f"<c.red>{NOISE}</c>".encode(), b"WEBVTT"),
        (
            "WebVTT",
            SPOKEN.encode(),
            f"<c.b>{NOISE}</c>".encode(),
            b"WEBVTT\n\nSTYLE\n::cue(.b) { color: red; }\n",
        ),
        (
            "ASS",
            f"0,0,Main,,0,0,0,,{SPOKEN}".encode(),
            f"1,0,Bruit,,0,0,0,,{NOISE}".encode(),
            ASS.encode(),
        ),
    ],
)
def test_what_is_shown_in_red_is_no_speech(
    coding: str, spoken: bytes, noise: bytes, header: bytes
) -> None:
    data = file_of(coding, [(1.0, 3.5, spoken), (4.25, 6.0, noise)], header)
    left: list[LeftOut] = []
    found = parse_subtitles(data, terms=Terms(offset_s=0.0), left_out=left.append)
    assert [(s.start_s, s.end_s, s.text) for s in found] == [(1.0, 3.5, SPOKEN)]
    assert len(left) == 1
    everything = parse_subtitles(data, terms=Terms(offset_s=0.0, everything=True))
    assert [s.runs[0].colour for s in everything] == [everything[0].runs[0].colour, "red"]


def test_documents_keep_colours_and_languages() -> None:
    document = (
        '<tt xmlns="http://www.w3.org/ns/ttml" xmlns:tts="http://www.w3.org/ns/ttml#styling" '
        'xml:lang="fr"><body><div>'
        f'<p begin="1s" end="3s">{SPOKEN}</p>'
        f'<p begin="4s" end="5s" tts:color="#ff0000">{NOISE}</p>'
        '<p begin="6s" end="7s" xml:lang="en">Restaurant, table, menu.</p>'
        "</div></body></tt>"
    )
    found = list(subtitles_of_packet(document.encode(), 1.0, 0.0))
    assert [s.start_s for s in found] == [1.0, 4.0, 6.0]
    left: list[LeftOut] = []
    kept = cued_subtitles(found, left_out=left.append)
    assert [s.text for s in kept] == [SPOKEN]
    assert len(left) == 2


def test_texts_that_look_like_files_stay_texts() -> None:
    text = "un --> deux\n\n00:00:09,000 --> 00:00:10,000\nfin"
    data = file_of("SubRip", [(1.0, 2.0, text.encode())], b"")
    assert len(parse_subtitles(data, terms=Terms(offset_s=0.0, everything=True))) == 1
    assert timed_text(b"") == ""
    assert timed_text(plain("Oui") + b"\0\0\0\7styl") == "Oui"
