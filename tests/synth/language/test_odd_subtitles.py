"""Fifty damaged or odd subtitle files: each subtitle is read right, or its loss is told."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codec.errors import CueError
from synth.language.subtitles.credits import is_credit
from synth.language.subtitles.findings import LeftOut
from synth.language.subtitles.language import languages
from synth.language.subtitles.read import Terms, parse_subtitles

A, B, C = (
    "1\n00:00:01,000 --> 00:00:02,000\nOui.\n",
    "2\n%s\nBonjour.\n",
    ("3\n00:00:05,000 --> 00:00:06,000\nÀ demain.\n"),
)
WHOLE = {1.0: "Oui.", 3.0: "Bonjour.", 5.0: "À demain."}
REST = {1.0: "Oui.", 5.0: "À demain."}


def srt(times: str, text: str = "Bonjour.") -> bytes:
    return "\n".join([A, (B % times).replace("Bonjour.", text), C]).encode()


def vtt(block: str, head: str = "WEBVTT") -> bytes:
    good = "00:01.000 --> 00:02.000\nOui.\n", "00:05.000 --> 00:06.000\nÀ demain.\n"
    return "\n".join([head + "\n", good[0], block + "\n", good[1]]).encode()


def ttml(paragraph: str, attributes: str = "", head: str = "", hours: str = "00") -> bytes:
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<tt xmlns="http://www.w3.org/ns/ttml" xmlns:ttp="http://www.w3.org/ns/ttml#parameter"
 xmlns:ebuttm="urn:ebu:tt:metadata" {attributes}><head><metadata>{head}</metadata></head><body><div>
<p begin="{hours}:00:01.000" end="{hours}:00:02.000">Oui.</p>
{paragraph}
<p begin="{hours}:00:05.000" end="{hours}:00:06.000">À demain.</p>
</div></body></tt>""".encode()


def ass(line: str) -> bytes:
    return f"""[Script Info]
Title: essai
[V4+ Styles]
Format: Name, Fontname
Style: Main,Arial
[Events]
Format: Layer, Start, End, Style, Name, MarginL, MarginR, MarginV, Effect, Text
Dialogue: 0,0:00:01.00,0:00:02.00,Main,Anne,0,0,0,,Oui.
{line}
Dialogue: 0,0:00:05.00,0:00:06.00,Main,,0,0,0,,À demain.
""".encode()


def stl(*blocks: tuple[bytes, bytes, bytes], tcp: bytes = b"10000000") -> bytes:
    header = bytearray(b" " * 1024)
    for offset, value in (
        (0, b"850STL25.010000F"),
        (224, b"26112126112100"),
        (238, b"%05d" % len(blocks)),
        (243, b"%05d" % len(blocks)),
        (248, b"0014023110000000"),
        (256, tcp),
        (264, b"11FRA"),
    ):
        header[offset : offset + len(value)] = value
    data = bytes(header)
    for number, (begin, end, text) in enumerate(blocks):
        head = b"\0" + number.to_bytes(2, "little") + b"\xff\0" + begin + end + b"\x14\x02\0"
        data += head + text.ljust(112, b"\x8f")
    return data


def at(*fields: int) -> bytes:
    return bytes(fields)


_OUI = (at(10, 0, 1, 0), at(10, 0, 2, 0), b"Oui.")
_LAST = (at(10, 0, 5, 0), at(10, 0, 6, 0), b"\xc1A demain.")

GOOD = "00:00:03,000 --> 00:00:04,000"
P = '<p begin="00:00:03.000" end="00:00:04.000">Bonjour.</p>'

CASES: dict[str, tuple[bytes, dict[float, str], list[str]]] = {
    # SubRip: spelled otherwise, and read
    "arrow ->": (srt(GOOD.replace("-->", "->")), WHOLE, []),
    "arrow -- >": (srt(GOOD.replace("-->", "-- >")), WHOLE, []),
    "arrow --->": (srt(GOOD.replace("-->", "--->")), WHOLE, []),
    "arrow of typography": (srt(GOOD.replace("-->", "→")), WHOLE, []),
    "dash for arrow": (srt(GOOD.replace("-->", "–>")), WHOLE, []),
    "points": (srt(GOOD.replace(",", ".")), WHOLE, []),
    "no hours": (srt("00:03,000 --> 00:04,000"), WHOLE, []),
    "frames": (srt("00:00:03:00 --> 00:00:04:12"), WHOLE, []),
    "no milliseconds": (srt("00:00:03 --> 00:00:04"), WHOLE, []),
    "positions": (srt(f"{GOOD} X1:40 X2:600 Y1:20 Y2:50"), WHOLE, []),
    "no counters": (srt(GOOD).replace(b"\n2\n", b"\n").replace(b"\n3\n", b"\n"), WHOLE, []),
    "no empty lines": (srt(GOOD).replace(b"\n\n", b"\n"), WHOLE, []),
    "many empty lines": (srt(GOOD).replace(b"\n\n", b"\n\n\n\n"), WHOLE, []),
    "spaces in times": (srt("00: 00: 03, 000  -->  00: 00: 04, 000"), WHOLE, []),
    "YouTube's commas": (srt("0:00:03.000,0:00:04.000"), WHOLE, []),
    "out of order": (
        "\n".join([C, B % GOOD, A]).encode(), WHOLE, [],
    ),
    "twice the same mark": (b"\xef\xbb\xbf\xef\xbb\xbf" + srt(GOOD), WHOLE, []),
    "old letters": (srt(GOOD, "Déjà !").decode().encode("cp1252"),
                    {**WHOLE, 3.0: "Déjà !"}, []),
    "mac letters": (srt(GOOD, "Déjà !").decode().encode("mac-roman"),
                    {**WHOLE, 3.0: "Déjà !"}, []),
    "entities and tags": (srt(GOOD, '<font color="#ff0">Bon&shy;jour</font>&nbsp;!'),
                          {**WHOLE, 3.0: "Bon\xadjour\xa0!"}, []),
    "overlap": (srt("00:00:01,500 --> 00:00:04,000"),
                {1.0: "Oui.", 1.5: "Bonjour.", 5.0: "À demain."}, []),
    # SubRip: damaged, and told
    "no length": (srt("00:00:03,000 --> 00:00:03,000"), REST, ["line 6: subtitle ends at 3.000"]),
    "end first": (srt("00:00:04,000 --> 00:00:03,000"), REST, ["line 6: subtitle ends at 3.000"]),
    "negative": (srt("-00:00:03,000 --> 00:00:04,000"), REST, ["line 6: malformed times"]),
    "letters for figures": (srt("00:0O:03,000 --> 00:00:04,000"), REST, ["line 6: malformed"]),
    "no end": (srt("00:00:03,000 -->"), REST, ["line 6: malformed times"]),
    "no start": (srt("--> 00:00:04,000"), REST, ["line 6: malformed times"]),
    "minutes": (srt("00:61:03,000 --> 00:62:04,000"), REST, ["line 6: 61 min 3 s: a field"]),
    "hundreds of hours": (srt("00:00:03,000 --> 999:00:04,000"), REST, ["line 6: subtitle ends"]),
    "times missing": ("\n".join([A, "2\nBonjour.\n", C]).encode(), REST,
                      ["line 5: 'Bonjour.' has no times"]),
    "a heading": (b"Mon film\n\n" + srt(GOOD), WHOLE, ["line 1: 'Mon film' stands where"]),
    "a control character": (srt(GOOD, "Bon\x01 jour."), {**WHOLE, 3.0: "Bon  jour."}, []),
    "broken utf-16": (b"\xff\xfe" + srt(GOOD).decode().encode("utf-16-le")[:-1],
                      {1.0: "Oui.", 3.0: "Bonjour."}, ["line 10: its letters cannot be read"]),
    "cut short": (srt(GOOD)[:-30], {1.0: "Oui.", 3.0: "Bonjour."},
                  ["line 9: '00:00:05,00' has no times"]),
    "tape's hour": (srt("00:00:03,000 --> 00:00:04,000").replace(b"00:00:0", b"10:00:0"),
                    WHOLE, []),
    "credits": (srt(GOOD, "Sous-titrage : RED BEE MEDIA"), REST, ["line 6: credits"]),
    "two languages": (srt(GOOD, "What are you doing here?"), REST, ["line 6: not French (en)"]),
    "Arabic": (srt(GOOD, "ماذا تفعل هنا؟"), REST, ["line 6: not French (ar)"]),
    "Chinese": (srt(GOOD, "你在这里做什么"), REST, ["line 6: not French (zh)"]),
    # WebVTT
    "vtt times": (vtt("00:03.000 --> zz\nBonjour."), REST, ["line 6: malformed times"]),
    "vtt arrow": (vtt("00:03.000 -> 00:04.000\nBonjour."), WHOLE, []),
    "vtt loose text": (vtt("Bonjour.\nBonsoir."), REST, ["line 6: 'Bonjour.' stands where"]),
    "vtt end first": (vtt("00:04.000 --> 00:03.000\nBonjour."), REST, ["line 6: subtitle ends"]),
    "vtt declared English": (
        vtt("00:03.000 --> 00:04.000\nNo.", "WEBVTT\nKind: captions\nLanguage: en"),
        {}, ["line 5: not French", "line 8: not French", "line 11: not French"],
    ),
    # ASS
    "ass": (ass("Dialogue: 0,0:00:03.00,0:00:04.00,Main,,0,0,0,,{\\i1}Bonjour{\\i0}."), WHOLE, []),
    "ass comment": (ass("Comment: 0,0:00:03.00,0:00:04.00,Main,,0,0,0,,Bonjour."), REST, []),
    "ass drawing": (ass("Dialogue: 0,0:00:03.00,0:00:04.00,M,,0,0,0,,{\\p1}m 0 0 l 9 9{\\p0}"),
                    REST, []),
    "ass times": (ass("Dialogue: 0,0:00:03.00,zz,Main,,0,0,0,,Bonjour."), REST,
                  ["line 9: malformed end 'zz'"]),
    "ass layers": (ass("Dialogue: 1,0:00:01.00,0:00:02.00,Main,Anne,0,0,0,,{\\blur5}Oui."),
                   REST, []),
    # XML
    "xml times": (ttml(P.replace("00:00:03.000", "zz")), REST, ["line 5: malformed begin 'zz'"]),
    "xml no end": (ttml(P.replace(' end="00:00:04.000"', "")), REST,
                   ["line 5: a subtitle without"]),
    "xml end first": (ttml(P.replace("04.000", "02.000")), REST, ["line 5: subtitle ends"]),
    "xml breaks off": (ttml(P)[:-60], {1.0: "Oui.", 3.0: "Bonjour."}, ["line 6: malformed XML"]),
    "xml in English": (ttml(P.replace(">B", ' xml:lang="en">B').replace("Bonjour", "No"),
                            'xml:lang="fr"'), REST, ["line 5: not French (en): 'No.'"]),
    "xml of a tape": (ttml(P.replace("00:00:0", "10:00:0"), 'ttp:timeBase="smpte"', hours="10"),
                      WHOLE, []),
    "xml with its start": (
        ttml(P.replace("00:00:0", "01:00:0"), 'ttp:timeBase="smpte"', hours="01", head=(
            "<ebuttm:documentStartOfProgramme>01:00:00:00</ebuttm:documentStartOfProgramme>")),
        WHOLE, [],
    ),
    # EBU STL
    "stl end first": (stl(_OUI, (at(10, 0, 4, 0), at(10, 0, 3, 0), b"Bonjour."), _LAST), REST,
                      ["line 2: subtitle ends at (10, 0, 3, 0)"]),
    "stl time": (stl(_OUI, (at(10, 77, 3, 0), at(10, 0, 4, 0), b"Bonjour."), _LAST), REST,
                 ["line 2: malformed time 10:77:3:0"]),
    "stl cut short": (stl(_OUI, _LAST, _OUI)[:-20], REST, ["line 3: the last block has 108 bytes"]),
    "stl start": (stl(_OUI, _LAST, tcp=b"00000000"), REST, []),
}  # fmt: skip


def read(data: bytes, terms: Terms) -> tuple[dict[float, str], list[str]]:
    told: list[LeftOut] = []
    found = parse_subtitles(data, terms=terms, left_out=told.append)
    return {s.start_s: s.text for s in found}, [str(item) for item in told]


def test_there_are_fifty() -> None:
    assert len(CASES) >= 50


@pytest.mark.parametrize("case", CASES)
def test_each_subtitle_is_right_or_told(case: str) -> None:
    data, subtitles, messages = CASES[case]
    found, told = read(data, Terms())
    assert found == subtitles
    assert len(told) == len(messages)
    for message, start in zip(told, messages, strict=True):
        assert message.startswith(start)


@pytest.mark.parametrize("case", ["no length", "arrow ->", "xml breaks off", "stl time"])
def test_a_strict_reader_refuses(case: str) -> None:
    with pytest.raises(CueError, match=r"^line \d+: "):
        read(CASES[case][0], Terms(strict=True))


def test_offsets() -> None:
    late = srt(GOOD)
    assert list(read(late, Terms(offset_s=2.0))[0]) == [3.0, 5.0, 7.0]
    found, told = read(late, Terms(offset_s=-2.5))
    assert list(found) == [0.5, 2.5]
    assert told == ["line 2: over before the programme starts"]
    # An offset takes the place of the file's hints.
    tape = CASES["tape's hour"][0]
    assert list(read(tape, Terms(offset_s=-36_000.0))[0]) == [1.0, 3.0, 5.0]
    assert list(read(tape, Terms(offset_s=0.0))[0]) == [36_001.0, 36_003.0, 36_005.0]


def test_a_programme_of_known_length_tells_its_hour() -> None:
    hour = srt(GOOD).replace(b"00:00:0", b"01:00:0")
    assert parse_subtitles(hour)[0].start_s == 3601.0
    assert parse_subtitles(hour, length_s=5400.0)[0].start_s == 3601.0
    assert parse_subtitles(hour, length_s=1800.0)[0].start_s == 1.0


def test_everything_is_cued_if_asked() -> None:
    found, told = read(CASES["two languages"][0], Terms(everything=True))
    assert found[3.0] == "What are you doing here?"
    assert not told


@pytest.mark.parametrize(
    ("text", "language"),
    [
        ("Je m'appelle John Smith.", "fr"),
        ("Barack Obama et Angela Merkel sont à Berlin.", "fr"),
        ('Il a dit : "I have a dream".', "fr"),
        ("Grrr !", "fr"),
        ("No.", "fr"),
        ("C'est un talk-show, un reality-show.", "fr"),
        ("Ouais, mec, j'ai kiffé grave !", "fr"),
        ("Allez, Paris Saint-Germain !", "fr"),
        ("Where are the others?", "en"),
        ("I love you.", "en"),
        ("¿Dónde está la biblioteca?", "es"),
        ("Guten Tag, wie geht es Ihnen?", "de"),
        ("Non lo so, amico mio, andiamo!", "it"),
        ("Я не понимаю.", "ru"),
        ("私は学生です", "ja"),
    ],
)
def test_languages(text: str, language: str) -> None:
    assert languages([text], [""]) == [language]


def test_short_texts_follow_their_neighbours() -> None:
    english = ["What do you want from me?", "No.", "OK.", "Tell me what you know about him."]
    assert languages(english, [""] * 4) == ["en"] * 4
    french = ["Qu'est-ce que tu veux ?", "No.", "OK.", "Dis-moi tout ce que tu sais."]
    assert languages(french, [""] * 4) == ["fr"] * 4
    assert languages(["OK."], ["en-GB"]) == ["en"]
    assert languages(["Je ne sais pas ce que tu veux."], ["en"]) == ["fr"]


@pytest.mark.parametrize(
    "text",
    [
        "Sous-titrage : RED BEE MEDIA",
        "Sous-titrage ST' 501",
        "Sous-titres réalisés par\nJean Dupont",
        "Sous-titrage MFP.",
        "Traduction : Marie Durand\nAdaptation : Paul Petit",
        "Adaptation : Marie Durand",
        "Synchro par Bibi",
        "Sous-titrage Société Radio-Canada",
        "Sous-titres disponibles sur www.opensubtitles.org",
        "Subtitles by the Amara.org community",
    ],
)
def test_credits(text: str) -> None:
    assert is_credit(text)


@pytest.mark.parametrize(
    "text",
    [
        "Les sous-titres sont en retard.",
        "Je travaille à la traduction de ce livre.",
        "L'adaptation est difficile.",
        "Traduction ?",
        "C'est une adaptation par amour.",
        "Corrections à faire demain.",
    ],
)
def test_what_is_said_about_subtitles_is_no_credit(text: str) -> None:
    assert not is_credit(text)


@settings(max_examples=60)
@given(st.data())
def test_damage_is_survived(data: st.DataObject) -> None:
    whole = data.draw(st.sampled_from([entry[0] for entry in CASES.values()]))
    damaged = bytearray(whole)
    for _ in range(data.draw(st.integers(1, 4))):
        position = data.draw(st.integers(0, len(damaged) - 1))
        damaged[position] = data.draw(st.integers(0, 255))
    assert outcome(bytes(damaged)).startswith("line ")


def outcome(data: bytes) -> str:
    """Return the message of the error, or that there is a number of lines."""
    try:
        return f"line count {len(parse_subtitles(data))}"
    except CueError as error:
        return str(error)
