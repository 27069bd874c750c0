"""Subtitles for the deaf as broadcasters write them: what is cued, and the reason for the rest.

The answers were written down before the readers knew colours.
"""

import pytest

from synth.language.subtitles import spoken
from synth.language.subtitles.findings import LeftOut
from synth.language.subtitles.read import Terms, parse_subtitles


def srt(*texts: str) -> bytes:
    cues = (
        f"{i}\n00:00:{2 * i:02},000 --> 00:00:{2 * i + 1:02},500\n{text}\n"
        for i, text in enumerate(texts, 1)
    )
    return "\n".join(cues).encode()


def font(colour: str, text: str) -> str:
    return f'<font color="{colour}">{text}</font>'


def vtt(*texts: str, style: str = "") -> bytes:
    cues = (f"00:{2 * i:02}.000 --> 00:{2 * i + 1:02}.500\n{t}\n" for i, t in enumerate(texts, 1))
    return "\n".join(["WEBVTT\n", *([f"STYLE\n{style}\n"] if style else []), *cues]).encode()


def ttml(*paragraphs: str, lines: bool = True) -> bytes:
    timed = (
        p.replace("<p", f'<p begin="00:00:{2 * i:02}.000" end="00:00:{2 * i + 1:02}.500"', 1)
        for i, p in enumerate(paragraphs, 1)
    )
    between = "\n" if lines else ""
    styles = "".join(
        f'<style xml:id="{name}" tts:color="{value}"/>'
        for name, value in (
            ("w", "#ffffff"),
            ("r", "#ff0000ff"),
            ("m", "magenta"),
            ("g", "rgb(0,255,0)"),
            ("c", "#00ffff"),
            ("y", "#FFFF00"),
        )
    )
    return (
        '<?xml version="1.0" encoding="UTF-8"?><tt xmlns="http://www.w3.org/ns/ttml" '
        'xmlns:tts="http://www.w3.org/ns/ttml#styling" xml:lang="fr"><head><styling>'
        f"{styles}</styling></head><body><div>{between}{between.join(timed)}{between}</div>"
        "</body></tt>"
    ).encode()


def stl(*texts: bytes) -> bytes:
    header = bytearray(b" " * 1024)
    for offset, value in (
        (0, b"850STL25.011000F"),
        (224, b"26112126112100"),
        (238, b"%05d" % len(texts)),
        (243, b"%05d" % len(texts)),
        (248, b"0014023110000000"),
        (256, b"00000000"),
        (264, b"11FRA"),
    ):
        header[offset : offset + len(value)] = value
    data = bytes(header)
    for number, text in enumerate(texts):
        start = 2 * (number + 1)
        head = b"\0" + number.to_bytes(2, "little") + b"\xff\0"
        head += bytes((0, 0, start, 0, 0, 0, start + 1, 12)) + b"\x14\x02\0"
        data += head + text.ljust(112, b"\x8f")
    return data


A, Z = "Bonjour à tous.", "On se retrouve demain."
TWICE = "Élève brillant, il a été reçu à l’école."

CASES: dict[str, tuple[bytes, list[str], list[str]]] = {
    # Colours
    "srt red": (srt(A, font("#FF0000", "Coup de feu au loin"), Z), [A, Z], ["sound"]),
    "srt red name": (srt(A, font("red", "Il frappe."), Z), [A, Z], ["sound"]),
    "srt alone": (srt(font("#ff0000", "Coup de feu au loin")), [], ["sound"]),
    "srt magenta": (srt(A, font("#FF00FF", "Musique inquiétante"), Z), [A, Z], ["music"]),
    "srt magenta sung": (srt(font("magenta", "♪ Non, rien de rien ♪")), ["Non, rien de rien"], []),
    "srt green": (srt(A, font("#00FF00", "Il parle anglais."), Z), [A, Z], ["foreign"]),
    "srt cyan": (srt(font("cyan", "Je me demande pourquoi.")), ["Je me demande pourquoi."], []),
    "srt yellow": (srt(font("#FFFF00", "J'arrive !")), ["J'arrive !"], []),
    "srt two colours": (
        srt(font("red", "Coup de feu") + "\n" + font("white", "Attention !")),
        ["Attention !"], ["sound"],
    ),
    "srt no quotes": (srt(A, "<font color=#ff0000>Porte qui claque</font>"), [A], ["sound"]),
    "srt unclosed": (srt(A, '<font color="red">Porte qui claque', Z), [A, Z], ["sound"]),
    "ass in srt": (srt(A, "{\\c&H0000FF&}Porte qui claque"), [A], ["sound"]),
    "dark red": (srt(A, font("#C00000", "Un chien gronde.")), [A], ["sound"]),
    "vtt class": (vtt(A, "<c.red>Un chien gronde.</c>", Z), [A, Z], ["sound"]),
    "vtt magenta": (vtt(A, "<c.magenta.bg_black>Air de jazz</c>"), [A], ["music"]),
    "vtt lime": (vtt(A, "<c.lime>Elle parle chinois.</c>"), [A], ["foreign"]),
    "vtt cyan": (vtt("<c.cyan>Que faire ?</c>"), ["Que faire ?"], []),
    "vtt style": (
        vtt(A, "<c.bruit>Un chien gronde.</c>", style="::cue(.bruit) { color: #f00; }"),
        [A], ["sound"],
    ),
    "vtt voice": (vtt("<v Anne>Tu viens ?"), ["Tu viens ?"], []),
    "vtt lang": (vtt("<lang en>See you later.</lang>", A), [A], ["not French (en)"]),
    "ttml red": (ttml('<p style="r">Coup de feu au loin</p>', f"<p>{A}</p>"), [A], ["sound"]),
    "ttml span": (
        ttml(f'<p><span style="r">Il rit.</span><br/><span style="w">{A}</span></p>'),
        [A], ["sound"],
    ),
    "ttml magenta": (ttml('<p style="m">Musique lente</p>', f"<p>{A}</p>"), [A], ["music"]),
    "ttml green": (ttml('<p style="g">Au revoir.</p>', f"<p>{A}</p>"), [A], ["foreign"]),
    "ttml cyan": (ttml('<p style="c">Que faire ?</p>'), ["Que faire ?"], []),
    "ttml inline": (ttml('<p tts:color="red">Il tousse.</p>', f"<p>{A}</p>"), [A], ["sound"]),
    "stl red": (stl(b"\x01Coup de feu", b"\x07Bonjour."), ["Bonjour."], ["sound"]),
    "stl magenta": (stl(b"\x05Air triste", b"\x07Bonjour."), ["Bonjour."], ["music"]),
    "stl cyan": (stl(b"\x06Que faire ?"), ["Que faire ?"], []),
    # Sounds without colour
    "applause": (srt(A, "Applaudissements", Z), [A, Z], ["sound"]),
    "soft music": (srt(A, "Musique douce", Z), [A, Z], ["sound"]),
    "laughter": (srt(A, "Rires", Z), [A, Z], ["sound"]),
    "stars": (srt(A, "*porte qui claque*", Z), [A, Z], ["sound"]),
    "stars before speech": (srt("*soupir* Je sais."), ["Je sais."], []),
    "emphasis": (srt("C'est *ma* place."), ["C'est *ma* place."], []),
    "brackets": (srt(A, "[Sonnerie]", Z), [A, Z], ["sound"]),
    "notes alone": (srt(A, "♪♪♪", Z), [A, Z], ["sound"]),
    "phone rings": (srt(A, "Sonnerie de téléphone"), [A], ["sound"]),
    "music is said": (srt("Musique !"), ["Musique !"], []),
    "laughter is said": (srt("Les rires font du bien."), ["Les rires font du bien."], []),
    "applause is asked": (srt("Applaudissements pour lui !"), ["Applaudissements pour lui !"], []),
    "barking": (srt(A, "Aboiements au loin"), [A], ["sound"]),
    # Languages
    "xml:lang": (
        ttml(f"<p>{A}</p>", '<p xml:lang="en">Fine, thanks.</p>', f"<p>{Z}</p>"),
        [A, Z], ["not French (en)"],
    ),
    "one line": (
        ttml(f"<p>{A}</p>", '<p xml:lang="en">Fine, thanks.</p>', f"<p>{Z}</p>", lines=False),
        [A, Z], ["column"],
    ),
    "yes": (srt(A, "Yes!", Z), [A, Z], ["not French (en)"]),
    "come on": (srt(A, "Come on!", Z), [A, Z], ["not French (en)"]),
    "let's go": (srt(A, "OK, let's go!", Z), [A, Z], ["not French (en)"]),
    "hasta la vista": (srt(A, "Hasta la vista, baby.", Z), [A, Z], ["not French (es)"]),
    "thank you": (srt(A, "Thank you.", Z), [A, Z], ["not French (en)"]),
    "gracias": (srt(A, "Muchas gracias, señor.", Z), [A, Z], ["not French (es)"]),
    "danke": (srt(A, "Danke schön.", Z), [A, Z], ["not French (de)"]),
    "grazie": (srt(A, "Grazie mille.", Z), [A, Z], ["not French (it)"]),
    "ok": (srt("OK.", "Cool !", "Stop !"), ["OK.", "Cool !", "Stop !"], []),
    "short French": (srt("Non.", "Allô ?", "Viens !"), ["Non.", "Allô ?", "Viens !"], []),
    "two languages in a cue": (
        srt("- What are you doing here?\n- Je t'attendais depuis une heure."),
        ["Je t'attendais depuis une heure."], ["not French (en)"],
    ),
    "French line first": (
        srt("Je t'attendais depuis une heure.\nWhat are you doing here?"),
        ["Je t'attendais depuis une heure."], ["not French (en)"],
    ),
    # Letters
    "encoded twice": (
        srt(TWICE).decode().encode().decode("latin-1").encode(), [TWICE], ["encoded twice"],
    ),
    "encoded twice, cp1252": (
        srt("Là, c’est très bien… où ça ?").decode("cp1252", "replace").encode(),
        ["Là, c’est très bien… où ça ?"], ["encoded twice"],
    ),
    "cut word": (srt("C'est pour au-\njourd'hui."), ["C'est pour aujourd'hui."], []),
    "cut name": (srt("Il a battu Lewan-\ndowski."), ["Il a battu Lewandowski."], []),
    "not cut": (srt("Donne-\nmoi ça."), ["Donne-moi ça."], []),
}  # fmt: skip


def read(data: bytes, terms: Terms) -> tuple[list[str], list[LeftOut]]:
    told: list[LeftOut] = []
    found = parse_subtitles(data, terms=terms, left_out=told.append)
    return [spoken(s.text) for s in found], told


@pytest.mark.parametrize("case", CASES)
def test_cues_are_right_or_reported(case: str) -> None:
    data, expected, reasons = CASES[case]
    found, told = read(data, Terms())
    assert [text for text in found if text] == expected
    assert len(told) == len(reasons), told
    for item, reason in zip(told, reasons, strict=True):
        assert reason in str(item)


def test_plain_profile_cues_every_colour() -> None:
    data = CASES["srt red"][0]
    assert len(read(data, Terms(profile="plain"))[0]) == 3


def test_a_file_all_in_one_colour_has_no_roles() -> None:
    texts = [font("#00ff00", f"Je reviens dans {i} jours.") for i in range(2, 27)]
    found, told = read(srt(*texts), Terms())
    assert len(found) == len(texts)
    assert "colours" in str(told[0])


def test_colour_voice_and_position_are_kept() -> None:
    (subtitle,) = parse_subtitles(vtt("<v Anne><c.yellow>Tu viens ?</c>"))
    assert [(run.colour, run.voice) for run in subtitle.runs] == [("yellow", "Anne")]
    (subtitle,) = parse_subtitles(srt("{\\an8}Tu viens ?"))
    assert subtitle.position == "an8"
