"""Compile everything that is compiled on first use, once, so that no work waits for it.

The compiled kernels lie beside the program, or in the folder NUMBA_CACHE_DIR, which the workers of
a batch and the processes of a playout may share.
"""

import argparse
import os
import tempfile
import time
from pathlib import Path

from cuecast.command.progress import note

SUMMARY = "compile the kernels, once for all processes"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "--carriers", choices=("audio", "all"), default="audio", help="audio by default"
    )


def run(args: argparse.Namespace) -> int:
    """Dub a short programme and receive it."""
    from itertools import islice

    from cuecast.command.cli import build_parser
    from cuecast.demo.content import FS, PICTURE_RATE, make_pictures, make_sound
    from cuecast.demo.run import as_srt
    from cuecast.dubbing.job import job_of, run_job
    from cuecast.media.film import write_film

    began_s = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="cuecast-warm-") as folder:
        source, text = Path(folder) / "a.mkv", Path(folder) / "a.srt"
        sound, subtitles = make_sound()
        pictures = make_pictures(4) if args.carriers == "all" else iter(())
        write_film(
            source, sound[: 4 * FS], FS, encoder="flac", pictures=islice(pictures, 4 * PICTURE_RATE)
        )
        text.write_text(as_srt(subtitles[:1]), encoding="utf-8")
        carriers = "audio,video,a335" if args.carriers == "all" else "audio"
        told = build_parser().parse_args(
            ["dub", str(source), "--subtitles", str(text), "-o", str(Path(folder) / "b.mkv"),
             "--carriers", carriers]
        )  # fmt: skip
        run_job(job_of(told))
    place = os.environ.get("NUMBA_CACHE_DIR", "beside the program")
    note(f"warm after {time.monotonic() - began_s:.1f} s, kernels {place}")
    return 0
