"""A new film from pictures, samples and captions; the programme of a cuer's film."""

import heapq
import os
from collections.abc import Iterable, Iterator, Sequence
from fractions import Fraction
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from cuecast.media.encode import SoundEncoder, SoundTarget
from cuecast.media.output import open_output
from cuecast.media.subtitles import choose_track, player_s_of, read_track, text_tracks
from cuecast.media.x264 import repeatable_options
from receiver.media.programme import SoundFormat, open_programme
from receiver.media.sound import SoundDecoder, sound_blocks
from synth.language.subtitles.model import Subtitle
from synth.language.subtitles.read import Terms, read_subtitles

_LAYOUTS = {1: "mono", 2: "stereo", 3: "2.1", 4: "4.0", 5: "5.0", 6: "5.1", 7: "6.1", 8: "7.1"}

_BLOCK = 4096
"""Samples that are coded at once."""

_CLOCK = 1000
"""Ticks per second of the captions."""

_SHOWN = Terms(offset_s=0.0, everything=True)
"""Captions show all of the subtitles, credits and descriptions of sounds as well."""

Timed = tuple[float, list[Any]]
"""A time in seconds and the packets that are due."""


def write_film(
    path: str | os.PathLike[str],
    sound: NDArray[np.float32] | Iterable[NDArray[np.float32]] | None,
    fs: int = 0,
    *,
    encoder: str = "aac",
    bit_rate: int = 0,
    pictures: Iterable[NDArray[np.uint8]] = (),
    picture_rate: int = 25,
    picture_codec: str = "libx264",
    crf: int = 20,
    captions: Sequence[Subtitle] = (),
) -> None:
    """Write a sound file, or a film.

    Parameters
    ----------
    path : path
        Its suffix names the container.
    sound : ndarray of float32, shape (n, channels), or iterable of such blocks, optional
        Full scale is 1; 1 to 8 channels. Blocks are read as the film proceeds.
    fs : int
        Sampling rate in Hz.
    encoder : str
        FFmpeg's name of the sound encoder.
    bit_rate : int
        Of the sound, bit/s; 0 for a lossless encoder.
    pictures : iterable of ndarray of uint8, shape (height, width, 3)
        Red, green, blue; even height and width. None: the file has no picture.
    picture_rate : int
        Pictures per second.
    crf : int
        Constant quality of the pictures, as x264 counts it.
    captions : sequence of Subtitle
        Sorted by start, on the film's clock: a track of text, for MP4.

    Raises
    ------
    CueError
        If the container or the encoder refuses.
    """
    pending = iter(pictures)
    first = next(pending, None)
    blocks = iter(_cut(sound) if isinstance(sound, np.ndarray) else sound or ())
    opening = next(blocks, None)
    with open_output(path, _options(path)) as container:
        sources: list[Iterator[Timed]] = []
        if first is not None:
            picture: Any = container.add_stream(picture_codec, rate=picture_rate)
            picture.height, picture.width = first.shape[:2]
            picture.pix_fmt = "yuv420p"
            options = repeatable_options() if picture_codec == "libx264" else {}
            picture.options = {"crf": str(crf), "preset": "veryfast"} | options
            # One thread: the file is the same with every run.
            picture.codec_context.thread_count = 1
            sources.append(_pictures(picture, _with(first, pending), picture_rate))
        if opening is not None:
            form = SoundFormat(
                encoder, fs, opening.shape[1], _LAYOUTS[opening.shape[1]], "s16", bit_rate
            )
            sounding = SoundEncoder(container, form, SoundTarget(encoder, bit_rate))
            sounding.open()
            sources.append(_sound(sounding, _with(opening, blocks), fs))
        if captions:
            sources.append(_captions(container, captions))
        for _, packets in heapq.merge(*sources, key=lambda item: item[0]):
            container.mux(packets)


def _options(path: str | os.PathLike[str]) -> dict[str, str]:
    """Return the container's options: an MP4 begins with its tables, for progressive playback."""
    return {"movflags": "+faststart"} if os.fspath(path).lower().endswith(".mp4") else {}


def _with(first: Any, others: Iterator[Any]) -> Iterator[Any]:
    yield first
    yield from others


def _cut(sound: NDArray[np.float32]) -> Iterator[NDArray[np.float32]]:
    for start in range(0, max(1, len(sound)), _BLOCK):
        yield sound[start : start + _BLOCK]


def _pictures(stream: Any, pictures: Iterator[NDArray[np.uint8]], rate: int) -> Iterator[Timed]:
    shown = 0
    for shown, picture in enumerate(pictures):
        frame = av.VideoFrame.from_ndarray(picture, format="rgb24")
        frame.pts, frame.time_base = shown, Fraction(1, rate)
        yield shown / rate, list(stream.encode(frame))
    yield (shown + 1) / rate, list(stream.encode(None))


def _sound(
    encoder: SoundEncoder, blocks: Iterator[NDArray[np.float32]], fs: int
) -> Iterator[Timed]:
    samples = 0
    for block in blocks:
        yield samples / fs, list(encoder.process(block, 0.0))
        samples += len(block)
    yield samples / fs, list(encoder.flush())


def _captions(container: Any, captions: Sequence[Subtitle]) -> Iterator[Timed]:
    """Yield captions as packets of mov_text: two bytes of length, the text in UTF-8."""
    try:
        stream: Any = container.add_stream("mov_text")
    except (av.FFmpegError, ValueError) as error:
        raise CueError(f"{container.format.name} cannot hold captions: {error}") from error
    stream.codec_context.subtitle_header = _STYLES
    stream.metadata["language"] = "fra"
    starts = [round(one.start_s * _CLOCK) for one in captions]

    def packets() -> Iterator[Timed]:
        for one, start, after in zip(captions, starts, [*starts[1:], None], strict=True):
            end = round(one.end_s * _CLOCK)
            end = end if after is None else min(end, after)
            if end <= start:
                continue
            text = one.text.encode()
            packet = av.Packet(len(text).to_bytes(2, "big") + text)
            packet.stream, packet.time_base = stream, Fraction(1, _CLOCK)
            packet.pts = packet.dts = start
            packet.duration = end - start
            yield one.start_s, [packet]

    return packets()


_STYLES = b"""[Script Info]
ScriptType: v4.00+

[V4+ Styles]
Format: Name, Fontname, Fontsize, PrimaryColour, BackColour, Alignment
Style: Default,Arial,16,&Hffffff,&H0,2
"""
"""What FFmpeg needs to open its encoder of mov_text."""


def programme_sound(
    path: str | os.PathLike[str], start_s: float, duration_s: float
) -> tuple[Iterator[NDArray[np.float32]], int]:
    """Return blocks of a programme's sound within a time, and its rate in Hz; 0 if it has none.

    The blocks are read as they are taken. Before and after the programme there is silence.

    Parameters
    ----------
    path : path
    start_s, duration_s : float
        On the programme's clock.

    Raises
    ------
    CueError
        If it is not a programme, or its sound is damaged.
    """
    with open_programme(path) as programme:
        if programme.sound is None:
            return iter(()), 0
        form = programme.format
    return _within(path, start_s, duration_s), form.fs


def _within(
    path: str | os.PathLike[str], start_s: float, duration_s: float
) -> Iterator[NDArray[np.float32]]:
    with open_programme(path) as programme:
        decoder = SoundDecoder(programme, strict=False)
        wanted, given, at = 0, 0, None
        for block in sound_blocks(decoder, programme):
            fs, channels = decoder.format.fs, block.shape[1]
            wanted = round(duration_s * fs)
            if at is None:
                at = round(((decoder.start_s or 0.0) - start_s) * fs)
                for silent in _silence(min(max(0, at), wanted), channels):
                    yield silent
                    given += len(silent)
            kept = block[max(0, -at) : max(0, wanted - at)]
            at += len(block)
            if len(kept):
                yield kept
                given += len(kept)
            if at >= wanted:
                return
        if at is not None:
            yield from _silence(wanted - given, decoder.format.channels)


def _silence(samples: int, channels: int) -> Iterator[NDArray[np.float32]]:
    for start in range(0, samples, _BLOCK):
        yield np.zeros((min(_BLOCK, samples - start), channels), np.float32)


def captions_of(
    programme: str | os.PathLike[str] | None,
    subtitles: str | os.PathLike[str] | None,
    track: str | None,
    start_s: float,
    duration_s: float,
) -> list[Subtitle]:
    """Return the captions of a film: of a file, or of a track of the programme, if it has one.

    Parameters
    ----------
    programme, subtitles : path, optional
    track : str, optional
        Number or language of the programme's track; the French one by default.
    start_s, duration_s : float
        What the film shows of the programme's clock; captions get the film's.

    Raises
    ------
    CueError
        If a file or track that was asked for cannot be read.
    """
    if subtitles is not None:
        player_s = 0.0 if programme is None else player_s_of(programme)
        found = read_subtitles(os.fspath(subtitles), player_s=player_s, terms=_SHOWN)
    elif programme is not None and (track is not None or _has_text(programme)):
        chosen = choose_track(text_tracks(programme), track, os.fspath(programme))
        found = read_track(programme, chosen, terms=_SHOWN)
    else:
        return []
    end_s = start_s + duration_s
    return [
        Subtitle(max(0.0, one.start_s - start_s), min(one.end_s, end_s) - start_s, one.text)
        for one in found
        if one.start_s < end_s and one.end_s > start_s and one.text
    ]


def _has_text(programme: str | os.PathLike[str]) -> bool:
    return any(one.readable for one in text_tracks(programme))
