"""Open marks for pictures and Cuecast's on the same films: how many bits are wrong after coding.

    pip install --no-deps invisible-watermark blind-watermark pywavelets opencv-python-headless
    pip install --no-deps blind-video-watermark dtcwt six tqdm
    python -m tests.bench.picture_peers FILM ... --record FILE

Of a peer each of 16 frames bears the same 160 bits, as many as L0 of a superframe, and the majority
of 16 frames decides; of Cuecast, that is 16 frames of 25 a second, all bits of a superframe's L0
count as wrong if it is lost. `blind-video-watermark`, made for films, hides one of a few patterns
in the colour: here the signs of 160 blocks of one pattern are the bits. Films are made smaller to
640 x 360. What needs torch (`rivaGan`, 32 bits) is left out. Channels are those of
`cuecast evaluate video`.
"""

import argparse
import importlib
import json
import sys
import tempfile
import types
from collections.abc import Callable, Iterator
from contextlib import redirect_stdout
from functools import partial
from io import StringIO
from itertools import chain
from pathlib import Path
from typing import Any

import av
import numpy as np

from cuecast.evaluate.picture_channels import compare, find_channel, send, vmaf
from cuecast.evaluate.records import make_record
from cuecast.evaluate.video import evaluate_video
from receiver.media.picture import picture_format

WIDTH, HEIGHT, FRAMES, BITS = 640, 360, 16, 160
OWN_FRAMES = 8 * FRAMES + 2
"""Of Cuecast: eight superframes, and the cross-fade at the end of the last."""

Peer = tuple[Callable[[Any], Any], Callable[[Any], Any]]


def main() -> None:
    """Print a row for each film, mark and channel."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("films", type=Path, nargs="+")
    parser.add_argument("--channels", default="none,h264-2M,mpeg2-4M,hqdn3d-h264-2M")
    parser.add_argument("--record", type=Path)
    options = parser.parse_args()
    channels = options.channels.split(",")
    bits = np.random.default_rng(0).integers(0, 2, BITS)
    marks = dict(peers(bits))
    rows = []
    for film in options.films:
        with av.open(str(film)) as container:
            shown = zip(container.decode(video=0), range(OWN_FRAMES), strict=False)
            frames = [f.reformat(WIDTH, HEIGHT, format="bgr24").to_ndarray() for f, _ in shown]
        for row in chain(
            own_rows(frames, channels), peer_rows(frames[:FRAMES], channels, marks, bits)
        ):
            rows.append({"clip": film.stem, **row})
            print(", ".join(f"{name} {value}" for name, value in rows[-1].items()), flush=True)
    if options.record:
        document = make_record("picture_peers", (), rows, seed=0, clips=options.films[0].parent)
        document["command"] = (
            f"python -m tests.bench.picture_peers CLIPS --channels {options.channels} --record FILE"
        )
        options.record.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


def own_rows(frames: list[Any], channels: list[str]) -> Iterator[dict[str, Any]]:
    """Yield what arrives of a film marked as `dub` marks it."""
    with tempfile.TemporaryDirectory() as folder:
        path = write_film(Path(folder) / "film.mkv", frames)
        for row in evaluate_video([path], channels, starts=1):
            yield {
                "mark": "cuecast", "channel": row.channel, "psnr_db": round(row.psnr_db, 1),
                "vmaf": row.vmaf and round(row.vmaf, 1),
                "wrong": BITS * row.l0_lost, "bits": BITS * row.superframes_sent,
            }  # fmt: skip


def peer_rows(
    frames: list[Any], channels: list[str], marks: dict[str, Peer], bits: Any
) -> Iterator[dict[str, Any]]:
    """Yield what arrives of the bits that peers write into these frames."""
    for name, (write, read) in marks.items():
        marked = [np.clip(write(frame.copy()), 0, 255).astype(np.uint8) for frame in frames]
        with tempfile.TemporaryDirectory() as folder:
            original = write_film(Path(folder) / "original.mkv", frames)
            film = write_film(Path(folder) / "film.mkv", marked)
            psnr_db, score = compare(original, film, 8).psnr_db, vmaf(original, film)
        for channel in channels:
            found = np.array([read(frame) for frame in through(marked, channel)])
            yield {
                "mark": name, "channel": channel, "psnr_db": round(psnr_db, 1),
                "vmaf": score and round(score, 1),
                "frame_error": round(float((found != bits).mean()), 3),
                "wrong": int(((found.mean(axis=0) > 0.5) != bits).sum()), "bits": BITS,
            }  # fmt: skip


def write_film(path: Path, frames: list[Any]) -> Path:
    """Write frames without loss but for their colour, and return the path."""
    with av.open(str(path), "w") as container:
        stream: Any = container.add_stream("ffv1", rate=25)
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        for frame in frames:
            shown = av.VideoFrame.from_ndarray(frame, format="bgr24")
            container.mux(stream.encode(shown.reformat(format="yuv420p")))
        container.mux(stream.encode(None))
    return path


def through(frames: list[Any], channel: str) -> Iterator[Any]:
    """Yield the frames that arrive."""
    with tempfile.TemporaryDirectory() as folder:
        path = write_film(Path(folder) / "marked.mkv", frames)
        arrived = send(path, picture_format(path), find_channel(channel))
        with av.open(str(arrived)) as container:
            for frame in container.decode(video=0):
                yield frame.to_ndarray(format="bgr24")


def _decoded(decoder: Any, method: str, frame: Any) -> Any:
    return np.array(decoder.decode(frame, method)).astype(int)


def peers(bits: Any) -> Iterator[tuple[str, Peer]]:
    """Yield the names of marks, how they write these bits into a picture, and how they read."""
    yield "blind-video-watermark", _video_peer(bits)  # before scipy could see the torch below
    for absent in ("torch", "onnxruntime"):
        sys.modules.setdefault(absent, types.ModuleType(absent))
    image = importlib.import_module("imwatermark")
    for method in ("dwtDct", "dwtDctSvd"):
        encoder, decoder = image.WatermarkEncoder(), image.WatermarkDecoder("bits", BITS)
        encoder.set_watermark("bits", bits.tolist())
        yield (
            f"invisible-watermark {method}",
            (partial(encoder.encode, method=method), partial(_decoded, decoder, method)),
        )
    blind = importlib.import_module("blind_watermark")
    blind.bw_notes.close()

    def write(frame: Any) -> Any:
        mark = blind.WaterMark(password_img=1, password_wm=1)
        mark.read_img(img=frame)
        mark.read_wm(bits.astype(bool).tolist(), mode="bit")
        return mark.embed()

    def read(frame: Any) -> Any:
        mark = blind.WaterMark(password_img=1, password_wm=1)
        with redirect_stdout(StringIO()):
            return np.array(mark.extract(embed_img=frame, wm_shape=BITS, mode="bit")) > 0.5

    yield "blind-watermark", (write, read)


def _video_peer(bits: Any) -> Peer:
    """Return how `blind-video-watermark` writes and reads; bits are signs of 10 by 16 blocks."""
    cv2 = importlib.import_module("cv2")
    # Names of numpy 1, for which it was written.
    for name, now in (("asfarray", np.asarray), ("issubsctype", np.issubdtype)):
        setattr(np, name, now)
    key = importlib.import_module("blind_video_watermark.dtcwt_key")
    older = types.SimpleNamespace(**vars(np))
    older.zeros = lambda shape, dtype=float: np.zeros(
        shape, complex if dtype == "complex_" else dtype
    )
    vars(key)["np"] = older
    encoder, decoder = key.DtcwtKeyEncoder(), key.DtcwtKeyDecoder()
    pattern = key.generate_wm(1, encoder.infer_wm_shape((HEIGHT, WIDTH)))
    rows, columns = (
        np.arange(n) * parts // n for n, parts in zip(pattern.shape, (10, 16), strict=True)
    )
    block = rows[:, None] * 16 + columns
    encoder.wm = pattern * (1.0 - 2.0 * bits[block])

    def write(frame: Any) -> Any:
        marked = encoder.encode(cv2.cvtColor(frame.astype(np.float32), cv2.COLOR_BGR2YUV))
        return cv2.cvtColor(marked, cv2.COLOR_YUV2BGR)

    def read(frame: Any) -> Any:
        found = decoder.decode(cv2.cvtColor(frame.astype(np.float32), cv2.COLOR_BGR2YUV))
        return np.bincount(block.ravel(), (found * pattern).ravel()) < 0

    return write, read


if __name__ == "__main__":
    main()
