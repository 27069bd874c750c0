"""No binding file changes unnoticed, and what is frozen is called so."""

import re

import pytest

from spec.reference import edition

README = (edition.SPEC / "README.md").read_text(encoding="utf-8")


def test_binding_files_are_those_of_the_edition() -> None:
    found, stated = edition.hashes(), edition.stated()["files"]
    changed = {path for path in {*found, *stated} if found.get(path) != stated.get(path)}
    assert not changed, (
        f"{', '.join(sorted(changed))}: if this is meant, say so in spec/changes.md and run "
        "`python -m spec.reference.edition`"
    )


def test_the_page_says_the_status() -> None:
    document = edition.stated()
    assert document["status"] in ("draft", "frozen")
    assert f"**Status: {document['status']}.**" in README


def test_documents_that_bind_are_those_that_the_page_calls_so() -> None:
    rows = re.findall(r"^\| (`.+`) \| .+ \| (yes|no|A17, A18) \|$", README, re.M)
    binding = {name for cell, word in rows if word != "no" for name in re.findall(r"`(.+?)`", cell)}
    assert binding | {"README.md"} == set(edition.BINDING)


def test_what_is_frozen_is_not_written_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(edition, "stated", lambda: {"edition": 2, "status": "frozen", "files": {}})
    with pytest.raises(SystemExit, match="frozen"):
        edition.main([])
