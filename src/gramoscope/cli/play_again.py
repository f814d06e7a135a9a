"""`gramoscope play --again`: a transfer repeated from its report."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from gramoscope.cli.terminal import FINE, Terminal
from gramoscope.errors import require

HOW = ("restart", "keep_reading", "verify", "json_progress")
ALLOWED = ("capture", "out", "again", "force", "workers", "executor", "scheduler", *HOW, "quiet", "json")
"""Options that say how, not what."""


def play_again(command: Callable[..., int], chosen: Mapping[str, Any]) -> int:
    """Repeat a transfer.

    Parameters
    ----------
    command : callable
        The command whose options they are.
    chosen : mapping
        Option → value; those that say what to do must be left as they are, for the report says it.
    """
    from gramoscope.cli.play import tell
    from gramoscope.cli.watch import at_work, groups_of
    from gramoscope.player.again import load_again
    from gramoscope.player.play import play

    _require_no_others(command, chosen)
    report: Path = chosen["again"]
    again = load_again(report, force=chosen["force"])
    folder = report.resolve().parent
    out: Path = chosen["out"] or folder.with_name(f"{folder.name}-again")
    terminal = Terminal(chosen["quiet"], chosen["json"])
    capture = again.opened(again.capture_folder(chosen["capture"]))
    again.require_same_files_in_common(capture)
    settings = again.settings(capture, chosen["workers"])
    for name, one in again.other_versions().items():
        terminal.say(f"[yellow]Note:[/] {name} was {one['then']} then, and is {one['now']} now")
    groups = groups_of(capture) if settings.device.name == "cpu" else 0
    how = {"groups": groups, **{name: chosen[name] for name in HOW}}
    with at_work(terminal, out, chosen["executor"], chosen["scheduler"], chosen["workers"], **how) as (progress, work):
        repeated = play(capture, again.recipe(), out, settings, progress=progress, judge=again.judged, work=work)
    terminal.result(repeated)
    tell(terminal, repeated, out)
    _tell_sameness(terminal, repeated["again"])
    return FINE


def _require_no_others(command: Callable[..., int], chosen: Mapping[str, Any]) -> None:
    usual = {name: one.default for name, one in inspect.signature(command).parameters.items()}
    others = [name for name, value in usual.items() if name not in ALLOWED and chosen[name] != value]
    require(
        not others,
        f"--again with {', '.join('--' + name.replace('_', '-') for name in others)}",
        "--again alone: the report says how the transfer was made",
        "leave them out, or play without --again",
    )


def _tell_sameness(terminal: Terminal, again: Mapping[str, Any]) -> None:
    if again["other_files"]:
        terminal.say(f"[yellow]Note:[/] other bits than then: {', '.join(again['other_files'])}")
    else:
        terminal.say(f"The same bits as then, all {len(again['same_files'])} sound files.")
