"""Pronunciation: worked examples of Cued Speech, traps of French, liaison, schwa."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codec.cues.phonology import PHONES
from codec.errors import CueError
from synth.language.text.lexicon import read_user_lexicon
from synth.language.text.pronounce import Style, phonemise
from synth.planning.scoring.text_score import score_of_text


def said(text: str, **options: str) -> str:
    words = phonemise(text, style=Style(**options))
    return " ".join("".join(word.phones) for word in words)


def keys(text: str) -> str:
    letters = {"side": "s", "mouth": "m", "chin": "c", "cheek": "b", "throat": "t"}
    return " ".join(f"{k.shape}-{letters[k.placement]}" for k in score_of_text(text).keys)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("bonjour", "4-m 1-c 3-s"),
        ("hier", "8-c 3-s"),
        ("objectif", "5-c 4-s 1-c 2-s 5-m 5-s"),
        ("voiture", "2-s 6-s 5-t 3-s"),
        ("bon", "4-m"),
    ],
)
def test_worked_examples(text: str, expected: str) -> None:
    assert keys(text) == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("ils jouent, louent, nouent, avouent, secouent", "il ʒu lu nu avu səku"),
        ("huit puis", "ɥit pɥi"),
        ("3e étage", "tʁwazjɛm etaʒ"),
        ("M. Dupont et Mme Martin", "məsjø dypɔ̃ e madam maʁtɛ̃"),
        ("à 20h30", "a vɛ̃ tœʁ tʁɑ̃t"),
        ("n° 5", "nymeʁo sɛ̃k"),
        ("les fils électriques", "le fil elɛktʁik"),
        ("ses fils arrivent", "se fis aʁiv"),
        ("le week-end au parking", "lə wikɛnd o paʁkiŋ"),
        ("les amis ont arrivé", "le zami ɔ̃ taʁive"),
        ("un grand homme, un petit enfant", "œ̃ gʁɑ̃ tɔm œ̃ pəti tɑ̃fɑ̃"),
        ("un ancien ami", "œ̃ nɑ̃sjɛ nami"),
        ("les héros et les haricots", "le eʁo e le aʁiko"),
        ("des œufs et des bœufs", "de zø e de bø"),
        ("vingt-deux et 1 234 567", "vɛ̃tdø e œ̃ miljɔ̃ dø sɑ̃ tʁɑ̃tkatʁə mil sɛ̃k sɑ̃ swasɑ̃tsɛt"),
        ("en 1789", "ɑ̃ mil sɛt sɑ̃ katʁəvɛ̃nœf"),
        ("les poules du couvent couvent", "le pul dy kuvɑ̃ kuv"),
        ("le président préside, ils président", "lə pʁezidɑ̃ pʁezid il pʁezid"),
        ("nous portions les portions", "nu pɔʁtjɔ̃ le pɔʁsjɔ̃"),
        ("neuf ans et six hommes", "nœv ɑ̃ e siz ɔm"),
    ],
)
def test_traps(text: str, expected: str) -> None:
    assert said(text) == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("c'est un ami", "s ɛ tœ̃ nami"),
        ("vont-elles venir", "vɔ̃ tɛl vəniʁ"),
        ("allez-y", "ale zi"),
        ("a-t-il faim", "a t il fɛ̃"),
        ("bon anniversaire", "bɔ nanivɛʁsɛʁ"),
        ("le premier étage", "lə pʁəmjɛ ʁetaʒ"),
        ("tout à coup", "tu ta ku"),
        ("dans un an", "dɑ̃ zœ̃ nɑ̃"),
        ("les onze enfants", "le ɔ̃z ɑ̃fɑ̃"),
        ("les oiseaux", "le zwazo"),
        ("un chat et un chien", "œ̃ ʃa e œ̃ ʃjɛ̃"),
        ("dix francs, huit jours", "di fʁɑ̃ ɥi ʒuʁ"),
        ("il y en a six", "il i ɑ̃ na sis"),
    ],
)
def test_liaison(text: str, expected: str) -> None:
    assert said(text) == expected


def test_liaison_can_be_left_out() -> None:
    assert said("les amis", liaison="none") == "le ami"


@pytest.mark.parametrize(
    ("final_schwa", "expected"),
    [
        ("none", "katʁ fam yn tabl"),
        ("cluster", "katʁə fam yn tabl"),
        ("cluster-pause", "katʁə fam yn tablə"),
        ("all", "katʁə fam ynə tabl"),
    ],
)
def test_final_schwa(final_schwa: str, expected: str) -> None:
    assert said("quatre femmes, une table.", final_schwa=final_schwa) == expected


def test_style_is_checked() -> None:
    with pytest.raises(CueError, match="liaison is 'some', not one of obligatory, none"):
        Style(liaison="some")


def test_unknown_words_are_spoken() -> None:
    assert said("le mouchouent") == "lə muʃu"
    assert said("les smartphones") == "le smaʁtfɔn"


def test_the_users_words_come_above_all_rules(tmp_path: Path) -> None:
    path = tmp_path / "mine.txt"
    path.write_text("SPA\tspa\nC-3PO\tsipo\net\tɛt\nM6\tɛmsi\n", encoding="utf-8")
    own = read_user_lexicon(str(path))
    words = phonemise("La SPA, l'M6 et C-3PO.", user_lexicon=own)
    assert " ".join("".join(word.phones) for word in words) == "la spa l ɛmsi ɛt sipo"


def test_user_lexicon(tmp_path: Path) -> None:
    path = tmp_path / "mine.txt"
    path.write_text("# mine\nGipsa\tʒipsa\n", encoding="utf-8")
    words = phonemise("Le Gipsa", user_lexicon=read_user_lexicon(path))
    assert "".join(words[1].phones) == "ʒipsa"
    path.write_text("gipsa\tʒipsX\n", encoding="utf-8")
    with pytest.raises(CueError, match=r"mine.txt line 1: unknown phone 'X'"):
        read_user_lexicon(path)
    with pytest.raises(CueError, match="cannot read the lexicon: No such file"):
        read_user_lexicon(tmp_path / "none.txt")


@pytest.mark.parametrize(
    "text", ["", "...", "♪", "𝐀", "Ա", "ǅ", "!?", "§§ 🙂", "1" * 400, "a" * 3000, "\x00"]
)
def test_odd_text_does_not_fail(text: str) -> None:
    phonemise(text)


@given(st.text(max_size=40) | st.text("aeiouyéèàçhlmnrstdpgx'- .,!?0123456789€°%MIXV", max_size=40))
def test_any_text_gives_phones(text: str) -> None:
    for word in phonemise(text):
        assert word.phones
        assert set(word.phones) <= set(PHONES[1:])
        assert word.pause in ("", ",", ".", "!", "?")


@pytest.mark.parametrize(
    ("written", "phones"),
    [
        ("22 ans", "vɛ̃tdø zɑ̃"),
        ("80 ans", "katʁəvɛ̃ zɑ̃"),
        ("36 ans", "tʁɑ̃tsiz ɑ̃"),
        ("36 jours", "tʁɑ̃tsi ʒuʁ"),
        ("90 ans", "katʁəvɛ̃diz ɑ̃"),
        ("88 francs", "katʁəvɛ̃ɥi fʁɑ̃"),
        ("101 ans", "sɑ̃ œ̃ nɑ̃"),
        ("quatre-vingt-un ans", "katʁəvɛ̃œ̃ nɑ̃"),
        ("Il en a plus que moi.", "il ɑ̃ na plys kə mwa"),
        ("Il n'y a plus que moi.", "il n i a ply kə mwa"),
        ("Plus que trois jours !", "ply kə tʁwa ʒuʁ"),
        ("Quant à moi, rien à dire.", "kɑ̃ ta mwa ʁjɛ̃ na diʁ"),
        ("un pied-à-terre", "œ̃ pjetatɛʁ"),
        ("l'INSEE", "l ɛ̃se"),
        ("M. et Mme Martin", "məsjø e madam maʁtɛ̃"),
        ("L'ETE DERNIER, IL A ETE PRESIDENT", "l ete dɛʁnje il a ete pʁezidɑ̃"),
        ("LE BEBE A MANGE SA PUREE", "lə bebe a mɑ̃ʒe sa pyʁe"),
        ("LE BEBE MANGE", "lə bebe mɑ̃ʒ"),
        ("JE SUIS DEJA ALLE A LA FETE", "ʒə sɥi deʒa ale a la fɛt"),
        ("LES ELEVES ONT TRAVAILLE", "le zelɛv ɔ̃ tʁavaje"),
        ("IL MANGE DÉJÀ", "il mɑ̃ʒ deʒa"),
    ],
)
def test_numerals_capitals_and_plus(written: str, phones: str) -> None:
    assert " ".join("".join(word.phones) for word in phonemise(written)) == phones


@pytest.mark.parametrize(
    ("written", "phones"),
    [
        ("6 %, 10 % et 8 %", "si puʁ sɑ̃ di puʁ sɑ̃ e ɥi puʁ sɑ̃"),
        ("18,5 %", "dizɥit viʁgyl sɛ̃k puʁ sɑ̃"),
        ("des pommes, etc.", "de pɔm ɛtseteʁa"),
        ("Bac +5", "bak plys sɛ̃k"),
        ("J'ai plus vingt ans.", "ʒ e ply vɛ̃ tɑ̃"),
        ("2,5 M d'euros", "dø viʁgyl sɛ̃k miljɔ̃ d øʁo"),
        ("12 Mds d'euros, 3 Mds €", "duz miljaʁ d øʁo tʁwa miljaʁ d øʁo"),
        ("le 4x4", "lə katʁkatʁ"),
        ("C-3PO et R2-D2", "se tʁwa pe o e ɛʁ dø de dø"),
        ("la COP21, le Covid-19", "la kɔp vɛ̃ te œ̃ lə kovid diznœf"),
        ("le xylophone", "lə ksilɔfɔn"),
        ("ex æquo", "ɛgzeko"),
        ("curriculum vitæ", "kyʁikylɔm vite"),
        ("la SPA, l'ENA, l'INA, le CHU", "la ɛs pe a l ena l ina lə se aʃ y"),
        ("le medef, le MEDEF, un cedex", "lə medɛf lə medɛf œ̃ sedɛks"),
        ("Grrr ! Tsss ! Nooooon ! Mmmm !", "gʁ ts nɔ̃ m"),
        ("NOOON ! Louis XIII", "nɔ̃ lwi tʁɛz"),
        ("Bzzz ! Vroum !", "bz vʁum"),
        ("il convient de partir", "il kɔ̃vjɛ̃ də paʁtiʁ"),
        ("Ils convient des amis.", "il kɔ̃vi de zami"),
        ("Les voisins convient leurs amis.", "le vwazɛ̃ kɔ̃vi lœʁ zami"),
        ("un jean, mon jean, des jeans", "œ̃ dʒin mɔ̃ dʒin de dʒin"),
        ("Jean arrive, son Jean aussi", "ʒɑ̃ aʁiv sɔ̃ ʒɑ̃ osi"),
        ("aux éditions du Seuil", "o zedisjɔ̃ dy sœj"),
        ("un verre de punch", "œ̃ vɛʁ də pɔ̃ʃ"),
        ("Il a du punch.", "il a dy pœnʃ"),
        ("M. le Président", "məsjø lə pʁezidɑ̃"),
    ],
)
def test_readings_of_television(written: str, phones: str) -> None:
    assert said(written) == phones


@pytest.mark.parametrize(
    ("written", "phones"),
    [
        ("Il vit à Damas.", "il vi a damas"),
        ("Du damas rouge", "dy dama ʁuʒ"),
        ("La ville de Sens, le sens", "la vil də sɑ̃s lə sɑ̃s"),
        ("Steve Jobs et des jobs", "stiv dʒɔbs e de dʒɔb"),
        ("DAMAS EST LOIN", "dama ɛ lwɛ̃"),
        ("un avignonnais de Bourgogne", "œ̃ naviɲɔnɛ də buʁgɔɲ"),
        ("mon ex, Alex Castex, Aix", "mɔ̃ nɛks alɛks kastɛks ɛks"),
    ],
)
def test_names_that_are_words_as_well(written: str, phones: str) -> None:
    assert said(written) == phones


@pytest.mark.parametrize(
    ("written", "phones"),
    [
        ("je serai, je dirai, j'aurai", "ʒə səʁe ʒə diʁe ʒ oʁe"),
        ("je parlai", "ʒə paʁle"),
        ("peur, peuple", "pœʁ pœpl"),
        ("qu'il ait", "k il ɛ"),
        ("le destin, la destruction", "lə dɛstɛ̃ la dɛstʁyksjɔ̃"),
        ("lesquels, mesdames", "lekɛl medam"),
        ("vous devriez, vous verrez", "vu dəvʁije vu vɛʁe"),
        ("tu sers à rien", "ty sɛʁ a ʁjɛ̃"),
        ("vous jouez, vous tuez, vous goupilleriez", "vu ʒwe vu tɥe vu gupijəʁje"),
        ("prévenir", "pʁevəniʁ"),
        ("le vrai balai", "lə vʁɛ balɛ"),
    ],
)
def test_what_lexique_gives_otherwise(written: str, phones: str) -> None:
    """Found by comparison with an independent lexicon over the 5000 most frequent words."""
    assert said(written) == phones
