"""Which changes of the core rooms no test notices: cosmic-ray on a copy of the project.

``python -m tests.mutation [--sample N] [ROOM ...]``; rooms are those of `ROOMS`. Hours without a
sample. What survives is printed as differences; some of them change nothing that can be seen.
"""

import argparse
import random
import shutil
import sqlite3
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
ROOMS = {
    "tracker": (["receiver/reception/tracking.py"], "tests/receiver/test_tracking.py"),
    "link": (
        ["watermark/link/link.py", "watermark/link/combine.py", "watermark/link/crc.py"],
        "tests/watermark/test_link.py tests/watermark/test_combine.py watermark/link",
    ),
    "bitstream": (["codec/bitstream"], "tests/codec codec/bitstream tests/spec"),
}


def mutate(room: str, sample: int, folder: Path) -> None:
    """Run the mutants of a room in a copy of the project, and print what survives."""
    copy, session = folder / room, folder / f"{room}.sqlite"
    shutil.copytree(ROOT, copy, ignore=shutil.ignore_patterns(".git", ".venv*", "node_modules"))
    modules, tests = ROOMS[room]
    config = folder / f"{room}.toml"
    config.write_text(
        f"[cosmic-ray]\nmodule-path = {modules!r}\ntimeout = 300.0\nexcluded-modules = []\n"
        f'test-command = "{sys.executable} -m pytest -x -q -p no:cacheprovider {tests}"\n'
        '[cosmic-ray.distributor]\nname = "local"\n'
    )
    tool = Path(sys.executable).parent
    subprocess.run([tool / "cosmic-ray", "init", config, session], cwd=copy, check=True)
    if sample:
        _thin_out(session, sample)
    subprocess.run([tool / "cosmic-ray", "exec", config, session], cwd=copy, check=True)
    report = [str(tool / "cr-report"), "--show-diff", "--surviving-only", str(session)]
    subprocess.run(report, cwd=copy, check=True)


def _thin_out(session: Path, count: int) -> None:
    """Keep some mutants at random."""
    with sqlite3.connect(session) as database:
        names = sorted(row[0] for row in database.execute("select job_id from work_items"))
        gone = set(names) - set(random.Random(1).sample(names, min(count, len(names))))
        for table in ("mutation_specs", "work_items"):
            database.executemany(f"delete from {table} where job_id = ?", [(n,) for n in gone])


def main() -> None:
    """Mutate the rooms that are named, or all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rooms", nargs="*", metavar="ROOM")
    parser.add_argument("--sample", type=int, default=0, help="mutants of each room at most")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for room in args.rooms or ROOMS:
            mutate(room, args.sample, Path(folder))


if __name__ == "__main__":
    main()
