"""Items to show: the motion of a text, of one of a pair, without the hand, after the channel."""

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.cues.phonology import PAUSE
from codec.cues.score import Score
from codec.cues.timeline import SUPERFRAME_S, TICK_S
from codec.errors import CueError
from codec.superframe.encoder import SuperframeEncoder
from codec.superframe.superframe import merge_scores
from cuecast.command.arguments import REST_S
from cuecast.evaluate.onair import received
from synth.motion.rules.performance import motion_of
from synth.planning.prosody.pacing import Pace
from synth.planning.scoring.text_score import PLAIN, Reading, score_of_text
from watermark.audio.signal.profile import STANDARD

LONGEST_TEXT = 600
"""Characters of a text that is shown at once: about a minute."""


def text_item(text: str, voice: Voice, *, seed: int = 0) -> Motion:
    """Return the motion of a text at a readable pace, with its score.

    Raises
    ------
    CueError
        If the text is too long or nothing in it is spoken.
    """
    if len(text) > LONGEST_TEXT:
        raise CueError(f"the text has {len(text)} characters, the limit is {LONGEST_TEXT}")
    score = score_of_text(text, start_s=REST_S, reading=Reading(pace=Pace()))
    if not score.keys:
        raise CueError("nothing in the text is spoken")
    return motion_of(score, voice, seed=seed)


def pair_items(words: Sequence[str], voice: Voice, *, seed: int = 0) -> tuple[Motion, ...]:
    """Return the motions of words with the same times for all their phones.

    Durations differ between look-alikes too (a voiced consonant makes its vowel longer) and would
    separate them without lips or hand: every word gets the mean times.

    Raises
    ------
    CueError
        If the words have different numbers of phones.

    Examples
    --------
    >>> from codec import load_voice
    >>> first, second = pair_items(("pain", "main"), load_voice())
    >>> [str(motion.score.keys[0]) for motion in (first, second)]
    ['41', '45']
    >>> len(first.params) == len(second.params)
    True
    """
    scores = [score_of_text(word, start_s=REST_S) for word in words]
    counts = {len(score.phones) for score in scores}
    if len(counts) != 1 or 0 in counts:
        raise CueError(f"{', '.join(words)}: not words of equally many phones")
    starts = np.mean([[phone.start for phone in score.phones] for score in scores], axis=0)
    ends = np.mean([[phone.end for phone in score.phones] for score in scores], axis=0)
    return tuple(
        motion_of(
            PLAIN.score(
                replace(phone, start=float(start), end=float(end))
                for phone, start, end in zip(score.phones, starts, ends, strict=True)
            ),
            voice,
            seed=seed,
        )
        for score in scores
    )


def lips_only(motion: Motion, voice: Voice) -> Motion:
    """Return a motion whose hand rests and whose head is still: only the face moves.

    The head is held too because it moves towards the hand and would betray the key.
    """
    params = motion.params.copy()
    columns = {
        part: [i for i, name in enumerate(motion.layout) if name.startswith(f"{part}.")]
        for part in ("hand", "head", "forearm")
    }
    params[:, columns["hand"]] = voice.gestures.shape_targets[0]
    params[:, columns["forearm"]] = voice.gestures.placement_targets[0, 0]
    params[:, columns["head"]] = voice.gestures.neutral_head
    return replace(motion, params=params)


def through_channel(
    motion: Motion, voice: Voice, *, lost: float, rng: np.random.Generator
) -> Motion:
    """Return what a receiver draws of a motion sent in the sound, some superframes lost.

    Parameters
    ----------
    motion : Motion
        With its score, from time 0 on.
    voice : Voice
    lost : float
        Share of superframes that do not arrive, 0 to 1.
    rng : Generator
        Draws the lost ones.

    Raises
    ------
    CueError
        If `lost` is no share.
    """
    if not 0 <= lost <= 1:
        raise CueError(f"a share of {lost:g} superframes cannot be lost")
    encoder = SuperframeEncoder(
        voice, l0_bytes=STANDARD.l0_bytes, l1_bytes=STANDARD.l1_bytes, protected=True
    )
    count = int(np.ceil(motion.duration_s / SUPERFRAME_S))
    frames = [encoder.encode(motion, k) for k in range(count)]
    gone = set(np.flatnonzero(rng.random(count) < lost).tolist())
    shown = received(voice, frames, gone)
    params = np.concatenate([one.params for one in shown])
    kept = round(motion.duration_s / TICK_S)
    return replace(
        motion, params=params[:kept], rate_hz=1 / TICK_S, start_s=0.0, score=merge_scores(shown)
    )


def phrase_starts(score: Score) -> list[float]:
    """Return when each phrase begins, seconds: at the first phone, and after each pause.

    Examples
    --------
    >>> len(phrase_starts(score_of_text("Bonjour. Ça va ?")))
    2
    """
    phones = [phone for phone in score.phones if phone.symbol != PAUSE]
    starts = [phones[0].start] if phones else []
    for before, after in itertools.pairwise(phones):
        if after.start - before.end >= _PAUSE_S:
            starts.append(after.start)
    return starts


_PAUSE_S = 0.12
"""Silence that separates phrases."""
