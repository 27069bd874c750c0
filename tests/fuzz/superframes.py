"""Fuzz the decoder of superframes and stream files with coverage feedback (atheris, libFuzzer).

``pip install --group fuzz`` first, then ``python -m tests.fuzz.archive superframes --unpack
FOLDER`` and ``python -m tests.fuzz.superframes -max_total_time=600 FOLDER``;
``python -m tests.fuzz.archive superframes FOLDER/* --seeds`` keeps what it found interesting, and
``tests/codec/superframe/test_fuzz_corpus.py`` replays it. The kernels that read bytes run as plain
Python here: their branches are seen and their indices checked.
"""

import sys
from typing import Any

import atheris
import numba

config: Any = numba.config
config.DISABLE_JIT = True
with atheris.instrument_imports(include=["codec"]):
    import codec.superframe._kernels
config.DISABLE_JIT = False
# The others are compiled, which needs their code as it is.
import codec.superframe.resynthesis._kernels  # noqa: E402, F401

with atheris.instrument_imports(include=["codec"]):
    from tests.fuzz.consume import consume


def main() -> None:
    """Run the fuzzer with the options of libFuzzer."""
    atheris.Setup(sys.argv, lambda data: consume(bytes(data)))
    atheris.Fuzz()


if __name__ == "__main__":
    main()
