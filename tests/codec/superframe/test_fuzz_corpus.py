from tests.fuzz.archive import inputs
from tests.fuzz.consume import consume

SEEDS = inputs("superframes", "seeds")


def test_there_are_seeds() -> None:
    assert len(SEEDS) > 20


def test_interesting_inputs_of_the_fuzzer_decode_or_are_refused() -> None:
    for name, data in SEEDS.items():
        try:
            consume(data)
        except Exception as error:
            error.add_note(f"input {name}")
            raise
