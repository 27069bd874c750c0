"""Open image marks on a film: how many of 160 bits are wrong after coding, frame by frame.

    pip install --no-deps invisible-watermark blind-watermark pywavelets opencv-python-headless
    python -m tests.bench.picture_peers FILM

Both are made for pictures: each of 16 frames bears the same 160 bits, as many as L0 of a
superframe, and the majority of 16 frames decides. FILM is made smaller to 640 x 360. What needs
torch (`rivaGan`, 32 bits) is left out. Channels are those of `cuecast evaluate video`.
"""

import argparse
import importlib
import sys
import tempfile
import types
from collections.abc import Callable, Iterator
from contextlib import redirect_stdout
from functools import partial
from io import StringIO
from pathlib import Path
from typing import Any

import av
import numpy as np

from cuecast.evaluate.picture_channels import find_channel, send
from receiver.media.picture import picture_format

WIDTH, HEIGHT, FRAMES, BITS = 640, 360, 16, 160
Peer = tuple[Callable[[Any], Any], Callable[[Any], Any]]


def main() -> None:
    """Print a line for each peer and channel."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("film", type=Path)
    parser.add_argument("--channels", default="none,h264-2M,mpeg2-4M,hqdn3d-h264-2M")
    options = parser.parse_args()
    with av.open(str(options.film)) as container:
        frames = [
            frame.reformat(WIDTH, HEIGHT, format="bgr24").to_ndarray()
            for frame, _ in zip(container.decode(video=0), range(FRAMES), strict=False)
        ]
    bits = np.random.default_rng(0).integers(0, 2, BITS)
    for name, (write, read) in peers(bits):
        marked = [np.clip(write(frame.copy()), 0, 255).astype(np.uint8) for frame in frames]
        error = np.mean([(m.astype(float) - f) ** 2 for m, f in zip(marked, frames, strict=True)])
        psnr_db = 10 * np.log10(255**2 / error)
        for channel in options.channels.split(","):
            found = np.array([read(frame) for frame in through(marked, channel)])
            single = float((found != bits).mean())
            together = int(((found.mean(axis=0) > 0.5) != bits).sum())
            print(
                f"{name:29s} {psnr_db:5.1f} dB  {channel:16s} wrong in a frame {single:.3f}, "
                f"by the majority of {FRAMES} {together} of {BITS}",
                flush=True,
            )


def through(frames: list[Any], channel: str) -> Iterator[Any]:
    """Yield the frames that arrive."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "marked.mkv"
        with av.open(str(path), "w") as container:
            stream: Any = container.add_stream("ffv1", rate=25)
            stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
            for frame in frames:
                shown = av.VideoFrame.from_ndarray(frame, format="bgr24")
                container.mux(stream.encode(shown.reformat(format="yuv420p")))
            container.mux(stream.encode(None))
        arrived = send(path, picture_format(path), find_channel(channel))
        with av.open(str(arrived)) as container:
            for frame in container.decode(video=0):
                yield frame.to_ndarray(format="bgr24")


def _decoded(decoder: Any, method: str, frame: Any) -> Any:
    return np.array(decoder.decode(frame, method)).astype(int)


def peers(bits: Any) -> Iterator[tuple[str, Peer]]:
    """Yield the names of marks, how they write these bits into a picture, and how they read."""
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


if __name__ == "__main__":
    main()
