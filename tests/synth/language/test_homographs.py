"""Homographs told apart by their neighbours."""

import pytest

from synth.language.text.pronounce import phonemise


@pytest.mark.parametrize(
    ("text", "word", "expected"),
    [
        ("il n'y en a plus", "plus", "ply"),
        ("deux plus deux", "plus", "plys"),
        ("j'en veux plus", "plus", "plys"),
        ("plus grand que toi", "plus", "ply"),
        ("en plus", "plus", "plys"),
        ("de plus en plus", "plus", "ply"),
        ("tous les jours", "tous", "tu"),
        ("ils sont tous partis", "tous", "tus"),
        ("tous ensemble", "tous", "tus"),
        ("un os", "os", "nɔs"),
        ("des os", "os", "zo"),
        ("il est fier", "fier", "fjɛʁ"),
        ("je peux me fier à lui", "fier", "fje"),
        ("vers l'est", "est", "ɛst"),
        ("il l'est", "est", "ɛ"),
        ("tu as raison", "as", "a"),
        ("un as du volant", "as", "nas"),
        ("ses fils jouent", "fils", "fis"),
        ("les fils de fer", "fils", "fil"),
        ("ils content une histoire", "content", "kɔ̃t"),
        ("il est content", "content", "kɔ̃tɑ̃"),
        ("un violent orage", "violent", "vjɔlɑ̃"),
        ("elles violent la loi", "violent", "vjɔl"),
        ("ils excellent", "excellent", "zɛksɛl"),
        ("un excellent repas", "excellent", "nɛksɛlɑ̃"),
        ("nous notions tout", "notions", "nɔtjɔ̃"),
        ("des notions utiles", "notions", "nɔsjɔ̃"),
        ("le second étage", "second", "səgɔ̃"),
        ("une femme", "femme", "fam"),
        ("monsieur", "monsieur", "məsjø"),
        ("six heures", "six", "siz"),
        ("les six livres", "six", "si"),
        ("il en a dix", "dix", "dis"),
        ("huit cents", "huit", "ɥi"),
    ],
)
def test_homographs(text: str, word: str, expected: str) -> None:
    found = ["".join(w.phones) for w in phonemise(text) if w.text == word]
    assert found[-1] == expected
