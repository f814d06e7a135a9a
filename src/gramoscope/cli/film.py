"""`gramoscope film`: any sound in, the film of a record that carries it out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from gramoscope.cli.terminal import FINE, FINITE, PROCESSORS, Terminal, Workers

if TYPE_CHECKING:
    from gramoscope.conventions import FloatArray

LONGEST_UNASKED_S = 0.25
"""So much of a longer sound is filmed when nobody says how much: half a thousand groups, four gigabytes."""


def film(
    sound: Path,
    capture: Path,
    /,
    *,
    start: Annotated[float, FINITE] = 0.0,
    seconds: Annotated[float | None, FINITE] = None,
    bench: Path | None = None,
    cut: Literal["lateral", "vertical", "stereo"] | None = None,
    level_cm_s: Annotated[float, FINITE] = 3.0,
    characteristic: str | None = None,
    texture: Literal["powder", "shellac", "polished"] = "powder",
    damage: Literal["none", "light", "heavy"] = "none",
    imperfections: Literal["none", "modest", "rough"] = "none",
    seed: int = 0,
    frames_per_group: int | None = None,
    height: int | None = None,
    layout: Literal["tiff", "png", "zarr", "video"] = "tiff",
    colour: Literal["mono", "rgb"] | None = None,
    bits: int | None = None,
    columns: Literal["forward", "backward"] | None = None,
    rows: Literal["inward", "outward"] | None = None,
    compress: bool = False,
    overwrite: bool = False,
    live: bool = False,
    workers: Workers = PROCESSORS,
    quiet: bool = False,
    json: bool = False,
) -> int:
    """Cut a sound into a record and film its groove: a capture as a rig would make it, and the truth beside it.

    A second of sound at 115 mm is about 2000 groups of 8 MB, so only the first quarter of a second is filmed unless
    --seconds says more. The truth, `truth.npz`, goes into the capture: `gramoscope compare CAPTURE/truth.npz DIR/flat.wav`.

    Parameters
    ----------
    sound
        Any sound file: WAV, FLAC, Ogg, MP3, AIFF. Two channels make a stereo record when --cut is stereo, else their mean
        is cut.
    capture
        Folder to make.
    start
        Second at which to begin.
    seconds
        How much to film.
    bench
        The apparatus, as a file like `capture.toml` or the folder of a capture (the frames and groups in it are not
        needed). The paper's when left out, with a picture that just holds the groove. Options below win.
    cut
        Direction of the groove's motion.
    level_cm_s
        Velocity of the groove, rms over the passage.
    characteristic
        Recording characteristic to cut with: flat (the default), any other that `gramoscope characteristics` lists, or free
        entry such as 300R-12.7, as in `gramoscope play`.
    texture
        What covers the walls: aluminium powder, natural shellac, or next to nothing.
    damage
        Scratches, chips, dust.
    imperfections
        Of the rig: uneven steps, wow, warp, drifting focus, walls off 45°.
    seed
        Another number makes another record of the same sound.
    frames_per_group
        12 when left out.
    height
        Rows of the picture; as many as the groove's swing needs, 512 … 1024, when left out. A --bench has its own.
    layout
        A TIFF a group, a PNG a frame, one Zarr array, or a lossless video.
    colour
        Of the camera.
    bits
        Of the camera, 8 … 16.
    columns
        Whether the groove runs forward or backward along a row of pixels.
    rows
        Whether rows count inward or outward on the disc.
    compress
        Smaller files, slower to read.
    overwrite
        Replace an earlier capture.
    live
        Film in place, so that `gramoscope play CAPTURE --out DIR --follow` can play along.
    workers
        Groups rendered at the same time; the pictures do not depend on it.
    quiet
        Say nothing.
    json
        Print what was made as JSON.
    """
    from gramoscope.apparatus.manifest import read_bench
    from gramoscope.errors import require
    from gramoscope.simulation.film_sound import film_sound, framing_height_px
    from gramoscope.simulation.scene import filming_bench, named_scene

    terminal = Terminal(quiet, json)
    require(
        bench is None or bench.exists(),
        f"there is no file {bench}",
        "a bench: a file like capture.toml",
        "film a moment without --bench, and change the capture.toml that comes out",
    )
    require(
        bench is None or height is None, "--height beside --bench", "one of the two", "write height_px into the bench"
    )
    given = read_bench(bench) if bench is not None else filming_bench()
    samples, rate_hz = _sound(terminal, sound, start, seconds, stereo=(cut or given.disc.cut) == "stereo")
    if bench is None:
        disc = replace(given.disc, cut=cut or given.disc.cut, characteristic=characteristic)
        needed = framing_height_px(samples, rate_hz, level_m_s=level_cm_s / 100, disc=disc)
        given = filming_bench(height_px=needed if height is None else height)
    disc, sensor, sequence = given.disc, given.sensor, given.sequence
    name = characteristic or disc.characteristic or "flat"
    disc = replace(disc, cut=cut or disc.cut, characteristic=name)
    sensor = replace(
        sensor,
        colour=colour or sensor.colour,
        bits=sensor.bits if bits is None else bits,
        columns=columns or sensor.columns,
        rows=rows or sensor.rows,
    )
    if frames_per_group is not None:
        sequence = replace(sequence, frames_per_group=frames_per_group)
    scene = named_scene(
        replace(given, disc=disc, sensor=sensor, sequence=sequence),
        texture=texture,
        damage=damage,
        imperfections=imperfections,
        seed=seed,
    )
    scene = replace(scene, level_m_s=level_cm_s / 100)
    with terminal.progress("Filming") as progress:
        film_sound(
            samples,
            rate_hz,
            scene,
            capture,
            layout,
            compress=compress,
            overwrite=overwrite,
            live=live,
            workers=workers,
            progress=progress,
        )
    tell(terminal, capture)
    return FINE


def _sound(
    terminal: Terminal, path: Path, start_s: float, seconds: float | None, *, stereo: bool
) -> tuple[FloatArray, float]:
    from gramoscope.listening.wav import read_sound

    samples, rate_hz = read_sound(path, start_s=start_s, seconds=seconds)
    whole_s = len(samples) / rate_hz
    if seconds is None and whole_s > LONGEST_UNASKED_S:
        samples = samples[: round(LONGEST_UNASKED_S * rate_hz)]
        terminal.say(
            f"Filming the first {LONGEST_UNASKED_S:g} s of {whole_s:.1f} s: a second of sound is 2000 groups. "
            f"More with --seconds {whole_s:.1f}."
        )
    return (samples[:, :2] if stereo else samples.mean(axis=1)), float(rate_hz)


def tell(terminal: Terminal, capture: Path) -> None:
    """Say what was made."""
    from gramoscope.apparatus.capture import open_capture

    opened = open_capture(capture)
    bench = opened.bench
    size_bytes = sum(path.stat().st_size for path in capture.rglob("*") if path.is_file())
    seconds = float(bench.rotation.time_of_arc_s(bench.passage_length_m))
    terminal.table(
        {
            "filmed": f"{seconds:.3f} s of sound, {bench.passage_length_m * 1e3:.1f} mm of groove",
            "frames": f"{opened.group_count} groups of {bench.sequence.frames_per_group}, {size_bytes / 1e6:.0f} MB",
            "capture": str(capture),
            "next": f"gramoscope play {capture} --out {capture}-played",
        }
    )
    terminal.result(
        {
            "capture": str(capture),
            "groups": opened.group_count,
            "seconds": seconds,
            "passage_m": bench.passage_length_m,
            "bytes": size_bytes,
        }
    )
