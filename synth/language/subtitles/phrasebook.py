"""Short sentences of neighbouring languages, too short for statistics: Come on! Hasta la vista.

In: a text.  Out: the language all of whose words are among its most frequent ones, at least one of
them foreign to French.
"""

import re

_WORD = re.compile(r"[^\W\d_]+(?:['’][^\W\d_]+)*")

_TELLING = {
    "en": (
        "the you your yours he she it it's is isn't was were wasn't are aren't i'm i'll i've "
        "i'd we we're they they're them his her this that that's these those what what's who "
        "who's where where's when why how how's yes yeah yep nope not don't doesn't didn't "
        "can't won't couldn't let let's know think thank thanks welcome please sorry hello "
        "goodbye good great nice love like wait come coming get got gotta gonna wanna want "
        "need here there now never always ever just right wrong too very much more my mine me "
        "of for from with and but because about again back have has had haven't been be do "
        "does did done will would could should shall say said see look listen tell told give "
        "take make help stay leave move shut up down out over off away home man guys girl boy "
        "friend night morning day fuck shit damn god jesus lord hell happy birthday dear "
        "mister ladies gentlemen everybody everyone somebody something nothing anything all "
        "right alright you're there's here's ain't mother father brother sister hurry sure "
        "true believe"
    ),
    "es": (
        "hasta vista gracias muchas señor señora señorita hola buenos buenas días noches "
        "tardes adiós por favor qué quién cómo dónde cuándo sí muy bien mucho está estás "
        "estoy eres soy somos vamos vámonos amigo amigos hombre mujer hijo hija madre padre "
        "dios mío luego mañana ahora aquí allí nada todo con pero porque también tengo tienes "
        "quiero puedo sabes claro perdón lo siento el ella usted ustedes nosotros mi casa "
        "vida corazón viva olé ándale cuidado salud"
    ),
    "it": (
        "grazie mille prego ciao buongiorno buonasera arrivederci signore signora signorina "
        "che cosa come sono sei siamo andiamo amico amore mio bella bello bene molto perché "
        "dove quando chi non voglio posso tutto niente questo questa dio mamma mia scusi "
        "scusa subito basta allora addio presto avanti capito va"
    ),
    "de": (
        "danke schön bitte guten tag morgen abend nacht gute auf wiedersehen ich bin bist ist "
        "sind wir sie er du und oder nicht nein ja was wer wie wo warum komm kommen schnell "
        "los halt achtung mein dein herr frau gott liebe haben habe hast kann alles gut sehr "
        "jetzt hier raus verstehen sprechen deutsch scheiße jawohl zurück"
    ),
}

_SHARED = {
    "en": (
        "a an on in to no so go at or me i us if baby man ok okay oh hey hi bye cool stop fine well"
    ),
    "es": ("la de a no me te se es en un y los las un una mi tu su al del si baby ok oh señor"),
    "it": ("la di a no me te se e un in il lo le i tu si va mi ti o ma ok oh"),
    "de": ("in an es am im so da mit von zu den das der die ein eine auf oh ok na"),
}

_FRENCH = frozenset(
    "me of on in or no so a do come dear man home all day but son for has had not can is it mine "
    "dire pour up move over casa viva con todo vista nada come sei non va mille bella presto basta "
    "mamma du er los mein tag gut amore los favor por bien mi el est est-ce ciao ja herr en te tu "
    "adieu olé corner halt gone love night boy girl sister hello sorry god like well please right "
    "yeah yep hey now just back see get guys hi bye".split()
)
"""Words that French texts have as well: they prove nothing by themselves."""


def phrase_language(text: str) -> str:
    """Return the language of a short sentence, "" where it may be French.

    Examples
    --------
    >>> [phrase_language(x) for x in ("Come on!", "Hasta la vista, baby.", "OK.", "Viens !")]
    ['en', 'es', '', '']
    """
    words = [word.lower().replace("’", "'") for word in _WORD.findall(text)]
    for language, telling in _LISTS.items():
        foreign = [word for word in words if word in telling and word not in _FRENCH]
        if foreign and all(word in telling or word in _COMMON[language] for word in words):
            return language
    return "en" if words == ["come", "on"] else ""


_LISTS = {language: frozenset(words.split()) for language, words in _TELLING.items()}
_COMMON = {language: frozenset(words.split()) for language, words in _SHARED.items()}
