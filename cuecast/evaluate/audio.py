"""Measure the audio carrier: clips times channels, losses, grades, tune-in and speed.

In: sound files and names of channels; out: one row per pair. Payloads are pseudorandom, so a
superframe that comes back identifies itself, and a wrong one is noticed. A channel is written NAME
or PROFILE:NAME, as in ``robust:aac_64``; the default profile is `standard`. ``high+mp2:192k`` in
the profile's place rehearses the mark through a coder, ``robust+none`` through none (the default is
that of `dub`), ``discreet@-0.1`` aims at a grade. Unmarked sound may come first: pieces of the
other clips, which reach the receiver unchanged.
"""

import importlib.util
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy.signal
import soundfile
from numpy.typing import NDArray

from codec.errors import CueError
from cuecast.demo.content import FS, make_sound
from cuecast.dubbing.coder_stream import make_rehearsal
from cuecast.evaluate.drawing import Dot, draw_dots
from cuecast.evaluate.options import EvaluateOptions, whole_channels
from cuecast.evaluate.sound_channels import CHANNELS, CUT_S, Channel, Sound, find_channel
from cuecast.evaluate.tables import wilson_interval
from receiver.media.sound import read_sound
from watermark import quality
from watermark.audio.embed.embedder import AudioEmbedder
from watermark.audio.receiver import AudioReceiver
from watermark.audio.signal.profile import AudioProfile, find_profile
from watermark.link.superframe import SUPERFRAME_S
from watermark.quality.loudness import loudness_lufs

USUAL = (
    "none",
    "mp2_192",
    "aac_128",
    "ac3_192",
    "mp3_128",
    "high:mp2_192",
    "high:ac3_192",
    "robust:aac_64",
    "robust:mp3_64",
    "robust:opus_64",
    "discreet@-0.1:aac_128",
)
"""Channels measured when none are named."""

_SOUNDS = {".wav", ".flac", ".mp3", ".m4a", ".ogg"}

BLOCK = 4800
"""Samples handed over at once."""

LONGEST_TUNE_IN_S = 6.0
"""A reception that has not locked by then counts with this time."""


@dataclass(frozen=True, slots=True)
class AudioRow:
    """Figures of one clip through one channel.

    Attributes
    ----------
    clip, channel, profile : str
        Names of the condition.
    net_bps : float
        Payload rate.
    superframes_sent, superframes_lost : int
        From the first one whose sound is whole; one without both classes is lost.
    lost_low, lost_high : float
        95 % interval of the share that is lost.
    l0_lost : int
        Superframes without their first class.
    wrong : int
        Superframes accepted with a payload that was never sent.
    odg, snr_db : float
        Objective difference grade of the marked clip before the channel, and mid over mark.
    odg_advanced : float
        The same grade by the advanced version of the meter, which the embedder does not listen to.
    segmental_snr_db : float
        Sound over mark, mean of short segments.
    pesq : float or None
        PESQ-WB of the marked clip, 4.64 at best; only of speech, which a name with "speech" is.
    loudness_change_lu : float
        What marking adds to the programme loudness (EBU R 128).
    tune_in_median_s, tune_in_p95_s : float
        From the first sample to the first superframe, over random starts; None if none were tried.
    embed_xrt, receive_xrt : float
        Speeds as multiples of real time, by processor time.
    after_s : float
        Seconds of unmarked sound before the mark.
    found_s : float or None
        Seconds of marked sound that the receiver took until it gave the first superframe; None if
        it gave none.
    """

    clip: str
    channel: str
    profile: str
    net_bps: float
    superframes_sent: int
    superframes_lost: int
    lost_low: float
    lost_high: float
    l0_lost: int
    wrong: int
    odg: float
    odg_advanced: float
    snr_db: float
    segmental_snr_db: float
    pesq: float | None
    loudness_change_lu: float
    tune_in_median_s: float | None
    tune_in_p95_s: float | None
    embed_xrt: float
    receive_xrt: float
    after_s: float = 0.0
    found_s: float | None = None


@dataclass(frozen=True, slots=True)
class MarkedClip:
    """A marked clip and its payload."""

    clip: str
    fs: int
    setting: str
    profile: AudioProfile
    sound: Sound
    payloads: tuple[tuple[bytes, bytes], ...]
    odg: float
    odg_advanced: float
    snr_db: float
    segmental_snr_db: float
    pesq: float | None
    loudness_change_lu: float
    xrt: float


def mark_clip(
    path: Path, profile: str, grade: float | None, seed: int, *, limit_s: float | None = None
) -> MarkedClip:
    """Write pseudorandom superframes into a sound file's programme.

    Raises
    ------
    CueError
        If the file cannot be read or marked.
    """
    sound, fs = read_sound(path)
    if limit_s is not None:
        sound = sound[: round(limit_s * fs)]
    setting, _, coder = profile.partition("+")
    name, _, wanted = setting.partition("@")
    grade = _grade(wanted) if wanted else grade
    chosen, rng = find_profile(name), np.random.default_rng(seed)
    count = int(len(sound) / fs / SUPERFRAME_S) + 2
    payloads = tuple((rng.bytes(chosen.l0_bytes), rng.bytes(chosen.l1_bytes)) for _ in range(count))
    begin = time.process_time()
    marked, snr_db = _embed(sound, fs, payloads, chosen, grade, coder or None)
    xrt = len(sound) / fs / (time.process_time() - begin)
    pair = sound[:, :2], marked[:, :2]
    if snr_db is None:
        raise CueError(f"{path.name} cannot carry: nothing was marked")
    speech = "speech" in path.stem and importlib.util.find_spec("pesq") is not None
    return MarkedClip(
        clip=path.stem,
        fs=fs,
        setting=profile,
        profile=chosen,
        sound=marked,
        payloads=payloads,
        odg=quality.grade(*pair, fs).odg,
        odg_advanced=quality.peaq_advanced(*pair, fs).odg,
        snr_db=snr_db,
        segmental_snr_db=quality.segmental_snr_db(sound.mean(axis=1), marked.mean(axis=1), fs),
        pesq=quality.pesq_wb(sound.mean(axis=1), marked.mean(axis=1), fs) if speech else None,
        loudness_change_lu=loudness_lufs(marked, fs) - loudness_lufs(sound, fs),
        xrt=xrt,
    )


def _grade(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise CueError(f"grade {text!r} is not a number") from None


def _embed(
    sound: Sound,
    fs: int,
    payloads: Sequence[tuple[bytes, bytes]],
    profile: AudioProfile,
    grade: float | None,
    coder: str | None,
) -> tuple[Sound, float | None]:
    """Mark a whole sound; return it and mid over mark in dB."""
    embedder = AudioEmbedder(
        fs,
        sound.shape[1],
        payloads.__getitem__,
        profile=profile.name,
        grade=grade,
        rehearsal=make_rehearsal(profile, 0, coder),
    )
    blocks = [embedder.process(sound[i : i + BLOCK]) for i in range(0, len(sound), BLOCK)]
    return np.concatenate([*blocks, embedder.flush()]), embedder.report().snr_db


def measure(
    marked: MarkedClip,
    name: str,
    channel: Channel,
    *,
    starts: int,
    rng: np.random.Generator,
    before: Sound | None = None,
) -> AudioRow:
    """Send a marked clip through a channel and receive it, after unmarked sound if any."""
    heard = channel(marked.sound, marked.fs)
    width = heard.shape[1]
    before = np.zeros((0, width), np.float32) if before is None else with_channels(before, width)
    receiver = AudioReceiver(marked.fs, width)
    number = {payload: k for k, (payload, _) in enumerate(marked.payloads)}
    begin = time.process_time()
    for i in range(0, len(before), BLOCK):
        receiver.process(before[i : i + BLOCK])
    found, found_s = [], None
    for i in range(0, len(heard), BLOCK):
        found += receiver.process(heard[i : i + BLOCK])
        if found_s is None and any(s.l0 in number for s in found):
            found_s = round(min(i + BLOCK, len(heard)) / marked.fs, 3)
    found += receiver.flush()
    xrt = (len(before) + len(heard)) / marked.fs / (time.process_time() - begin)
    got = {number[s.l0]: s.l1 for s in found if s.l0 in number}
    wrong = sum(s.l0 is not None and s.l0 not in number for s in found)
    wrong += sum(l1 not in (None, marked.payloads[k][1]) for k, l1 in got.items())
    last = int(len(marked.sound) / marked.fs / SUPERFRAME_S - 0.02)
    due = range(math.ceil(CUT_S / SUPERFRAME_S) if name == "crop" else 0, last)
    l0_lost = sum(k not in got for k in due)
    lost = sum(got.get(k) is None for k in due)
    low, high = wilson_interval(lost, len(due))
    waits = [_tune_in(heard, marked.fs, rng) for _ in range(starts)]
    return AudioRow(
        clip=marked.clip,
        channel=name,
        profile=marked.setting,
        net_bps=marked.profile.net_bps,
        superframes_sent=len(due),
        superframes_lost=lost,
        lost_low=low,
        lost_high=high,
        l0_lost=l0_lost,
        wrong=wrong,
        odg=marked.odg,
        odg_advanced=marked.odg_advanced,
        snr_db=marked.snr_db,
        segmental_snr_db=marked.segmental_snr_db,
        pesq=marked.pesq,
        loudness_change_lu=marked.loudness_change_lu,
        tune_in_median_s=float(np.median(waits)) if waits else None,
        tune_in_p95_s=float(np.quantile(waits, 0.95)) if waits else None,
        embed_xrt=marked.xrt,
        receive_xrt=xrt,
        after_s=len(before) / marked.fs,
        found_s=found_s,
    )


def unmarked_sound(
    clips: Sequence[Path], length_s: float, fs: int, rng: np.random.Generator
) -> Sound:
    """Join pieces of 10 to 30 s of unmarked clips.

    Parameters
    ----------
    clips : sequence of Path
        Sound files.
    length_s : float
        Seconds.
    fs : int
        Rate in Hz.
    rng : Generator
        Chooses clips, places and lengths.

    Returns
    -------
    ndarray of float32, shape (n, 2)
    """
    sounds: dict[Path, Sound] = {}
    pieces: list[Sound] = [np.zeros((0, 2), np.float32)]
    missing = round(length_s * fs)
    while missing > 0:
        path = clips[int(rng.integers(len(clips)))]
        if path not in sounds:
            sound, own_fs = read_sound(path)
            divisor = math.gcd(fs, own_fs)
            if own_fs != fs:
                sound = scipy.signal.resample_poly(sound, fs // divisor, own_fs // divisor)
            sounds[path] = with_channels(np.asarray(sound, np.float32), 2)
        sound = sounds[path]
        count = min(round(rng.uniform(10.0, 30.0) * fs), missing, len(sound))
        start = int(rng.integers(len(sound) - count + 1))
        pieces.append(sound[start : start + count])
        missing -= count
    return np.concatenate(pieces)


def with_channels(x: Sound, channels: int) -> Sound:
    """Make mono of two channels, or repeat mono, so that there are as many as wanted."""
    if channels == 1:
        return np.asarray(x[:, :2].mean(axis=1, keepdims=True), np.float32)
    return np.repeat(x[:, :1], channels, axis=1) if x.shape[1] == 1 else x[:, :channels]


def _tune_in(heard: NDArray[np.float32], fs: int, rng: np.random.Generator) -> float:
    """Seconds from a random sample to the first superframe."""
    longest = int(LONGEST_TUNE_IN_S * fs)
    start = int(rng.integers(0, max(len(heard) - longest, 1)))
    receiver = AudioReceiver(fs, heard.shape[1])
    for i in range(start, min(start + longest, len(heard)), BLOCK):
        receiver.process(heard[i : i + BLOCK])
        if receiver.first_lock_s is not None:
            return receiver.first_lock_s
    return LONGEST_TUNE_IN_S


def evaluate_audio(
    clips: Sequence[Path],
    channels: Sequence[str],
    *,
    grade: float | None = None,
    starts: int = 8,
    limit_s: float | None = None,
    seed: int = 0,
    after_s: float = 0.0,
    progress: Callable[[AudioRow], None] = lambda row: None,
) -> list[AudioRow]:
    """Measure every clip through every channel.

    Parameters
    ----------
    clips : sequence of Path
        Sound files.
    channels : sequence of str
        NAME or PROFILE:NAME, names as in `cuecast.evaluate.sound_channels.CHANNELS`.
    grade : float, optional
        Objective difference grade that the embedder aims at, if not each profile's own.
    starts : int
        Random starts of reception per row.
    limit_s : float, optional
        Use only the first seconds of each clip.
    seed : int
        Of payloads, starts and unmarked sound.
    after_s : float
        Seconds of unmarked sound before each mark, of the other clips if there are others.
    progress : callable
        Gets each row as it is ready.

    Raises
    ------
    CueError
        If a clip cannot be used or a channel is unknown.
    """
    plan: dict[str, list[tuple[str, Channel]]] = {}
    for channel in channels:
        profile, _, name = channel.rpartition(":")
        find_profile(profile.partition("+")[0].partition("@")[0] or "standard")
        plan.setdefault(profile or "standard", []).append((name, find_channel(name)))
    rng, rows = np.random.default_rng(seed), []
    for path in clips:
        others = [other for other in clips if other != path] or [path]
        for profile, chosen in plan.items():
            marked = mark_clip(path, profile, grade, seed, limit_s=limit_s)
            for name, send in chosen:
                before = unmarked_sound(others, after_s, marked.fs, rng) if after_s else None
                rows.append(measure(marked, name, send, starts=starts, rng=rng, before=before))
                progress(rows[-1])
    return rows


def evaluate(options: EvaluateOptions) -> list[dict[str, Any]]:
    """Rows of `evaluate audio`: every clip of a folder through every channel.

    Raises
    ------
    CueError
        If a channel is unknown or the folder holds no sound.
    """
    clips = _sounds_of(options.clips) if options.clips else [_built_in(options.folder)]
    rows = evaluate_audio(
        clips,
        whole_channels(options.channels or USUAL, CHANNELS),
        starts=0 if options.after_s else 8,
        seed=options.seed,
        after_s=options.after_s,
        progress=lambda row: options.say(
            f"{row.clip} {row.profile}:{row.channel}: "
            f"{row.superframes_lost} of {row.superframes_sent} lost "
            f"at grade {row.odg:.2f}, advanced {row.odg_advanced:.2f}, "
            + ("never found" if row.found_s is None else f"found after {row.found_s:.1f} s")
        ),
    )
    sent = sum(row.superframes_sent for row in rows)
    wrong = sum(row.wrong for row in rows)
    options.say(f"{sent} superframes sent, {wrong} accepted wrong")
    return [asdict(row) for row in rows]


def _sounds_of(folder: Path) -> list[Path]:
    clips = sorted(path for path in folder.glob("*") if path.suffix.lower() in _SOUNDS)
    if not clips:
        raise CueError(f"{folder}: no sound files in it")
    return clips


def _built_in(folder: Path) -> Path:
    """Write the sound of the demonstration."""
    path = folder / "demonstration.flac"
    soundfile.write(path, make_sound()[0], FS)
    return path


def plot(results: list[dict[str, Any]], figure: Any) -> None:
    """Draw the share of lost superframes, a line for each channel, a dot for each clip."""
    draw_dots(
        figure,
        [
            Dot(
                f"{row['profile']}: {row['channel']}",
                row["clip"],
                100 * row["superframes_lost"] / max(row["superframes_sent"], 1),
                100 * row["lost_low"],
                100 * row["lost_high"],
            )
            for row in results
        ],
        xlabel="superframes lost, % (95 % intervals)",
    )
