"""The files of a transfer are all there or not at all, and an earlier transfer survives a failed one."""

from __future__ import annotations

import hashlib
import json
import os
import re
import resource
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile
from matplotlib.figure import Figure

from gramoscope.errors import OutputError
from gramoscope.listening.broadcast_metadata import BroadcastMetadata
from gramoscope.player.outputs import Outputs
from gramoscope.player.track_file import TrackFile
from gramoscope.player.tracks import EQUALISED, FLAT, REPAIR_TRACKS, TRACKS, Track, alone
from gramoscope.quality import Quality
from gramoscope.signal_path import Audio

RATE_HZ = 96_000.0
SOUNDS = ("flat.wav", "equalised.wav")
NAMES = {*SOUNDS, *(f"{name}.sha256" for name in SOUNDS), "report.json", "report.html", "groove.png"}
FLACS = {"flat.flac", "equalised.flac", "flat.flac.sha256", "equalised.flac.sha256"}


def _outputs(folder: Path, *, flac: bool = False) -> Outputs:
    tracks = {FLAT: BroadcastMetadata("flat"), EQUALISED: BroadcastMetadata("equalised")}
    return Outputs(folder, tracks, rate_hz=RATE_HZ, full_scale_m_s=0.5, flac=flac)


def _write(files: Outputs, track: Track, *levels: float, samples: int = 3000) -> None:
    pieces = [
        Audio(k * samples, RATE_HZ, np.full(samples, level), np.zeros(samples), np.zeros(samples, np.uint16))
        for k, level in enumerate(levels)
    ]
    assert list(files.kept(track, pieces, alone)) == pieces


def _transfer(
    folder: Path, *, level: float = 0.2, samples: int = 700, report: Any = None, flac: bool = False
) -> dict[str, Any]:
    with _outputs(folder, flac=flac) as files:
        _write(files, FLAT, level, level, level, samples=samples)
        _write(files, EQUALISED, -level, -level, -level, samples=samples)
        said = files.complete()
        files.finish({"level": level} if report is None else report, _picture(), f"<p>{level}</p>")
    return said


def _picture() -> Figure:
    """Some ten kilobytes that cannot be packed."""
    figure = Figure()
    figure.figimage(np.random.default_rng(1).random((90, 130)))
    return figure


def _content(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@contextmanager
def _files_of_at_most(size_bytes: int) -> Iterator[None]:
    """A disk as good as full: no file grows beyond a size."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size_bytes, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.fixture
def older(tmp_path: Path) -> Path:
    """A folder with a transfer in it."""
    _transfer(tmp_path / "out", level=0.1)
    return tmp_path / "out"


def test_a_transfer_leaves_its_files_and_nothing_else(tmp_path: Path) -> None:
    _transfer(tmp_path / "new" / "deep" / "out")
    out = tmp_path / "new" / "deep" / "out"
    assert set(_content(out)) == NAMES
    assert json.loads((out / "report.json").read_text()) == {"level": 0.2}
    assert (out / "report.html").read_text() == "<p>0.2</p>"
    flat, equalised = soundfile.read(out / "flat.wav")[0], soundfile.read(out / "equalised.wav")[0]
    assert flat.size == equalised.size == 2100
    np.testing.assert_allclose(flat, -equalised, atol=2**-22)


def test_until_the_end_of_the_block_nothing_has_its_name(older: Path) -> None:
    before = _content(older)
    with _outputs(older) as files:
        _write(files, FLAT, 1.0)
        seen = {name: (older / name).read_bytes() for name in NAMES}
        assert seen == before
        assert all(name.startswith(".") for name in set(_content(older)) - NAMES)


def test_a_new_transfer_replaces_an_older_one_whole(older: Path) -> None:
    before = _content(older)
    _transfer(older, level=0.3)
    after = _content(older)
    assert set(after) == NAMES
    assert all(after[name] != before[name] for name in NAMES - {"groove.png"})


class _PictureThatFails(Figure):
    def __init__(self, error: BaseException) -> None:
        super().__init__()
        self.error = error

    def savefig(self, *_: Any, **__: Any) -> None:
        raise self.error


@pytest.mark.parametrize("error", [ValueError("no"), KeyboardInterrupt(), OSError(28, "No space left on device")])
@pytest.mark.parametrize("where", ["in the block", "in the picture"])
@pytest.mark.parametrize("place", ["new", "older"])
def test_whatever_goes_wrong_leaves_things_as_they_were(
    older: Path, tmp_path: Path, error: BaseException, where: str, place: str
) -> None:
    folder = older if place == "older" else tmp_path / "a" / "b"
    before = _content(older)

    def fail() -> None:
        with _outputs(folder, flac=True) as files:
            _write(files, FLAT, 1.0)
            if where == "in the block":
                raise error
            _write(files, EQUALISED, 1.0)
            files.finish({}, _PictureThatFails(error), "")

    with pytest.raises((type(error), OutputError)):
        fail()
    assert _content(older) == before
    assert {path.name for path in tmp_path.iterdir()} == {"out"}, "folders made for it are gone"


def test_a_report_that_cannot_be_written_down_spoils_nothing(older: Path) -> None:
    before = _content(older)
    with pytest.raises(TypeError):
        _transfer(older, report={"what": object()})
    assert _content(older) == before


@pytest.mark.parametrize("size_bytes", [2_000, 10_000], ids=["in the sound", "in the picture"])
def test_a_full_disk_is_said_and_leaves_things_as_they_were(older: Path, size_bytes: int) -> None:
    before = _content(older)
    with _files_of_at_most(size_bytes), pytest.raises(OutputError) as caught:
        _transfer(older, level=0.4)
    assert _content(older) == before
    assert caught.value.needed
    assert "free some space" in caught.value.remedy


def test_a_full_disk_at_the_last_block_of_the_sound_is_noticed(older: Path) -> None:
    before = _content(older)
    whole = (older / "flat.wav").stat().st_size
    with _files_of_at_most(whole - 1), pytest.raises(OutputError):
        _transfer(older, level=0.4)
    assert _content(older) == before


def test_a_folder_that_was_there_and_empty_stays(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    with pytest.raises(ValueError, match="no"), _outputs(tmp_path / "out"):
        raise ValueError("no")
    assert list((tmp_path / "out").iterdir()) == []


def test_a_file_where_the_folder_should_be_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("mine")
    for folder in (tmp_path / "out", tmp_path / "out" / "deeper"):
        with pytest.raises(OutputError) as caught:
            _transfer(folder)
        assert "--out" in caught.value.remedy
    assert (tmp_path / "out").read_text() == "mine"


def test_a_folder_without_permission_is_said(tmp_path: Path) -> None:
    if os.geteuid() == 0:
        pytest.skip("nothing is forbidden to root")
    (tmp_path / "out").mkdir()
    (tmp_path / "out").chmod(0o500)
    for folder in (tmp_path / "out", tmp_path / "out" / "deeper"):
        with pytest.raises(OutputError, match="Permission"):
            _transfer(folder)
    (tmp_path / "out").chmod(0o700)
    assert list((tmp_path / "out").iterdir()) == []


@pytest.mark.parametrize("name", ["equalised.wav", "equalised.wav.sha256", "equalised.flac"])
def test_a_name_that_one_of_the_files_cannot_have_is_found_out_before_the_work(tmp_path: Path, name: str) -> None:
    (tmp_path / "out" / name).mkdir(parents=True)
    with pytest.raises(OutputError, match=re.escape(name)), _outputs(tmp_path / "out"):
        pytest.fail("the block was entered")
    assert {path.name for path in (tmp_path / "out").iterdir()} == {name}


def test_what_a_killed_transfer_left_does_not_confuse_the_next(older: Path) -> None:
    # killed without mercy: its temporaries stay, one with the number of this very process
    stale = {f".flat.wav.{os.getpid()}.part": b"RIFF half", ".report.json.99999.part": b"{"}
    for name, content in stale.items():
        (older / name).write_bytes(content)
    _transfer(older, level=0.3)
    assert soundfile.read(older / "flat.wav")[0][0] == pytest.approx(0.3 / 0.5)
    assert set(_content(older)) - NAMES <= {".report.json.99999.part"}


def test_the_report_is_the_last_to_appear_and_the_first_to_go(older: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen = []
    commit = TrackFile.commit

    def watched(self: Any) -> None:
        seen.append((older / "report.json").exists())
        commit(self)

    monkeypatch.setattr(TrackFile, "commit", watched)
    _transfer(older, level=0.3)
    assert seen == [False, False]


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.mark.parametrize("flac", [False, True])
def test_the_sum_beside_each_file_is_its_own_and_stands_in_the_report(tmp_path: Path, flac: bool) -> None:
    said = _transfer(tmp_path, flac=flac)
    assert set(_content(tmp_path)) == NAMES | (FLACS if flac else set())
    for name in SOUNDS:
        digest = _sha256(tmp_path / name)
        assert (tmp_path / f"{name}.sha256").read_text() == f"{digest}  {name}\n"
        assert said[name]["sha256"] == digest
        if flac:
            copy = name.replace("wav", "flac")
            assert said[name]["flac"] == {"name": copy, "sha256": _sha256(tmp_path / copy)}
            assert (tmp_path / f"{copy}.sha256").read_text() == f"{_sha256(tmp_path / copy)}  {copy}\n"


def test_sha256sum_checks_every_sum(tmp_path: Path) -> None:
    if shutil.which("sha256sum") is None:
        pytest.skip("sha256sum is not installed")
    _transfer(tmp_path, flac=True)
    sums = sorted(path.name for path in tmp_path.glob("*.sha256"))
    assert len(sums) == 4
    check = ["sha256sum", "--check", "--strict", *sums]
    assert subprocess.run(check, cwd=tmp_path, capture_output=True, check=False).returncode == 0
    with (tmp_path / "flat.wav").open("ab") as file:
        file.write(b"x")
    assert subprocess.run(check, cwd=tmp_path, capture_output=True, check=False).returncode != 0


def test_flac_is_the_same_to_the_bit(tmp_path: Path) -> None:
    _transfer(tmp_path, flac=True)
    for name in SOUNDS:
        wav, flac = (soundfile.read(tmp_path / n, dtype="int32")[0] for n in (name, name.replace("wav", "flac")))
        np.testing.assert_array_equal(wav, flac)
        assert wav.any()


def test_a_transfer_without_flac_leaves_none_of_an_older_one(tmp_path: Path) -> None:
    _transfer(tmp_path, flac=True)
    _transfer(tmp_path, level=0.3)
    assert set(_content(tmp_path)) == NAMES


def test_killed_between_two_names_every_file_is_whole_and_no_sum_is_wrong(
    older: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Looks at the folder after every single name that is given or taken away at the end."""
    before = _content(older)
    looks: list[dict[str, bytes]] = []

    def watch(name: str) -> None:
        real = getattr(Path, name)

        def watched(self: Path, *arguments: Any, **options: Any) -> Any:
            answer = real(self, *arguments, **options)
            looks.append({path.name: path.read_bytes() for path in older.iterdir() if not path.name.startswith(".")})
            return answer

        monkeypatch.setattr(Path, name, watched)

    watch("replace")
    watch("unlink")
    _transfer(older, level=0.3)
    monkeypatch.undo()
    after = _content(older)
    assert len(looks) >= 9
    for look in looks:
        for name, content in look.items():
            assert content in (before.get(name), after.get(name)), name
        for name in SOUNDS:
            if f"{name}.sha256" in look:
                digest = hashlib.sha256(look[name]).hexdigest()
                assert look[f"{name}.sha256"] == f"{digest}  {name}\n".encode()
        if "report.json" in look:
            assert look in (before, after)


def test_what_became_of_each_file_is_told(tmp_path: Path) -> None:
    with _outputs(tmp_path) as files:
        flags = np.where(np.arange(3001) < 7, np.uint16(Quality.INTERPOLATED), np.uint16(Quality.EDGE))
        samples = np.full(3001, 0.25)
        samples[[5, 9]] = 0.51, -7.0
        piece = Audio(0, RATE_HZ, samples, samples, flags)
        list(files.kept(FLAT, [piece], alone))
        said = files.complete()["flat.wav"]
    assert (said["samples"], said["clipped_samples"], said["full_scale_m_s"], said["bits"]) == (3001, 2, 0.5, 24)
    assert said["interpolated_samples"] == {"groove": 7}
    assert said["description"] == "flat"
    assert said["loudness"]["max_true_peak_dbtp"] >= 0
    assert np.isnan(said["loudness"]["integrated_lufs"]), "30 ms have none"


def test_tracks_have_names_of_their_own_and_say_what_they_are() -> None:
    every = (*TRACKS, *REPAIR_TRACKS)
    assert len({track.name for track in every}) == len(every) == 6
    assert all(track.name.endswith(".wav") and track.what.isascii() for track in every)
