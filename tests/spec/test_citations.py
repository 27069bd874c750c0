"""Every paragraph and section of spec/ that code cites exists, and names its document."""

import re
from pathlib import Path

import pytest

from codec.cues.phonology import PHONES

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("codec", "watermark", "synth", "receiver", "cuecast", "lab", "spec/reference")
TEXTS = {path.stem: path.read_text(encoding="utf-8") for path in (ROOT / "spec").glob("*.md")}
PARAGRAPHS = {
    name: set(re.findall(r"^- \*\*([A-Z]\d+)\*\*", text, re.M)) for name, text in TEXTS.items()
}
SECTIONS = {
    name: set(re.findall(r"^##+ (\d+(?:\.\d+)?)\.? ", text, re.M)) for name, text in TEXTS.items()
}
LETTERS = {name[0] for found in PARAGRAPHS.values() for name in found}
SEVERAL = r"[A-Z]\d+(?:(?:,? and |, | to )[A-Z]\d+)*"
CITATION = re.compile(rf"""section="([A-Z]\d+)"|\(({SEVERAL})\)|paragraphs? ({SEVERAL})""")
NAMED = re.compile(r"spec/([a-z0-9-]+)\.md")
PARTS = {"L0", "L1"}
"""Parts of a superframe: not paragraphs, although spec/a335-carrier.md has an L1."""


def sources() -> dict[str, str]:
    """Return the code of all files that cite a paragraph or a section of spec/."""
    found = {}
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).rglob("*.py")):
            text = re.sub(r"\s+", " ", path.read_text(encoding="utf-8"))
            if "Specification:" in text or NAMED.search(text):
                found[str(path.relative_to(ROOT))] = text
    return found


SOURCES = sources()


def test_what_follows_the_word_specification_is_a_document() -> None:
    for name, text in SOURCES.items():
        for rest in re.findall(r"Specification: (.{0,40})", text):
            assert NAMED.match(rest), f"{name}: Specification: {rest}"


@pytest.mark.parametrize("document", sorted(name for name in TEXTS if PARAGRAPHS[name]))
def test_paragraphs_are_numbered_without_holes(document: str) -> None:
    for letter in sorted({name[0] for name in PARAGRAPHS[document]}):
        own = (name for name in PARAGRAPHS[document] if name[0] == letter)
        numbers = sorted(int(name[1:]) for name in own)
        assert numbers == list(range(1, len(numbers) + 1)), (document, letter)


def test_every_cited_paragraph_and_section_exists() -> None:
    cited = 0
    for name, text in SOURCES.items():
        documents = set(NAMED.findall(text)) & set(TEXTS)
        assert set(NAMED.findall(text)) <= set(TEXTS), name
        known = set().union(*(PARAGRAPHS[one] for one in documents))
        # What is cited directly behind a document is that document's own.
        for document, rest in re.findall(rf"spec/([a-z0-9-]+)\.md,? ({SEVERAL})", text):
            paragraphs = set(re.findall(r"[A-Z]\d+", rest)) - PARTS
            assert paragraphs <= PARAGRAPHS[document], (name, document, paragraphs)
            cited += len(paragraphs)
        for document, rest in re.findall(
            r"spec/([a-z0-9-]+)\.md,? sections? ((?:[\d.]+(?:,| and| to)? ?)+)", text
        ):
            sections = {number.rstrip(".") for number in re.findall(r"\d+(?:\.\d+)?", rest)}
            assert sections <= SECTIONS[document], (name, document, sections)
            cited += len(sections)
        for groups in CITATION.findall(text):
            paragraphs = {p for p in re.findall(r"[A-Z]\d+", " ".join(groups)) if p[0] in LETTERS}
            assert paragraphs - PARTS <= known, f"{name} cites {paragraphs - PARTS - known}"
            cited += len(paragraphs)
    assert cited > 200


def test_phone_table_is_the_code_s() -> None:
    rows = re.findall(r"^\| \d+\.\.\d+ \| (.*) \|$", TEXTS["bitstream"], re.M)
    assert " ".join(rows).replace("`", "").split() == list(PHONES)
