"""The native receiver passes the vectors, by the protocol for anybody's decoder."""

import shutil
import subprocess
from pathlib import Path

import pytest

from cuecast.conformance.examine import examine
from cuecast.conformance.verdict import CLASSES
from tests.receiver.native.building import FLAGS, INCLUDES, NATIVE, built

HEARD = 14
"""Sounds of `spec/vectors/hearing.json` that it hears, of 14: all, measured on 2026-11-22."""


MACHINES = {
    "arm-linux-gnueabihf": "qemu-arm",
    "i686-linux-gnu": "qemu-i386",
    "mips-linux-gnu": "qemu-mips",
    "riscv64-linux-gnu": "qemu-riscv64",
    "s390x-linux-gnu": "qemu-s390x",
}
"""Machines by their compilers' prefixes, and their players: words of 32 bits, registers of 80 bits
for fractions, the highest byte first (MIPS, s390x)."""


def test_native_passes_all_vectors() -> None:
    report = examine([built("cue_conform")])
    assert [verdict for verdict in report.failed if verdict.group != "sound"] == []
    assert report.reached()[:4] == tuple(CLASSES)[:4]
    assert set(report.counts()) == {group for groups in CLASSES.values() for group in groups}
    assert report.counts()["sound"]["passed"] >= HEARD
    assert report.skipped == ()


@pytest.mark.slow
@pytest.mark.parametrize("machine", sorted(MACHINES))
def test_other_machines_pass_all_vectors(machine: str, tmp_path: Path) -> None:
    compiler, player = shutil.which(f"{machine}-gcc"), shutil.which(MACHINES[machine])
    if compiler is None or player is None:
        pytest.skip(f"needs gcc-{machine}, its libc and qemu-user (Debian)")
    vendored = [str(path) for path in NATIVE.glob("vendor/*/*.c")]
    objects = [str(tmp_path / f"{Path(path).stem}.o") for path in vendored]
    for path, made in zip(vendored, objects, strict=True):
        subprocess.run([compiler, "-std=c11", "-O2", "-w", "-c", path, "-o", made], check=True)
    files = [*map(str, NATIVE.glob("src/*.c")), str(NATIVE / "tools" / "cue_conform.c"), *objects]
    program = str(tmp_path / "cue_conform")
    subprocess.run(
        [compiler, *FLAGS, "-Werror", "-static", *INCLUDES, *files, "-lm", "-o", program],
        check=True,
    )
    report = examine([player, program])
    assert report.failed == ()
    assert report.reached() == tuple(CLASSES)
