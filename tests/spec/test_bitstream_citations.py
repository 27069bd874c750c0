"""Every paragraph of spec/bitstream.md that code or tests cite exists."""

import re
from pathlib import Path

from codec.cues.phonology import PHONES

ROOT = Path(__file__).resolve().parents[2]
SPECIFICATION = (ROOT / "spec/bitstream.md").read_text(encoding="utf-8")
PARAGRAPHS = set(re.findall(r"^- \*\*([A-Z]\d+)\*\*", SPECIFICATION, re.M))
CITATION = re.compile(
    r"""section="([A-Z]\d+)"|\(((?:[A-Z]\d+)(?:(?:, | to | and )[A-Z]\d+)*)\)"""
    r"""|paragraphs? ([A-Z]\d+(?:(?:, | to | and )[A-Z]\d+)*)"""
)


def cited() -> dict[str, set[str]]:
    """Return the paragraphs that each file of code cites which refers to the specification."""
    result = {}
    for folder in ("codec", "spec/reference"):
        for path in (ROOT / folder).rglob("*.py"):
            text = path.read_text(encoding="utf-8")
            names = re.findall(r"[A-Z]\d+", str(CITATION.findall(text)))
            if names and "spec/bitstream.md" in text:
                result[path.name] = set(names)
    return result


def test_every_citation_exists() -> None:
    found = cited()
    assert {"payload.py", "bits.py", "stream.py", "quantise.py", "decoder.py"} <= set(found)
    for name, paragraphs in found.items():
        assert paragraphs <= PARAGRAPHS, f"{name} cites {paragraphs - PARAGRAPHS}"


def test_paragraphs_are_numbered_without_holes() -> None:
    for letter in sorted({name[0] for name in PARAGRAPHS}):
        numbers = sorted(int(name[1:]) for name in PARAGRAPHS if name[0] == letter)
        assert numbers == list(range(1, len(numbers) + 1)), letter


def test_phone_table_is_the_code_s() -> None:
    rows = re.findall(r"^\| \d+\.\.\d+ \| (.*) \|$", SPECIFICATION, re.M)
    assert " ".join(rows).replace("`", "").split() == list(PHONES)
