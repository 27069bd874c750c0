"""Written French to words: a hundred cases of figures, abbreviations, signs and sigles."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codec.errors import CueError
from synth.language.text import numbers
from synth.language.text.normalise import PAUSES, normalise

CASES = {
    # cardinals
    "0": "zéro",
    "1 chat": "un chat",
    "1 fois": "une fois",
    "21 heures": "vingt et une heures",
    "16": "seize",
    "17": "dix-sept",
    "70": "soixante-dix",
    "71": "soixante et onze",
    "77": "soixante-dix-sept",
    "80": "quatre-vingts",
    "81": "quatre-vingt-un",
    "91": "quatre-vingt-onze",
    "99": "quatre-vingt-dix-neuf",
    "100": "cent",
    "101": "cent un",
    "200": "deux cents",
    "201": "deux cent un",
    "1000": "mille",
    "1 001": "mille un",
    "1789": "mille sept cent quatre-vingt-neuf",
    "2024": "deux mille vingt-quatre",
    "80 000": "quatre-vingt mille",
    "200 000": "deux cent mille",
    "1 000 000": "un million",
    "3.000.000": "trois millions",
    "2 500 000 000": "deux milliards cinq cents millions",
    "1\u202f234\u202f567": "un million deux cent trente-quatre mille cinq cent soixante-sept",
    "007": "zéro zéro sept",
    "12345678901234567": "un deux trois quatre cinq six sept huit neuf zéro un deux trois quatre "
    "cinq six sept",
    # decimals, signs
    "3,14": "trois virgule quatorze",
    "0,05": "zéro virgule zéro cinq",
    "il fait -5": "il fait moins cinq",
    "2 + 2 = 4": "deux plus deux égale quatre",
    "3 x 4": "trois fois quatre",
    "1/2": "un demi",
    "3/4": "trois quarts",
    "2/3": "deux tiers",
    "1/5": "un cinquième",
    "15/20": "quinze sur vingt",
    # ordinals
    "1er": "premier",
    "1re": "première",
    "1ère fois": "première fois",
    "2e": "deuxième",
    "2nd": "second",
    "2nde": "seconde",
    "3ème étage": "troisième étage",
    "5e": "cinquième",
    "9e": "neuvième",
    "21e": "vingt et unième",
    "80e": "quatre-vingtième",
    "100e": "centième",
    "1 000e": "millième",
    "les 1ers": "les premiers",
    # Roman numerals
    "XIXe siècle": "dix-neuvième siècle",
    "Louis XIV": "louis quatorze",
    "François Ier": "françois premier",
    "chapitre IV": "chapitre quatre",
    "Rocky II": "rocky deux",
    # hours
    "20h30": "vingt heures trente",
    "20 h 30": "vingt heures trente",
    "8h05": "huit heures cinq",
    "1h": "une heure",
    "21h": "vingt et une heures",
    "12:45": "douze heures quarante-cinq",
    "2h15min30s": "deux heures quinze et trente secondes",
    "48h": "quarante-huit heures",
    # dates
    "14/07/1789": "quatorze juillet mille sept cent quatre-vingt-neuf",
    "01/01/2000": "premier janvier deux mille",
    "1.5.2021": "premier mai deux mille vingt et un",
    "le 1 mai": "le premier mai",
    "le 11 novembre 1918": "le onze novembre mille neuf cent dix-huit",
    "31/12/99": "trente et un décembre quatre-vingt-dix-neuf",
    # money
    "1 €": "un euro",
    "5€": "cinq euros",
    "12,50 €": "douze euros cinquante",
    "3,5 €": "trois virgule cinq euros",
    "1 000 000 €": "un million d' euros",
    "2 millions €": "deux millions d' euros",
    "$5": "cinq dollars",
    "21 £": "vingt et une livres",
    "3 M€": "trois millions d' euros",
    # units
    "5 km": "cinq kilomètres",
    "1 km": "un kilomètre",
    "130 km/h": "cent trente kilomètres heure",
    "20 °C": "vingt degrés celsius",
    "-3 °C": "moins trois degrés celsius",
    "3,5 %": "trois virgule cinq pour cent",
    "100%": "cent pour cent",
    "10 m²": "dix mètres carrés",
    "21 t": "vingt et une tonnes",
    "500 g": "cinq cents grammes",
    "10 min": "dix minutes",
    # abbreviations
    "M. Dupont": "monsieur dupont",
    "Mme Martin": "madame martin",
    "Mlle Rose": "mademoiselle rose",
    "MM. Dupont": "messieurs dupont",
    "Dr House": "docteur house",
    "St-Malo": "saint malo",
    "n° 3": "numéro trois",
    "etc.": "etcetera",
    "c.-à-d. demain": "c'est-à-dire demain",
    "av. J.-C.": "avant jésus-christ",
    "p. 12": "page douze",
    "tél. 01 23 45 67 89": "téléphone zéro un , vingt-trois , quarante-cinq , soixante-sept , "
    "quatre-vingt-neuf",
    "+33 6 12 34 56 78": "plus trente-trois six , douze , trente-quatre , cinquante-six , "
    "soixante-dix-huit",
    # letters and figures in one word, single letters
    "M6": "emme six",
    "la N7": "la enne sept",
    "le G20": "le gé vingt",
    "la 3D": "la trois dé",
    "H1N1": "ache un enne un",
    "le CO2": "le cé o deux",
    "le plan B": "le plan bé",
    "J. K. Rowling": "ji ka rowling",
    "24h/24, 7j/7": "vingt-quatre heures sur vingt-quatre , sept jours sur sept",
    "1m80": "un mètre quatre-vingts",
    "le 11/09": "le onze septembre",
    "0 800 123 456": "zéro huit cents , cent vingt-trois , quatre cent cinquante-six",
    "les USA": "les u esse a",
    "le K.-O.": "le ka o",
    "C'est l'an 2": "c' est l' an deux",
    # sigles, addresses, signs
    "la SNCF": "la esse enne cé effe",
    "S.N.C.F.": "esse enne cé effe",
    "l'ONU": "l' onu",
    "l'OTAN": "l' otan",
    "un TGV": "un té gé vé",
    "STOP": "stop",
    "QUE FAIS-TU ?": "que fais-tu",
    "jean@site.fr": "jean arobase site point effe erre",
    "www.arte.tv": "trois double vé point arte point té vé",
    "Tom & Co": "tom et co",
    # typography
    "l’homme": "l' homme",
    "aujourd’hui": "aujourd'hui",
    "«\u00a0Oui\u00a0!\u00a0»": "oui",
    "co\u00adeur": "coeur",
    "qu'il n'y en a": "qu' il n' y en a",
}


@pytest.mark.parametrize(("text", "words"), CASES.items(), ids=list(CASES))
def test_cases(text: str, words: str) -> None:
    assert " ".join(normalise(text)).rstrip(" ,.!?") == words


def test_there_are_a_hundred_cases() -> None:
    assert len(CASES) >= 100


@pytest.mark.parametrize(
    ("text", "tokens"),
    [
        ("Oui, non. Si", ["oui", ",", "non", ".", "si"]),
        ("Quoi ?! Ah…", ["quoi", "?", "ah", "."]),
        ("Ah ! ... « Tu viens ? », dit-il.", ["ah", "!", "tu", "viens", "?", "dit-il", "."]),
        ("Toi？！ Non‽", ["toi", "?", "non", "?"]),
        ("... et puis", ["et", "puis"]),
        ("un — deux", ["un", ",", "deux"]),
        ("«Oui», dit-il", ["oui", ",", "dit-il"]),
    ],
)
def test_pauses(text: str, tokens: list[str]) -> None:
    assert normalise(text) == tokens


@given(st.text(max_size=60))
def test_tokens_are_words_or_pauses(text: str) -> None:
    for token in normalise(text):
        assert token in PAUSES or token[0].isalpha()
        assert not any(letter.isdigit() for letter in token)


@given(st.integers(0, numbers.LARGEST))
def test_cardinals_are_read_back(n: int) -> None:
    assert _value(numbers.cardinal(n)) == n


def _value(words: str) -> int:
    """Read a cardinal by the grammar of French numbers: the inverse of `numbers.cardinal`."""
    units = {name: value for value, name in enumerate(numbers.UNITS)}
    tens = {"vingt": 20, "vingts": 20, "trente": 30, "quarante": 40, "cinquante": 50,
            "soixante": 60}  # fmt: skip
    scales = {"mille": 10**3, "million": 10**6, "milliard": 10**9, "billion": 10**12}
    total = group = 0
    for word in words.replace("dix-", "dix_").replace("-", " ").replace("dix_", "dix-").split():
        plain = word.rstrip("s") if word not in units and word not in tens else word
        if word == "et":
            continue
        if plain == "cent":
            group = max(1, group) * 100
        elif plain in scales:
            total += max(1, group) * scales[plain]
            group = 0
        elif word in tens:
            group += 80 - 4 if tens[word] == 20 and group % 10 == 4 else tens[word]
        else:
            group += units[word]
    return total + group


def test_numbers_out_of_range() -> None:
    with pytest.raises(CueError, match="number 1000000000000000 is larger than 999999999999999"):
        numbers.cardinal(10**15)
    with pytest.raises(CueError, match="no ordinal of 0"):
        numbers.ordinal(0)


@pytest.mark.parametrize("n", [1, 4, 9, 14, 40, 90, 400, 900, 1453, 1999, 3999])
def test_roman(n: int) -> None:
    signs = ((1000, "M"), (900, "CM"), (500, "D"), (400, "CD"), (100, "C"), (90, "XC"), (50, "L"),
             (40, "XL"), (10, "X"), (9, "IX"), (5, "V"), (4, "IV"), (1, "I"))  # fmt: skip
    text, rest = "", n
    for value, sign in signs:
        while rest >= value:
            text, rest = text + sign, rest - value
    assert numbers.roman(text) == n
    assert numbers.roman(text + "A") == 0
