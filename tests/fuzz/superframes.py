"""Fuzz the decoder of superframes and stream files with coverage feedback (atheris, libFuzzer).

``pip install --group fuzz`` first, then
``python -m tests.fuzz.superframes -max_total_time=600 tests/fuzz/corpus``;
``tests/codec/test_fuzz_corpus.py`` replays the corpus. Kernels run as plain Python here: their
branches are seen and their indices checked.
"""

import os
import sys

os.environ["NUMBA_DISABLE_JIT"] = "1"

import atheris

with atheris.instrument_imports(include=["codec"]):
    from tests.fuzz.consume import consume


def main() -> None:
    """Run the fuzzer with the options of libFuzzer."""
    atheris.Setup(sys.argv, lambda data: consume(bytes(data)))
    atheris.Fuzz()


if __name__ == "__main__":
    main()
