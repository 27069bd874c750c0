"""Text-to-cued-speech synthesis by concatenation: the paper's own system.

In: a score. Out: speech, and the motion of face, head, forearm and hand. Polysounds give sound
and face, dikeys give hand and head (Gibert, Bailly, Elisei 2004, section 5.1).
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from codec.cueing import DEFAULT_OPTIONS, CueingOptions
from codec.errors import CueError
from codec.motion import Motion
from codec.score import Score
from codec.voice import Voice
from synth.dikeys import DikeyDictionary
from synth.melody import Melody, plan_melody
from synth.movement import plan_gestures
from synth.recording import Recording
from synth.sounds import Choice, SoundDictionary
from synth.speech.marks import PitchMarks
from synth.speech.pitch import PitchTrack
from synth.speech.psola import Piece, modify_prosody
from synth.trajectories import Trajectories, join_trajectories
from synth.units import cut_dikeys, cut_sounds, with_pauses

_PASSAGE_GAP_S = 1.0
_MARGIN_S = 0.03
_FADE_S = 0.005
_BREAK_S = 0.01
_RATIO_LIMITS = (0.4, 2.5)
_LEAD_S = 1.0
_HAND_SMOOTHING_S = 0.028
"""Standard deviation of a Gaussian that leaves the hand what lies below 5 Hz, nearly all of a real
cuer's motion: dikeys squeezed into keys of less than 0.1 s undershoot instead of racing."""


@dataclass(frozen=True, slots=True)
class Performance:
    """What the synthesiser delivers.

    Attributes
    ----------
    sound : ndarray of float32, shape (n,)
        Speech; sample 0 stands at ``motion.start_s``.
    fs : int
        Its rate in Hz.
    motion : Motion
        With the score.
    """

    sound: NDArray[np.float32]
    fs: int
    motion: Motion


class ConcatenativeSynthesiser:
    """The dictionaries of one speaker, ready to say and cue scores.

    Parameters
    ----------
    recordings : sequence of Recording
        All at one sample rate and of one voice.
    voice : Voice
        The voice of the recordings' motion.
    alignment : str
        One of `synth.movement.ALIGNMENTS`: when a key's target is reached.
    options : CueingOptions

    Raises
    ------
    CueError
        If the recordings do not belong together or to the voice, or hold no unit.
    """

    def __init__(
        self,
        recordings: Sequence[Recording],
        voice: Voice,
        *,
        alignment: str = "paper",
        options: CueingOptions = DEFAULT_OPTIONS,
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
        motions = [recording.motion for recording in recordings]
        self._face = Trajectories(motions, self._face_columns)
        self._hand = Trajectories(motions, self._hand_columns)
        weights = _explained_variance(voice, self._hand)
        self.sounds = SoundDictionary(recordings)
        self.dikeys = DikeyDictionary(recordings, self._hand, weights)

    def perform(self, score: Score, *, rate_hz: float = 50.0) -> Iterator[Performance]:
        """Say and cue a score, passage by passage.

        Parameters
        ----------
        score : Score
        rate_hz : float
            Frames per second of the motion.

        Yields
        ------
        Performance
            One per passage between silences of at least one second; together they cover the time
            from one second before the first phone to one second after the last one.
        """
        for start_s, end_s, passage in _passages(score, rate_hz):
            sounds = self.sounds.select(cut_sounds(with_pauses(passage.phones, start_s, end_s)))
            yield Performance(
                self._say(sounds, plan_melody(passage.phones), start_s, end_s), self.fs,
                self._move(sounds, passage, start_s, end_s, rate_hz),
            )  # fmt: skip

    def _say(
        self, choices: Sequence[Choice], melody: Melody, start_s: float, end_s: float
    ) -> NDArray[np.float32]:
        n = round((end_s - start_s) * self.fs)
        sound = np.zeros(n, dtype=np.float32)
        for stretch in _stretches(choices):
            said = self._say_stretch(stretch, melody)
            first = round((stretch[0].target.edges_s[0] - start_s) * self.fs)
            said = said[max(-first, 0) : n - first]
            first = max(first, 0)
            sound[first : first + len(said)] += said.astype(np.float32)
        return sound

    def _say_stretch(self, choices: Sequence[Choice], melody: Melody) -> NDArray[np.float64]:
        """Return the sound of units that follow each other without a gap."""
        sources, samples, voiced, pieces = [], [], [], []
        offset = 0
        for choice in choices:
            made = self.recordings[choice.recording]
            edges = np.array(choice.source.edges_s)
            first = max(round((edges[0] - _MARGIN_S) * self.fs), 0)
            last = min(round((edges[-1] + _MARGIN_S) * self.fs), len(made.sound))
            inside = (made.marks.sample >= first) & (made.marks.sample < last)
            samples.append(made.marks.sample[inside] - first + offset)
            voiced.append(made.marks.voiced[inside])
            sources.append(made.sound[first:last].astype(np.float64))
            shift_s = (offset - first) / self.fs
            pieces.append(self._piece(choice, made.track, melody, shift_s))
            offset += last - first
        marks = PitchMarks(np.concatenate(samples), np.concatenate(voiced), self.fs)
        said = modify_prosody(np.concatenate(sources), marks, pieces)
        # A short pause may still ring with what was said before it where it was recorded.
        fade = np.sin(np.linspace(0.0, np.pi / 2, round(_FADE_S * self.fs))) ** 2
        n = min(len(fade), len(said))
        said[:n] *= fade[:n]
        said[len(said) - n :] *= fade[:n][::-1]
        return said

    def _piece(self, choice: Choice, track: PitchTrack, melody: Melody, shift_s: float) -> Piece:
        """Return where a unit goes, with the melody's pitch over its own every 10 ms."""
        source_edges, target_edges = _strictly_ascending(choice)
        steps = max(int((target_edges[-1] - target_edges[0]) / _BREAK_S), 1)
        target = np.union1d(np.linspace(target_edges[0], target_edges[-1], steps + 1), target_edges)
        target = target[np.concatenate(([True], np.diff(target) > 1e-6))]
        target[-1] = target_edges[-1]
        source = np.interp(target, target_edges, source_edges)
        known = track.f0 > 0
        if not known.any():
            return Piece.of(source + shift_s, target)
        at = np.arange(len(track.f0)) * track.hop_s
        own = np.interp(source, at[known], track.f0[known])
        ratio = np.clip(melody.at(target) / own, *_RATIO_LIMITS)
        return Piece.of(source + shift_s, target, ratio)

    def _move(
        self,
        sounds: Sequence[Choice],
        passage: Score,
        start_s: float,
        end_s: float,
        rate_hz: float,
    ) -> Motion:
        times = start_s + np.arange(round((end_s - start_s) * rate_hz)) / rate_hz
        params = np.zeros((len(times), len(self._voice.layout)))
        params[:, self._face_columns] = _joined(self._face, sounds, times)
        gestures = plan_gestures(passage, alignment=self._alignment, options=self._options)
        dikeys = self.dikeys.select(cut_dikeys(gestures))
        hand = _joined(self._hand, dikeys, times)
        params[:, self._hand_columns] = gaussian_filter1d(
            hand, _HAND_SMOOTHING_S * rate_hz, axis=0, mode="nearest"
        )
        return Motion(
            params.astype(np.float32), rate_hz, start_s, self._voice.layout,
            self._voice.identity, passage,
        )  # fmt: skip


def _joined(
    source: Trajectories, choices: Sequence[Choice], times: NDArray[np.float64]
) -> NDArray[np.float64]:
    return join_trajectories(
        source, np.array([c.recording for c in choices]),
        [c.source.edges_s for c in choices], [c.target.edges_s for c in choices], times,
    )  # fmt: skip


def _explained_variance(voice: Voice, motion: Trajectories) -> NDArray[np.float64]:
    """Return the variance of the markers that one deviation of each parameter explains, mm^2."""
    neutral = np.zeros((1 + len(motion.columns), len(voice.layout)))
    for row, column in enumerate(motion.columns, 1):
        neutral[row, column] = motion.deviation[row - 1]
    markers = voice.reconstruct(neutral).astype(np.float64)
    return np.asarray(((markers[1:] - markers[0]) ** 2).sum(axis=2).mean(axis=1))


def _passages(score: Score, rate_hz: float) -> Iterator[tuple[float, float, Score]]:
    """Yield start, end and score of each passage; starts stand on the frame grid."""
    phones = [p for p in score.phones if p.symbol != "_"]
    if not phones:
        return
    cuts = [0]
    for i, (before, after) in enumerate(itertools.pairwise(phones), 1):
        if after.start - before.end >= _PASSAGE_GAP_S:
            cuts.append(i)
    cuts.append(len(phones))
    start = np.floor((phones[0].start - _LEAD_S) * rate_hz) / rate_hz
    for first, last in itertools.pairwise(cuts):
        group = phones[first:last]
        end = group[-1].end + _LEAD_S
        if last < len(phones):
            end = (group[-1].end + phones[last].start) / 2
        end = np.ceil(end * rate_hz) / rate_hz
        keys = tuple(k for k in score.keys if group[0].start - 1e-6 <= k.start < group[-1].end)
        yield float(start), float(end), Score(tuple(group), keys)
        start = end


def _stretches(choices: Sequence[Choice]) -> Iterator[list[Choice]]:
    """Split a line of units where the time between two of them is silent."""
    stretch: list[Choice] = []
    for choice in choices:
        if stretch and choice.target.edges_s[0] - stretch[-1].target.edges_s[-1] > 1e-6:
            yield stretch
            stretch = []
        stretch.append(choice)
    if stretch:
        yield stretch


def _strictly_ascending(choice: Choice) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a unit's edges without those that coincide in source or target."""
    source, target = np.array(choice.source.edges_s), np.array(choice.target.edges_s)
    kept = [0]
    for i in range(1, len(source)):
        if source[i] - source[kept[-1]] > 1e-4 and target[i] - target[kept[-1]] > 1e-4:
            kept.append(i)
    if len(kept) == 1:
        return np.array([source[0], source[0] + 1e-3]), np.array([target[0], target[0] + 1e-3])
    kept[-1] = len(source) - 1
    return source[kept], target[kept]
