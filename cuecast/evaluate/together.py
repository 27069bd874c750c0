"""Sound and picture together: what each alone loses, and what both lose, as channels get worse.

Rows: clip, channel, net_bps, superframes_sent, lost_sound, lost_picture, lost_together (shares of
the superframes sent), recovered (those that neither had alone), psnr_db, snr_db. A channel is
called ``PICTURE+SOUND``: ``h264-400k+aac-64k-12dB`` codes the picture with H.264 at 400 kbit/s and
the sound, with white noise 12 dB below it, with AAC at 64 kbit/s.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from codec.cuer.voice import Voice, load_voice
from codec.errors import CueError
from cuecast.demo.content import FS, PICTURE_RATE, make_pictures, make_sound
from cuecast.dubbing.dub import DubOptions, dub
from cuecast.dubbing.motions import SynthesisedMotion
from cuecast.dubbing.receive import receive
from cuecast.evaluate.drawing import Dot, draw_dots
from cuecast.evaluate.options import EvaluateOptions
from cuecast.evaluate.video import films_of
from cuecast.media.film import write_film
from cuecast.media.picture import rewrite_picture
from cuecast.media.rewrite import Unchanged, rewrite_sound
from receiver.media.picture import PictureDecoder
from receiver.media.programme import has_stream, open_programme
from synth.planning.scoring.text_score import score_of_subtitles
from watermark.link.superframe import SUPERFRAME_S

LENGTH_S = 60.0
"""Shorter clips are shown forwards and backwards until there is so much of them."""

USUAL = ("h264-4M+aac-128k", "h264-300k+aac-96k-14dB")

_PICTURES = {"h264": "libx264", "hevc": "libx265", "mpeg2": "mpeg2video", "av1": "libsvtav1"}
_SOUNDS = {"aac": "aac", "mp2": "mp2", "ac3": "ac3"}
_NAME = re.compile(r"(\w+)-(\d+)([kM])\+(\w+)-(\d+)k(?:-(\d+)dB)?")


@dataclass(frozen=True, slots=True)
class Together:
    """A channel: encoders, bits per second, signal to noise in the sound (None: no noise)."""

    picture: str
    picture_bps: int
    sound: str
    sound_bps: int
    snr_db: int | None

    @classmethod
    def named(cls, name: str) -> "Together":
        """Return the channel of that name.

        Raises
        ------
        CueError
            If the name says something else.

        Examples
        --------
        >>> Together.named("hevc-1M+mp2-192k").picture_bps
        1000000
        """
        found = _NAME.fullmatch(name)
        if found is None or found[1] not in _PICTURES or found[4] not in _SOUNDS:
            raise CueError(f"no channel called {name!r}: say it as h264-400k+aac-64k-12dB")
        picture_bps = int(found[2]) * (1000 if found[3] == "k" else 1_000_000)
        snr_db = None if found[6] is None else int(found[6])
        return cls(
            _PICTURES[found[1]], picture_bps, _SOUNDS[found[4]], 1000 * int(found[5]), snr_db
        )


def evaluate(options: EvaluateOptions) -> list[dict[str, Any]]:
    """Dub clips in sound and picture, send them through channels, receive with one or both.

    Clips without sound get that of the demonstration.

    Raises
    ------
    CueError
        If a channel is unknown, the folder holds no films, or a clip is unusable.
    """
    channels = {name: Together.named(name) for name in options.channels or USUAL}
    voice = load_voice()
    rows = []
    for clip in films_of(options.clips) if options.clips else [_built_in(options.folder)]:
        programme = options.folder / "programme.mkv"
        _lengthened(clip, programme)
        dubbed, report = _dubbed(programme, voice, options)
        for name, channel in channels.items():
            row = {"clip": clip.stem, "channel": name, **_row(dubbed, channel, voice, options)}
            row["net_bps"] = report["carriers"]["video"]["net_bps"]
            row["psnr_db"] = report["carriers"]["video"]["psnr_db"]
            row["snr_db"] = report["carriers"]["audio"]["snr_db"]
            rows.append(row)
            options.say(
                f"{clip.stem} {name}: lost {row['lost_sound']:.1%} by the sound alone, "
                f"{row['lost_picture']:.1%} by the picture, {row['lost_together']:.1%} by both"
            )
    return rows


def plot(results: list[dict[str, Any]], figure: Any) -> None:
    """Draw losses of sound, picture and both, a line for each clip and channel."""
    draw_dots(
        figure,
        [
            Dot(f"{row['clip']}: {row['channel']}", kind, 100 * row[f"lost_{kind}"])
            for row in results
            for kind in ("sound", "picture", "together")
        ],
        xlabel="superframes lost, %",
    )


def _built_in(folder: Path) -> Path:
    path = folder / "demonstration.mkv"
    sound, _ = make_sound()
    seconds = len(sound) / FS
    pictures = make_pictures(seconds)
    write_film(path, sound, FS, encoder="flac", pictures=pictures, picture_rate=PICTURE_RATE)
    return path


def _dubbed(programme: Path, voice: Voice, options: EvaluateOptions) -> tuple[Path, dict[str, Any]]:
    target = options.folder / "dubbed.mkv"
    _, subtitles = make_sound()
    score = score_of_subtitles(subtitles, warn=lambda line: None)
    choice = DubOptions(
        carriers=("audio", "video"), audio_codec="flac", video_codec="ffv1", graded=False
    )
    source = SynthesisedMotion(score, voice, seed=options.seed)
    return target, dub(programme, source, voice, target, choice)


def _row(dubbed: Path, channel: Together, voice: Voice, options: EvaluateOptions) -> dict[str, Any]:
    """Code the dubbed programme and receive it by sound, by picture and by both."""
    shown, coded = options.folder / "shown.mkv", options.folder / "coded.mkv"
    rewrite_picture(
        dubbed, shown, lambda form: [], codec=channel.picture, bit_rate=channel.picture_bps
    )
    noise = Unchanged() if channel.snr_db is None else _Noise(channel.snr_db, options.seed)
    rewrite_sound(shown, coded, lambda *_: noise, codec=channel.sound, bit_rate=channel.sound_bps)
    received, recovered, sent = {}, 0, 0
    for kind, listen, look in (
        ("sound", True, False),
        ("picture", False, True),
        ("together", True, True),
    ):
        summary = receive(coded, voice, keep_motion=False, listen=listen, look=look).summary
        sent = max(sent, int(summary["duration_s"] / SUPERFRAME_S - 0.1))
        received[f"lost_{kind}"] = summary["superframes"]["received"]
        recovered = summary["recovered_together"]
    shares = {kind: round(max(0.0, 1 - count / sent), 4) for kind, count in received.items()}
    return {"superframes_sent": sent, **shares, "recovered": recovered}


class _Noise:
    """White noise, `snr_db` below each block of the sound, as a stage."""

    def __init__(self, snr_db: float, seed: int) -> None:
        self._gain = 10 ** (-snr_db / 20)
        self._rng = np.random.default_rng(seed)

    def process(self, block: NDArray[np.float32]) -> NDArray[np.float32]:
        """Add noise to samples (n, channels)."""
        rms = float(np.sqrt(np.mean(np.square(block, dtype=np.float64)))) if len(block) else 0.0
        noise = self._rng.normal(0, 1, block.shape) * rms * self._gain
        return np.asarray(np.clip(block + noise, -1, 1), dtype=np.float32)

    def flush(self) -> NDArray[np.float32]:
        """Give nothing: no sample is held back."""
        return np.zeros((0, 1), np.float32)


def _lengthened(clip: Path, target: Path) -> None:
    """Write `LENGTH_S` of a clip, to and fro, with its sound repeated or the demonstration's."""
    sound, fs = _sound_of(clip)
    with av.open(str(target), "w") as output, open_programme(clip) as programme:
        decoder = PictureDecoder(programme)
        form = decoder.format
        picture: Any = output.add_stream("libx264", rate=form.fps)
        picture.width, picture.height, picture.pix_fmt = form.width, form.height, "yuv420p"
        picture.options = {"preset": "ultrafast", "crf": "12"}
        heard: Any = output.add_stream("flac", rate=fs)
        heard.layout = "stereo"
        words = np.resize(np.round(32767 * sound).astype(np.int16), (round(LENGTH_S * fs), 2))
        given = 0
        for number, frame in enumerate(_to_and_fro(decoder, programme, round(LENGTH_S * form.fps))):
            due = min(round((number + 1) / form.fps * fs), len(words))
            block = av.AudioFrame.from_ndarray(
                words[given:due].reshape(1, -1), format="s16", layout="stereo"
            )
            block.sample_rate, block.pts, block.time_base = fs, given, Fraction(1, fs)
            output.mux(heard.encode(block))
            given = due
            shown = frame.reformat(format="yuv420p")
            shown.pts, shown.time_base = number, 1 / form.fps
            shown.pict_type = 0
            output.mux(picture.encode(shown))
        output.mux(picture.encode(None))
        output.mux(heard.encode(None))


def _to_and_fro(decoder: PictureDecoder, programme: Any, count: int) -> Iterator[Any]:
    """Yield `count` frames of a clip, whose first ten seconds are kept."""
    kept: list[Any] = []
    for packet in programme.packets():
        if packet.stream is programme.picture and len(kept) < min(count, 250):
            kept += [frame for _, frame in decoder.process(packet)]
    if not kept:
        raise CueError(f"{programme.name}: its picture is empty")
    period = max(1, 2 * len(kept) - 2)
    for number in range(count):
        place = number % period
        yield kept[min(place, period - place)]


def _sound_of(clip: Path) -> tuple[NDArray[np.float32], int]:
    from receiver.media.sound import read_sound

    if not has_stream(clip, "audio"):
        return make_sound()[0], FS
    sound, fs = read_sound(clip)
    return np.repeat(sound[:, :1], 2, axis=1) if sound.shape[1] != 2 else sound, fs
