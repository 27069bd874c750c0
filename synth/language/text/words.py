"""The words of the front end: on their way through its steps, and as they leave it."""

from dataclasses import dataclass

from synth.language.text.lexicon import Variant


@dataclass(frozen=True, slots=True)
class Word:
    """A spoken word.

    Attributes
    ----------
    text : str
        The word in lower case.
    phones : tuple of str
        IPA symbols of `codec.cues.phonology`; a linking consonant opens the word that follows it.
    pause : str
        The pause after the word: ``""``, ``","`` (short), or ``"."``, ``"!"``, ``"?"`` (long).
    word_class : str
        Letter of `synth.language.text.tagging`.
    guess : tuple of str
        The rule-based phones of a word that no lexicon knows, without a link; () for the others.

    Examples
    --------
    >>> from synth.language.text.pronounce import phonemise
    >>> [(word.text, word.pause) for word in phonemise("Oui, bonsoir.")]
    [('oui', ','), ('bonsoir', '.')]
    """

    text: str
    phones: tuple[str, ...]
    pause: str = ""
    word_class: str = "N"
    guess: tuple[str, ...] = ()


@dataclass(slots=True)
class DraftWord:
    """A word on its way: what `Word` holds, and whether a hyphen ties it to the next."""

    text: str
    variants: tuple[Variant, ...]
    pause: str = ""
    hyphen: bool = False
    word_class: str = "N"
    phones: tuple[str, ...] = ()
    guess: tuple[str, ...] = ()
