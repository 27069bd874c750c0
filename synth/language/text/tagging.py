"""Word classes by context: a Viterbi search with hand-set affinities of neighbouring classes.

In: for each word of a stretch between pauses the classes that the lexicon allows, with their
levels (9 + log2 of the share).  Out: one class for each word.  It only has to separate
homographs (couvent, portions, fier, est) and to decide on liaisons, so the table
holds ten classes of words and is small enough to be read.
"""

from collections.abc import Mapping, Sequence

BORDER = "#"
SUBJECT = "S"
"""A subject pronoun; the lexicon writes O for every pronoun."""

_TONIC = "T"
"""Inside the search: a pronoun that does not lean on a verb (un, tout, celui)."""

CLITICS = frozenset("me m' te t' se s' le la l' les lui leur y en nous vous".split())

SUBJECT_PRONOUNS = frozenset(
    "je j' tu il elle on nous vous ils elles qui c' ce ça cela celui-ci celle-ci".split()
)

AFFINITY: dict[str, Mapping[str, float]] = {
    BORDER: {"D": 1, "S": 1, "P": 0.5, "C": 0.5, "R": 0.5},
    "D": {"N": 2, "A": 2, "U": 2, "O": -1, "V": -6, "D": -4, "S": -6, "P": -4, "C": -5, "R": -2,
          BORDER: -6},
    "S": {"V": 3, "O": 2, "R": 1, "S": -2, "N": -5, "A": -4, "D": -3, "P": -2, "U": -3},
    "O": {"V": 2, "O": 0.5, "N": -4, "A": -2, "D": -1, "S": -1},
    "T": {"V": 0.5, "P": 1, "N": -3, "A": -1, "D": -1},
    "P": {"D": 2, "N": 1, "O": 1, "U": 1, "P": -3, "C": -4, "S": -4, BORDER: -4},
    "N": {"A": 1, "V": 1, "P": 1.5, "C": 1, "N": -3, "D": -1, "U": -1},
    "A": {"N": 2, "P": 0.5, "C": 0.5, "V": -1, "D": -1},
    "V": {"D": 1, "P": 1, "R": 1, "A": 0.5, "N": -2},
    "R": {"V": 1, "A": 1, "D": 0.5, "N": -1},
    "C": {"D": 1, "S": 1, BORDER: -4},
    "U": {"N": 2, "U": 2, "V": -4},
    "I": {},
}  # fmt: skip
"""log2 of how much likelier than by chance a class follows another; 0 where not listed."""

WEIGHT = 0.5
"""Weight of the lexicon's levels: subtitles differ from the books behind the counts."""


def _emissions(word: str, classes: Mapping[str, int]) -> dict[str, float]:
    scores = {letter: WEIGHT * (level - 9) for letter, level in classes.items()}
    if "O" in scores and word not in CLITICS and word not in SUBJECT_PRONOUNS:
        scores[_TONIC] = scores.pop("O")
    if word in SUBJECT_PRONOUNS and "O" in scores:
        scores[SUBJECT] = scores.pop("O")
        if word in ("nous", "vous", "elle", "elles"):
            scores["O"] = scores[SUBJECT] - 0.5
    return scores


def tag(words: Sequence[str], classes: Sequence[Mapping[str, int]]) -> list[str]:
    """Return the likeliest class of each word.

    Parameters
    ----------
    words : sequence of str
        Lower-case words of one stretch between pauses.
    classes : sequence of mapping
        For each word, class letter to level.

    Returns
    -------
    list of str
        Letters of `synth.language.text.lexicon.WORD_CLASSES`, `SUBJECT` for subject pronouns.

    Examples
    --------
    >>> tag(["ils", "portions"], [{"O": 9}, {"N": 9, "V": 6}])
    ['S', 'V']
    """
    best: dict[str, tuple[float, tuple[str, ...]]] = {BORDER: (0.0, ())}
    for word, allowed in zip(words, classes, strict=True):
        reached: dict[str, tuple[float, tuple[str, ...]]] = {}
        for letter, emission in _emissions(word, allowed).items():
            reached[letter] = max(
                (score + AFFINITY[before].get(letter, 0.0) + emission, (*path, letter))
                for before, (score, path) in best.items()
            )
        best = reached
    ends = ((score + AFFINITY[last].get(BORDER, 0.0), path) for last, (score, path) in best.items())
    return ["O" if letter == _TONIC else letter for letter in max(ends)[1]]
