"""Text-to-cued-speech synthesis by concatenation: the paper's own system.

In: a score. Out: speech, and the motion of face, head, forearm and hand. Polysounds give sound
and face, dikeys give hand and head (Gibert, Bailly, Elisei 2004, section 5.1).
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.cues.cueing import DEFAULT_OPTIONS, CueingOptions
from codec.cues.score import Score
from codec.errors import CueError
from synth.motion.rules.movement import Gestures, plan_gestures
from synth.planning.prosody.melody import Melody, plan_melody
from synth.planning.prosody.passages import ScorePassage, passages
from synth.units.concatenation.assembly import Flow
from synth.units.concatenation.dikeys import DikeyDictionary
from synth.units.concatenation.durations import near_own_durations, stretches
from synth.units.concatenation.headmotion import HeadMotion
from synth.units.concatenation.intonation import PitchedUnit, intone, runs
from synth.units.concatenation.sounds import PlacedUnit, SoundDictionary
from synth.units.concatenation.trajectories import (
    Trajectories,
    calm_joins,
    join_trajectories,
    quickest,
)
from synth.units.concatenation.units import cut_dikeys, cut_sounds, with_pauses
from synth.units.recordings.recording import UnitRecording
from synth.units.speech.marks import PitchMarks
from synth.units.speech.psola import SpeechPiece, modify_prosody

_MARGIN_S = 0.03
"""Seconds of sound on either side of a unit, for the windows of its periods."""

_FADE_S = 0.005
"""Seconds over which the sounds of units fade into each other: half a period."""

_ONSET = 1.15
"""Pitch at the onset of a statement over a speaker's median: it falls from there."""

_LEAD_S = 1.0
"""Seconds before and after a passage for which its sources stand still."""

_SILENT = Score((), ())
_HAND_SMOOTHING_S = 0.028
"""Standard deviation of a Gaussian that leaves the hand what lies below 5 Hz, nearly all of a real
cuer's motion: dikeys squeezed into keys of less than 0.1 s undershoot instead of racing."""

_HEAD_SMOOTHING_S = 0.045
"""The same for the head, which is heavier: it meets the hand half-way, in no more of a hurry than
it was recorded in."""


@dataclass(frozen=True, slots=True)
class Performance:
    """The output of the synthesiser.

    Attributes
    ----------
    sound : ndarray of float32, shape (n,)
        Speech; sample 0 stands at ``motion.start_s``.
    fs : int
        Its rate in Hz.
    motion : Motion
        With the score.
    units : tuple of PlacedUnit
        Those whose sound begins in this part, in order of time.
    """

    sound: NDArray[np.float32]
    fs: int
    motion: Motion
    units: tuple[PlacedUnit, ...] = ()


class ConcatenativeSynthesiser:
    """The dictionaries of one speaker, ready to say and cue scores.

    Parameters
    ----------
    recordings : sequence of UnitRecording
        All at one sample rate and of one voice.
    voice : Voice
        The voice of the recordings' motion.
    alignment : str
        One of `synth.motion.rules.movement.ALIGNMENTS`: when a key's target is reached.
    options : CueingOptions
    seed : int
        Of the slow motion of the head.

    Raises
    ------
    CueError
        If the recordings do not belong together or to the voice, or hold no unit.
    """

    def __init__(
        self,
        recordings: Sequence[UnitRecording],
        voice: Voice,
        *,
        alignment: str = "paper",
        options: CueingOptions = DEFAULT_OPTIONS,
        seed: int = 0,
    ) -> None:
        if len({recording.fs for recording in recordings}) != 1:
            raise CueError("recordings differ in their sample rate, or there is none")
        if any(recording.motion.voice != voice.identity for recording in recordings):
            raise CueError(f"recordings were not made with voice {voice.identity}")
        self.recordings = recordings
        self._voice = voice
        self._alignment = alignment
        self._options = options
        self.fs = recordings[0].fs
        columns = range(len(voice.layout))
        self._face_columns = [i for i in columns if voice.layout[i].startswith("face.")]
        self._hand_columns = [i for i in columns if i not in self._face_columns]
        self._head_columns = [i for i in columns if voice.layout[i].startswith("head.")]
        # Slow head motion cannot be cut into units: it is removed here and added anew in `perform`.
        self._head = HeadMotion(voice, recordings, seed=seed)
        motions = self._head.without_slow_part(recordings)
        self._face = Trajectories(motions, self._face_columns)
        self._hand = Trajectories(motions, self._hand_columns)
        self._quickest_mm_s = quickest((recording.motion for recording in recordings), voice)
        weights = _explained_variance(voice, self._hand)
        self.sounds = SoundDictionary(recordings)
        self.dikeys = DikeyDictionary(recordings, self._hand, weights)

    def perform(
        self, pieces: Iterable[Score], *, rate_hz: float = 50.0, start_s: float | None = None
    ) -> Iterator[Performance]:
        """Say and cue a score, passage by passage, in constant memory.

        Parameters
        ----------
        pieces : iterable of Score
            In order of time; a whole score is one piece. The result does not depend on how
            the score is cut into pieces.
        rate_hz : float
            Frames per second of the motion.
        start_s : float, optional
            When the first frame is due; by default one second before the first phone.

        Yields
        ------
        Performance
            Without gaps, until one second after the last phone.
        """
        start = None if start_s is None else round(start_s * rate_hz)
        flow = Flow(rate_hz, self.fs, start)
        for passage in passages(pieces):
            first, last = (round(t * rate_hz) for t in (passage.start_s, passage.end_s))
            gestures = plan_gestures(
                passage.around, alignment=self._alignment, options=self._options
            )
            params, sound, units = self._make(passage, gestures, flow, first, last)
            # Neighbouring passages overlap and are cross-faded: what comes out is final.
            for at, frames, samples in flow.join(first, last, params, sound):
                times = np.arange(at, at + len(frames)) / rate_hz
                moving = self._head.added(frames, times, passage.around.phones, gestures)
                end = at + len(frames)
                # A passage's score goes out once, with its last frames.
                score = passage.score if end == last else _SILENT
                said = (u for u in units if at <= u.target.edges_s[0] * rate_hz < end)
                yield Performance(
                    samples,
                    self.fs,
                    Motion(
                        moving.astype(np.float32),
                        rate_hz,
                        at / rate_hz,
                        self._voice.layout,
                        self._voice.identity,
                        score,
                    ),
                    tuple(said),
                )

    def _make(
        self, passage: ScorePassage, gestures: Gestures, flow: Flow, first: int, last: int
    ) -> tuple[NDArray[np.float64], NDArray[np.float32], list[PlacedUnit]]:
        """Return frames, samples and units of a passage and of the moment after it."""
        around = passage.around
        times = np.arange(first, last + flow.fade_frames) / flow.rate_hz
        line = with_pauses(
            around.phones,
            min(times[0], around.phones[0].start - _LEAD_S),
            max(times[-1], around.phones[-1].end + _LEAD_S),
        )
        melody = plan_melody(around.phones, f0_hz=_ONSET * self.sounds.median_hz)
        sounds = near_own_durations(self.sounds.select(cut_sounds(line), melody))
        begin, end = flow.sample(first), flow.sample(last + flow.fade_frames)
        sound = self._say(sounds, melody, begin, end)
        return self._move(sounds, gestures, times, flow.rate_hz), sound, sounds

    def _say(
        self, choices: Sequence[PlacedUnit], melody: Melody, begin: int, end: int
    ) -> NDArray[np.float32]:
        """Return the samples from `begin` to `end` of the programme."""
        sound = np.zeros(end - begin, dtype=np.float32)
        for stretch in stretches(choices):
            first = round(stretch[0].target.edges_s[0] * self.fs) - begin
            if first >= len(sound) or stretch[-1].target.edges_s[-1] * self.fs <= begin:
                continue
            said = self._say_stretch(stretch, melody)
            said = said[max(-first, 0) : len(sound) - first]
            first = max(first, 0)
            sound[first : first + len(said)] += said.astype(np.float32)
        return sound

    def _say_stretch(self, choices: Sequence[PlacedUnit], melody: Melody) -> NDArray[np.float64]:
        """Return the sound of units that follow each other without a gap."""
        tracks = [self.recordings[choice.recording].track for choice in choices]
        maps = intone(melody, choices, tracks)
        sources, samples, voiced, pieces = [], [], [], []
        offset = 0
        for run in runs(choices):
            made = self.recordings[choices[run[0]].recording]
            source_s, target_s, ratio = _in_a_row([maps[k] for k in run])
            first = max(round((source_s[0] - _MARGIN_S) * self.fs), 0)
            last = min(round((source_s[-1] + _MARGIN_S) * self.fs), len(made.sound))
            inside = (made.marks.sample >= first) & (made.marks.sample < last)
            samples.append(made.marks.sample[inside] - first + offset)
            voiced.append(made.marks.voiced[inside])
            sources.append(made.sound[first:last].astype(np.float64))
            shift_s = (offset - first) / self.fs
            pieces.append(SpeechPiece.of(source_s + shift_s, target_s, ratio))
            offset += last - first
        marks = PitchMarks(np.concatenate(samples), np.concatenate(voiced), self.fs)
        said = modify_prosody(np.concatenate(sources), marks, pieces)
        # A short pause may still ring with what was said before it where it was recorded.
        fade = np.sin(np.linspace(0.0, np.pi / 2, round(_FADE_S * self.fs))) ** 2
        n = min(len(fade), len(said))
        said[:n] *= fade[:n]
        said[len(said) - n :] *= fade[:n][::-1]
        return said

    def _move(
        self,
        sounds: Sequence[PlacedUnit],
        gestures: Gestures,
        times: NDArray[np.float64],
        rate_hz: float,
    ) -> NDArray[np.float64]:
        params = np.zeros((len(times), len(self._voice.layout)))
        params[:, self._face_columns] = _joined(self._face, sounds, times)
        dikeys = self.dikeys.select(cut_dikeys(gestures))
        hand = _joined(self._hand, dikeys, times)
        params[:, self._hand_columns] = hand
        # Dikeys meet in the middle of a held key; smoothing rounds the joins, which are then slowed
        # to what the recordings show.
        for columns, width_s in (
            (self._hand_columns, _HAND_SMOOTHING_S),
            (self._head_columns, _HEAD_SMOOTHING_S),
        ):
            params[:, columns] = gaussian_filter1d(
                params[:, columns], width_s * rate_hz, axis=0, mode="nearest"
            )
        reached = np.rint((gestures.reach[1:] - times[0]) * rate_hz).astype(np.int64)
        return calm_joins(
            params,
            self._hand_columns,
            reached,
            self._voice,
            limit_mm_s=self._quickest_mm_s,
            rate_hz=rate_hz,
        )


def _in_a_row(maps: Sequence[PitchedUnit]) -> PitchedUnit:
    """Return the map of units that follow each other in a recording."""
    source, target, ratio = (np.concatenate(lines) for lines in zip(*maps, strict=True))
    ahead = np.minimum(np.diff(source, prepend=-np.inf), np.diff(target, prepend=-np.inf)) > 1e-6
    return source[ahead], target[ahead], ratio[ahead]


def _joined(
    source: Trajectories, choices: Sequence[PlacedUnit], times: NDArray[np.float64]
) -> NDArray[np.float64]:
    return join_trajectories(
        source,
        np.array([c.recording for c in choices]),
        [c.source.edges_s for c in choices],
        [c.target.edges_s for c in choices],
        times,
    )


def _explained_variance(voice: Voice, motion: Trajectories) -> NDArray[np.float64]:
    """Return the variance of the markers that one deviation of each parameter explains, mm^2."""
    neutral = np.zeros((1 + len(motion.columns), len(voice.layout)))
    for row, column in enumerate(motion.columns, 1):
        neutral[row, column] = motion.deviation[row - 1]
    markers = voice.reconstruct(neutral).astype(np.float64)
    return np.asarray(((markers[1:] - markers[0]) ** 2).sum(axis=2).mean(axis=1))
