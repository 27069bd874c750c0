"""Memory of a long reception: large blocks and the compiler's code go back to the system."""

import platform
import subprocess
import sys

import pytest

from receiver.television.memory import release, unchanged_ranges

PROGRAM = """
import sys
from pathlib import Path

from receiver.television.memory import give_back_large_blocks

def resident_mb():
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6

if sys.argv[1] == "give":
    give_back_large_blocks()
bytearray(30_000_000)  # once freed, blocks up to this size come from the heap
before = resident_mb()
held = []
for _ in range(40):
    block = bytearray(2_000_000)
    held.append((block, bytearray(9000)))  # small ones lie between the large ones
small = [pair[1] for pair in held]
del held, block
print(resident_mb() - before)
"""

RELEASE = """
from pathlib import Path
import re

import numba

from receiver.television.memory import release, unchanged_ranges

def resident_mb():
    listing = Path("/proc/self/smaps").read_text()
    return sum(map(int, re.findall(r"libllvmlite.*\\n.*\\n.*\\n.*\\nRss: +(\\d+)", listing))) / 1024

double = numba.njit(lambda x: x + x)
assert double(2) == 4
before = resident_mb()
ranges = unchanged_ranges("libllvmlite")
release(ranges)
after = resident_mb()
print(before, after, double(3), double(4.5))
"""


def kept_mb(how: str) -> float:
    """Memory that a process still has after it has freed 80 MB in blocks of 2 MB."""
    command = [sys.executable, "-c", PROGRAM, how]
    return float(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="the C library is not glibc")
def test_large_blocks_are_given_back() -> None:
    assert kept_mb("keep") > 40
    assert kept_mb("give") < 5


@pytest.mark.skipif(platform.system() != "Linux", reason="no /proc/self/smaps")
def test_compiler_is_given_back_and_works_again() -> None:
    command = [sys.executable, "-c", RELEASE]
    shown = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    before, after, from_cache, compiled_anew = map(float, shown.split())
    assert (from_cache, compiled_anew) == (6, 9)
    assert before > 20
    assert after < 5


def test_nothing_is_released_where_no_library_is() -> None:
    assert unchanged_ranges("no such library") == []
    release([])
