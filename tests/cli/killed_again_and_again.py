"""Play a capture again and again, each time killed a little later; used by `test_killed.py`, in a process of its own.

    python killed_again_and_again.py CAPTURE OUT KILLS SEED

The first life ends before it has read anything, the last when all is read and it draws, those between after so many groups and
a random while.

The process loads everything once and forks, so that a life costs no start. Prints how many groups each life had played.
"""

from __future__ import annotations

import json
import os
import random
import signal
import sys
import time
from datetime import UTC, datetime
from pathlib import Path

from gramoscope.apparatus.capture import open_capture
from gramoscope.player.catalogue import Catalogue
from gramoscope.player.play import Settings, play
from gramoscope.player.reading_store import STORE
from gramoscope.player.recipe import load_recipe

PATIENCE_S = 30.0
RECIPE = load_recipe("seed-paper")
SETTINGS = Settings(workers=2, catalogue=Catalogue(made=datetime(2031, 2, 13, tzinfo=UTC)))


def lives(capture: Path, out: Path) -> int:
    """Begin a life; return its process."""
    process = os.fork()
    if process == 0:
        play(open_capture(capture), RECIPE, out, SETTINGS)
        os._exit(0)
    return process


def main() -> int:
    capture, out, kills, seed = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])
    opened = open_capture(capture)
    # compiled code is loaded before anybody is born
    RECIPE.cartridge_for(opened.bench).learn(opened.group, 1, map).read(opened.group(0))
    moments, words, ends = random.Random(seed), out / STORE / "words" / "c", []

    def groups() -> int:
        return len(list(words.glob("*"))) if words.is_dir() else 0

    for life in range(kills):
        process = lives(capture, out)
        wanted, before = opened.group_count * life // (kills - 1), time.monotonic()
        while groups() < wanted and time.monotonic() - before < PATIENCE_S:
            time.sleep(0.002)
        time.sleep(moments.uniform(0.0, 0.03))
        # who is done already is still to be waited for, and can be killed
        os.kill(process, signal.SIGKILL)
        os.waitpid(process, 0)
        ends.append(groups())
    _, status = os.waitpid(lives(capture, out), 0)
    print(json.dumps({"ends": ends, "status": status}))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
