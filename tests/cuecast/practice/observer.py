"""An observer of known sensitivity who takes a test of minimal pairs.

A word on the left shifts an inner impression up by half of d', one on the right down by as much;
noise of unit variance is added, and impressions above a preference are answered "left". Nothing
here knows how d' is estimated.
"""

from dataclasses import dataclass

import numpy as np

from cuecast.practice.session import SEEN, Answer, TrialSession, new_session
from cuecast.practice.trial import ItemCondition, Trial


@dataclass
class Observer:
    """Sensitivity with and without the hand; a positive preference favours the right side."""

    with_hand: float
    lips_only: float
    rng: np.random.Generator
    preference: float = 0.0

    def choose(self, condition: ItemCondition, target: int) -> int:
        d = self.with_hand if condition.hand == "hand" else self.lips_only
        impression = (0.5 - target) * d + self.rng.standard_normal()
        return int(impression <= self.preference)

    def take(self, trial: Trial) -> TrialSession:
        """Answer a whole list."""
        session = new_session(trial)
        while not session.ended:
            step = session.steps[session.next]
            choice = self.choose(step.condition, step.target) if step.choices else SEEN
            session.answer(session.next, Answer(choice, 600 + 50 * self.rng.random(), 50.0))
        return session
