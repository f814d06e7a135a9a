"""How the commands talk: progress and prose to people on standard error, results on standard output, JSON to machines."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Annotated, Any

from cyclopts import Parameter
from rich.console import Console
from rich.panel import Panel
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from gramoscope.errors import GramoscopeError

FINE, FOUND_WRONG, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
"""Exit codes: all is well; it worked and something was found wrong; the command cannot work as given; stopped by Ctrl-C."""


def show_error(error: GramoscopeError) -> None:
    """Print what was found, what was needed and what to do."""
    text = Text(error.found)
    if error.needed:
        text.append("\n\nNeeded: ", style="bold").append(error.needed)
    if error.remedy:
        text.append("\n\nTry: ", style="bold").append(error.remedy)
    Console(stderr=True).print(Panel(text, title="Gramoscope cannot do this", title_align="left", border_style="red"))


def several(number: int, thing: str) -> str:
    """Return e.g. "1 frame" or "2 frames"."""
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"


def _finite(_: object, value: float | tuple[float, ...] | None) -> None:
    numbers = value if isinstance(value, tuple) else (value,)
    if any(number is not None and not math.isfinite(number) for number in numbers):
        raise ValueError("Needed: a finite number.")


def _some(_: object, value: int) -> None:
    if value < 1:
        raise ValueError("Needed: at least 1.")


FINITE = Parameter(validator=_finite)
"""For every option that is a number of something."""
Workers = Annotated[int, Parameter(validator=_some, show_default=False)]
PROCESSORS = os.cpu_count() or 1


@dataclass(frozen=True)
class Terminal:
    """What a command says, and to whom.

    Parameters
    ----------
    quiet : bool
        Say nothing but errors.
    json : bool
        Print the result as JSON, and nothing else, on standard output.
    """

    quiet: bool = False
    json: bool = False

    def say(self, text: str) -> None:
        """Print a line for people."""
        if not self.quiet and not self.json:
            Console().print(text, highlight=False, soft_wrap=True)

    def table(self, rows: Mapping[str, str], *, title: str = "") -> None:
        """Print names and values for people."""
        if self.quiet or self.json:
            return
        table = Table(title=title or None, title_justify="left", show_header=False, box=None, pad_edge=False)
        table.add_column(style="cyan", no_wrap=True)
        table.add_column()
        for name, value in rows.items():
            table.add_row(name, value)
        Console().print(table, highlight=False)

    def columns(self, heads: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
        """Print a table with heads for people."""
        if self.quiet or self.json:
            return
        table = Table(*heads, box=None, pad_edge=False, header_style="bold")
        table.columns[0].no_wrap, table.columns[0].style = True, "cyan"
        for row in rows:
            table.add_row(*row)
        Console().print(table, highlight=False)

    def result(self, values: Mapping[str, Any]) -> None:
        """Print a result for machines, when that is wanted."""
        if self.json:
            from gramoscope.listening.report import json_text

            sys.stdout.write(json_text(values).rstrip() + "\n")

    @contextmanager
    def progress(self, title: str) -> Iterator[Callable[..., None] | None]:
        """Show a progress bar while the block runs; yields what to call with (done, of how many, of what)."""
        if self.quiet:
            yield None
            return
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
        )
        with Progress(*columns, console=Console(stderr=True)) as bar:
            task = bar.add_task(title, total=None)
            try:
                yield lambda done, total, what=title: bar.update(task, completed=done, total=total, description=what)
            except BaseException:
                # a bar that stands still has nothing to say beside a message
                bar.live.transient = True
                raise
