"""Every command that the documents name exists, with the options they give it."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
COMMAND = re.compile(r"^\s*(?:\$ )?(?:\S*/)?gramoscope ([a-z]\w*)(.*)$")


def _documents() -> list[Path]:
    return sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])


def _commands_of(text: str) -> list[tuple[str, frozenset[str]]]:
    """Command and options of each line that begins with the program's name, in code blocks and code spans."""
    blocks = re.findall(r"^```[^\n]*\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)
    spans = re.findall(r"`([^`\n]+)`", re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL))
    joined = [line for block in blocks for line in block.replace("\\\n", " ").splitlines()]
    found = [COMMAND.match(part) for line in [*joined, *spans] for part in line.split("&&")]
    return [(match[1], frozenset(re.findall(r"(--[a-z][\w-]*)", match[2]))) for match in found if match]


@cache
def _help(command: str) -> str:
    call = [sys.executable, "-c", "from gramoscope.cli.main import main; main()", command, "--help"]
    environment = {**os.environ, "COLUMNS": "240", "NO_COLOR": "1", "TERM": "dumb"}
    result = subprocess.run(call, capture_output=True, text=True, check=False, env=environment)
    assert result.returncode == 0, result.stderr
    return result.stdout


def test_commands_are_found_in_blocks_and_in_spans() -> None:
    text = "Say `gramoscope info A` or\n```\n$ gramoscope play A --out B \\\n  --rate 1\nbin/gramoscope demo && ls --all\n```\n"
    assert _commands_of(text) == [
        ("play", frozenset({"--out", "--rate"})),
        ("demo", frozenset()),
        ("info", frozenset()),
    ]


@pytest.mark.parametrize("path", _documents(), ids=lambda path: str(path.relative_to(ROOT)))
def test_every_command_in_a_document_exists(path: Path) -> None:
    if importlib.util.find_spec("gramoscope.cli.main") is None:
        pytest.skip("the commands are not built in")
    for command, options in _commands_of(path.read_text(encoding="utf-8")):
        text = _help(command)
        assert re.search(rf"gramoscope {command}\b", text), f"{path.name} names the unknown command {command!r}"
        missing = {option for option in options if not re.search(rf"{option}(?![\w-])", text)}
        assert not missing, f"{path.name}: gramoscope {command} has no {', '.join(sorted(missing))}"
