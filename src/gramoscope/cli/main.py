"""The command `gramoscope`.

Commands import what they need when they run, so that help comes at once.
"""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Sequence
from importlib.metadata import version

import cyclopts

from gramoscope.cli.characteristics import characteristics
from gramoscope.cli.compare import compare
from gramoscope.cli.demo import demo
from gramoscope.cli.film import film
from gramoscope.cli.info import info
from gramoscope.cli.pack import pack
from gramoscope.cli.play import play
from gramoscope.cli.recipe import recipe
from gramoscope.cli.terminal import BAD_INPUT, FINE, INTERRUPTED, show_error
from gramoscope.cli.unroll import unroll
from gramoscope.errors import GramoscopeError
from gramoscope.interruption import ctrl_c_noted

app = cyclopts.App(
    name="gramoscope",
    help="""Play gramophone records with light.

    A microscope films the groove of a slowly turning record through an objective with two focal planes; Gramoscope turns the
    film into sound, with error bars.

    First steps, without a record:

    - `gramoscope demo` films a sound of its own, plays the film and says how well that went;
    - `gramoscope film SOUND CAPTURE` films any sound file;
    - `gramoscope play CAPTURE --out DIR` plays a film;
    - `gramoscope play PICTURE.png --out DIR` plays a photograph of grooves; `gramoscope unroll` straightens a scan of a disc;
    - `gramoscope pack DIR` makes a package for an archive of it.

    Exit codes: 0 all is well; 1 `info` found something wrong; 2 the command cannot work as given; 130 stopped by Ctrl-C.
    """,
    help_format="markdown",
    version=version("gramoscope"),
    suppress_keyboard_interrupt=False,
    result_action="return_value",
    default_parameter=cyclopts.Parameter(negative=()),
)
for command in (demo, film, play, compare, info, recipe, characteristics, pack, unroll):
    app.command(command)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line.

    Parameters
    ----------
    arguments : sequence of str, optional
        Those of the process when left out.

    Returns
    -------
    int
        Exit code, see `gramoscope.cli.terminal`.
    """
    with ctrl_c_noted() as stopped:
        try:
            result = app(arguments if arguments is None else list(arguments), exit_on_error=False)
            sys.stdout.flush()
        except BaseException as error:
            if not (stopped() or isinstance(error, KeyboardInterrupt)):
                return _told(error)
            if arguments is None:
                # libraries that were stopped half-way complain while the interpreter tidies up: nobody can use that
                sys.unraisablehook = lambda _: None
            sys.stderr.write("\nStopped. No half-written file was left.\n")
            return INTERRUPTED
    return result if isinstance(result, int) else FINE


def _told(error: BaseException) -> int:
    """Tell people what went wrong; a defect is theirs who wrote this."""
    match error:
        case cyclopts.CycloptsError():
            pass  # told by the one who raised it
        case BrokenPipeError():
            _write_no_more()
            return FINE
        case OSError():
            _write_no_more()
            show_error(_of_the_system(error))
        case GramoscopeError():
            show_error(error)
        case MemoryError():
            show_error(
                GramoscopeError("there is not enough memory", "less at a time", "fewer --workers, or a lower --rate")
            )
        case _:
            raise error
    return BAD_INPUT


def _write_no_more() -> None:
    """Nobody reads standard output any more (`| head`), or it cannot be written: what is left of it goes nowhere."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _of_the_system(error: OSError) -> GramoscopeError:
    where = f"{error.filename}: " if error.filename else "reading or writing failed: "
    return GramoscopeError(
        f"{where}{error.strerror or error}",
        "files that can be read, and a disk with room",
        "check the names, the permissions and the room on the disk",
    )
