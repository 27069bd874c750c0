"""`cuecast conform`: decoders that pass, one that errs, and programs that break the protocol."""

import json
import sys
from pathlib import Path

import pytest

from codec.errors import CueError
from cuecast.command.cli import main
from cuecast.conformance.examine import VECTORS, examine
from cuecast.conformance.own import BUILT_IN
from cuecast.conformance.program import Program

WRONG = """
import json, sys
from cuecast.conformance.own import Own
own = Own()
for line in sys.stdin:
    request = json.loads(line)
    answer = own.requests[request["do"]](request)
    if request["do"] == "draw":
        answer["keys"] = answer["keys"][1:]
    if answer.get("section") == "H6":
        answer = {"valid": False, "section": "H1"}
    print(json.dumps(answer), flush=True)
"""


def test_own_decoder_passes() -> None:
    report = examine(BUILT_IN["python"])
    assert report.failed == ()
    assert report.reached() == ("keys", "markers", "picture", "files")
    assert report.skipped == ("proofs", "sound")


@pytest.mark.slow
def test_plain_decoder_passes() -> None:
    assert examine(BUILT_IN["reference"]).failed == ()


def thinned(folder: Path) -> str:
    """Write every fourth vector, and those that are looked at; all of them are passed above."""
    for name in ("superframe", "stream", "reception", "authentication", "hearing"):
        document = json.loads((VECTORS / f"{name}.json").read_text(encoding="utf-8"))
        document["cases"] = [
            case
            for number, case in enumerate(document["cases"])
            if number % 4 == 0 or case["id"] in ("wrong-check", "lost-0")
        ]
        (folder / f"{name}.json").write_text(json.dumps(document), encoding="utf-8")
    return str(folder)


def test_a_wrong_decoder_is_told_which_paragraph(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "wrong.py").write_text(WRONG, encoding="utf-8")
    argv = ["conform", "--json", "--vectors", thinned(tmp_path), sys.executable]
    assert main([*argv, str(tmp_path / "wrong.py")]) == 1
    report = json.loads(capsys.readouterr().out)
    assert report["classes"] == ["files"]
    sections = {one["case"]: one["detail"] for one in report["failed"]}
    assert sections["wrong-check"] == "refused by H1, it violates H6"
    assert "keys of superframe" in sections["lost-0"]
    assert report["groups"]["superframes: coefficients"]["passed"] > 25


@pytest.mark.parametrize(
    ("code", "message"),
    [
        ("print('hello')", "no JSON in answer to 'hello': hello"),
        ("print([1])", "answer to 'hello' is no JSON object"),
        ("raise SystemExit(4)", "ended with status 4 at 'hello'"),
        ("import time; time.sleep(60)", "no answer to 'hello' in 0.5 s"),
    ],
)
def test_programs_that_break_the_protocol(code: str, message: str) -> None:
    with (
        Program([sys.executable, "-c", code], timeout_s=0.5 if "sleep" in code else 30) as program,
        pytest.raises(CueError, match=message),
    ):
        program.ask("hello")


def test_another_protocol_and_no_program() -> None:
    code = "print('{\"protocol\": 9}')"
    with pytest.raises(CueError, match="protocol 9, this is 1"):
        examine([sys.executable, "-c", code])
    with pytest.raises(CueError, match="cannot start"):
        examine(["/nowhere/decoder"])


def test_missing_vectors_are_an_error(tmp_path: Path) -> None:
    with pytest.raises(CueError, match="the vectors are missing"):
        examine(BUILT_IN["python"], tmp_path)
