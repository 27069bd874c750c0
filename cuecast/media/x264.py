"""x264 that writes the same bits with every run.

Its AVX-512 code for the macroblock tree reads memory that nobody wrote where a row of macroblocks
does not fill its registers: a film of 720 pixels a row, 45 macroblocks, had other bits with every
run, and with other contents of free memory from its first packet on. In AVX2 it had not. Machines
without AVX2 may still write other bits than those that have it, as the tree is of rounded numbers.
"""

from functools import cache

from llvmlite import binding

_WIDE = "avx512f"
"""LLVM's name of what such processors have."""

_NARROW = {"x264-params": "asm=avx2,fma3,lzcnt,bmi2"}
"""What each of them has beside it."""


@cache
def repeatable_options() -> dict[str, str]:
    """Return options that make x264 on this machine write the same with every run.

    Examples
    --------
    >>> set(repeatable_options()) <= {"x264-params"}
    True
    """
    try:
        features = binding.get_host_cpu_features()
    except RuntimeError:  # LLVM does not know the processor
        return {}
    return dict(_NARROW) if features.get(_WIDE) else {}
