"""What the sound files of a transfer say of themselves: the archive's words, and how they were made."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from importlib.metadata import version
from typing import TYPE_CHECKING

from gramoscope.apparatus.bench import Bench
from gramoscope.apparatus.still_bench import StillBench
from gramoscope.listening.broadcast_metadata import (
    DESCRIPTION,
    ORIGINATOR,
    REFERENCE,
    BroadcastMetadata,
    CodingStep,
    ascii_text,
    basic_umid,
)
from gramoscope.player.recipe import Recipe
from gramoscope.player.tracks import Track

if TYPE_CHECKING:
    from gramoscope.player.play import Settings

BITS = 24


@dataclass(frozen=True)
class Catalogue:
    """The archive's words for a transfer; what is left out comes from the capture.

    Parameters
    ----------
    title : str
        Of the recording; as the manifest says when empty.
    originator : str
        Who makes the transfer, 32 characters at the most; the program when empty.
    reference : str
        The archive's own mark for it, 32 characters at the most; the name of the capture when empty.
    description : str
        256 characters at the most; title, performer, label, matrix, side and date of the manifest when empty.
    made : datetime
        When the transfer was made, in UTC. The same moment, capture, recipe and settings give the same bytes.
    """

    title: str = ""
    originator: str = ""
    reference: str = ""
    description: str = ""
    made: datetime = field(default_factory=lambda: datetime.now(UTC))

    def __post_init__(self) -> None:
        # refuses what does not fit
        BroadcastMetadata(self.description, self.originator, self.reference)


def metadata_of(
    track: Track, bench: Bench | StillBench, recipe: Recipe, settings: Settings, *, capture_name: str
) -> BroadcastMetadata:
    """Return what one sound file of a transfer says of itself."""
    words, disc, program = settings.catalogue, bench.disc, f"Gramoscope {version('gramoscope')}"
    title = words.title or disc.notes.get("title", "")
    reference = words.reference or ascii_text(capture_name)[:REFERENCE]
    description = _description(words.description or record_in_words(title, disc.notes), track, settings)
    medium = f"gramophone record; {settings.speed.rotation_of(bench.rotation).in_words()}; {disc.cut} cut"
    steps = track.done(settings, recipe)
    told = (f"recipe {recipe.name}", settings.speed.done(bench.rotation), _assumed(bench), steps)
    done = "; ".join([program, "optical", *filter(None, told), f"full scale {settings.full_scale_m_s:g} m/s"])
    mode = "mono" if len(track.channels) == 1 else "dual-mono"
    made = words.made.astimezone(UTC)
    label = " ".join(disc.notes[name] for name in ("label", "matrix", "side") if name in disc.notes)
    return BroadcastMetadata(
        description=description,
        originator=words.originator or program[:ORIGINATOR],
        originator_reference=reference,
        made=made,
        coding_history=(
            CodingStep("ANALOGUE", "stereo" if disc.cut == "stereo" else "mono", medium),
            CodingStep("PCM", mode, done, rate_hz=round(settings.rate_hz), bits=BITS),
        ),
        umid=basic_umid(
            "\n".join([made.isoformat(), reference, track.name, description, done]), channels=len(track.channels)
        ),
        info={
            "INAM": title,
            "IART": disc.notes.get("performer", ""),
            "IARL": words.originator,
            "ISRC": label,
            "IMED": medium,
            "ICRD": made.strftime("%Y-%m-%d"),
            "ISFT": program,
            "ICMT": f"{track.what}; {steps}",
        },
    )


def _assumed(bench: Bench | StillBench) -> str:
    """What of the scale nobody knows, in ASCII."""
    if not isinstance(bench, StillBench) or not bench.assumed:
        return ""
    return ascii_text("scale not known, assumed: " + ", ".join(bench.assumed))


def record_in_words(title: str, notes: Mapping[str, str]) -> str:
    """Return what is known of a record, in a line; empty if nothing is.

    Parameters
    ----------
    title : str
        Of the recording.
    notes : mapping
        As in `gramoscope.disc.formats.Disc`; its title does not count.
    """
    notes = {**notes, "title": title}
    return ", ".join(
        notes[name] for name in ("title", "performer", "label", "matrix", "side", "date") if notes.get(name)
    )


def _description(words: str, track: Track, settings: Settings) -> str:
    """The archive's words and what the file holds, the second as far as there is room."""
    ours = f"{track.what}; full scale {settings.full_scale_m_s:g} m/s"
    both = ascii_text(f"{words}. {ours}" if words else ours)
    return both if len(both) <= DESCRIPTION else ascii_text(words)[:DESCRIPTION]
