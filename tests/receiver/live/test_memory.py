"""Memory of a long reception: large blocks go back to the system when they are freed."""

import platform
import subprocess
import sys

import pytest

PROGRAM = """
import sys
from pathlib import Path

from receiver.live.memory import give_back_large_blocks

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


def kept_mb(how: str) -> float:
    """Memory that a process still has after it has freed 80 MB in blocks of 2 MB."""
    command = [sys.executable, "-c", PROGRAM, how]
    return float(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="the C library is not glibc")
def test_large_blocks_are_given_back() -> None:
    assert kept_mb("keep") > 40
    assert kept_mb("give") < 5
