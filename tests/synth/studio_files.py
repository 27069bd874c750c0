"""Files as laboratories write them, of takes of the virtual cuer."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from codec.cuer.layout import MARKERS
from codec.cues.score import Key, Phone, Score
from synth.motion.rules.gesture import GestureSynthesiser
from synth.planning.scoring.text_score import score_of_text
from synth.studio.studio import Studio
from synth.studio.take import StudioTake, record

TEXT = "Bonsoir, le petit chat."
RATE_HZ = 60.0


def score() -> Score:
    """Return some syllables, spoken as slowly as cuers speak."""
    quick = score_of_text(TEXT, start_s=0.35)
    slow = 1.5
    return Score(
        tuple(Phone(p.symbol, slow * p.start, slow * p.end) for p in quick.phones),
        tuple(
            Key(slow * k.start, slow * k.end, k.phones, k.shape, k.placement) for k in quick.keys
        ),
    )


def take(identity: str, *, swaps: float = 0.0, ghosts: float = 0.0, seed: int = 5) -> StudioTake:
    """Return a take before twelve cameras."""
    cuer = GestureSynthesiser(identity, rate_hz=RATE_HZ, seed=seed)
    return record(cuer, score(), studio=Studio(swaps_per_s=swaps, ghosts_per_s=ghosts), seed=seed)


def trc(
    markers: NDArray[np.floating],
    labels: tuple[str, ...] = MARKERS,
    *,
    unit: str = "mm",
    rate_hz: float = RATE_HZ,
) -> str:
    """Return a TRC file; hidden markers are empty fields."""
    lines = [
        "PathFileType\t4\t(X/Y/Z)\ttake.trc",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame"
        "\tOrigNumFrames",
        f"{rate_hz}\t{rate_hz}\t{len(markers)}\t{len(labels)}\t{unit}\t{rate_hz}\t1\t{len(markers)}",
        "Frame#\tTime\t" + "\t\t\t".join(labels) + "\t\t",
        "\t\t" + "\t".join(f"{a}{i + 1}" for i in range(len(labels)) for a in "XYZ"),
        "",
    ]
    for number, frame in enumerate(markers):
        fields = ["" if np.isnan(v) else f"{v:.5f}" for v in frame.ravel()]
        lines.append(f"{number + 1}\t{number / rate_hz:.6f}\t" + "\t".join(fields))
    return "\n".join(lines) + "\n"


def tsv(markers: NDArray[np.floating], labels: tuple[str, ...] = MARKERS, *, lead: int = 0) -> str:
    """Return a TSV as Qualisys Track Manager writes it; hidden markers are zeros."""
    lines = [
        f"NO_OF_FRAMES\t{len(markers)}", "NO_OF_CAMERAS\t12", f"NO_OF_MARKERS\t{len(labels)}",
        f"FREQUENCY\t{RATE_HZ:g}", "NO_OF_ANALOG\t0", "ANALOG_FREQUENCY\t0", "DESCRIPTION\t--",
        "TIME_STAMP\t2021-02-03, 10:11:12.123\t12345.678", "DATA_INCLUDED\t3D",
        "MARKER_NAMES\t" + "\t".join(labels),
    ]  # fmt: skip
    if lead:
        titles = ["Frame", "Time"][:lead]
        lines.append("\t".join([*titles, *(f"{n} {a}" for n in labels for a in "XYZ")]))
    for number, frame in enumerate(np.nan_to_num(markers)):
        first = [f"{number + 1}", f"{number / RATE_HZ:.5f}"][:lead]
        lines.append("\t".join([*first, *(f"{v:.3f}" for v in frame.ravel())]))
    return "\r\n".join(lines) + "\r\n"


def write_foreign_c3d(
    path: Path,
    markers: NDArray[np.floating],
    labels: list[str],
    *,
    unit: str = "mm",
    rate_hz: float = RATE_HZ,
) -> None:
    """Write a C3D file by ezc3d, hidden points as the origin."""
    import ezc3d

    c3d = ezc3d.c3d()
    points = np.ones((4, markers.shape[1], len(markers)))
    points[:3] = np.nan_to_num(markers).transpose(2, 1, 0)
    c3d["parameters"]["POINT"]["LABELS"]["value"] = labels
    c3d["parameters"]["POINT"]["UNITS"]["value"] = [unit]
    c3d["parameters"]["POINT"]["RATE"]["value"] = [rate_hz]
    c3d["parameters"]["ANALOG"]["LABELS"]["value"] = ["microphone"]
    c3d["parameters"]["ANALOG"]["RATE"]["value"] = [4 * rate_hz]
    c3d["data"]["points"] = points
    c3d["data"]["analogs"] = np.zeros((1, 1, 4 * len(markers)))
    c3d.write(str(path))
