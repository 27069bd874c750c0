"""Memory of a command that works through large arrays: its pages are cleared once."""

import platform
import subprocess
import sys

import pytest

PROGRAM = """
import resource, sys
from cuecast.dubbing.memory import keep_freed_memory

if sys.argv[1] == "keep":
    assert keep_freed_memory()
def work():
    blocks = [bytearray(1_500_000) for _ in range(4)]
work()
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(20):
    work()
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="the choice is glibc's")
def test_pages_of_freed_arrays_are_used_again() -> None:
    faults = {}
    for choice in ("keep", "leave"):
        done = subprocess.run(
            [sys.executable, "-c", PROGRAM, choice], capture_output=True, text=True, check=True
        )
        faults[choice] = int(done.stdout)
    assert faults["keep"] < 100
    assert faults["leave"] > 1000
