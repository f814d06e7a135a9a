"""Make all pages of the seed paper, or some: `python -m experiments.seed_paper.make [PAGE …]`."""

from __future__ import annotations

import argparse
import importlib
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from experiments.seed_paper.page import FOLDER, PAPER, SHARED, Page

PAGES = ("optics", "in_focus", "flow", "hough", "orientation", "sound", "damage", "kalman")
"""In the order of the paper; each is a module with `make(folder)`."""
COMMAND = "python -m experiments.seed_paper.make"


def make_page(name: str, folder: Path) -> Page:
    """Make one page; a library that is not installed is said in the page."""
    try:
        page = importlib.import_module(f"experiments.seed_paper.{name}").make(folder)
        assert isinstance(page, Page)
    except ImportError as error:
        page = Page(name, f"{name}: not made", finding=f"Not made: {error}.", folder=folder)
        page.say(f"This page was not made: {error}. Install what is missing and run `{COMMAND} {name}`.")
        page.write()
    return page


def readme(pages: Sequence[Page]) -> str:
    """Return the list of pages, each with what it found."""
    rows = "\n".join(f"| [{page.title}](pages/{page.name}.md) | {page.finding} |" for page in pages)
    return f"""# The seed paper, reproduced

{PAPER}: every number that it prints, every figure, computed again. Each page has a table *claim · ours · why they differ*,
and nothing is claimed that its script did not compute. This list and all pages are made by

```
{COMMAND}
```

in the root of the project, in some minutes on two cores; `{COMMAND} optics hough` makes only those two.
Practice sounds and captures lie in `../{SHARED.name}` beside the project; where they are absent the scripts use what they can
simulate, and the pages say so.

| page | what was found |
| --- | --- |
{rows}

The paper reads real records and has no truth to compare with; these pages read simulated ones, whose truth is known to the
last digit. So a correlation here is no proof that ours would be better on the paper's films: it says what the method can do
when everything that the paper leaves out is as the simulator has it, and where it stops.

How to read on: [optics](pages/optics.md) first, for the three stripes; then [in focus](pages/in_focus.md),
[Hough](pages/hough.md), [orientation](pages/orientation.md), [sound](pages/sound.md), which are the signal path of
[`pickup/seed_paper.py`](../../src/gramoscope/pickup/seed_paper.py) in its own order.
"""


@contextmanager
def _progress(console: Console) -> Iterator[Progress]:
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console) as progress:
        yield progress


def make(names: Sequence[str], folder: Path, *, console: Console) -> list[Page]:
    """Make some pages with a progress bar; all of them together also make the list of pages."""
    pages = []
    with _progress(console) as progress:
        task = progress.add_task("Seed paper", total=len(names))
        for name in names:
            progress.update(task, description=f"{name:<12}")
            started = time.perf_counter()
            pages.append(make_page(name, folder))
            progress.console.print(
                f"{name:<12} {time.perf_counter() - started:5.1f} s  {pages[-1].finding}", highlight=False
            )
            progress.advance(task)
    if tuple(names) == PAGES:
        (folder.parent / "README.md").write_text(readme(pages), encoding="utf-8")
    return pages


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog=COMMAND, description="Make the pages of the seed paper.")
    parser.add_argument("pages", nargs="*", metavar="PAGE", help=f"some of: {', '.join(PAGES)}; all if left out")
    parser.add_argument("--folder", type=Path, default=FOLDER, help="where the pages go")
    given = parser.parse_args()
    unknown = [name for name in given.pages if name not in PAGES]
    if unknown:
        parser.error(f"there is no page {unknown[0]}; choose from {', '.join(PAGES)}")
    console = Console(stderr=True)
    started = time.perf_counter()
    make(given.pages or PAGES, given.folder, console=console)
    console.print(
        f"Done in {time.perf_counter() - started:.0f} s: {given.folder.parent / 'README.md'}", highlight=False
    )


if __name__ == "__main__":
    main()
