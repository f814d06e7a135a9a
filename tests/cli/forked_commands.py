"""Run command lines, each in a fork of this process, which has everything imported; used by `test_interruption.py`.

    python forked_commands.py

Reads lines of JSON, {"arguments": […], "said": FILE}: what to run and where all goes that it says. Answers each with the number
of its process, and with its exit code when it has ended.
"""

from __future__ import annotations

import json
import os
import signal
import sys

import gramoscope.cli.play
import gramoscope.cli.watch
import gramoscope.player.play
import gramoscope.simulation.film_sound  # noqa: F401
from gramoscope.cli.main import main


def run(arguments: list[str], said: str) -> None:
    """Be the command, to the end of this process."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    file = os.open(said, os.O_WRONLY | os.O_CREAT)
    os.dup2(file, 1)
    os.dup2(file, 2)
    sys.argv = ["gramoscope", *arguments]
    code = 1
    try:
        code = main()
    except BaseException:
        sys.excepthook(*sys.exc_info())
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


if __name__ == "__main__":
    for line in sys.stdin:
        process = os.fork()
        if process == 0:
            run(**json.loads(line))
        print(process, flush=True)
        print(os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]), flush=True)
