"""Reading of a superframe in pieces: along the likeliest paths of its frames, then by all means.

In: sound and about where its frames lie; out: the reading that the link's check accepts, if any.
Cost: `purse.PIECES` for a place, `purse.PIECES_VIEW` for each path.
Specification: spec/audio-carrier.md, W48.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from watermark.audio.follow.align import SuperframeView
from watermark.audio.follow.demodulate import Demodulator, SuperframeReading
from watermark.audio.follow.purse import PIECES, PIECES_VIEW, DecodingPurse
from watermark.audio.follow.retries import LONGEST_LIST_SIZE
from watermark.audio.follow.stretched_path import Paths
from watermark.audio.signal.layout import make_pilots
from watermark.audio.signal.masking import make_masker
from watermark.audio.signal.sample_buffer import SampleBuffer

JUMPS = (20.0, 10.0)
"""Natural logarithms of the likelihood ratio that a jump must be worth, tried in turn."""

ATTEMPTS = tuple((None, jump) for jump in JUMPS)
"""Where a superframe begins, if that is known, and what a jump must be worth: tried in turn."""

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class PathReading:
    """A superframe's frames along one path.

    Attributes
    ----------
    view : SuperframeView
        There.
    level : float
        That was assumed.
    places : ndarray of float64, shape (64,)
        Where they begin, samples of the tape.
    tempo : float
        At which they were looked for.
    reading : SuperframeReading
        The result.
    """

    view: SuperframeView
    level: float
    places: Array
    tempo: float
    reading: SuperframeReading


class PiecesReader:
    """Reads superframes in pieces.

    Parameters
    ----------
    key : int
        Seed of the layout.
    nominal : float
        Samples that come for one of the mark's own.
    purse : DecodingPurse
        That pays for attempts.
    """

    def __init__(self, key: int, nominal: float, purse: DecodingPurse) -> None:
        self._pilots, self._masker = make_pilots(key), make_masker()
        self._nominal, self._purse = nominal, purse

    def paths(self, tape: SampleBuffer, centre: Array, demodulator: Demodulator) -> Paths:
        """Look at the places of frames that begin about `centre`, see `Paths`."""
        self._purse.charge(PIECES)
        return Paths(tape, centre, self._nominal, demodulator, self._pilots, self._masker)

    def brief(
        self,
        paths: Paths,
        levels: list[float],
        attempts: Sequence[tuple[float | None, float]],
        looked_at: list[PathReading],
        tempo: float = 1.0,
    ) -> PathReading | None:
        """Read briefly along the likeliest paths: from some place on, jumps being worth so much.

        Each is noted, as far as the purse pays; the one that was read is returned.
        """
        demodulator = paths.demodulator
        for n, (begin, jump) in enumerate(attempts):
            if not n:
                self._purse.charge(PIECES_VIEW)
            elif not self._purse.pays(PIECES_VIEW):
                return None
            level, path = paths.find(levels, jump=jump, first=begin)
            view, places = paths.view(path, level)
            reading = demodulator.read(view, [level], brief=True)
            if reading.decoded.l0 is not None and reading.decoded.l1 is None:
                known, level = demodulator.expected(reading.decoded), reading.level
                again = paths.find_known(level, known, jump=jump, first=begin)
                better, _ = paths.view(again, level, known)
                reading = demodulator.read_second(reading, better)
            looked_at.append(PathReading(view, level, paths.on_tape(places), tempo, reading))
            if reading.decoded.l0 is not None:
                return looked_at[-1]
        return None

    def again(
        self, demodulator: Demodulator, looked_at: list[PathReading], *, due: bool
    ) -> PathReading | None:
        """Read by all means what was read briefly in vain."""
        for one in looked_at:
            if self._purse.affords(demodulator.cost(LONGEST_LIST_SIZE)):
                reading = demodulator.read(one.view, [one.level], due=due)
                if reading.decoded.l0 is not None:
                    return replace(one, reading=reading)
        return None
