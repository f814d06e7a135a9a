"""`gramoscope characteristics`: the recording characteristics, and which of them a record may have been cut with."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from gramoscope.cli.terminal import FINE, Terminal

if TYPE_CHECKING:
    from gramoscope.disc.characteristics import Characteristic
    from gramoscope.disc.recorded_with import RecordedWith, Support

    Found = list[tuple[RecordedWith, Support]]

HEADS = ("name", "what", "shelf", "turnover", "roll-off", "at 10 kHz")


def characteristics(
    name: str | None = None,
    /,
    *,
    label: str | None = None,
    year: int | None = None,
    figure: Path | None = None,
    quiet: bool = False,
    json: bool = False,
) -> int:
    """List the recording characteristics, explain one, or look up what a record may have been cut with.

    `gramoscope characteristics --label Decca --year 1948` says which curves go with the label and the year, how sure that is,
    and who says so. Any name in the list, and any curve in the collectors' notation, is good for `--characteristic` of
    `gramoscope play` and `gramoscope film`.

    The notation is turnover in Hz, a letter for the shelf, roll-off in dB at 10 kHz: 500N-16, 250N-0, 300R-12.7. N is no shelf,
    R 50.05 Hz as in RIAA, A and B 50 Hz, C 100 Hz; any other is written with an S: 300S70-16 has its shelf at 70 Hz. A 0 is
    none. What stands in the list is the curve of the list: 350A-10.5 is iec-78, whose turnover is 353.7 Hz.

    Parameters
    ----------
    name
        One characteristic, by name or notation; all when left out.
    label
        Label of the record.
    year
        Year of the recording.
    figure
        Draw the playback curves into this PNG file.
    quiet
        Say nothing.
    json
        Print everything as JSON.
    """
    from gramoscope.disc.characteristics import CHARACTERISTICS, characteristic
    from gramoscope.disc.recorded_with import look_up
    from gramoscope.errors import require

    terminal, asked = Terminal(quiet, json), label is not None or year is not None
    require(not (name and asked), "a name beside --label or --year", "one of the two")
    found: Found = look_up(label, year) if asked else []
    curves = [characteristic(name)] if name else list(CHARACTERISTICS)
    if asked:
        curves = list({line.curve.name: line.curve for line, _ in found}.values())
        _tell_found(terminal, found, label, year)
    else:
        _tell_curves(terminal, curves)
    terminal.result(
        {"found": [_found_json(*each) for each in found]} if asked else {"curves": [_json(each) for each in curves]}
    )
    if figure is not None:
        _draw(terminal, curves, figure)
    return FINE


def _tell_curves(terminal: Terminal, curves: list[Characteristic]) -> None:
    from gramoscope.disc.recorded_with import uses_of

    terminal.columns((*HEADS, "where, when"), [(*_cells(curve), uses_of(curve)) for curve in curves])


def _tell_found(terminal: Terminal, found: Found, label: str | None, year: int | None) -> None:
    from gramoscope.disc.recorded_with import ERA_ACCURACY_DB, known_labels, near_labels

    if label is not None and not any(line.labels for line, _ in found):
        near = near_labels(label)
        hint = f"did you mean {' or '.join(near)}?" if near else f"it names {', '.join(known_labels())}."
        terminal.say(f"[yellow]Note:[/] the literature names no label {label!r}; {hint}")
    if not found:
        terminal.say("Nothing is known of it" + ("; a --year gives the customs of the time." if year is None else "."))
        return
    rows = [(*_cells(line.curve), line.where_when, support.value) for line, support in found]
    terminal.columns((*HEADS, "where, when", "how sure"), rows)
    for source in dict.fromkeys(line.source for line, _ in found):
        terminal.say(f"Source: {source}.")
    low_db, high_db = ERA_ACCURACY_DB
    terminal.say(
        f"Machines of the era kept to their curve within {low_db:g} … {high_db:g} dB: let the ear decide, and keep flat.wav. "
        f"Next: gramoscope play CAPTURE --out DIR --characteristic {found[0][0].curve.name}"
    )


def _cells(curve: Characteristic) -> tuple[str, ...]:
    corners = (curve.shelf_hz, curve.turnover_hz, curve.rolloff_hz)
    shown = ("–" if corner is None else f"{corner:.4g} Hz" for corner in corners)
    return (
        curve.name,
        curve.title,
        *shown,
        f"{-curve.rolloff_db:.1f} dB".replace("-", "−") if curve.rolloff_hz else "–",
    )


def _json(curve: Characteristic) -> dict[str, Any]:
    from gramoscope.disc.recorded_with import uses_of

    return {
        "name": curve.name,
        "title": curve.title,
        "shelf_hz": curve.shelf_hz,
        "turnover_hz": curve.turnover_hz,
        "rolloff_hz": curve.rolloff_hz,
        "rolloff_db": curve.rolloff_db,
        "where_when": uses_of(curve),
    }


def _found_json(line: RecordedWith, support: Support) -> dict[str, Any]:
    from gramoscope.disc.recorded_with import ERA_ACCURACY_DB

    return {
        **_json(line.curve),
        "where_when": line.where_when,
        "support": support.name.lower(),
        "how_sure": support.value,
        "within_db": list(ERA_ACCURACY_DB),
        "source": line.source,
    }


def _draw(terminal: Terminal, curves: list[Characteristic], path: Path) -> None:
    from gramoscope.errors import require
    from gramoscope.listening.characteristics_figure import characteristics_figure
    from gramoscope.listening.ink import save_png

    require(bool(curves), "no curve to draw", "a label or a year that something is known of")
    save_png(characteristics_figure(curves), path)
    terminal.say(f"Drawn into {path}")
