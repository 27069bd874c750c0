"""The score: the symbolic line of a programme, phones and keys with their times.

`Phone` and `Key` are values; a `Score` holds both lines sorted by time and turns into the JSON
that stands in motion files, in ``cuecast keys --json`` and in the reports.
"""

import itertools
import json
from dataclasses import dataclass, field, replace
from typing import Any

from codec.cues.language import french, known_languages
from codec.errors import CueError

PLACEMENTS = french().placements
"""Hand placements of French; the paper fixes the numbers 0 (rest), 1 (side) and 2 (mouth) only."""

PLACEMENT_NUMBER = {name: number for number, name in enumerate(PLACEMENTS)}
"""From placement names to numbers: index in `PLACEMENTS`."""

SENTENCE_ENDS = ("statement", "question", "interrogation", "exclamation")
"""Contours that end a sentence."""

CONTOURS = ("", "continuation", *SENTENCE_ENDS)
"""How the voice moves where a group of words ends; "" where nothing is known.

The names are those of Delattre 1966: a question can be answered by yes or no, an interrogation asks
with a word of its own (who, where, how).
"""

SHAPES = range(french().n_shapes)
"""Hand shapes 0 (rest, closed fist) to 8."""


def _is_phone(symbol: str) -> bool:
    return symbol in french().number_of or any(symbol in one.number_of for one in known_languages())


def _is_placement(name: str) -> bool:
    return name in PLACEMENT_NUMBER or any(name in one.placements for one in known_languages())


def _n_shapes() -> int:
    return max(one.n_shapes for one in known_languages())


def _check_interval(what: str, start: float, end: float) -> None:
    if not (0 <= end - start < 1e6):
        raise CueError(f"{what} lasts from {start} to {end} s: the end lies before the start")


@dataclass(frozen=True, slots=True)
class Phone:
    """A speech sound.

    Attributes
    ----------
    symbol : str
        IPA symbol, one of a known language's phones.
    start, end : float
        Seconds on the programme's clock.
    contour : str
        One of `CONTOURS`: what ends with this phone. It is for who speaks the score; it stands in
        no file, no stream and no comparison.

    Examples
    --------
    >>> Phone("ʃ", 0.10, 0.22).symbol
    'ʃ'
    """

    symbol: str
    start: float
    end: float
    contour: str = field(default="", compare=False, repr=False)

    def __post_init__(self) -> None:
        if not _is_phone(self.symbol):
            raise CueError(f"unknown phone {self.symbol!r}")
        if self.contour not in CONTOURS:
            raise CueError(f"unknown contour {self.contour!r}")
        _check_interval(f"phone {self.symbol}", self.start, self.end)


@dataclass(frozen=True, slots=True)
class Key:
    """One gesture of the hand: shape and placement, with the sound it belongs to.

    Attributes
    ----------
    start, end : float
        Acoustic interval of the key's phones, seconds on the programme's clock.
    phones : tuple of str
        The one or two phones that the key cues.
    shape : int
        Hand shape, 0 to 8.
    placement : str
        One of a known language's, of French one of `PLACEMENTS`.

    Examples
    --------
    >>> key = Key(0.0, 0.25, ("b", "a"), shape=4, placement="side")
    >>> str(key), key.end - key.start
    ('14', 0.25)
    """

    start: float
    end: float
    phones: tuple[str, ...]
    shape: int
    placement: str

    def __post_init__(self) -> None:
        if not 0 <= self.shape < _n_shapes():
            raise CueError(f"hand shape {self.shape} is not within 0..{_n_shapes() - 1}")
        if not _is_placement(self.placement):
            raise CueError(f"unknown hand placement {self.placement!r}")
        _check_interval(f"key {self}", self.start, self.end)

    def __str__(self) -> str:
        """Return the key as the paper prints it: placement, then shape.

        Examples
        --------
        >>> str(Key(0.0, 0.2, ("b", "ɔ̃"), 4, "mouth"))
        '24'
        """
        return f"{PLACEMENT_NUMBER.get(self.placement, self.placement)}{self.shape}"

    def as_dict(self) -> dict[str, Any]:
        """Return the fields under the names of the command line's JSON.

        Returns
        -------
        dict
            ``start``, ``end`` (seconds), ``phones``, ``shape``, ``placement``.
        """
        return {
            "start": round(self.start, 4),
            "end": round(self.end, 4),
            "phones": list(self.phones),
            "shape": self.shape,
            "placement": self.placement,
        }


@dataclass(frozen=True, slots=True)
class Score:
    """Phones and keys of a stretch of programme, each line in order of time.

    Pauses are gaps between phones; the rest key is not listed, a gap between keys of at least
    `CueingOptions.rest_gap_s` implies it.

    Attributes
    ----------
    phones : tuple of Phone
    keys : tuple of Key

    Examples
    --------
    >>> from codec.cues.cueing import cue
    >>> score = Score((Phone("b", 0.0, 0.1), Phone("a", 0.1, 0.3)), ())
    >>> len(score.phones), score.keys
    (2, ())
    """

    phones: tuple[Phone, ...]
    keys: tuple[Key, ...]

    def __post_init__(self) -> None:
        for line in (list[Phone | Key](self.phones), list[Phone | Key](self.keys)):
            for before, after in itertools.pairwise(line):
                if after.start < before.start:
                    raise CueError(f"{after} starts before its predecessor {before}")

    def shifted(self, delay_s: float) -> "Score":
        """Return the score moved in time.

        Parameters
        ----------
        delay_s : float
            Seconds; negative ones move it to earlier times.

        Returns
        -------
        Score
        """
        return Score(
            tuple(replace(p, start=p.start + delay_s, end=p.end + delay_s) for p in self.phones),
            tuple(
                Key(k.start + delay_s, k.end + delay_s, k.phones, k.shape, k.placement)
                for k in self.keys
            ),
        )

    def to_json(self) -> str:
        """Return the JSON text that stands in a motion file.

        Returns
        -------
        str
        """
        keys = [k.as_dict() for k in self.keys]
        return json.dumps({"phones": self.phone_rows(), "keys": keys}, ensure_ascii=False)

    def phone_rows(self) -> list[list[str | float]]:
        """Return the phones as they stand in the JSON text.

        Returns
        -------
        list
            Symbol, start and end in seconds of each.
        """
        return [[p.symbol, round(p.start, 4), round(p.end, 4)] for p in self.phones]

    @classmethod
    def from_json(cls, text: str) -> "Score":
        """Read what `to_json` wrote.

        Parameters
        ----------
        text : str

        Returns
        -------
        Score

        Raises
        ------
        CueError
            If the text is not such a document.
        """
        try:
            document = json.loads(text)
            phones = tuple(Phone(str(s), float(a), float(b)) for s, a, b in document["phones"])
            keys = tuple(
                Key(
                    float(k["start"]),
                    float(k["end"]),
                    tuple(map(str, k["phones"])),
                    int(k["shape"]),
                    str(k["placement"]),
                )
                for k in document["keys"]
            )
        except (KeyError, TypeError, ValueError, RecursionError) as error:
            raise CueError(f"malformed score: {error!r}") from error
        return cls(phones, keys)
