"""Every sound file says what it is, of which record, by whom, and how it was made."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from datetime import datetime, timedelta, timezone
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest
import wavinfo

from gramoscope.errors import ArgumentError
from gramoscope.player.catalogue import Catalogue, metadata_of
from gramoscope.player.play import Settings
from gramoscope.player.recipe import load_recipe
from gramoscope.player.tracks import EQUALISED, FLAT, TRACKS, WALLS, Track
from gramoscope.simulation.scene import filming_bench

PROGRAM = f"Gramoscope {version('gramoscope')}"
MADE = datetime(2031, 2, 13, 1, 15, 16, tzinfo=timezone(timedelta(hours=2)))
NOTES = {"title": "Kalinka", "performer": "A choir", "label": "Orfej", "matrix": "4711-II", "side": "B", "date": "1931"}


BENCH = filming_bench()
NOTED = replace(BENCH, disc=replace(BENCH.disc, notes=NOTES))


def _said(
    track: Track = FLAT, *, rate_hz: float = 96_000.0, curve: str = "riaa", name: str = "side-b", **words: Any
) -> Any:
    settings = Settings(rate_hz, curve, catalogue=Catalogue(**{"made": MADE, **words}))
    return metadata_of(track, NOTED, load_recipe("seed-paper"), settings, capture_name=name)


def test_the_record_is_described_by_what_the_manifest_knows() -> None:
    said = _said()
    assert said.description == (
        "Kalinka, A choir, Orfej, 4711-II, B, 1931. velocity of the groove in the direction of the cut; full scale 0.5 m/s"
    )
    assert (said.info["INAM"], said.info["IART"], said.info["ISRC"]) == ("Kalinka", "A choir", "Orfej 4711-II B")
    assert (said.originator, said.originator_reference) == (PROGRAM, "side-b")


def test_the_archives_words_win() -> None:
    said = _said(title="Other", originator="The archive", reference="A/1", description="Side B, transfer 2")
    assert said.description.startswith("Side B, transfer 2. velocity")
    assert (said.info["INAM"], said.originator, said.originator_reference) == ("Other", "The archive", "A/1")
    long = _said(description="d" * 250)
    assert long.description == "d" * 250, "their words before ours"


def test_the_history_is_that_of_r98() -> None:
    lines = [step.line() for step in _said(EQUALISED, rate_hz=48_000.0, curve="columbia-lp").coding_history]
    assert lines[0] == "A=ANALOGUE,M=mono,T=gramophone record; 78 rpm; lateral cut"
    assert lines[1].startswith(
        f"A=PCM,F=48000,W=24,M=mono,T={PROGRAM}; optical; recipe seed-paper; equalised for playback"
    )
    assert "turnover 500.5 Hz" in lines[1]
    assert lines[1].endswith("full scale 0.5 m/s")
    assert lines[1].count(",") == 4, "commas part the fields"
    (_, flat), (_, walls) = (_said(track).coding_history for track in (FLAT, WALLS))
    assert "not equalised" in flat.text
    assert (flat.mode, walls.mode) == ("mono", "dual-mono")


def test_the_moment_is_told_in_utc() -> None:
    assert _said().made.strftime("%Y-%m-%d %H:%M:%S") == "2031-02-12 23:15:16"


def test_no_two_files_share_a_umid_and_the_same_transfer_has_the_same() -> None:
    umids = {_said(track).umid for track in TRACKS}
    umids |= {_said(made=MADE + timedelta(microseconds=1)).umid, _said(curve="flat", reference="x").umid}
    assert len(umids) == len(TRACKS) + 2
    assert _said().umid == _said().umid


@pytest.mark.parametrize("wrong", [{"originator": "x" * 33}, {"reference": "x" * 33}, {"description": "x" * 257}])
def test_words_that_do_not_fit_are_refused_before_anything_is_read(wrong: dict[str, str]) -> None:
    with pytest.raises(ArgumentError, match=f"{len(next(iter(wrong.values())))} characters"):
        Catalogue(**wrong)


def test_every_name_of_a_folder_is_a_reference() -> None:
    said = _said(name="Größe " + "x" * 40)
    assert said.originator_reference == "Gro?e " + "x" * 26


def test_it_stands_in_the_files(transfer: Any, played: Callable[..., Any], capture: Path, tmp_path: Path) -> None:
    words = Catalogue(title="A song", originator="The archive", reference="A/1", made=MADE)
    other = played(capture, tmp_path / "out", catalogue=words)
    for name, file in other.report["files"].items():
        bext = wavinfo.WavInfoReader(str(other.folder / name)).bext
        assert (bext.version, bext.originator, bext.originator_ref, bext.time_reference) == (2, "The archive", "A/1", 0)
        assert bext.description == file["description"]
        assert [line.rstrip() for line in bext.coding_history.splitlines()] == file["coding_history"]
        peak = file["loudness"]["max_true_peak_dbtp"]
        assert bext.max_true_peak == pytest.approx(327.67 if peak is None else peak, abs=0.006)
    assert other.report["made"] == MADE.isoformat(timespec="seconds")
    assert other.report["catalogue"]["originator"] == "The archive"
