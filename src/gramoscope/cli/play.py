"""`gramoscope play`: a capture in, sound files, a report and a picture out."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from gramoscope.cli.picture_options import AS_IT_IS, PictureOptions
from gramoscope.cli.terminal import FINE, FINITE, PROCESSORS, Terminal, Workers, several

SHOWN_GROUPS = 8


def play(
    capture: Path | None = None,
    /,
    *,
    out: Path | None = None,
    recipe: str | None = None,
    rate: int = 96_000,
    characteristic: str | None = None,
    declick: bool = False,
    decrackle: bool = False,
    rumble_hz: Annotated[float | None, FINITE] = None,
    flac: bool = False,
    rpm: str | None = None,
    speed_curve: Path | None = None,
    remove_wow: bool = False,
    full_scale_cm_s: Annotated[float, FINITE] = 50.0,
    title: str = "",
    originator: str = "",
    reference: str = "",
    description: str = "",
    groove: int | None = None,
    picture: PictureOptions = AS_IT_IS,
    again: Path | None = None,
    force: bool = False,
    workers: Workers = PROCESSORS,
    device: Literal["cpu", "cuda"] = "cpu",
    executor: Literal["auto", "threads", "processes", "dask"] = "auto",
    scheduler: str | None = None,
    restart: bool = False,
    keep_reading: bool = False,
    verify: bool = False,
    follow: bool = False,
    json_progress: bool = False,
    quiet: bool = False,
    json: bool = False,
) -> int:
    """Play a filmed record, or photographs of its grooves.

    Writes into DIR, all of them or nothing: `flat.wav` (velocity of the groove in the direction of the cut, no equalisation),
    `walls.wav` (outer and inner wall for themselves), `vertical.wav` (up and down), `equalised.wav`, each Broadcast Wave of
    24 bit with its SHA-256 beside it; `report.html` (how good it is, for people), `report.json` (the same for machines) and
    `groove.png`.

    Repairs are made only when asked for, and can be undone: `flat.wav` stays as it is, and `repaired.wav`, `difference.wav`
    (what was taken off), `cues.json` and `labels.txt` (where, the latter for Audacity) come beside it. `equalised.wav` is then
    made of the repaired sound.

    What was read lies in DIR/.reading.zarr until the transfer is whole. Whatever stops the command (Ctrl-C, a kill, a full
    disk), the same command goes on from there, and the result is the same to the bit. What has changed since is noticed and
    read again.

    What the film does not show (a chipped wall, a lost frame) is bridged, flagged and counted in the report.

    Parameters
    ----------
    capture
        Folder with `capture.toml` and frames or pictures, or one picture (PNG, TIFF, JPEG, BMP); may be left out with --again.
    out
        Folder for the results; made if it does not exist. An earlier transfer in it is replaced. With --again it may be left
        out: a folder beside that of the report, with `-again` after its name.
    recipe
        How to read: a name that ships with us, or a TOML file. `gramoscope recipe` shows them. When left out, best for films
        and stills for photographs.
    rate
        Samples a second.
    characteristic
        Recording characteristic to undo in `equalised.wav`: a name (riaa, flat, aes, decca-ffrr, …) or turnover in Hz, shelf
        and roll-off in dB at 10 kHz, as collectors write them: 500N-16, 300R-12.7, 250N-0. `gramoscope characteristics` lists
        names and letters, and looks up a label and a year. As the capture says when left out, riaa (as in the paper) if it
        does not.
    declick
        Replace clicks by what their surroundings predict, with the pickup's flags as witnesses.
    decrackle
        Take small pulses near the noise off.
    rumble_hz
        Take off what lies below so many hertz, say 20.
    flac
        Write every sound as FLAC too: the same samples in about half the room.
    rpm
        The speed at which the record was meant to turn: a number, or 78-us (78.26), 78-europe (77.92), 76-us (76.60), 80, 45,
        33-third (or 33⅓), 16-two-thirds, pathe (90). As the capture says when left out.
    speed_curve
        CSV file with the header `time_s,rpm`: the speed over time, in the seconds of the sound that comes out; straight
        lines between the rows, the same before the first and after the last. In place of `--rpm`.
    remove_wow
        Measure how far the hole is off centre, and remove its wow if that is sure; the passage must cover most of a turn. A
        survey of the passage comes first and takes time. Without it the wow is measured and told, and nothing is done.
    full_scale_cm_s
        Groove velocity at full scale (0 dBFS). The same for all files and for quiet and loud records alike: nothing is
        normalised. What lies beyond is clipped, counted and told.
    title
        Title of the recording; as the capture says when left out.
    originator
        Who makes the transfer: the name of your archive, 32 characters at the most.
    reference
        Your mark for it, a shelf or accession number, 32 characters at the most; the capture's name when left out.
    description
        What the files shall say first of themselves, 256 characters at the most; title, performer, label, matrix, side and
        date of the capture when left out.
    groove
        Of photographs: play this groove alone, counted from 1 in playing order.
    again
        A `report.json`: repeat its transfer bit for bit, with its recipe, settings and words, from the same capture. What
        differs is told: other versions, other sums.
    force
        With --again: go on although the capture is not the one that was played.
    workers
        Stretches read at the same time; one for each processor when left out. The result does not depend on it.
    device
        What reads: cpu, or cuda, a graphics card by NVIDIA (needs `pip install "gramoscope[gpu]"`; recipe best only; so far
        checked in CUDA's simulator, not on a card). Both agree to rounding.
    executor
        Who reads: threads, processes, or the workers of Dask (needs `pip install "gramoscope[cluster]"`), on this machine
        unless --scheduler says where; auto takes processes for 1024 groups or more, which they read sooner than threads. The
        result does not depend on it.
    scheduler
        Address of a Dask scheduler that runs already, such as tcp://10.0.0.1:8786, whatever started it. Its workers must see
        the capture and DIR under the same paths.
    restart
        Throw away what an earlier, stopped command read.
    keep_reading
        Keep what was read when the transfer is whole: another transfer into DIR, with another rate, characteristic, smoother or
        repair, then need not read again.
    verify
        Add up the files of what was read before, even if size and time of writing are the same.
    follow
        Play along while the capture is still being filmed (see `gramoscope film --live`): groups are played as they arrive,
        with level, sharpness and stripes on the way, and warnings; the sound can be heard while it grows. The first groups are
        what is learned from.
    json_progress
        Tell how far things are in lines of JSON, on standard error.
    quiet
        Say nothing.
    json
        Print the report as JSON.
    """
    if again is not None:
        from gramoscope.cli.play_again import play_again

        return play_again(play, locals())
    from gramoscope.apparatus.opening import opened
    from gramoscope.cli.watch import at_work, groups_of
    from gramoscope.errors import ArgumentError
    from gramoscope.player.catalogue import Catalogue
    from gramoscope.player.devices import device_named
    from gramoscope.player.following import follow as follow_film
    from gramoscope.player.play import Settings
    from gramoscope.player.play import play as play_capture
    from gramoscope.player.recipe import load_recipe, recipe_for, with_repairs
    from gramoscope.player.speed import Speed

    if capture is None or out is None:
        raise ArgumentError(
            f"{'CAPTURE' if capture is None else '--out'} requires an argument", "a capture and a folder"
        )
    terminal = Terminal(quiet, json)
    following = follow_film(capture) if follow else None
    played = opened(capture, picture.manifest(rpm)) if following is None else following.capture
    name = characteristic or played.bench.disc.characteristic or "riaa"
    catalogue = Catalogue(title=title, originator=originator, reference=reference, description=description)
    chosen = with_repairs(
        load_recipe(recipe or recipe_for(played)), declick=declick, decrackle=decrackle, rumble_hz=rumble_hz
    )
    speed, where = Speed.chosen(rpm, speed_curve, remove_wow=remove_wow), device_named(device)
    if played.layout == "stills" and speed.rpm == played.bench.rotation.rpm:
        # it is the picture's own speed, not another one
        speed = Speed.chosen(None, speed_curve, remove_wow=remove_wow)
    settings = Settings(
        rate_hz=float(rate),
        characteristic_name=name,
        workers=workers,
        full_scale_m_s=full_scale_cm_s / 100,
        flac=flac,
        catalogue=catalogue,
        speed=speed,
        device=where,
        groove=groove,
    )
    how: dict[str, Any] = {
        "groups": groups_of(played) if device == "cpu" else 0,
        "json_progress": json_progress,
        "restart": restart,
        "keep_reading": keep_reading,
        "verify": verify,
        "following": following,
    }
    with at_work(terminal, out, executor, scheduler, workers, **how) as (progress, work):
        report = play_capture(played, chosen, out, settings, progress=progress, work=work)
    terminal.result(report)
    tell(terminal, report, out)
    return FINE


def tell(terminal: Terminal, report: Mapping[str, Any], out: Path) -> None:
    """Say in a few lines what a transfer is worth and where it lies."""
    noise, share, level = report["noise_estimate"], report["share"], report["level"]
    rows = {
        "played": f"{report['seconds']:.3f} s in {report['elapsed_s']:.1f} s, recipe {report['recipe'].get('name', '?')}",
        "speed": _speed(report["speed"]),
        **({"grooves": _grooves(report["grooves"])} if "grooves" in report else {"groups": _groups(report)}),
        "measured": f"{share['measured']:.1%} of the sound; {share['interpolated']:.1%} interpolated and flagged",
        "level": f"{level['rms_cm_s']:.2f} cm/s rms, {level['peak_cm_s']:.1f} cm/s peak",
        "noise": f"{noise['sigma_rms_cm_s']:.2f} cm/s rms by the error bars, {_below(noise)}",
        "equalised": f"{report['files']['equalised.wav']['characteristic']}",
        **({"repaired": _repairs(report)} if report["repair"] else {}),
        "files": "  ".join(str(out / name) for name in _names(report)),
    }
    terminal.table(rows)
    for hint in filter(None, (hint.get("words") for hint in report["hints"].values())):
        terminal.say(f"[yellow]Hint:[/] {hint}")
    for remark in report["remarks"]:
        terminal.say(f"[yellow]Note:[/] {remark}")
    for problem in report["problems"][:5]:
        terminal.say(f"[yellow]Found:[/] {problem}")
    more = len(report["problems"]) - 5 + report["problems_not_listed"]
    if more > 0:
        terminal.say(f"[yellow]Found:[/] {more} more problems; they are in report.json")


def _names(report: Mapping[str, Any]) -> list[str]:
    from gramoscope.player.transfer import cue_files_of

    sounds = [[name, *([file["flac"]["name"]] if "flac" in file else [])] for name, file in report["files"].items()]
    return [
        *(name for names in sounds for name in names),
        *cue_files_of(report),
        *(report["grooves"][which] for which in ("table", "edges", "labels") if "grooves" in report),
        "groove.png",
        "report.html",
        "report.json",
    ]


def _repairs(report: Mapping[str, Any]) -> str:
    spans, seconds = report["repair"]["spans"], report["repair"]["seconds"]
    repaired = {kind: number for kind, number in spans.items() if kind != "interpolated"}
    told = [f"{several(number, 'span')} by {kind} ({seconds[kind] * 1e3:.1f} ms)" for kind, number in repaired.items()]
    return "; ".join(told) or "nothing was found"


def _speed(speed: Mapping[str, Any]) -> str:
    from gramoscope.player.speed import speed_in_words

    if speed["curve"] is not None:
        return f"{speed_in_words(speed)}, as {speed['chosen']} says"
    return speed_in_words(speed) + (f"; the capture says {speed['capture_rpm']:g}" if speed["chosen"] else "")


def _groups(report: Mapping[str, Any]) -> str:
    groups, numbers = report["groups"], report["lost_groups"]
    shown = ", ".join(str(number) for number in numbers[:SHOWN_GROUPS]) + (", …" if len(numbers) > SHOWN_GROUPS else "")
    which = f" ({shown})" if numbers else ""
    return f"{groups['read']} read, {groups['lost']} lost{which}; {several(report['frames_lost'], 'frame')} lost"


def _grooves(grooves: Mapping[str, Any]) -> str:
    spans = [f"{row['groove']}: {row['start_s']:.4f} … {row['stop_s']:.4f} s" for row in grooves["played"]]
    shown = ", ".join(spans[:SHOWN_GROUPS]) + (", …" if len(spans) > SHOWN_GROUPS else "")
    turns = sum(row["turns"] for row in grooves["played"])
    joined = f", of {several(turns, 'turn')}" if grooves["turn_px"] is not None else ""
    return f"{len(spans)} in {several(grooves['pictures'], 'picture')}{joined} ({shown})"


def _below(noise: Mapping[str, float]) -> str:
    below_db = noise["signal_to_noise_db"]
    return f"{below_db:.1f} dB below the sound" if math.isfinite(below_db) else "as strong as the sound"
