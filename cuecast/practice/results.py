"""Figures of a test from its files of answers: by condition, over all participants."""

import math
from collections import defaultdict
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy import stats

from codec.errors import CueError
from cuecast.practice.session import answer_files, read_answers
from cuecast.practice.statistics import Counts, Estimate, d_prime, mean_of, share_right
from cuecast.practice.trial import Trial

Row = dict[str, Any]
_Key = tuple[str, str, str, str]

SLOWEST_FPS = 20.0
"""Pictures per second below which an item was not shown properly: its answer does not count."""

_CONDITION = ("hand", "display", "channel", "source")


def figures(trial: Trial) -> dict[str, Any]:
    """Return the figures of all answers that are there.

    Returns
    -------
    dict
        ``kind``, ``participants``, ``shown_slowly`` (answers left out because the item was drawn
        with fewer than `SLOWEST_FPS` pictures per second), ``conditions`` (one row each) and
        ``comparisons`` (paired tests over participants).

    Raises
    ------
    CueError
        If there are no answers, or a file of answers is malformed.
    """
    rows: list[dict[str, str]] = []
    for path in answer_files(trial.folder):
        rows += read_answers(path)
    try:
        answered = [row for row in rows if row["answer"] != ""]
        asked = [row for row in answered if not 0 < float(row["frames_per_second"]) < SLOWEST_FPS]
        if not asked:
            raise CueError(
                f"{trial.folder}: no answers yet ({len(answered)} to items shown slowly)"
            )
        found = {
            "pairs": _pairs,
            "naturalness": _ratings,
            "comprehension": _shares,
            "voices": _preferences,
        }[trial.kind](asked)
    except (KeyError, ValueError) as error:
        raise CueError(f"{trial.folder}: malformed answers: {error!r}") from error
    people = len({row["participant"] for row in asked})
    slow = len(answered) - len(asked)
    return {"kind": trial.kind, "participants": people, "shown_slowly": slow, **found}


def _grouped(rows: Sequence[dict[str, str]]) -> dict[_Key, dict[str, list[dict[str, str]]]]:
    """Return rows by condition and participant."""
    found: dict[_Key, dict[str, list[dict[str, str]]]] = defaultdict(lambda: defaultdict(list))
    for row in rows:
        hand, display, channel, source = (row[name] for name in _CONDITION)
        found[hand, display, channel, source][row["participant"]].append(row)
    return dict(sorted(found.items()))


def counts_of(rows: Sequence[dict[str, str]]) -> Counts:
    """Return the counts of two-alternative answers; the left side is choice 0."""
    left = [row for row in rows if int(row["target"]) == 0]
    right = [row for row in rows if int(row["target"]) == 1]
    said_left = [sum(int(row["answer"]) == 0 for row in side) for side in (left, right)]
    return Counts(said_left[0], len(left), said_left[1], len(right))


def _pairs(rows: Sequence[dict[str, str]]) -> dict[str, Any]:
    grouped = _grouped(rows)
    conditions, single = [], dict[_Key, dict[str, float]]()
    for key, people in grouped.items():
        all_rows = [row for own in people.values() for row in own]
        counts = counts_of(all_rows)
        known = {
            name: d_prime(found).value
            for name, own in people.items()
            if min((found := counts_of(own)).left, found.right) > 0
        }
        single[key] = known
        answered = [float(row["answer_ms"]) for row in all_rows if row["right"] == "1"]
        conditions.append(
            dict(zip(_CONDITION, key, strict=True))
            | {
                "trials": counts.trials,
                "right": counts.correct,
                "share": _row(share_right(counts.correct, counts.trials)),
                "d_prime_pooled": _row(d_prime(counts)) if counts.left and counts.right else None,
                "d_prime_mean": _row(mean_of(list(known.values()))) if known else None,
                "median_ms_right": round(float(np.median(answered))) if answered else None,
            }
        )
    return {"conditions": conditions, "comparisons": _compared(single, "hand", "lips", "hand")}


def _ratings(rows: Sequence[dict[str, str]]) -> dict[str, Any]:
    grouped = _grouped(rows)
    conditions, single = [], dict[_Key, dict[str, float]]()
    for key, people in grouped.items():
        means = {
            name: float(np.mean([1 + int(row["answer"]) for row in own]))
            for name, own in people.items()
        }
        single[key] = means
        conditions.append(
            dict(zip(_CONDITION, key, strict=True))
            | {
                "ratings": sum(len(own) for own in people.values()),
                "mean": _row(mean_of(list(means.values()))),
            }
        )
    comparisons = [
        row
        for first, second in (("synthetic", "natural"), ("other", "natural"))
        for row in _compared(single, "source", first, second)
    ]
    return {"conditions": conditions, "comparisons": comparisons}


def _shares(rows: Sequence[dict[str, str]]) -> dict[str, Any]:
    conditions, single = [], dict[_Key, dict[str, float]]()
    for key, people in _grouped(rows).items():
        shares = {
            name: float(np.mean([row["right"] == "1" for row in own]))
            for name, own in people.items()
        }
        single[key[0], "", key[2], key[3]] = shares  # subtitles are shown without any display
        all_rows = [row for own in people.values() for row in own]
        right = sum(row["right"] == "1" for row in all_rows)
        conditions.append(
            dict(zip(_CONDITION, key, strict=True))
            | {
                "questions": len(all_rows),
                "right": right,
                "share": _row(share_right(right, len(all_rows))),
                "share_mean": _row(mean_of(list(shares.values()))),
            }
        )
    comparisons = [
        row
        for first, second in (("subtitles", "cuer"), ("subtitles", "both"), ("cuer", "both"))
        for row in _compared(single, "source", first, second)
    ]
    return {"conditions": conditions, "comparisons": comparisons}


_PREFERRED = (1.0, 0.0, 0.5)
"""Answers to a pair of voices as shares of the first one: first, second, both."""


def _preferences(rows: Sequence[dict[str, str]]) -> dict[str, Any]:
    people: dict[tuple[str, ...], dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    for row in rows:
        first, second = row["source"].split("-")
        share = _PREFERRED[int(row["answer"])]
        pair = tuple(sorted((first, second)))
        people[pair][row["participant"]].append(share if first == pair[0] else 1 - share)
    conditions = [
        {
            "source": f"{pair[0]} over {pair[1]}",
            "answers": sum(map(len, own.values())),
            "share": _row(mean_of([float(np.mean(shares)) for shares in own.values()])),
        }
        for pair, own in sorted(people.items())
    ]
    return {"conditions": conditions, "comparisons": []}


def _compared(
    single: dict[_Key, dict[str, float]], factor: str, first: str, second: str
) -> list[Row]:
    """Return `second` minus `first` in everything else alike, by a paired t-test over people."""
    at = _CONDITION.index(factor)
    rows: list[Row] = []
    for key, values in single.items():
        if key[at] != first:
            continue
        twin: _Key = (*key[:at], second, *key[at + 1 :])  # type: ignore[assignment]
        others = single.get(twin, {})
        people = sorted(set(values) & set(others))
        if len(people) < 2:
            continue
        differences = [others[name] - values[name] for name in people]
        found = mean_of(differences)
        varied = float(np.ptp(differences)) > 0
        p = float(stats.ttest_1samp(differences, 0.0).pvalue) if varied else None
        rest = {name: key[i] for i, name in enumerate(_CONDITION) if i != at and key[i]}
        rows.append(
            {
                "compared": f"{second} - {first}",
                **rest,
                "participants": len(people),
                "difference": _row(found),
                "p": None if p is None else float(f"{p:.3g}"),
            }
        )
    return rows


def _row(estimate: Estimate) -> list[float | None]:
    """Return value, low and high for a document; None where an end is not finite."""
    values = (estimate.value, estimate.low, estimate.high)
    return [round(x, 3) if math.isfinite(x) else None for x in values]


def in_words(found: dict[str, Any]) -> str:
    """Return the figures as lines for a reader."""
    slow = found["shown_slowly"]
    left_out = f"; {slow} answers left out: the item was drawn too slowly" if slow else ""
    lines = [f"{found['participants']} participants, {found['kind']}{left_out}"]
    for row in [*found["conditions"], *found["comparisons"]]:
        parts = []
        for name, value in row.items():
            if isinstance(value, list):
                low, high = ("?" if x is None else f"{x:.2f}" for x in value[1:])
                parts.append(f"{name} {value[0]:.2f} [{low}, {high}]")
            elif name in _CONDITION or name == "compared":
                parts.append(str(value))
            elif value is not None:
                parts.append(f"{name} {value}")
        lines.append("  ".join(parts))
    return "\n".join(lines)
