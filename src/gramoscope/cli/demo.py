"""`gramoscope demo`: the whole way round in one command."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from gramoscope.cli.terminal import FINE, FINITE, PROCESSORS, Terminal, Workers


def demo(
    *,
    out: Path = Path("gramoscope-demo"),
    seconds: Annotated[float, FINITE] = 0.1,
    workers: Workers = PROCESSORS,
    quiet: bool = False,
    json: bool = False,
) -> int:
    """Film a short sound that ships with us, play the film, and say how much of the sound came back.

    Parameters
    ----------
    out
        Folder for everything that is made; an earlier demonstration in it is replaced.
    seconds
        How much to film, a hundredth of a second or more; a tenth is 200 groups.
    workers
        Groups at the same time; one for each processor when left out.
    quiet
        Say nothing.
    json
        Print the comparison as JSON.
    """
    from gramoscope.apparatus.capture import open_capture
    from gramoscope.cli import compare as compare_command
    from gramoscope.cli import play as play_command
    from gramoscope.errors import require
    from gramoscope.listening.broadcast_metadata import BroadcastMetadata
    from gramoscope.listening.broadcast_wave import WavWriter
    from gramoscope.listening.compare import compare
    from gramoscope.listening.comparison_figure import comparison_figure
    from gramoscope.listening.ink import save_png
    from gramoscope.listening.pair import at_rate
    from gramoscope.listening.wav import read_sound
    from gramoscope.player.play import Settings, play
    from gramoscope.player.recipe import DEFAULT_RECIPE, load_recipe
    from gramoscope.simulation.demo_sound import demo_sound
    from gramoscope.simulation.film_sound import film_sound
    from gramoscope.simulation.scene import filming_bench, named_scene

    terminal = Terminal(quiet, json)
    require(
        seconds >= SHORTEST_S, f"{seconds:g} seconds", f"at least {SHORTEST_S:g}, for there to be something to compare"
    )
    sound, rate_hz = demo_sound(seconds=seconds)
    bench = filming_bench()
    scene = named_scene(replace(bench, sequence=replace(bench.sequence, frames_per_group=DEMO_FRAMES)))
    capture, played = out / "capture", out / "played"
    terminal.say(f"1. Cutting {seconds:g} s of a sung melody into a record and filming its groove …")
    with terminal.progress("Filming") as progress:
        film_sound(sound, rate_hz, scene, capture, "tiff", overwrite=True, workers=workers, progress=progress)
    said = BroadcastMetadata(description="what was cut into the demonstration's record")
    with WavWriter(out / "original.wav", rate_hz=rate_hz, full_scale_m_s=1.0, metadata=said) as original:
        original.write(0.9 * sound)
    terminal.say("2. Playing the film …")
    opened, settings = open_capture(capture), Settings(characteristic_name="flat", workers=workers)
    with terminal.progress("Playing") as progress:
        report = play(opened, load_recipe(DEFAULT_RECIPE), played, settings, progress=progress)
    play_command.tell(terminal, report, played)
    terminal.say("\n3. What came back, against the original:")
    copy, copy_rate_hz = read_sound(played / "flat.wav")
    found = compare(sound, rate_hz, copy, copy_rate_hz, trim_s=min(ENDS_S, seconds / 10))
    compare_command.tell(terminal, found)
    terminal.result({**found.as_dict(), "folder": str(out)})
    original_there, copy_there = (
        at_rate(sound, rate_hz, found.rate_hz),
        at_rate(copy[:, 0], copy_rate_hz, found.rate_hz),
    )
    save_png(comparison_figure(original_there, copy_there, found.rate_hz, found), out / "comparison.png")
    terminal.say(
        f"\nLook at {played / 'report.html'}, {played / 'groove.png'} and {out / 'comparison.png'}; "
        f"listen to {out / 'original.wav'} and {played / 'flat.wav'}.\n"
        "Your own sound: gramoscope film SOUND CAPTURE, then gramoscope play CAPTURE --out DIR"
    )
    return FINE


SHORTEST_S = 0.01
ENDS_S = 0.002
"""Left out of the comparison at both ends, where the film goes on a little longer than the sound."""
DEMO_FRAMES = 4
"""Frames a group: fewer than a rig would take, so that nobody waits."""
