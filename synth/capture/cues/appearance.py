"""What keys look like: where each shape's fingers are and where each placement is, with spreads.

At first they are anybody's. A take then moves them to its own cuer, as far as it has shown them
(`synth.capture.cues.between`), and the uncertainty about her is added to the spread.

The placements are the mean of two cuers' finger tips (k-means of slow frames) and of a published
model of five others (SPPAS, face box of 3752 pictures); between cuers they differ by the deviations
given, from key to key by the spreads. The fingers are those of the virtual cuers' joints, folded
ones as far out as trackers read them (photographs of six people, B. Bigi, CNRS, LPL).
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from codec.cuer.models.face import N_FACE_PARAMETERS
from codec.cuer.models.hand import N_HAND_PARAMETERS
from codec.cuer.voice import Voice
from codec.cues.score import PLACEMENTS, SHAPES
from synth.capture.cues.between import (
    CuerPrior,
    KeyExample,
    between_fingers,
    between_places,
    between_stances,
)
from synth.capture.cues.features import see_motion

FloatArray = NDArray[np.float64]

KEYS = ((0, 0), *((s, p) for s in SHAPES[1:] for p in range(1, len(PLACEMENTS))))
"""Shape and placement of each state; the first is rest."""

POINTS_WITH = np.array([1, 0, 1, 1, 1, 1, 0, 1, 1])
"""Finger of each shape that points: 0 index, 1 middle finger."""

_FINGERS = np.array(
    [[0.40, 0.30, 0.20, 0.20, 0.10, 0.38, 0.60], [1.00, -0.20, -0.25, -0.22, -0.35, 0.35, 1.25],
     [1.02, 1.07, -0.20, -0.20, -0.40, 0.35, 0.23], [0.45, 1.07, 1.03, 0.83, -0.32, 0.47, 0.70],
     [1.03, 1.09, 1.03, 0.83, -0.32, 0.45, 0.23], [1.00, 1.09, 1.03, 0.83, 0.72, 0.35, 0.28],
     [1.02, -0.22, -0.28, -0.23, 0.72, 0.35, 1.28], [1.03, 1.08, -0.18, -0.18, 0.68, 0.38, 0.23],
     [0.98, 1.08, -0.18, -0.18, -0.38, 0.35, 0.85]]
)  # fmt: skip
"""Features of each shape (`synth.capture.cues.features`), without unit."""

_FINGERS_SD = np.array([0.127, 0.15, 0.15, 0.138, 0.15, 0.104, 0.15])
"""Spread of each feature within a person."""

_PLACES = np.array(
    [[-95.0, -235.0], [-86.0, -5.0], [-40.0, -9.0], [-12.0, -39.0], [-57.0, 37.0], [-14.0, -106.0]]
)
"""Where the pointing tip is for each placement, mm in the head's frame."""

_PLACES_SD = np.array(
    [[54.0, 54.0], [40.0, 26.0], [7.2, 6.3], [9.9, 8.1], [8.1, 8.1], [15.3, 13.5]]
)
"""Spread of each place within a person."""

_STANCES = np.array(
    [[0.99, 1.0], [1.08, 1.02], [0.96, 0.94], [0.86, 1.0], [1.01, 0.94], [0.82, 0.94]]
)
"""Direction of the palm, radians, and its width at each placement. The direction is that of the
virtual cuers' arms; a hand that comes to touch mouth, cheek or throat turns about the forearm, so
that a camera sees its palm narrower."""

_STANCES_SD = np.array([[0.6, 0.1], *[[0.1, 0.06]] * 5])
"""Spread of them within a person."""

_STANCE_BETWEEN = (0.04, 0.02)
"""Spread of direction and width at one placement between persons."""

_TRUST = 0.3
"""Weight of an example: neighbouring keys err alike, and who is read amiss is learnt amiss. Of 112
takes (64 of a real cuer, 48 of constructed ones) 19 lost 23 keys by learning at 0.7 and 102 were
won; at 0.3 10 lose 11 and 91 are won. Of 78 takes that served no choice: 9 lost 13 and 100 were
won, 5 lose 6 and 81 are won."""

_MEASURED = 1.6
"""How much more eagerly keys are recognised from markers than from landmarks, which are less
sure."""

_SURE_SHARE = 0.5
"""Weight of a frame in the confidence of a key, relative to its weight in the choice of
the line: with this, as many keys were right as their probabilities said, on films of real cuers and
on studio takes of virtual ones."""

_STILL_FRAMES, _STILL_HZ = 11, 30.0
"""Frames, and their rate, of the still poses that a voice's looks are taken from."""


@dataclass(frozen=True, slots=True)
class KeyAppearance:
    """Normal distributions of shapes and placements.

    Attributes
    ----------
    fingers, fingers_sd : ndarray of float64, shape (9, 7)
        As `synth.capture.cues.features.HandFeatures.fingers`.
    places, places_sd : ndarray of float64, shape (6, 2)
        Of the pointing tip against the mouth, mm.
    stances, stances_sd : ndarray of float64, shape (6, 2)
        Of the palm at each placement, as `synth.capture.cues.features.HandFeatures.stance`.
    eagerness : float
        Natural logarithm that every key is given, so that as many are too many as too few: more
        where the hand was measured than where a camera guessed it.
    sure_share : float
        Part of its log density that a frame counts in probabilities.
    """

    fingers: FloatArray
    fingers_sd: FloatArray
    places: FloatArray
    places_sd: FloatArray
    stances: FloatArray
    stances_sd: FloatArray
    eagerness: float = 1.2
    sure_share: float = _SURE_SHARE

    def learnt(self, seen: "KeyExamples", before: "KeyAppearance") -> "KeyAppearance":
        """Return the looks of a cuer who has shown some keys.

        Parameters
        ----------
        seen : KeyExamples
        before : KeyAppearance
            The prior appearance; `self` says how far out an example is.
        """
        fingers, places, stances = _priors(before.fingers, before.places, before.stances)
        now = (
            fingers.posterior(seen.fingers, self.fingers, self.fingers_sd),
            places.posterior(seen.places, self.places, self.places_sd),
            stances.posterior(seen.stances, self.stances, self.stances_sd),
        )
        return replace(
            self,
            fingers=now[0][0],
            fingers_sd=now[0][1],
            places=now[1][0],
            places_sd=now[1][1],
            stances=now[2][0],
            stances_sd=now[2][1],
        )


@dataclass(frozen=True, slots=True)
class KeyExamples:
    """What some held keys showed: fingers by shape; places and stances by placement."""

    fingers: tuple[KeyExample, ...] = ()
    places: tuple[KeyExample, ...] = ()
    stances: tuple[KeyExample, ...] = ()

    def last(self, count: int) -> "KeyExamples":
        """Return at most the last examples of each kind."""
        return KeyExamples(self.fingers[-count:], self.places[-count:], self.stances[-count:])


NOTHING_SHOWN = KeyExamples()
"""Of a cuer nobody has seen."""


def _priors(
    fingers: FloatArray, places: FloatArray, stances: FloatArray
) -> tuple[CuerPrior, CuerPrior, CuerPrior]:
    """Return the prior for cuers with these means."""
    axes = ((0,), (1,))
    return (
        CuerPrior(
            fingers,
            np.tile(_FINGERS_SD, (len(SHAPES), 1)),
            (tuple(range(fingers.shape[1])),),
            (between_fingers(),),
            _TRUST,
        ),
        CuerPrior(places, _PLACES_SD, axes, between_places(places), _TRUST),
        CuerPrior(stances, _STANCES_SD, axes, between_stances(*_STANCE_BETWEEN), _TRUST),
    )


def _of_nobody(fingers: FloatArray, places: FloatArray, stances: FloatArray) -> KeyAppearance:
    """Return looks before anything of a cuer is known, with these means."""
    priors = _priors(fingers, places, stances)
    return KeyAppearance(
        fingers, priors[0].spreads, places, priors[1].spreads, stances, priors[2].spreads
    )


ANYBODYS = _of_nobody(_FINGERS, _PLACES, _STANCES)
"""Before anything of a cuer is known."""


def looks_of(voice: Voice) -> KeyAppearance:
    """Return what keys look like in the parameters of a voice: at its own targets."""
    table = voice.gestures
    shapes, places = np.array(KEYS).T
    rows = np.zeros((len(KEYS), len(voice.layout)))
    rows[:, voice.face_columns[N_FACE_PARAMETERS:]] = table.neutral_head
    rows[:, voice.hand_columns[:N_HAND_PARAMETERS]] = table.shape_targets[shapes]
    rows[:, voice.hand_columns[N_HAND_PARAMETERS:]] = table.placement_targets[shapes, places]
    seen = see_motion(voice, np.repeat(rows, _STILL_FRAMES, axis=0), rate_hz=_STILL_HZ)
    at = np.arange(len(KEYS)) * _STILL_FRAMES + _STILL_FRAMES // 2
    fingers = np.stack([seen.fingers[at[shapes == s]].mean(0) for s in SHAPES])
    tips = seen.tips[at, POINTS_WITH[shapes]]
    tips[0] = seen.pointers[at[0], 1]
    where = np.stack([tips[places == p].mean(0) for p in range(len(PLACEMENTS))])
    where[1] = 0.5 * (where[1] + ANYBODYS.places[1])
    stances = np.stack([seen.stance[at[places == p]].mean(0) for p in range(len(PLACEMENTS))])
    # Palms of virtual cuers do not turn as a camera sees them: nothing is expected of the width.
    stances[:, 1] = stances[1:, 1].mean()
    return replace(_of_nobody(fingers, where, stances), eagerness=_MEASURED)
