"""Kernels: numba only where it is needed, one process that compiles, the others wait for it."""

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from codec.analysis import shapes
from codec.analysis.shapes import shapes_apart
from codec.compiled import Kernel, lightly
from codec.cuer.models import rigid
from cuecast.command.cli import main
from synth.motion.rules import _kernels

KERNELS = """
from codec.compiled import njit

@njit(cache=True, inner=True)
def inner(x):
    return x * x

@njit(cache=True)
def outer(n):
    total = 0
    for i in range(n):
        total += inner(i)
    return total + inner(0) + inner(1) - 1  # constants take no forms of their own
"""

PROGRAM = """
import gc, sys, kernels
from codec.compiled import Settings
heard, before = [], gc.get_threshold()
Settings.listener = heard.append
print(kernels.outer(10), heard, Settings.count)
assert (kernels.inner(3), kernels.outer.py_func(3)) == (9, 5)  # as Python
assert gc.get_threshold() == before
"""


def start(folder: Path) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [sys.executable, "-c", PROGRAM],
        stdout=subprocess.PIPE,
        text=True,
        cwd=folder,
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(folder), *sys.path])},
    )


def test_one_process_compiles_and_the_next_loads(tmp_path: Path) -> None:
    (tmp_path / "kernels.py").write_text(KERNELS)
    both = [start(tmp_path), start(tmp_path)]
    found = sorted((one.communicate()[0].strip() for one in both), key=len)
    assert [one.returncode for one in both] == [0, 0]
    assert all(line.startswith("285 ") for line in found)
    compiled = sum(int(line.split()[-1]) for line in found)
    assert compiled == 2, found


@pytest.mark.slow
def test_who_is_killed_lets_the_next_one_compile(tmp_path: Path) -> None:
    (tmp_path / "kernels.py").write_text(KERNELS)
    lock = tmp_path / "__pycache__" / "compiling.lock"
    lock.parent.mkdir()
    holder = subprocess.Popen(
        [
            sys.executable,
            "-c",
            "import fcntl, sys, time; f = open(sys.argv[1], 'w');"
            "fcntl.flock(f, fcntl.LOCK_EX); print('held', flush=True); time.sleep(60)",
            str(lock),
        ],
        stdout=subprocess.PIPE,
    )
    assert holder.stdout is not None
    holder.stdout.readline()
    waiting = start(tmp_path)
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline and waiting.poll() is None:
        locks = Path("/proc/locks").read_text()
        if f":{lock.stat().st_ino} " in locks and "->" in locks:
            break
        time.sleep(0.05)
    holder.kill()
    holder.communicate()
    assert waiting.communicate(timeout=60)[0].strip() == "285 [-1, 0, 0] 2"


def test_small_work_is_done_without_numba(tmp_path: Path) -> None:
    """What is imported decides what a word costs: numba alone takes half a second and 90 MB."""
    motion, stream = tmp_path / "m.npz", tmp_path / "m.cue"
    assert main(["synth", "Oui.", "-o", str(motion)]) == 0
    assert main(["encode", str(motion), "-o", str(stream)]) == 0
    verbs = [["keys", "un mot"], ["compare", str(motion), str(motion)], ["inspect", str(stream)]]
    program = f"""
import sys
from cuecast.command.cli import main
assert [main(verb) for verb in {verbs!r}] == [0, 0, 0]
print(sorted({{"numba", "scipy", "av", "matplotlib"}} & set(sys.modules)))
"""
    done = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        check=True,
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
    )
    assert done.stdout.splitlines()[-1] == "[]"


def test_a_kernel_is_the_same_without_numba() -> None:
    times = np.array([0.0, 0.3, 0.7]), np.array([0.3, 0.6, 1.0]), np.array([0.1, 0.4, 0.8])
    given = (*times, np.array([True, False, False]), np.array([100.0, 60.0, 80.0]))
    rest = (0.5, 0.4, 0.2, 0.1, 0.3, 0.001, 0.2, 0.05, 0.001, 0.05, 0.3, 0.1, 0.4)
    found = []
    for kernel in (_kernels.strokes_into, lightly(Kernel(_kernels.strokes_into.py_func, {}))):
        leave, reach = np.full(8, -9.0), np.full(8, -9.0)
        assert kernel(*given, *rest, leave, reach) == 5
        found.append(np.concatenate([leave, reach]))
    np.testing.assert_allclose(found[0], found[1], rtol=1e-14)


@pytest.mark.parametrize("loaded", [False, True])
def test_shapes_apart_is_a_fit_of_each_pair(loaded: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shapes, "is_loaded", lambda: loaded)
    rng = np.random.default_rng(3)
    still, fingers = 30 * rng.normal(size=(3, 9, 3)), 30 * rng.normal(size=(3, 7, 3))
    motion = np.concatenate([rng.normal(size=(5, 3)), 50 * rng.normal(size=(5, 3))], axis=1)
    back = rigid.rigid_motion(still[1], motion) + 0.3 * rng.normal(size=(5, 9, 3))
    back[2, 4] += 40.0  # one marker far off is left out
    seen = rigid.rigid_motion(fingers[1], motion) + 2.0 * rng.normal(size=(5, 7, 3))
    found = shapes_apart(back, seen, still, fingers, outlier_mm=3.0, rounds=3)
    for shape in range(3):
        fit, _ = rigid.estimate_motion(still[shape], back)
        apart = np.linalg.norm(rigid.rigid_motion(fingers[shape], fit) - seen, axis=2)
        np.testing.assert_allclose(found[:, shape], np.sqrt((apart**2).mean(axis=1)), rtol=1e-9)
    assert (found[:, 1] < 6.0).all()


def test_much_light_work_is_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("codec.compiled.is_loaded", lambda: False)
    kernel = Kernel(_kernels.strokes_into.py_func, {})
    taken = [lightly(kernel, work_s=0.2) is kernel for _ in range(4)]
    assert taken == [False, False, False, True]
