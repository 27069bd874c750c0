"""A thousand real sentences: phones against labels, keys against a second reading of the code."""

import itertools
import re
from pathlib import Path

import pytest

from synth.language.text.pronounce import Style, phonemise
from synth.planning.scoring.text_score import score_of_text

LABELS = Path(__file__).resolve().parents[4] / "shared" / "data" / "text" / "enst-camille-data.yaml"

JUDGED = Path(__file__).with_name("judged_labels.txt")

# The labels were made by a synthesiser's front end: no liaison, a schwa after two consonants
# also at the end of a group, and neither ɲ nor ŋ in the inventory.
STYLE = Style(liaison="none", final_schwa="cluster-pause")
IPA = {
    "R": "ʁ", "@": "ə", "E": "ɛ", "O": "ɔ", "a~": "ɑ̃", "o~": "ɔ̃", "e~": "ɛ̃", "9~": "œ̃",
    "9": "œ", "S": "ʃ", "Z": "ʒ", "H": "ɥ",
}  # fmt: skip
MERGED = {"ɔ": "o", "ɛ": "e", "œ": "ə", "ø": "ə", "ɑ": "a"}
SPLIT = {"ɲ": ("n", "j"), "ŋ": ("n", "g")}

SHAPES = {"pdʒ": 1, "kvz": 2, "sʁ": 3, "bnɥ": 4, "mtf": 5, "lʃɲw": 6, "g": 7, "jŋ": 8}
PLACES = {"side": "aɑoœə", "mouth": "iÔÂ", "chin": "ɛɔu", "cheek": "Êø", "throat": "eyÛ"}
NASAL = {"ɔ̃": "Ô", "ɑ̃": "Â", "ɛ̃": "Ê", "œ̃": "Û"}


def sentences() -> list[tuple[str, list[str]]]:
    if not LABELS.exists():
        pytest.skip("shared data absent: text/enst-camille-data.yaml")
    found = []
    for block in LABELS.read_text(encoding="utf-8").split("- prompt: ")[1:]:
        text = re.search(r"text: (.*)", block)
        assert text is not None
        labels = [label.strip("'") for label in re.findall(r"lab: (.*)", block)]
        found.append((text[1], [IPA.get(label, label) for label in labels if label != "_"]))
    return found


def judged() -> dict[tuple[str, str, str], list[tuple[str, str]]]:
    """Return verdicts and the sentence's words that they need, by word, label and ours."""
    found: dict[tuple[str, str, str], list[tuple[str, str]]] = {}
    for line in JUDGED.read_text(encoding="utf-8").splitlines():
        if not line.startswith("#"):
            verdict, word, label, ours, *words = line.split("\t")
            found.setdefault((word, label, ours), []).append((verdict, "".join(words)))
    return found


def by_word(text: str, labels: list[str]) -> list[tuple[str, list[str], list[str]]]:
    """Return each word with the labels that lie nearest to its phones, and with its phones."""
    words = phonemise(text, style=STYLE)
    ours = [q for word in words for p in word.phones for q in SPLIT.get(p, (p,))]
    owners = [n for n, word in enumerate(words) for p in word.phones for _ in SPLIT.get(p, (p,))]
    rows = [list(range(len(ours) + 1))]
    for i, x in enumerate(labels, 1):
        row = [i]
        for j, y in enumerate(ours, 1):
            row.append(min(rows[-1][j] + 1, row[-1] + 1, rows[-1][j - 1] + (x != y)))
        rows.append(row)
    path: list[tuple[int | None, int | None]] = []
    i, j = len(labels), len(ours)
    while i or j:
        if i and j and rows[i][j] == rows[i - 1][j - 1] + (labels[i - 1] != ours[j - 1]):
            i, j = i - 1, j - 1
            path.append((i, j))
        elif i and rows[i][j] == rows[i - 1][j] + 1:
            i -= 1
            path.append((i, None))
        else:
            j -= 1
            path.append((None, j))
    result: list[tuple[str, list[str], list[str]]] = [(word.text.lower(), [], []) for word in words]
    last = 0
    for label, phone in reversed(path):
        if phone is not None:
            last = owners[phone]
            result[last][2].append(ours[phone])
        if label is not None:
            result[last][1].append(labels[label])
    return result


def right_label(
    text: str,
    word: str,
    label: list[str],
    ours: list[str],
    verdicts: dict[tuple[str, str, str], list[tuple[str, str]]],
) -> list[str]:
    """Return what should be said: the label unless it was judged wrong or as good as ours."""
    found = verdicts.get((word, "".join(label), "".join(ours)), [])
    fitting = [verdict for verdict, words in found if words in text]
    return ours if fitting and "ours" not in fitting else label


@pytest.mark.parametrize("every", [5, pytest.param(1, marks=pytest.mark.slow)])
def test_keys_where_labels_are_right(every: int) -> None:
    """Disagreements that nobody has judged count as ours."""
    verdicts = judged()
    wrong = total = raw = 0
    for text, labels in sentences()[::every]:
        rows = by_word(text, labels)
        spoken = [p for *_, ours in rows for p in ours]
        right = [p for w, label, ours in rows for p in right_label(text, w, label, ours, verdicts)]
        wrong += distance(keys_of(right), keys_of(spoken))
        raw += distance(keys_of(labels), keys_of(spoken))
        total += len(keys_of(right))
    assert total > 30_000 / every
    assert raw / total > 0.05  # the labels as they stand
    assert wrong / total <= 0.0015  # measured: 0.08 % of all


def keys_of(phones: list[str]) -> list[str]:
    """Return shape and place of each key of phones without pauses, as text."""
    group = "".join(NASAL.get(phone, phone) for phone in phones)
    return [f"{shape} {place}" for shape, place in read(group)]


def test_every_verdict_is_one_of_three() -> None:
    assert {v for found in judged().values() for v, _ in found} == {"label", "free", "ours"}


def distance(a: list[str], b: list[str]) -> int:
    row = list(range(len(b) + 1))
    for i, x in enumerate(a, 1):
        before, row = row, [i]
        for j, y in enumerate(b, 1):
            row.append(min(before[j] + 1, row[-1] + 1, before[j - 1] + (x != y)))
    return row[-1]


@pytest.mark.parametrize(
    ("part", "limit"),
    # Measured: 2.99 %, and 3.32 % on the 801 that nobody has looked at; most of that are faults of
    # the labels (un, c'est read letter by letter).
    [(slice(200), 0.030), pytest.param(slice(200, None), 0.035, marks=pytest.mark.slow)],
)
def test_phone_error_rate(part: slice, limit: float) -> None:
    errors = total = 0
    for text, labels in sentences()[part]:
        spoken = [p for word in phonemise(text, style=STYLE) for p in word.phones]
        ours = [MERGED.get(q, q) for p in spoken for q in SPLIT.get(p, (p,))]
        reference = [MERGED.get(p, p) for p in labels]
        errors += distance(reference, ours)
        total += len(reference)
    assert total > 11_000
    assert errors / total <= limit


@pytest.mark.parametrize("every", [10, pytest.param(1, marks=pytest.mark.slow)])
def test_keys_obey_the_code(every: int) -> None:
    for text, _ in sentences()[::every]:
        score = score_of_text(text)
        keys = [(k.shape, k.placement) for k in score.keys]
        assert keys == [key for group in groups(score.phones) for key in read(group)]


def groups(phones: tuple) -> list[str]:  # type: ignore[type-arg]
    """Return the phones between pauses, one letter each."""
    letters = [""]
    for before, phone in itertools.pairwise((None, *phones)):
        if before is not None and phone.start - before.end > 0.01:
            letters.append("")
        letters[-1] += NASAL.get(phone.symbol, phone.symbol)
    return letters


def read(group: str) -> list[tuple[int, str]]:
    """Return the keys of a group by cutting it into syllable pieces with one expression."""
    vowels, consonants = "".join(PLACES.values()), "".join(SHAPES)
    pieces = re.findall(f"[{consonants}][{vowels}]|[{consonants}]|[{vowels}]", group)
    assert "".join(pieces) == group
    return [
        (
            next((shape for row, shape in SHAPES.items() if piece[0] in row), 5),
            next((place for place, row in PLACES.items() if piece[-1] in row), "side"),
        )
        for piece in pieces
    ]
