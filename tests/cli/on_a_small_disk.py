"""Plays onto a disk of its own that is too small, and once more when it has become larger; says how both went.

    unshare --mount python on_a_small_disk.py CAPTURE OUT MEGABYTES COPY

The disk is a tmpfs at OUT, which nobody else sees and which is gone afterwards: what lies there in the end is copied.
"""

import json
import shutil
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path

from gramoscope.apparatus.capture import open_capture
from gramoscope.errors import OutputError
from gramoscope.player.catalogue import Catalogue
from gramoscope.player.play import Settings, play
from gramoscope.player.reading_store import STORE
from gramoscope.player.recipe import load_recipe

SETTINGS = Settings(workers=2, catalogue=Catalogue(made=datetime(2031, 2, 13, tzinfo=UTC)))


def _mount(out: Path, *options: str) -> None:
    subprocess.run(["mount", *options, str(out)], check=True)


def main() -> int:
    """Play twice."""
    capture, out, size, copy = Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3], Path(sys.argv[4])
    out.mkdir()
    _mount(out, "-t", "tmpfs", "-o", f"size={size}m", "tmpfs")
    said = {"error": "", "left": [], "pieces": 0}
    try:
        play(open_capture(capture), load_recipe("seed-paper"), out, SETTINGS)
    except OutputError as error:
        words = out / STORE / "words" / "c"
        said = {
            "error": str(error),
            "left": [path.name for path in out.iterdir()],
            "pieces": len(list(words.iterdir())),
        }
    _mount(out, "-o", "remount,size=256m")
    play(open_capture(capture), load_recipe("seed-paper"), out, SETTINGS)
    shutil.copytree(out, copy)
    print(json.dumps(said))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
