from pathlib import Path

import pytest

from tests.fuzz.consume import consume

CORPUS = sorted((Path(__file__).parents[2] / "fuzz" / "corpus").iterdir())


def test_there_is_a_corpus() -> None:
    assert len(CORPUS) > 20


@pytest.mark.parametrize("path", CORPUS, ids=lambda path: path.name)
def test_what_the_fuzzer_found_interesting_decodes_or_is_refused(path: Path) -> None:
    consume(path.read_bytes())
