import pytest

from tests.fuzz.archive import inputs
from tests.fuzz.consume import consume

SEEDS = inputs("superframes", "seeds")


def test_there_are_seeds() -> None:
    assert len(SEEDS) > 20


@pytest.mark.parametrize("name", SEEDS)
def test_what_the_fuzzer_found_interesting_decodes_or_is_refused(name: str) -> None:
    consume(SEEDS[name])
