"""Inputs of the fuzzer's targets, one archive each: seeds, and regressions that once broke it.

``python -m tests.fuzz.archive TARGET FILE ...`` adds files as regressions, with ``--seeds`` as
seeds, and ``--unpack FOLDER`` writes the seeds as files, for libFuzzer. An input is called by the
first twelve digits of its SHA-256.
"""

import argparse
import hashlib
import sys
import zipfile
from pathlib import Path

INPUTS = Path(__file__).with_name("inputs")
KINDS = ("seeds", "regressions")


def inputs(target: str, kind: str) -> dict[str, bytes]:
    """Return the inputs of a target by their names; none if it has no archive."""
    path = INPUTS / f"{target}.zip"
    if not path.exists():
        return {}
    with zipfile.ZipFile(path) as archive:
        names = sorted(name for name in archive.namelist() if name.startswith(f"{kind}/"))
        return {name.removeprefix(f"{kind}/"): archive.read(name) for name in names}


def add(target: str, kind: str, more: list[bytes]) -> None:
    """Add inputs to the archive of a target; the same inputs make the same archive."""
    kept = {each: inputs(target, each) for each in KINDS}
    kept[kind] |= {hashlib.sha256(data).hexdigest()[:12]: data for data in more}
    INPUTS.mkdir(exist_ok=True)
    with zipfile.ZipFile(INPUTS / f"{target}.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        for each in KINDS:
            for name, data in sorted(kept[each].items()):
                archive.writestr(zipfile.ZipInfo(f"{each}/{name}"), data, zipfile.ZIP_DEFLATED)


def main() -> int:
    """Run the command."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz.archive", description=__doc__)
    parser.add_argument("target")
    parser.add_argument("files", nargs="*", type=Path)
    parser.add_argument("--seeds", action="store_true", help="add the files as seeds")
    parser.add_argument("--unpack", type=Path, metavar="FOLDER")
    args = parser.parse_args()
    if args.files:
        add(args.target, KINDS[not args.seeds], [path.read_bytes() for path in args.files])
    if args.unpack:
        args.unpack.mkdir(parents=True, exist_ok=True)
        for name, data in inputs(args.target, "seeds").items():
            (args.unpack / name).write_bytes(data)
    return 0


if __name__ == "__main__":
    sys.exit(main())
