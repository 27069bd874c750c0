"""Compilation of everything that is compiled on first use: a short programme is dubbed for that."""

import os
import tempfile
from itertools import islice
from pathlib import Path


def warm_kernels(carriers: str = "audio") -> str:
    """Dub a short programme and receive it.

    Parameters
    ----------
    carriers : str
        ``audio``, or ``audio,video,a335``.

    Returns
    -------
    str
        Where the compiled kernels are kept.
    """
    from cuecast.command.cache import VARIABLE
    from cuecast.command.cli import build_parser
    from cuecast.demo.content import FS, PICTURE_RATE, make_pictures, make_sound
    from cuecast.demo.run import as_srt
    from cuecast.dubbing.job import job_of, run_job
    from cuecast.media.film import write_film

    with tempfile.TemporaryDirectory(prefix="cuecast-warm-") as folder:
        source, text = Path(folder) / "a.mkv", Path(folder) / "a.srt"
        sound, subtitles = make_sound()
        pictures = make_pictures(4) if carriers != "audio" else iter(())
        write_film(
            source, sound[: 4 * FS], FS, encoder="flac", pictures=islice(pictures, 4 * PICTURE_RATE)
        )
        text.write_text(as_srt(subtitles[:1]), encoding="utf-8")
        told = build_parser().parse_args(
            ["dub", str(source), "--subtitles", str(text), "-o", str(Path(folder) / "b.mkv"),
             "--carriers", carriers]
        )  # fmt: skip
        run_job(job_of(told))
    return os.environ.get(VARIABLE, "beside the program")
