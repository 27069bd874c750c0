"""A page to check the segmentation of an utterance by eye, and to correct it.

Points, sound, probabilities of shapes and placements, and the tiers of phones and keys stand on
one clock. Borders can be moved, labels changed, and saved as a TextGrid that takes the place
of the one beside the recording. The page is one file and needs no server. It stands for the
manual check in Gibert, Bailly, Elisei 2004, section 4.
"""

import base64
import io
import json
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import soundfile
from numpy.typing import NDArray

from codec.analysis.recognise import Recogniser
from codec.cuer import layout
from codec.cues.phonology import PHONES
from codec.cues.score import PLACEMENTS, SHAPES
from codec.files.whole import whole_file
from cuecast.evaluate.models_fits import ModelFit
from cuecast.evaluate.takes import EvaluatedTake

_POINTS_HZ = 60.0
"""Frames per second that the page shows."""

_COLUMNS = 1500
"""Columns of the picture of the sound."""

_MARGIN_MM = 15.0
"""Margin in mm around the points."""

_TENTHS_LIMIT = 32767
"""Largest whole number of tenths of a millimetre: that of 16 bits."""


def write_page(
    path: Path, data: str, take: EvaluatedTake, fit: ModelFit, recogniser: Recogniser
) -> None:
    """Write the page of one utterance.

    Parameters
    ----------
    path : Path
        Of the HTML file.
    data : str
        Source of the utterance, for the title.
    take : EvaluatedTake
    fit : ModelFit
        The models' fit.
    recogniser : Recogniser
    """
    document = _document(take, fit, recogniser) | {"title": f"{take.name} ({data})"}
    template = (files("cuecast.evaluate") / "segmentation.html").read_text(encoding="utf-8")
    # A label must not be able to end the script element that holds it.
    text = json.dumps(document, ensure_ascii=False).replace("<", "\\u003c")
    with whole_file(path) as temporary:
        temporary.write_text(template.replace("__DATA__", text), encoding="utf-8")


def _document(take: EvaluatedTake, fit: ModelFit, recogniser: Recogniser) -> dict[str, Any]:
    step = max(1, round(take.rate_hz / _POINTS_HZ))
    shape = recogniser.shape_posteriors(fit.markers)
    placement = recogniser.placement_posteriors(fit.markers, shape.argmax(1))
    seen = np.asarray(np.isfinite(take.observed).all(-1))
    shown = np.where(seen[..., None], take.observed, fit.markers)[::step]
    shown[:, layout.N_FACE :] = fit.recovered[::step]
    low, high = shown.min((0, 1)) - _MARGIN_MM, shown.max((0, 1)) + _MARGIN_MM
    duration_s = len(seen) / take.rate_hz
    phones = [(p.start, p.end, p.symbol) for p in take.score.phones]
    keys = [(k.start, k.end, " ".join([str(k), *k.phones])) for k in take.score.keys]
    tenths = np.clip(np.round(10 * shown), -_TENTHS_LIMIT, _TENTHS_LIMIT)
    return {
        "name": Path(take.name).name,
        "rate": take.rate_hz / step,
        "duration": duration_s,
        "frames": len(shown),
        "markers": shown.shape[1],
        "box": [float(v) for v in (low[0], low[1], high[0], high[1])],
        "points": _packed(tenths.astype("<i2")),
        "hidden": _packed((~seen[::step]).astype(np.uint8)),
        "shape": _packed(np.round(255 * shape[::step]).astype(np.uint8)),
        "placement": _packed(np.round(255 * placement[::step]).astype(np.uint8)),
        "shapes": [str(s) for s in SHAPES],
        "placements": list(PLACEMENTS),
        "phones": list(PHONES),
        "tiers": {"phones": _filled(phones, duration_s), "keys": _filled(keys, duration_s)},
        "sound": _sound(take),
        "wave": _wave(take, duration_s),
    }


def _packed(array: NDArray[Any]) -> str:
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode("ascii")


def _filled(
    intervals: list[tuple[float, float, str]], duration_s: float
) -> list[list[float | str]]:
    """Return the intervals with empty ones in their gaps."""
    out: list[list[float | str]] = []
    at = 0.0
    for start, end, text in intervals:
        if start > at + 1e-6:
            out.append([at, start, ""])
        out.append([start, end, text])
        at = end
    if at < duration_s - 1e-6:
        out.append([at, duration_s, ""])
    return out


def _sound(take: EvaluatedTake) -> str | None:
    """Return the sound as a data address that a browser plays."""
    if take.sound is None:
        return None
    file = io.BytesIO()
    soundfile.write(file, take.sound, take.fs, format="WAV", subtype="PCM_16")
    return "data:audio/wav;base64," + base64.b64encode(file.getvalue()).decode("ascii")


def _wave(take: EvaluatedTake, duration_s: float) -> str | None:
    """Return least and greatest value of each column of the drawn sound, full scale 127."""
    if take.sound is None:
        return None
    mono = take.sound if take.sound.ndim == 1 else take.sound.mean(1)
    padded = np.zeros(max(round(duration_s * take.fs), _COLUMNS), dtype=np.float64)
    padded[: min(len(mono), len(padded))] = mono[: len(padded)]
    cuts = np.linspace(0, len(padded), _COLUMNS + 1).astype(int)[:-1]
    peak = max(float(np.abs(padded).max()), 1e-9)
    edges = np.stack([np.minimum.reduceat(padded, cuts), np.maximum.reduceat(padded, cuts)], 1)
    return _packed(np.round(127 * edges / peak).astype(np.int8))
