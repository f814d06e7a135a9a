"""A page in Markdown: prose, tables, pictures, and the table *claim · ours · why they differ* that every page has."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from matplotlib.figure import Figure
from PIL import Image

from gramoscope.listening.ink import save_png

FOLDER = Path(__file__).parent / "pages"
SHARED = Path(__file__).parents[3] / "shared"
"""Practice sounds and captures, beside the repository; what is absent is replaced, and the page says so."""

PAPER = (
    "B. Tian and J. L. Barron, *Sound from gramophone record groove surface orientation*, 16th IEEE International "
    "Conference on Image Processing, 2009"
)


def _pack(path: Path) -> None:
    """Make a picture as small as it goes: pages are kept for good, where a transfer's pictures are wanted soon."""
    with Image.open(path) as picture:
        picture.load()
        picture.save(path, optimize=True)


@dataclass(frozen=True)
class Claim:
    """What the paper says of one thing, what comes out here, and why the two differ."""

    place: str
    claim: str
    ours: str
    why: str = ""

    @property
    def cells(self) -> tuple[str, str, str, str]:
        """The row of the table."""
        return self.place, self.claim, self.ours, self.why or "they agree"


@dataclass
class Page:
    """A page that grows from top to bottom.

    Attributes
    ----------
    name : str
        Of the file, without ending; pictures are called after it.
    title : str
    finding : str
        One sentence for the list of pages.
    folder : Path
        Where the page goes.
    """

    name: str
    title: str
    finding: str = ""
    folder: Path = FOLDER
    parts: list[str] = field(default_factory=list)

    def say(self, text: str) -> None:
        """Add prose: lines are joined, a blank line ends a paragraph."""
        paragraphs = [" ".join(part.split()) for part in text.strip().split("\n\n")]
        self.parts.append("\n\n".join(paragraphs))

    def verbatim(self, text: str) -> None:
        """Add a block that keeps its lines, such as an equation."""
        self.parts.append(f"```\n{text.strip(chr(10))}\n```")

    def head(self, text: str) -> None:
        """Begin a section."""
        self.parts.append(f"## {text}")

    def table(self, header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
        """Add a table."""
        lines = [header, ["---"] * len(header), *rows]
        self.parts.append("\n".join("| " + " | ".join(line) + " |" for line in lines))

    def claims(self, claims: Sequence[Claim]) -> None:
        """Add the table that every page has."""
        self.head("Claim · ours · why they differ")
        self.table(("section", "claim", "ours", "why they differ"), [claim.cells for claim in claims])

    def picture(self, figure: Figure, what: str, caption: str) -> None:
        """Save a picture beside the page and show it."""
        (self.folder / "pictures").mkdir(parents=True, exist_ok=True)
        file = f"pictures/{self.name}-{what}.png"
        save_png(figure, self.folder / file)
        _pack(self.folder / file)
        words = " ".join(caption.split())
        self.parts.append(f"![{words.split('. ')[0].rstrip('.')}]({file})\n\n*{words}*")

    @property
    def text(self) -> str:
        """The whole page."""
        made = f"*Made by `experiments/seed_paper/{self.name}.py`; every number on this page was computed by it.*"
        return "\n\n".join([f"# {self.title}", made, *self.parts]) + "\n"

    def write(self) -> Path:
        """Write the page and return its path."""
        self.folder.mkdir(parents=True, exist_ok=True)
        path = self.folder / f"{self.name}.md"
        path.write_text(self.text, encoding="utf-8")
        return path


def percent(share: float, digits: int = 0) -> str:
    """Return a share in words, e.g. `12 %`."""
    return f"{100 * share:.{digits}f} %"
