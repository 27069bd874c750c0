"""Subtitle files: formats, encodings, what is said, malformed files."""

from pathlib import Path

import pytest

from codec.errors import CueError
from synth.language.subtitles import Subtitle, read_subtitles, spoken
from synth.language.subtitles.read import LARGEST_BYTES, Terms, parse_subtitles

SRT = "1\n00:00:01,000 --> 00:00:02,500\nL'été déjà !\n\n2\n00:00:03,000 --> 00:00:04,000\nOui.\n"
VTT = "WEBVTT - titre\n\nNOTE rien\n\nun\n00:01.000 --> 00:02.500 line:0\n<v Anne>L'été déjà !\n"


@pytest.mark.parametrize(
    "encoding", ["utf-8", "utf-8-sig", "cp1252", "iso-8859-15", "utf-16", "utf-16-le", "utf-16-be"]
)
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_encodings_and_line_ends(tmp_path: Path, encoding: str, end: str) -> None:
    path = tmp_path / "a.srt"
    path.write_bytes(SRT.replace("\n", end).encode(encoding))
    assert read_subtitles(path)[0] == Subtitle(1.0, 2.5, "L'été déjà !", 2)


def test_vtt() -> None:
    assert parse_subtitles(VTT.encode()) == [Subtitle(1.0, 2.5, "L'été déjà !", 6)]


def test_content_tells_the_format(tmp_path: Path) -> None:
    path = tmp_path / "programme"
    path.write_text(VTT, encoding="utf-8")
    assert read_subtitles(path)[0].start_s == 1.0


def test_subtitles_are_sorted() -> None:
    late_first = "00:00:05,000 --> 00:00:06,000\nB\n\n00:00:01,000 --> 00:00:02,000\nA\n"
    assert [s.text for s in parse_subtitles(late_first.encode())] == ["A", "B"]


def test_clocks_in_a_text_are_text() -> None:
    text = "1\n00:00:01,000 --> 00:00:02,000\n12:45, 3 personnes\n- Il est 8:30:15.\n"
    assert parse_subtitles(text.encode())[0].text.startswith("12:45, 3")


def test_empty_lines_inside_a_text() -> None:
    text = "1\n00:00:01.0 --> 00:00:02.0 X1:0 X2:9\nun\n\ndeux\n\n2\n00:03 --> 00:04\ntrois"
    assert [s.text for s in parse_subtitles(text.encode())] == ["un\n\ndeux", "trois"]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("- Tu viens ?\n- Oui", "Tu viens ? Oui"),
        ("- Non\n- Si", "Non. Si"),
        ("(Bruit de porte)", ""),
        ("[il rit] Ah bon ?", "Ah bon ?"),
        ("JEAN : Viens !", "Viens !"),
        ("♪ Musique douce ♪", ""),
        ("♪ Au clair de la lune ♪", "Au clair de la lune"),
        ("# Musique", ""),
        ("Il est dix heures :\nc'est tard.", "Il est dix heures : c'est tard."),
        ("...", ""),
    ],
)
def test_spoken(text: str, expected: str) -> None:
    assert spoken(text) == expected


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "line 1: the file is empty"),
        pytest.param(b"x" * (LARGEST_BYTES + 1), "more than 8388608 bytes", id="large"),
        (b"bonjour\n", "line 1: 'bonjour' stands where times should"),
        (b"1\n00:00:01,000 -> 00:00:02,000\nA\n", "line 2: malformed times"),
        (b"1\n00:00:03,000 --> 00:00:02,000\nA\n", "line 2: subtitle ends at 2.000 s"),
        (b"1\n00:61:03,000 --> 00:62:02,000\nA\n", "line 2: 61 min 3 s: a field exceeds 59"),
        (b"WEBVTT\n\n00:01.000 --> zz\nA\n", "line 3: malformed times"),
        (b"WEBVTT\n\nhello\nA\n", "line 3: 'hello' stands where times should"),
        (b"WEBVTT\n", "line 1: the file has no subtitles"),
        (b"1\n00:00:01,000 --> 00:00:02,000\nA\x01B\n", "line 3: control character 0x01"),
    ],
)
def test_malformed(data: bytes, message: str) -> None:
    with pytest.raises(CueError) as caught:
        parse_subtitles(data, terms=Terms(strict=True))
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(CueError, match="cannot read subtitles: No such file"):
        read_subtitles(tmp_path / "none.srt")


@pytest.mark.parametrize(
    ("shown", "said"),
    [
        ("Jean : Tu viens ?", "Tu viens ?"),
        ("- Paul: Non.\n- Marie (off) : Si !", "Non. Si !"),
        ("Jean-Pierre :\nOui", "Oui"),
        ("Voix de femme : Entrez !", "Entrez !"),
        ("Homme 1 : Stop !", "Stop !"),
        ("GARÇON 2 :\nViens !", "Viens !"),
        ("Le docteur Martin : Il ira mieux.", "Le docteur Martin : Il ira mieux."),
        ("Attention : Danger !", "Attention : Danger !"),
        ("Il m'a dit : Viens ici.", "Il m'a dit : Viens ici."),
        ("Mon ami Paul : un génie.", "Mon ami Paul : un génie."),
        ("* Il rit *", ""),
        ("- *Sonnerie*\n- Allô ?", "Allô ?"),
        ("On *adore* ça", "On *adore* ça"),
        ("Je ne com-\nprends pas", "Je ne comprends pas"),
        ("Donne-\nmoi ça", "Donne-moi ça"),
        ("Il vient -\nje crois", "Il vient - je crois"),
    ],
)
def test_labels_sounds_and_broken_words(shown: str, said: str) -> None:
    assert spoken(shown) == said


def test_what_stays_on_the_screen_is_said_once() -> None:
    def srt(*cues: tuple[float, float, str]) -> bytes:
        blocks = [f"00:{a:06.3f} --> 00:{b:06.3f}\n{text}\n" for a, b, text in cues]
        return "\n".join(blocks).encode()

    rolling = srt((0, 2, "Bonjour"), (2, 4, "Bonjour\ncher ami"), (4, 6, "cher ami\net vous ?"))
    assert [s.text for s in parse_subtitles(rolling)] == ["Bonjour", "cher ami", "et vous ?"]
    growing = srt((0, 1, "Je"), (1, 2, "Je viens"), (2, 3, "Je viens demain"))
    assert [s.text for s in parse_subtitles(growing)] == ["Je", "viens", "demain"]
    twice = parse_subtitles(srt((0, 1, "Oui."), (1, 2, "Oui."), (4, 5, "Oui.")))
    assert [(s.start_s, s.end_s) for s in twice] == [(0, 2), (4, 5)]
    apart = srt((0, 2, "Non."), (2.5, 4, "Non.\nJamais."))
    assert [s.text for s in parse_subtitles(apart)] == ["Non.", "Non.\nJamais."]


def test_the_map_of_a_stream_moves_its_subtitles() -> None:
    body = "\n\n00:05.000 --> 00:06.000\nOui.\n\n00:20.000 --> 00:21.000\nNon.\n"

    def starts(header: str, stream_s: float | None) -> list[float]:
        data = f"WEBVTT\n{header}{body}".encode()
        return [round(s.start_s, 3) for s in parse_subtitles(data, stream_s=stream_s)]

    header = "X-TIMESTAMP-MAP=LOCAL:00:00:04.000,MPEGTS:900000"
    assert starts(header, None) == [5.0, 20.0]
    assert starts(header, 10.0) == [1.0, 16.0]
    assert starts(header, 1.4) == [9.6, 24.6]
    # What is over when the programme begins is left out, what is under way is cut.
    assert starts(header, 11.5) == [0.0, 14.5]
    assert starts(header, 20.0) == [6.0]
    # The count of 33 bits begins anew between the map and the programme.
    wrapped = f"X-TIMESTAMP-MAP=MPEGTS:{(1 << 33) - 90_000},LOCAL:00:00.000"
    assert starts(wrapped, 0.5) == [3.5, 18.5]
    with pytest.raises(CueError, match="line 2: malformed 'X-TIMESTAMP-MAP=MPEGTS:x'"):
        starts("X-TIMESTAMP-MAP=MPEGTS:x", 0.0)
