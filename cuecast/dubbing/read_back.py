"""Reading the output back: it goes through a receiver, and the report has the result.

In: a dubbed file and its superframes. Out: for each carrier how many superframes arrived as
they were sent, how many keys a viewer sees, and the true PSNR of the picture. Noticing that a
programme was dubbed before is the same look with less patience.
"""

import contextlib
import math
import os
import tempfile
import zlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from codec.cuer.voice import Voice
from codec.cues.score import Key
from codec.errors import BitstreamError, CueError
from codec.superframe.checks import proof_of
from cuecast.dubbing.coder_stream import chains_of
from cuecast.media.rewrite import Unchanged, rewrite_sound
from receiver.media.picture import picture_format, read_lumas
from receiver.media.programme import open_programme
from receiver.reception.picture_search import Found
from receiver.reception.reception import ProgrammeReceiver
from watermark.link.superframe import SUPERFRAME_S

ENOUGH = 0.98
"""Share of the superframes below which the written mark is not good enough."""

_LOOK_S = 12.0
"""How long one look for an earlier mark lasts; tuning in takes 1.3 to 4 s."""

_PROOF = 2
"""Superframes whose check holds that make an earlier mark certain."""

_SAME_KEY_S = 0.1
"""Seconds within which a received key counts as the one that was sent."""

Payloads = Callable[[int], tuple[bytes, bytes]]


@dataclass(slots=True)
class Sent:
    """What went into the carriers of a programme.

    Attributes
    ----------
    superframes : dict of str to dict of int to int
        For each carrier the checksum of L0 by the number of its superframe on air.
    silent : list of (float, float)
        Seconds of sound that could not carry.
    sound_start_s : float
        Where the sound begins on the programme's clock.
    """

    superframes: dict[str, dict[int, int]] = field(default_factory=dict)
    silent: list[tuple[float, float]] = field(default_factory=list)
    sound_start_s: float = 0.0

    def noting(self, carrier: str, source: Payloads, first: int = 0) -> Payloads:
        """Return `source`, whose payloads are noted; its superframe 0 is number `first` on air."""
        noted = self.superframes.setdefault(carrier, {})

        def give(k: int) -> tuple[bytes, bytes]:
            l0, l1 = source(k)
            noted[first + k] = zlib.crc32(l0)
            return l0, l1

        return give

    def expected(self, carrier: str, duration_s: float) -> dict[int, int]:
        """Return what of a carrier lies whole within the programme, in sound that can carry."""
        silent = self.silent if carrier == "audio" else []
        ends_s = duration_s + (self.sound_start_s if carrier == "audio" else 0.0)
        return {
            index: check
            for index, check in self.superframes.get(carrier, {}).items()
            if (index + 1) * SUPERFRAME_S <= ends_s
            and not any(a - 1e-3 <= index * SUPERFRAME_S < b - 1e-3 for a, b in silent)
        }


def read_back(
    target: str | os.PathLike[str],
    sent: Sent,
    keys: Iterable[Key],
    voice: Voice,
    *,
    lead: int,
    key: int = 0,
    track: int = 0,
    duration_s: float,
    through: str | None = None,
    progress: Callable[[float], None] = lambda seconds: None,
) -> dict[str, Any]:
    """Receive a dubbed programme and compare it with the superframes sent.

    Parameters
    ----------
    target : path
        The dubbed programme.
    sent : Sent
    keys : iterable of Key
        Those of the whole cuer.
    voice : Voice
    lead : int
        How many superframes a superframe is on air before its motion is due.
    key : int
        Key of the watermark.
    track : int
        Which of its sounds.
    duration_s : float
        Of the marked part.
    through : str, optional
        Coders of the broadcast, such as ``aac:64k``, that the sound passes first; of several
        alternatives the first one, see `cuecast.dubbing.coder_stream.chains_of`.
    progress : callable
        Called with the seconds that each piece brought.

    Returns
    -------
    dict
        ``through``, ``carriers`` (each with ``sent``, ``received``, ``lost``, ``share``) and
        ``keys``: those that the superframes ``sent`` can hold, ``received`` of them, and
        ``outside``: those that no superframe of this programme can, ``not_on_air`` by reason.
    """
    with tempfile.TemporaryDirectory(prefix=".cuecast-", dir=Path(target).parent) as folder:
        heard = None
        if through is not None and "audio" in sent.superframes:
            heard = _coded(Path(target), Path(folder), through, track)
        arrived, found = _received(Path(target), heard, sent, voice, key, track, progress)
    carriers = {}
    wanted = {name: sent.expected(name, duration_s) for name in sent.superframes}
    for name, checks in wanted.items():
        right = sum(arrived[name].get(index) == check for index, check in checks.items())
        carriers[name] = {
            "sent": len(checks),
            "received": right,
            "lost": len(checks) - right,
            "share": round(right / len(checks), 4) if checks else None,
        }
    on_air = set().union(*wanted.values())
    all_keys = list(keys)
    within = [k for k in all_keys if math.floor(k.start / SUPERFRAME_S) - lead in on_air]
    return {
        "through": through,
        "carriers": carriers,
        "keys": {
            "sent": len(within),
            "received": _matching(within, found),
            "outside": len(all_keys) - len(within),
            "not_on_air": _not_on_air(all_keys, within, lead, sent.silent, on_air),
        },
    }


def _not_on_air(
    keys: list[Key],
    within: list[Key],
    lead: int,
    silent: list[tuple[float, float]],
    on_air: set[int],
) -> dict[str, int]:
    """Count the keys that no superframe could hold, by reason."""
    held, reasons = set(within), {"before_the_first": 0, "in_silence": 0, "after_the_last": 0}
    for key in keys:
        index = math.floor(key.start / SUPERFRAME_S) - lead
        if key in held:
            continue
        if any(a - 1e-3 <= index * SUPERFRAME_S < b - 1e-3 for a, b in silent):
            reasons["in_silence"] += 1
        else:
            early = not on_air or index < min(on_air)
            reasons["before_the_first" if early else "after_the_last"] += 1
    return reasons


def _received(
    target: Path,
    heard: Path | None,
    sent: Sent,
    voice: Voice,
    key: int,
    track: int,
    progress: Callable[[float], None],
) -> tuple[dict[str, dict[int, int]], list[dict[str, Any]]]:
    """Checksums of what arrives in each carrier, and the keys that a viewer sees.

    The sound is that of `target`, or of the file `heard` if it passed a channel.
    """
    arrived: dict[str, dict[int, int]] = {name: {} for name in sent.superframes}

    def witness(found: Found) -> None:
        one = found.superframe
        if one.l0 is not None and found.carrier in arrived:
            index = round(one.position_s / SUPERFRAME_S)
            arrived[found.carrier].setdefault(index, zlib.crc32(one.l0))

    hears, sees = "audio" in sent.superframes, bool(set(sent.superframes) - {"audio"})
    passes = [(target, track, 0.0, hears and heard is None, sees)]
    if heard is not None:
        passes = [(heard, 0, _sound_begins_s(target, track), True, False), *passes * sees]
    keys: list[dict[str, Any]] = []
    for path, number, clock_s, listen, look in passes:
        with open_programme(path, track=number) as programme:
            reception = ProgrammeReceiver(
                programme, voice, key=key, listen=listen, look=look, clock_s=clock_s, draw=False
            )
            reception.receiver.witness = witness
            for before, after in pairwise(one.until_s for one in reception.progress()):
                progress(max(0.0, after - before))
            keys += reception.receiver.summary()["keys"]
    return arrived, keys


def _sound_begins_s(target: str | os.PathLike[str], track: int) -> float:
    """Where the sound of `target` begins on its own clock; a sound alone begins at 0."""
    with open_programme(target, track=track) as programme:
        sound = programme.sound
        if sound.start_time is None:
            return 0.0
        return float(sound.start_time * sound.time_base) - programme.origin_s


def _coded(path: Path, folder: Path, through: str, track: int) -> Path:
    """Write the sound of a programme as it comes through coders in a row."""
    for number, coder in enumerate(chains_of(through)[0]):
        name, rate = coder.split(":")[:2]
        target = folder / f"channel-{number}.mka"
        rewrite_sound(
            path,
            target,
            lambda *_: Unchanged(),
            track=0 if number else track,
            codec=name,
            alone=True,
            bit_rate=int(rate.removesuffix("k")) * 1000,
        )
        path = target
    return path


def _matching(sent: list[Key], found: list[dict[str, Any]]) -> int:
    """Count the keys that were found at their time with their gesture."""
    have: dict[tuple[int, str], list[float]] = {}
    for one in found:
        have.setdefault((one["shape"], one["placement"]), []).append(one["start"])
    count = 0
    for key in sent:
        told = key.as_dict()
        times = have.get((told["shape"], told["placement"]), [])
        near = [t for t in times if abs(t - told["start"]) <= _SAME_KEY_S]
        if near:
            times.remove(min(near, key=lambda t: abs(t - told["start"])))
            count += 1
    return count


def shortfalls(found: dict[str, Any], coded_bps: Mapping[str, int] | None = None) -> list[str]:
    """Say which carriers of what `read_back` returned fall short of `ENOUGH`.

    `coded_bps` are the bit rates of the picture that holds a carrier, by its name.

    Examples
    --------
    >>> shortfalls({"carriers": {"video": {"sent": 4, "received": 1, "share": 0.25}}})
    ['video: only 1 of 4 superframes can be read back (25 %)']
    """
    return [
        f"{name}: only {one['received']} of {one['sent']} superframes can be read back "
        f"({one['share']:.0%})".replace("%)", " %)")
        + (
            f"; its picture is coded with {coded_bps[name] // 1000} kbit/s: "
            "more with --video-bitrate"
            if coded_bps and name in coded_bps
            else ""
        )
        for name, one in found["carriers"].items()
        if one["share"] is not None and one["share"] < ENOUGH
    ]


def true_psnr_db(programme: str | os.PathLike[str], target: str | os.PathLike[str]) -> float | None:
    """Return the PSNR of the luma of `target` against that of `programme`, dB.

    None where the pictures are of different sizes, or exactly the same.
    """
    before, after = picture_format(programme), picture_format(target)
    if (before.width, before.height) != (after.width, after.height):
        return None
    scales = [1 / ((1 << form.depth) - 1) for form in (before, after)]
    total, count = 0.0, 0
    for one, other in zip(read_lumas(programme), read_lumas(target), strict=False):
        difference = one[1] * np.float32(scales[0]) - other[1] * np.float32(scales[1])
        total += float(np.mean(np.square(difference, dtype=np.float32)))
        count += 1
    return round(-10 * math.log10(total / count), 2) if total and count else None


def earlier_marks(
    programme: str | os.PathLike[str], voice: Voice, *, key: int = 0, track: int = 0
) -> dict[str, bool]:
    """Return the carriers that have a cuer already, and whether she is signed.

    Two places are looked at.

    A mark of another key is not seen, nor one so changed that receivers have to guess what happened
    to it: these never come to guess, since the mark that will be made is found first.
    """
    found: dict[str, int] = {}
    signed: set[str] = set()
    with open_programme(programme, track=track) as opened:
        length_s = opened.duration_s or 0.0
    places = [0.0] if length_s < 4 * _LOOK_S else [0.0, length_s / 2]
    for start_s in places:
        with open_programme(programme, track=track) as opened:
            opened.seek(start_s)
            try:
                reception = ProgrammeReceiver(
                    opened,
                    voice,
                    key=key,
                    start_s=start_s,
                    keep_keys=False,
                    guess=False,
                    draw=False,
                )
            except CueError:  # neither a sound nor a picture that could have one
                return {}
            reception.receiver.witness = lambda one: _count(found, signed, one)
            try:
                for reached in reception.progress():
                    if (
                        reached.until_s > start_s + _LOOK_S
                        or max(found.values(), default=0) > _PROOF
                    ):
                        break
            except CueError:  # what is wrong with it, dubbing will tell
                continue
    return {name: name in signed for name in sorted(found) if found[name] >= _PROOF}


def _count(found: dict[str, int], signed: set[str], one: Found) -> None:
    if one.superframe.l0 is not None:
        found[one.carrier] = found.get(one.carrier, 0) + 1
        with contextlib.suppress(BitstreamError):
            signed |= {one.carrier} if proof_of(one.superframe.l0) is not None else set()
