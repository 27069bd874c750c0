"""The papers of a test, in French: consent to be read by participants, protocol for who runs it."""

from importlib.resources import files
from pathlib import Path
from typing import Any

from codec.errors import CueError
from codec.files.whole import whole_file
from cuecast.practice.trial import Trial

CONSENT, PROTOCOL = "consentement.txt", "protocole.txt"

_MOST_BYTES = 1 << 16
"""Bytes of a consent at most."""

UNFINISHED = "(à compléter"
"""Beginning of a text that the researcher has to fill in."""

_RESPONSIBLE = f"{UNFINISHED} : nom, établissement, adresse)"

_PAIRS = {
    "titre": "paires minimales",
    "tache": "une codeuse dit un mot, sans son ; vous choisissez entre deux mots écrits.",
    "question": "Les clés de synthèse permettent-elles de distinguer des mots que les lèvres "
    "seules ne distinguent pas ?",
    "materiel": "Paires de mots dont les lèvres se ressemblent et dont les clés diffèrent ; les "
    "deux mots d’une paire ont les mêmes durées. Facteurs croisés : {facteurs}.",
    "deroulement": "L’ordre, les paires et le côté du bon mot sont tirés au sort pour chaque "
    "personne ; chaque côté est juste aussi souvent.",
    "mesures": "Le mot choisi, et le temps entre l’apparition des deux mots et la réponse.",
    "analyse": "d’ par personne et par condition (oui/non sur le côté gauche, correction de "
    "Hautus), moyenne avec intervalle de Student, différence main moins lèvres par un test t "
    "apparié. d’ = 0 : hasard.",
}

_NATURALNESS = {
    "titre": "mouvement naturel et mouvement de synthèse",
    "tache": "vous verrez des points lumineux bouger avec une voix ; vous direz, de 1 à 5, si les "
    "mouvements vont avec la voix.",
    "question": "Le mouvement de synthèse est-il jugé aussi naturel que celui de la personne qui "
    "parle ?",
    "materiel": "Chaque enregistrement est montré trois fois avec le même son : mouvement "
    "naturel, mouvement de synthèse, mouvement naturel d’une autre phrase.",
    "deroulement": "L’ordre est tiré au sort pour chaque personne. Régler le son avant de "
    "commencer.",
    "mesures": "La note de 1 à 5, et le temps de réponse.",
    "analyse": "Moyenne des notes par personne et par condition, intervalle de Student, "
    "différences par un test t apparié.",
}

_COMPREHENSION = {
    "titre": "comprendre deux minutes",
    "tache": "vous suivrez trois textes de deux minutes, sans son, avec des sous-titres, une "
    "codeuse ou les deux, et vous répondrez à des questions.",
    "question": "Que comprend-on d’un texte par les sous-titres, par la codeuse, par les deux ?",
    "materiel": "Textes lus au rythme de la codeuse ; les sous-titres ont les mêmes temps.",
    "deroulement": "Textes et conditions sont associés par un carré latin sur les personnes, "
    "l’ordre est tiré au sort.",
    "mesures": "La réponse à chaque question, et le temps de réponse.",
    "analyse": "Part de réponses justes par personne et par condition, différences par un test t "
    "apparié ; intervalle de Wilson pour toutes les réponses réunies.",
}

_VOICES = {
    "titre": "deux voix de synthèse",
    "tache": "vous entendrez chaque phrase deux fois, dite par deux voix de synthèse ; vous direz "
    "laquelle se comprend le mieux.",
    "question": "Laquelle de deux voix de synthèse comprend-on le mieux ?",
    "materiel": "Chaque phrase est dite par les deux voix, au même niveau ; chaque voix commence "
    "une fois sur deux.",
    "deroulement": "L’ordre est tiré au sort pour chaque personne. Régler le son avant de "
    "commencer.",
    "mesures": "La voix choisie, ou les deux, et le temps de réponse.",
    "analyse": "Part des phrases où la première voix nommée est préférée (les deux : une demie), "
    "par personne ; moyenne avec intervalle de Student ; .5 : pas de préférence.",
}

_TEXTS = {
    "pairs": _PAIRS,
    "naturalness": _NATURALNESS,
    "comprehension": _COMPREHENSION,
    "voices": _VOICES,
}

_SECONDS = {"pairs": 6.0, "naturalness": 12.0, "comprehension": 28.0, "voices": 14.0}
"""Seconds that one step takes in the mean."""

_NAMES = {
    "lips": "lèvres seules",
    "hand": "lèvres et main",
    "points": "points",
    "avatar": "avatar",
    "clear": "direct",
    "channel": "après la transmission",
}


def write_papers(trial: Trial) -> None:
    """Write consent and protocol of a test into its folder, to be read and edited."""
    values = dict(_TEXTS[trial.kind]) | {
        "graine": str(trial.seed),
        "voix": trial.voice,
        "responsable": _RESPONSIBLE,
        "minutes": str(max(1, round(len(trial.steps(1)) * _SECONDS[trial.kind] / 60))),
        "essais": str(trial.settings.get("trials", 10)),
    }
    values["materiel"] = values["materiel"].format(facteurs=_factors(trial.settings))
    for name in (CONSENT, PROTOCOL):
        text = (files("cuecast") / "practice" / "papers" / name).read_text(encoding="utf-8")
        with whole_file(trial.folder / name) as path:
            path.write_text(text.format_map(values), encoding="utf-8")


def _factors(settings: Any) -> str:
    groups = [settings[name] for name in ("hands", "displays", "channels") if name in settings]
    return " × ".join(" ou ".join(_NAMES[level] for level in group) for group in groups)


def consent_of(trial: Trial) -> list[str]:
    """Return the paragraphs that participants read first.

    Raises
    ------
    CueError
        If the file is missing or no text.
    """
    path = Path(trial.folder) / CONSENT
    try:
        data = path.read_bytes()[:_MOST_BYTES]
        return [part.strip() for part in data.decode("utf-8").split("\n\n") if part.strip()]
    except (OSError, UnicodeDecodeError) as error:
        raise CueError(f"{path}: cannot be read: {error}") from error
