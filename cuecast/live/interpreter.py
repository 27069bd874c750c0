"""A live interpreter: her parameters as they come, one line each, and the keys that she shows.

Lines of ``capture - --live`` in, a motion on the programme's clock out. She works at the same
programme as the playout; the sound waits until what she did at it is known, so that she is as late
for the viewer as she was in the studio. Where she is missing, the cuer goes to rest.
"""

import json
from collections import deque
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from codec.cuer.motion import MOST_PARAM, Motion
from codec.cuer.voice import Voice
from codec.cues.score import Key, Phone, Score
from codec.cues.timeline import SUPERFRAME_S
from codec.errors import CueError
from cuecast.dubbing.motions import RATE_HZ
from synth.capture.cues.appearance import NOTHING_SHOWN, looks_of
from synth.capture.cues.features import POINTS, see_motion, see_points
from synth.capture.cues.line import joined
from synth.capture.cues.recognise import HeldKey, recognise_keys
from synth.capture.cues.score import is_sure, score_of
from synth.capture.points.solve import resting
from synth.capture.points.speaker import Speaker
from synth.capture.sources.landmark_maps import N_HAND_LANDMARKS
from synth.capture.sources.resample import evenly

LATE_S = 0.17
"""Delay of a line that states none: that of `capture --live` at 30 frames per second."""

SETTLED_S = 0.5
"""How much of what follows a key's beginning has to be seen for the key to be reported."""

_AWAY_S, _TO_REST_S = 0.4, 0.25
"""Seconds without a line after which she goes to rest, and that it takes to get there."""

_KEPT_S = 12.0
"""Seconds that are kept of her."""

_LOOKED_AT_S = 8.0
"""Seconds searched for keys."""

_DRIFT = 1e-3
"""Most seconds in a second that the clock of her lines may lose."""

_NEW_CLOCK_S = 2.0
"""Lines that come so much later or earlier than those before have a new clock."""

_LEARNT_KEYS = 300
"""Examples of keys that are kept of her: of the last minute or two."""

_MOST_MM = 1e5
"""Greatest coordinate of a point that is believed."""

_UNSEEN = np.full((len(POINTS) + N_HAND_LANDMARKS, 2), np.nan)

_OVERLAP_S = 0.12
"""Two keys that overlap more are one key, recognised twice."""


@dataclass(frozen=True, slots=True)
class LivePose:
    """Parameters (P,) of the frame at `time_s` of its own clock, `age_s` after it was filmed.

    `points` (25, 2) are the landmarks for recognising keys; NaN where the hand is not visible, and
    of lines that have none.
    """

    time_s: float
    params: NDArray[np.float64]
    age_s: float = LATE_S
    points: NDArray[np.float64] = field(default_factory=lambda: _UNSEEN.copy(), repr=False)


def read_pose(line: str | bytes, count: int) -> LivePose | None:
    """Read a line: JSON with ``time`` in seconds and ``params``; ``age`` and ``points`` if known.

    Parameters
    ----------
    line : str or bytes
    count : int
        Parameters of the voice.

    Returns
    -------
    LivePose or None
        None for an empty line.

    Raises
    ------
    CueError
        If it is not such a line.

    Examples
    --------
    >>> read_pose('{"time": 2.5, "params": [0, 1.5]}', 2)
    LivePose(time_s=2.5, params=array([0. , 1.5]), age_s=0.17)
    """
    if not line.strip():
        return None
    try:
        found = json.loads(line)
        params = np.array(found["params"], dtype=np.float64)
        time_s, age_s = float(found["time"]), float(found.get("age", LATE_S))
        points = np.array(found["points"], dtype=np.float64) if "points" in found else _UNSEEN
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise CueError(f"interpreter: not JSON with time and params: {str(line)[:60]}") from error
    if params.shape != (count,):
        raise CueError(f"interpreter: {params.size} parameters, the voice has {count}")
    if not (abs(time_s) < 1e9 and 0 <= age_s < 1e3 and (np.abs(params) <= MOST_PARAM).all()):
        raise CueError(f"interpreter: no time or no parameters: {str(line)[:60]}")
    if points.size != _UNSEEN.size or (np.abs(points) > _MOST_MM).any():
        raise CueError(f"interpreter: {points.size} numbers are no points of face and hand")
    return LivePose(time_s, params, age_s, points.reshape(_UNSEEN.shape))


class InterpretedMotion:
    """Motion of an interpreter, known up to a moment ago.

    Parameters
    ----------
    voice : Voice
        That of the capture.

    Attributes
    ----------
    known_s : float
        Up to where she is known, on the programme's clock.
    poses, keys : int
        Lines that were taken, keys that were recognised.
    """

    def __init__(self, voice: Voice) -> None:
        self._voice = voice
        self.rate_hz = RATE_HZ
        self.filmed, self.whole = True, False
        self._rest = resting(Speaker(voice, voice.face, voice.hand))
        self._looks = looks_of(voice)
        self._times: deque[float] = deque()
        self._rows: deque[NDArray[np.float64]] = deque()
        self._points: deque[NDArray[np.float64]] = deque()
        self._known, self._learnt_s = NOTHING_SHOWN, float("-inf")
        self._offset_s: float | None = None
        self._told_s = 0.0
        self._phones: deque[Phone] = deque()
        self._keys: deque[Key] = deque()
        self.poses = self.keys = 0

    @property
    def known_s(self) -> float:
        """Time of the last frame, minus infinity before there is one."""
        return self._times[-1] if self._times else float("-inf")

    @property
    def score(self) -> Score:
        """Phones and keys that are still kept."""
        return Score(tuple(self._phones), tuple(self._keys))

    def add(self, line: str | bytes, now_s: float | None) -> bool:
        """Take a line; return whether it is used.

        Parameters
        ----------
        line : str or bytes
            See `read_pose`.
        now_s : float or None
            The programme's clock as it came; None: its time is the programme's.

        Raises
        ------
        CueError
            If it is not such a line.
        """
        pose = read_pose(line, len(self._rest))
        if pose is None:
            return False
        time_s = pose.time_s + (0.0 if now_s is None else self._offset(pose, now_s))
        if time_s <= self.known_s:
            return False
        gap_s = time_s - self.known_s
        if gap_s > _AWAY_S + _TO_REST_S:
            self._fill(time_s)
        self._append(time_s, pose.params, pose.points)
        self.poses += 1
        return True

    def _offset(self, pose: LivePose, now_s: float) -> float:
        """Return the offset of her clock to the programme's, from the least delayed lines."""
        offset_s = now_s - pose.age_s - pose.time_s
        before = self._offset_s
        if before is None or abs(offset_s - before) > _NEW_CLOCK_S:
            self._offset_s = offset_s
        else:
            self._offset_s = min(offset_s, before + _DRIFT / RATE_HZ)
        return self._offset_s

    def _fill(self, time_s: float) -> None:
        """Let her rest where nothing is known."""
        if self._times:
            last_s, last = self._times[-1], self._rows[-1]
            self._append(last_s + _AWAY_S, last)
            self._append(last_s + _AWAY_S + _TO_REST_S, self._rest)
        if time_s - _TO_REST_S > self.known_s:
            self._append(time_s - _TO_REST_S, self._rest)

    def _append(
        self, time_s: float, row: NDArray[np.float64], points: NDArray[np.float64] = _UNSEEN
    ) -> None:
        self._times.append(time_s)
        self._rows.append(row)
        self._points.append(points)
        while len(self._times) > 2 and self._times[1] < time_s - _KEPT_S:
            self._times.popleft()
            self._rows.popleft()
            self._points.popleft()

    def window(self, start_s: float, frames: int) -> Motion:
        """Return the motion from `start_s` on, for the lines so far, with the keys in it."""
        times = start_s + np.arange(frames) / RATE_HZ
        self._recognise(start_s + frames / RATE_HZ)
        for line in (self._phones, self._keys):
            while line and line[0].end < start_s - _KEPT_S:
                line.popleft()
        return Motion(
            self._at(times).astype(np.float32),
            RATE_HZ,
            start_s,
            self._voice.layout,
            self._voice.identity,
            self.score,
        )

    def _at(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return her parameters (T, P); after the last frame she waits, then rests."""
        if not self._times:
            return np.repeat(self._rest[None], len(times), axis=0)
        known, rows = np.array(self._times), np.stack(self._rows)
        end_s = known[-1]
        known = np.append(known, [end_s + _AWAY_S, end_s + _AWAY_S + _TO_REST_S])
        rows = np.concatenate([rows, rows[-1:], self._rest[None]])
        return np.stack([np.interp(times, known, column) for column in rows.T], axis=1)

    def _recognise(self, end_s: float) -> None:
        """Tell the keys up to a superframe after a time, which the coding leans on; they stay."""
        last_s = min(self.known_s, end_s + _LOOKED_AT_S)
        begin_s = self._told_s
        end_s = max(end_s, min(end_s + SUPERFRAME_S, last_s - SETTLED_S))
        if end_s <= begin_s:
            return
        self._told_s = end_s
        first_s = max(last_s - _LOOKED_AT_S, self._times[0] if self._times else 0.0)
        frames = int((last_s - first_s) * RATE_HZ) if self._times else 0
        if frames < SETTLED_S * RATE_HZ:
            return
        params = self._at(first_s + np.arange(frames) / RATE_HZ)
        held = self._held(params, first_s, last_s)
        if not is_sure(held):
            return
        found = score_of(held, self._voice, params, rate_hz=RATE_HZ, start_s=first_s)
        for key, phones in _phones_of(found):
            if begin_s <= key.start < end_s:
                self._tell(key, phones)

    def _held(
        self, params: NDArray[np.float64], first_s: float, last_s: float
    ) -> tuple[HeldKey, ...]:
        """Return the keys held between two times: by her landmarks, else by parameters (T, P)."""
        times = np.array(self._times)
        at = (times >= first_s) & (times <= last_s)
        points = np.stack(self._points)[at] if at.any() else _UNSEEN[None]
        if not np.isfinite(points).any():
            seen = see_motion(self._voice, params, rate_hz=RATE_HZ)
            return recognise_keys(seen, looks=self._looks).held
        even, rate_hz = evenly(times[at], points.reshape(len(points), -1), name="interpreter")
        seen = see_points(even.reshape(len(even), *_UNSEEN.shape), rate_hz=rate_hz)
        found = recognise_keys(seen, known=self._known)
        if last_s - self._learnt_s >= _LOOKED_AT_S:
            # Windows overlap: each moment is learnt from once.
            shown = joined([self._known, found.shown])
            self._known, self._learnt_s = shown.last(_LEARNT_KEYS), last_s
        late_s = times[at][0] - first_s
        return tuple(
            replace(one, reach_s=one.reach_s + late_s, leave_s=one.leave_s + late_s)
            for one in found.held
        )

    def _tell(self, key: Key, phones: list[Phone]) -> None:
        """Put a key behind those before it, unless it is one of them."""
        free_s = self._phones[-1].end if self._phones else float("-inf")
        late_s = free_s - key.start
        if late_s > _OVERLAP_S or key.end - free_s < _OVERLAP_S / 2:
            return
        if late_s > 0:
            factor = (key.end - free_s) / (key.end - key.start)
            phones = [
                Phone(
                    p.symbol,
                    key.end - factor * (key.end - p.start),
                    key.end - factor * (key.end - p.end),
                )
                for p in phones
            ]
            key = Key(free_s, key.end, key.phones, key.shape, key.placement)
        self._phones += phones
        self._keys.append(key)
        self.keys += 1


def warm_recognition(voice: Voice) -> None:
    """Load what recognition needs, which would otherwise be loaded while sound waits."""
    at_rest = resting(Speaker(voice, voice.face, voice.hand))
    params = np.repeat(at_rest[None], round(RATE_HZ), axis=0)
    recognise_keys(see_motion(voice, params, rate_hz=RATE_HZ), looks=looks_of(voice))


def _phones_of(score: Score) -> list[tuple[Key, list[Phone]]]:
    """Return each key with its phones."""
    phones = iter(score.phones)
    return [(key, [next(phones) for _ in key.phones]) for key in score.keys]
