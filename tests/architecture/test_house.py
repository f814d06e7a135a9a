"""The house keeps its rules: imports point down, public names are explained, modules and functions are short."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "src" / "gramoscope"
Function = ast.FunctionDef | ast.AsyncFunctionDef
LONGEST_MODULE = 500
LONG_FUNCTION = 36


def _modules() -> list[Path]:
    return sorted(SOURCE.rglob("*.py"))


def _tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def _public(body: list[ast.stmt], prefix: str) -> Iterator[tuple[str, Function | ast.ClassDef]]:
    """Every public function, class and method, by its dotted name."""
    for node in body:
        if isinstance(node, Function | ast.ClassDef) and not node.name.startswith("_"):
            yield f"{prefix}.{node.name}", node
            if isinstance(node, ast.ClassDef):
                yield from _public(node.body, f"{prefix}.{node.name}")


def _lines_of_code(function: Function) -> int:
    """Lines from the signature to the end, docstring left out."""
    total = (function.end_lineno or function.lineno) - function.lineno + 1
    first = function.body[0]
    if ast.get_docstring(function) is not None:
        total -= (first.end_lineno or first.lineno) - first.lineno + 1
    return total


def test_imports_point_down_only() -> None:
    pytest.importorskip("importlinter")
    check = "import sys; from importlinter.cli import lint_imports; sys.exit(lint_imports(no_cache=True))"
    result = subprocess.run([sys.executable, "-c", check], cwd=ROOT, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr
    assert "0 broken" in result.stdout


@pytest.mark.parametrize("path", _modules(), ids=lambda path: str(path.relative_to(SOURCE)))
def test_every_module_and_public_name_says_what_it_is(path: Path) -> None:
    tree = _tree(path)
    unexplained = [name for name, node in _public(tree.body, path.stem) if not ast.get_docstring(node)]
    assert ast.get_docstring(tree), "the module has no docstring"
    assert unexplained == []


def test_every_python_file_holds_one_idea() -> None:
    folders = ("src", "tests", "benchmarks", "experiments")
    files = [path for folder in folders for path in (ROOT / folder).rglob("*.py")]
    lengths = {path: len(path.read_text(encoding="utf-8").splitlines()) for path in files}
    assert len(lengths) > 20
    assert [f"{path.relative_to(ROOT)}: {length}" for path, length in lengths.items() if length >= LONGEST_MODULE] == []


def test_functions_are_short() -> None:
    functions = [node for path in _modules() for node in ast.walk(_tree(path)) if isinstance(node, Function)]
    lengths = np.array([_lines_of_code(function) for function in functions])
    longest = sorted(zip(lengths, (function.name for function in functions), strict=True))[-5:]
    assert np.mean(lengths < LONG_FUNCTION) >= 0.9, longest
    assert np.median(lengths) <= 12


def test_no_module_is_a_drawer_for_everything() -> None:
    names = {path.stem for path in _modules()} | {path.parent.name for path in _modules()}
    assert not names & {"utils", "util", "helpers", "common", "misc", "core"}


def test_every_name_in_the_nomenclature_stands_in_the_code() -> None:
    document = (ROOT / "docs" / "nomenclature.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| ((?:`\w+`(?:, )?)+) \|", document, flags=re.MULTILINE)
    named = {name for row in rows for name in re.findall(r"`(\w+)`", row)}
    code = "\n".join(path.read_text(encoding="utf-8") for path in _modules())
    assert len(named) > 40
    assert sorted(named - set(re.findall(r"\w+", code))) == []
