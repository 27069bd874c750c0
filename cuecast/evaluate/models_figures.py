"""Tables and pictures of the models' evaluation: the paper's figures 3, 4 and 5."""

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from codec.analysis.phases import profiles
from codec.analysis.recognise import Recogniser
from codec.cues.score import PLACEMENTS
from codec.files.whole import whole_file
from cuecast.evaluate.models_fits import ModelFit, Occlusion, Phases
from cuecast.evaluate.segmentation import write_page
from cuecast.evaluate.tables import PAGE_IN, write_plot
from cuecast.evaluate.takes import EvaluatedTake

ATTINA_MS = {"lead": 239, "lag": 37}
"""Begin before and end after the consonant's onset: Attina 2005, first experiment, CV keys."""


def write_all(
    out: Path,
    data: str,
    seen: Sequence[ModelFit],
    unseen: Sequence[ModelFit],
    recogniser: Recogniser,
    example: tuple[EvaluatedTake, ModelFit],
    phases: Phases,
    hidden: Occlusion,
) -> None:
    """Write figures 3 to 5 as CSV and PNG, the table of hidden markers, a page of an example."""
    out.mkdir(parents=True, exist_ok=True)
    _figure_3(out, data, seen, unseen)
    _figure_4(out, data, recogniser, example)
    _figure_5(out, data, phases)
    write_page(out / "segmentation.html", data, *example, recogniser)
    rows = list(hidden.rows())
    names = tuple(rows[0]) if rows else ("by", "group")
    _write_csv(out / "hidden.csv", data, names, [tuple(row.values()) for row in rows])


def _write_csv(path: Path, data: str, header: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
    with whole_file(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow([*header, "data"])
        writer.writerows([*row, data] for row in rows)


def _figure_3(out: Path, data: str, seen: Sequence[ModelFit], unseen: Sequence[ModelFit]) -> None:
    """Mean and standard deviation of the error of each sentence."""
    fits = [("training", fit) for fit in seen] + [("test", fit) for fit in unseen]
    _write_csv(
        out / "figure3.csv", data,
        ("sentence", "set", "hand_mm", "hand_sd_mm", "face_mm", "face_sd_mm"),
        [
            (f.name, kind, round(f.hand_mm, 3), round(f.hand_sd_mm, 3),
             round(f.face_mm, 3), round(f.face_sd_mm, 3))
            for kind, f in fits
        ],
    )  # fmt: skip

    def draw(_: Any, figure: Any) -> None:
        figure.suptitle(f"Reconstruction error of each sentence ({data})", fontsize=9)
        for axes, part, limit in zip(figure.subplots(2, 1), ("hand", "face"), (2, 1), strict=True):
            mean = np.array([getattr(f, f"{part}_mm") for _, f in fits])
            spread = np.array([getattr(f, f"{part}_sd_mm") for _, f in fits])
            axes.errorbar(np.arange(len(fits)) + 1, mean, spread, fmt=".", lw=0.6)
            axes.axvline(len(seen) + 0.5, color="grey", ls="--")
            axes.axhline(limit, color="tab:red", lw=0.8)
            axes.set(ylabel=f"{part}, mm", ylim=(0, None))
        axes.set_xlabel("sentence (training left of the dashed line; red: the paper's mean)")

    write_plot(out / "figure3.png", [], draw, size_in=PAGE_IN)


def _figure_4(
    out: Path, data: str, recogniser: Recogniser, example: tuple[EvaluatedTake, ModelFit]
) -> None:
    """Probabilities of shapes and placements over one utterance, with its sound."""
    take, fit = example
    shape = recogniser.shape_posteriors(fit.markers)
    placement = recogniser.placement_posteriors(fit.markers, shape.argmax(1))
    times = np.arange(len(shape)) / take.rate_hz
    _write_csv(
        out / "figure4.csv",
        data,
        ("time_s", *(f"shape_{k}" for k in range(9)), *(f"placement_{p}" for p in PLACEMENTS)),
        np.column_stack([times, shape, placement]).round(4).tolist(),
    )

    def draw(_: Any, figure: Any) -> None:
        figure.suptitle(f"Gestures recognised in {take.name} ({data})", fontsize=9)
        top, middle, bottom = figure.subplots(3, 1, sharex=True, height_ratios=(3, 3, 1))
        for axes, table, names in (
            (top, shape, [str(k) for k in range(9)]),
            (middle, placement, PLACEMENTS),
        ):
            for k, name in enumerate(names):
                axes.plot(times, table[:, k], label=name, lw=1)
            axes.legend(ncols=9, fontsize=7, loc="upper center")
            axes.set(ylim=(0, 1.25), ylabel="probability")
        if take.sound is not None:
            bottom.plot(np.arange(len(take.sound)) / take.fs, take.sound, lw=0.3)
        for key in take.score.keys:
            bottom.axvline(key.start, color="grey", lw=0.4)
            bottom.text(key.start, -1.0, str(key), fontsize=6)
        bottom.set(xlabel="s", ylabel="sound", ylim=(-1.1, 1.1), xlim=(0, times[-1]))

    write_plot(out / "figure4.png", [], draw, size_in=PAGE_IN)


def _figure_5(out: Path, data: str, phases: Phases) -> None:
    """Begin and end of gestures against the acoustic onset of their keys."""
    groups = {
        "shape extent": phases.shapes,
        "placement extent": phases.placements,
        "stroke": phases.strokes,
    }
    rows: list[tuple[Any, ...]] = [
        (
            name,
            p.kind,
            p.count,
            *(round(1000 * value) for value in (p.lead_s, p.lead_sd_s, p.lag_s, p.lag_sd_s)),
        )
        for name, found in groups.items()
        for p in profiles(found)
    ]
    _write_csv(
        out / "figure5.csv",
        data,
        ("gesture", "key", "count", "lead_ms", "lead_sd_ms", "lag_ms", "lag_sd_ms"),
        rows,
    )

    def draw(_: Any, figure: Any) -> None:
        axes = figure.subplots()
        axes.set_title(f"Gestures against the acoustic onset of their keys ({data})", fontsize=9)
        for place, (*_, lead, lead_sd, lag, lag_sd) in enumerate(rows):
            axes.barh(place, lead + lag, left=-lead, alpha=0.5)
            axes.errorbar([-lead, lag], [place] * 2, xerr=[lead_sd, lag_sd], fmt="k|", lw=0.8)
        axes.axvline(0, color="black")
        for edge in (-ATTINA_MS["lead"], ATTINA_MS["lag"]):
            axes.axvline(edge, color="tab:red", ls=":")
        labels = [f"{name}, {kind} (n={count})" for name, kind, count, *_ in rows]
        axes.set_yticks(range(len(rows)), labels)
        axes.set_xlabel("ms (red: Attina's M1 and M2 of CV keys, one cuer)")

    write_plot(out / "figure5.png", [], draw, size_in=PAGE_IN)
