"""Words of subtitles that no lexicon contains: an editor may want to mend their phones."""

from collections.abc import Iterable
from dataclasses import dataclass

from synth.language.subtitles import Subtitle, spoken
from synth.planning.scoring.text_score import Reading


@dataclass(frozen=True, slots=True)
class UnknownWord:
    """A word with a rule-based pronunciation.

    Attributes
    ----------
    text : str
        The word in lower case.
    phones : tuple of str
        The pronunciation that was taken, without a linking consonant.
    count : int
        How often it is said.
    line : int
        Where it first stands in its file.
    """

    text: str
    phones: tuple[str, ...]
    count: int
    line: int

    def __str__(self) -> str:
        """Return a line of a user's lexicon (`synth.language.text.lexicon.read_user_lexicon`)."""
        return f"{self.text}\t{''.join(self.phones)}"


def unknown_words(subtitles: Iterable[Subtitle], reading: Reading) -> list[UnknownWord]:
    r"""Return the words of subtitles with a rule-based pronunciation, the most frequent first.

    Examples
    --------
    >>> from synth.planning.scoring.text_score import PLAIN
    >>> [str(word) for word in unknown_words([Subtitle(0, 1, "Le mouchouent.")], PLAIN)]
    ['mouchouent\tmuʃu']
    """
    found: dict[str, UnknownWord] = {}
    for subtitle in subtitles:
        for word in reading.words(spoken(subtitle.text)):
            if word.guess:
                before = found.get(word.text)
                count, line = (before.count, before.line) if before else (0, subtitle.line)
                found[word.text] = UnknownWord(word.text, word.guess, count + 1, line)
    return sorted(found.values(), key=lambda word: (-word.count, word.line, word.text))
