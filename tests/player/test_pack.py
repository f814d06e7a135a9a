"""A packed transfer is a valid bag by two judges, says the truth about its sounds, and appears whole or not at all."""

from __future__ import annotations

import csv
import hashlib
import json
import logging
import os
import re
import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bagit
import numpy as np
import pytest
from matplotlib.figure import Figure

from gramoscope.apparatus.bench import Bench
from gramoscope.disc.formats import Disc
from gramoscope.errors import GramoscopeError, OutputError, TransferError
from gramoscope.player import pack as pack_module
from gramoscope.player.catalogue import Catalogue, metadata_of
from gramoscope.player.centring import Centring
from gramoscope.player.monitor import Monitor
from gramoscope.player.outputs import Outputs
from gramoscope.player.pack import BagLabel, pack
from gramoscope.player.play import Settings
from gramoscope.player.provenance import InputHashes
from gramoscope.player.recipe import load_recipe, with_repairs
from gramoscope.player.report import transfer_report
from gramoscope.player.speed import Speed
from gramoscope.player.tracks import alone, tracks_of
from gramoscope.quality import Quality
from gramoscope.signal_path import Audio
from gramoscope.turntable.rotation import Rotation
from gramoscope.turntable.speed_curve import SpeedCurve

SAMPLES = 700
LABEL = BagLabel(bagged=date(2031, 2, 13))
NOTES = {"title": "Kalinka", "performer": "Хор", "label": "Orfej", "side": "B"}


def _audio(flags: Quality) -> Audio:
    samples = 0.1 * np.sin(0.3 * np.arange(SAMPLES) + 0.7)
    spoilt = np.zeros(SAMPLES, np.uint16)
    spoilt[100:142] = np.uint16(flags)
    return Audio(0, 96_000.0, samples, np.full(SAMPLES, 1e-4), spoilt)


def _transfer(
    folder: Path,
    *,
    cut: Any = "lateral",
    rpm: float = 78.0,
    curve: str = "riaa",
    flags: Quality | None = None,
    flac: bool = False,
    repaired: bool = False,
    speed: Speed | None = None,
    **words: str,
) -> Path:
    """What `play` leaves, by its own writers, without a film."""
    bench = Bench(disc=Disc(cut=cut, groove_width_m=152.4e-6, notes=NOTES), rotation=Rotation(rpm, 0.115))
    recipe = with_repairs(load_recipe("seed-paper"), declick=False, decrackle=repaired, rumble_hz=None)
    settings = Settings(
        characteristic_name=curve,
        flac=flac,
        catalogue=Catalogue(**words),
        speed=speed if speed is not None else Speed(),
    )
    where = {"folder": Path("films/side-b"), "path": Path("films/side-b"), "name": "side-b", "layout": "tiff"}
    capture = SimpleNamespace(**where, bench=bench, problems=(), common_files=list)
    tracks = {track: metadata_of(track, bench, recipe, settings, capture_name="side-b") for track in tracks_of(recipe)}
    monitor, audio = Monitor(), _audio(flags or Quality(0))
    monitor.heard(audio)
    with Outputs(folder, tracks, rate_hz=settings.rate_hz, full_scale_m_s=0.5, flac=flac) as files:
        for track in tracks_of(recipe):
            for _ in files.kept(track, [audio], alone if len(track.channels) == 1 else lambda piece: (piece, piece)):
                pass
        seen = {"walls": ("inner", "outer"), "calibration": {}, "hashes": InputHashes(), "centring": Centring()}
        reading: Any = SimpleNamespace(**seen, as_dict=dict, remarks=list)
        anything: Any = capture
        report = transfer_report(anything, recipe, reading, settings, monitor, files, folder, 1.0)
        files.finish(report, Figure(figsize=(1, 1)), "<p>page</p>")
    return folder


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return _transfer(tmp_path_factory.mktemp("made") / "transfer", flac=True)


@pytest.fixture
def transfer(made: Path, tmp_path: Path) -> Path:
    """A copy to be spoilt, with a picture of the label beside the sounds."""
    copy = shutil.copytree(made, tmp_path / "transfer")
    (copy / "pictures").mkdir()
    (copy / "pictures" / "étiquette rouge.jpg").write_bytes(b"not really")
    return copy


def _content(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def _technical(bag: Path) -> dict[str, Any]:
    read: dict[str, Any] = json.loads((bag / "metadata" / "technical.json").read_text(encoding="utf-8"))
    return read


def _packed(folder: Path, tmp_path: Path, **transfer: Any) -> dict[str, Any]:
    pack(_transfer(folder, **transfer), tmp_path / "bag", LABEL)
    return _technical(tmp_path / "bag")


def _sound(technical: dict[str, Any], name: str) -> dict[str, Any]:
    (found,) = (file for file in technical["files"] if file["filename"] == f"data/{name}")
    return found


def _judged_by_ourselves(bag: Path) -> None:
    """RFC 8493, sections 2 and 3, read again without the library."""
    assert (bag / "bagit.txt").read_bytes() == b"BagIt-Version: 1.0\nTag-File-Character-Encoding: UTF-8\n"
    files = _content(bag)
    payload = {name for name in files if name.startswith("data/")}
    tags = set(files) - payload - {"tagmanifest-sha256.txt", "tagmanifest-sha512.txt"}
    for kind in ("sha256", "sha512"):
        for manifest, listed in ((f"manifest-{kind}.txt", payload), (f"tagmanifest-{kind}.txt", tags)):
            lines = files[manifest].decode("utf-8").splitlines()
            entries = dict(reversed(line.split("  ", 1)) for line in lines)
            assert len(entries) == len(lines), "no file twice"
            assert set(entries) == listed, "every file, and no other"
            for name, digest in entries.items():
                assert digest == hashlib.new(kind, files[name]).hexdigest()
    info = files["bag-info.txt"].decode("utf-8")
    assert f"Payload-Oxum: {sum(len(files[name]) for name in payload)}.{len(payload)}\n" in info
    assert re.fullmatch(r"(?:[A-Z][A-Za-z-]+: \S[^\r\n]*\n)+", info)
    assert not any(files[name].startswith(b"\xef\xbb\xbf") for name in tags), "no byte order mark"


def test_a_bag_is_valid_by_the_library_of_congress_and_by_the_rules_read_again(transfer: Path, tmp_path: Path) -> None:
    before = _content(transfer)
    said = pack(transfer, tmp_path / "bag", LABEL)
    bag = bagit.Bag(str(tmp_path / "bag"))
    assert bag.validate()
    assert bag.version_info == (1, 0)
    assert sorted(bag.algorithms) == ["sha256", "sha512"]
    _judged_by_ourselves(tmp_path / "bag")
    assert _content(transfer) == before, "the transfer is as it was"
    assert {f"data/{name}": content for name, content in before.items()}.items() <= _content(tmp_path / "bag").items()
    assert said["files"] == len(before)
    assert {path.name for path in tmp_path.iterdir()} == {"transfer", "bag"}
    assert not {path.stat().st_ino for path in transfer.iterdir()} & {
        path.stat().st_ino for path in (tmp_path / "bag" / "data").iterdir()
    }, "a copy, not the same file twice"
    assert (tmp_path / "bag" / "data" / "flat.wav").stat().st_mtime == (transfer / "flat.wav").stat().st_mtime


@pytest.mark.parametrize("name", ["data/flat.wav", "data/report.json", "bag-info.txt", "metadata/technical.json"])
@pytest.mark.parametrize("how", ["changed", "missing"])
def test_tampering_is_noticed(transfer: Path, tmp_path: Path, name: str, how: str) -> None:
    pack(transfer, tmp_path / "bag", LABEL)
    path = tmp_path / "bag" / name
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.unlink()
    if how == "changed":
        path.write_bytes(content)
    with pytest.raises(AssertionError):
        _judged_by_ourselves(tmp_path / "bag")
    with pytest.raises(bagit.BagError):
        bagit.Bag(str(tmp_path / "bag")).validate()


def test_what_is_on_the_bag_comes_from_the_transfer_and_from_the_archive(tmp_path: Path) -> None:
    folder = _transfer(tmp_path / "t", originator="The archive", reference="A/1", rpm=78.26)
    said = pack(folder, tmp_path / "one", LABEL)["bag_info"]
    assert said == bagit.Bag(str(tmp_path / "one")).info
    assert said["Source-Organization"] == "The archive"
    assert said["External-Identifier"] == "A/1"
    assert said["External-Description"] == (
        "Kalinka, Хор, Orfej, B; optical transfer of a gramophone record, lateral cut, 78.26 rpm, 0.007 s"
    )
    assert said["Bagging-Date"] == "2031-02-13"
    assert re.fullmatch(r"\d+\.11", said["Payload-Oxum"])
    assert re.fullmatch(r"\d+\.\d kB", said["Bag-Size"])
    assert said["Bag-Software-Agent"].startswith("Gramoscope ")
    assert "Contact-Name" not in said, "what nobody gave is left out"
    label = BagLabel("Дом звука", "A. Name", "a@b.example", "+1 2", "B/2", "Two\r\nlines: one", date(2030, 1, 2))
    pack(folder, tmp_path / "two", label)
    words = bagit.Bag(str(tmp_path / "two")).info
    assert words["Source-Organization"] == "Дом звука"
    assert (words["Contact-Name"], words["Contact-Email"], words["Contact-Phone"]) == ("A. Name", "a@b.example", "+1 2")
    assert (words["External-Identifier"], words["External-Description"]) == ("B/2", "Two lines: one")
    assert pack(_transfer(tmp_path / "u"), tmp_path / "three", LABEL)["bag_info"]["External-Identifier"] == "side-b"


@pytest.mark.parametrize(
    ("curve", "turnover_hz", "rolloff_db", "shelf_hz"),
    [
        ("riaa", 500.5, -13.7, 50.0),
        ("flat", 0.0, 0.0, None),
        ("european-78", 250.0, 0.0, None),
        ("aes", 400.0, -12.3, None),
        ("columbia-78", 300.0, -16.1, None),
    ],
)
def test_the_equaliser_is_told_in_the_archives_words_for_each_sound(
    tmp_path: Path, curve: str, turnover_hz: float, rolloff_db: float, shelf_hz: float | None
) -> None:
    technical = _packed(tmp_path / "t", tmp_path, curve=curve)
    preamp = _sound(technical, "equalised.wav")["phonoPreamp"]
    assert preamp["eqTurnover"] == {"measure": turnover_hz, "unit": "Hz"}
    assert preamp["eqRolloff"] == {"measure": rolloff_db, "unit": "dB"}
    assert str(preamp["eqRolloff"]["measure"]) != "-0.0"
    assert preamp.get("eqShelf", {"measure": None})["measure"] == shelf_hz
    for name in ("flat.wav", "walls.wav", "vertical.wav"):
        flat = _sound(technical, name)["phonoPreamp"]
        assert (flat["eq"], flat["eqTurnover"]["measure"], flat["eqRolloff"]["measure"]) == ("none", 0, 0)


@pytest.mark.parametrize(
    ("cut", "direction"),
    [("lateral", "lateral"), ("vertical", "vertical"), ("stereo", "lateral and vertical (45/45)")],
)
def test_the_record_is_told_in_the_archives_words(tmp_path: Path, cut: str, direction: str) -> None:
    technical = _packed(tmp_path / "t", tmp_path, cut=cut, rpm=78.26)
    assert technical["playingSpeed"] == {"measure": 78.26, "unit": "rpm"}
    assert technical["grooveDirection"] == direction
    assert technical["grooveSize"] == {"measure": 152.4, "unit": "µm"}
    assert technical["recordingMethod"] == "analogue"
    assert technical["bibliographic"] == NOTES


def test_each_sound_is_described_in_json_and_in_the_table(transfer: Path, tmp_path: Path) -> None:
    pack(transfer, tmp_path / "bag", LABEL)
    technical = _technical(tmp_path / "bag")
    walls = _sound(technical, "walls.flac")
    path = tmp_path / "bag" / walls["filename"]
    assert walls["fileFormat"] == "FLAC"
    assert walls["fileSize"]["measure"] == path.stat().st_size
    assert walls["sha256"] == hashlib.sha256(path.read_bytes()).hexdigest()
    assert walls["sampleRate"] == {"measure": 96_000.0, "unit": "Hz"}
    assert (walls["bitDepth"], walls["channels"]) == (24, ["outer", "inner"])
    assert walls["durationMilli"] == {"measure": pytest.approx(1e3 * SAMPLES / 96_000, abs=1e-3), "unit": "ms"}
    with (tmp_path / "bag" / "metadata" / "technical.csv").open(encoding="utf-8", newline="") as file:
        rows = {row["filename"]: row for row in csv.DictReader(file)}
    assert set(rows) == {file["filename"] for file in technical["files"]}
    assert len(rows) == 8
    row = rows["data/equalised.wav"]
    assert (row["phonoPreamp.eqTurnover (Hz)"], row["phonoPreamp.eqRolloff (dB)"]) == ("500.5", "-13.7")
    assert (row["playingSpeed (rpm)"], row["grooveDirection"], row["sampleRate (Hz)"]) == ("78.0", "lateral", "96000.0")
    assert all(cell for each in rows.values() for cell in each.values()), "no column without a value"


def test_signal_notes_are_derived_or_not_assessed(tmp_path: Path) -> None:
    notes = {note["note"]: note for note in _packed(tmp_path / "t", tmp_path)["signalNotes"]}
    assert list(notes) == [
        *("Centre start disc", "Crackle", "Cracks", "Delamination", "Groove damage", "Incorrect speed", "Surface noise")
    ]
    damage = notes.pop("Groove damage")
    assert damage["status"] == "not found"
    assert {note["status"] for note in notes.values()} == {"not assessed"}
    assert all(note["basis"] for note in notes.values())


def test_groove_damage_is_where_no_stripe_was_found_and_lost_frames_are_told_apart(tmp_path: Path) -> None:
    def damage(name: str, flags: Quality) -> dict[str, str]:
        pack(_transfer(tmp_path / name, flags=flags), tmp_path / f"{name}-bag", LABEL)
        notes = _technical(tmp_path / f"{name}-bag")["signalNotes"]
        (found,) = (note for note in notes if note["note"] == "Groove damage")
        return dict(found)

    chipped = damage("chipped", Quality.NO_STRIPE | Quality.INTERPOLATED)
    assert chipped["status"] == "found"
    assert f"42 of {SAMPLES} samples" in chipped["basis"]
    lost = damage("lost", Quality.FRAME_LOST | Quality.INTERPOLATED)
    assert lost["status"] == "not found"
    assert "42 samples are flagged for lost" in lost["basis"]


def test_a_number_that_nobody_could_give_is_absent(tmp_path: Path) -> None:
    folder = _transfer(tmp_path / "t")
    report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    report["noise_estimate"]["signal_to_noise_db"] = None
    report["files"]["equalised.wav"]["characteristic"] = "of the house"
    (folder / "report.json").write_text(json.dumps(report), encoding="utf-8")
    pack(folder, tmp_path / "bag", LABEL)
    technical = _technical(tmp_path / "bag")
    assert "signalToNoise" not in technical["quality"]
    assert "sigmaRms" in technical["quality"]
    assert "phonoPreamp" not in _sound(technical, "equalised.wav")
    assert len(technical["files"]) == 4


def test_a_repair_goes_along_and_is_told(tmp_path: Path) -> None:
    folder = _transfer(tmp_path / "t", repaired=True)
    pack(folder, tmp_path / "bag", LABEL)
    technical = _technical(tmp_path / "bag")
    names = {file["filename"] for file in technical["files"]}
    assert {"data/repaired.wav", "data/difference.wav"} < names
    assert _sound(technical, "equalised.wav")["madeOf"] == "data/repaired.wav"
    assert "small pulses" in " ".join(_sound(technical, "repaired.wav")["codingHistory"])
    assert _sound(technical, "repaired.wav")["phonoPreamp"]["eq"] == "none"
    crackle = next(note for note in technical["signalNotes"] if note["note"] == "Crackle")
    assert crackle["status"] in ("found", "not found")
    assert "decrackling" in crackle["basis"]
    for name in ("cues.json", "labels.txt"):
        assert (tmp_path / "bag" / "data" / name).is_file()
        spoilt = shutil.copytree(folder, tmp_path / f"without-{name}")
        (spoilt / name).unlink()
        with pytest.raises(TransferError, match=name):
            pack(spoilt, tmp_path / "none", LABEL)


def test_a_speed_that_was_chosen_is_the_one_that_is_told(tmp_path: Path) -> None:
    folder = _transfer(tmp_path / "t", speed=Speed.chosen("78-us", None))
    info = pack(folder, tmp_path / "bag", LABEL)["bag_info"]
    assert "78.261 rpm" in info["External-Description"]
    assert _technical(tmp_path / "bag")["playingSpeed"]["measure"] == pytest.approx(78.26, abs=0.001)
    drifting = _transfer(tmp_path / "u", speed=Speed(name="x", curve=SpeedCurve((0.0, 9.0), (78.0, 76.5))))
    assert "76.5 to 78 rpm" in pack(drifting, tmp_path / "two", LABEL)["bag_info"]["External-Description"]
    range_rpm = {"lowest": 76.5, "highest": 78.0, "unit": "rpm"}
    assert _technical(tmp_path / "two")["playingSpeedRange"] == range_rpm


@pytest.mark.parametrize("links", [True, False], ids=["one disk", "two disks"])
def test_moving_takes_the_files_away_once_the_bag_is_whole(
    transfer: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, links: bool
) -> None:
    before = _content(transfer)
    place = (transfer / "flat.wav").stat().st_ino

    def no_link(*_: Any) -> None:
        raise OSError(18, "Invalid cross-device link")

    if not links:
        monkeypatch.setattr(os, "link", no_link)
    pack(transfer, tmp_path / "bag", LABEL, move=True)
    assert not transfer.exists()
    assert bagit.Bag(str(tmp_path / "bag")).validate()
    after = _content(tmp_path / "bag" / "data")
    assert after == before
    assert ((tmp_path / "bag" / "data" / "flat.wav").stat().st_ino == place) is links


def test_what_changes_while_it_is_moved_stays(transfer: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    judge = pack_module.require_valid

    def meanwhile(bag: Path) -> None:
        judge(bag)
        (transfer / "flat.wav").unlink()
        (transfer / "flat.wav").write_text("another transfer")
        (transfer / "new.txt").write_text("new")

    monkeypatch.setattr(pack_module, "require_valid", meanwhile)
    said = pack(transfer, tmp_path / "bag", LABEL, move=True)
    assert said["not_moved"] == ["flat.wav"]
    assert _content(transfer) == {"flat.wav": b"another transfer", "new.txt": b"new"}
    assert bagit.Bag(str(tmp_path / "bag")).validate()


@dataclass(frozen=True)
class Spoilt:
    """A way to spoil a transfer, and what is said of it."""

    spoil: Callable[[Path], Any]
    said: str


def _edit(name: str, old: bytes, new: bytes) -> Callable[[Path], Any]:
    def edit(folder: Path) -> None:
        content = (folder / name).read_bytes()
        assert old in content
        (folder / name).write_bytes(content.replace(old, new))

    return edit


def _flip(folder: Path) -> None:
    content = bytearray((folder / "walls.wav").read_bytes())
    content[-5] ^= 1
    (folder / "walls.wav").write_bytes(content)


SPOILT = {
    "no folder": Spoilt(shutil.rmtree, "there is no folder"),
    "no report": Spoilt(lambda folder: (folder / "report.json").unlink(), "there is no report.json"),
    "no JSON": Spoilt(lambda folder: (folder / "report.json").write_text("{"), "is not JSON"),
    "a list": Spoilt(lambda folder: (folder / "report.json").write_text("[]"), "has the format None"),
    "another report": Spoilt(_edit("report.json", b"gramoscope-report/1", b"other/3"), "has the format 'other/3'"),
    "an old report": Spoilt(_edit("report.json", b'"catalogue"', b'"katalog"'), "does not tell: catalogue"),
    "a sound missing": Spoilt(lambda folder: (folder / "vertical.wav").unlink(), "there is no vertical.wav"),
    "a FLAC missing": Spoilt(lambda folder: (folder / "flat.flac").unlink(), "there is no flat.flac"),
    "a sum missing": Spoilt(lambda folder: (folder / "flat.wav.sha256").unlink(), "flat.wav.sha256 cannot be read"),
    "another sum": Spoilt(_edit("flat.wav.sha256", b"  flat", b"0  flat"), "flat.wav.sha256 says"),
    "a bit flipped": Spoilt(_flip, "walls.wav has the SHA-256"),
    "under way": Spoilt(lambda folder: (folder / ".flat.wav.7.part").touch(), "is a file under way"),
    "a link": Spoilt(lambda folder: (folder / "x").symlink_to("flat.wav"), "is no plain file"),
    "a per cent sign": Spoilt(lambda folder: (folder / "100%.txt").touch(), "'100%.txt'"),
    "a line break": Spoilt(lambda folder: (folder / "a\nb").touch(), "'a\\nb'"),
    "a blank at the end": Spoilt(lambda folder: (folder / "a ").touch(), "'a '"),
    "twins": Spoilt(lambda folder: (folder / "FLAT.wav").touch(), "are one name to other systems"),
}


@pytest.mark.parametrize("how", SPOILT)
@pytest.mark.parametrize("move", [False, True], ids=["copy", "move"])
def test_what_is_no_whole_transfer_is_refused_and_stays_as_it_was(
    transfer: Path, tmp_path: Path, how: str, move: bool
) -> None:
    SPOILT[how].spoil(transfer)
    before = _content(tmp_path)
    with pytest.raises(TransferError) as refused:
        pack(transfer, tmp_path / "bag", LABEL, move=move)
    assert SPOILT[how].said in refused.value.found
    assert refused.value.needed
    assert refused.value.remedy
    assert _content(tmp_path) == before
    assert not (tmp_path / "bag").exists()


@pytest.mark.parametrize("there", ["a folder", "a file", "a link to nothing"])
def test_what_exists_is_not_overwritten(transfer: Path, tmp_path: Path, there: str) -> None:
    bag = tmp_path / "bag"
    {"a folder": bag.mkdir, "a file": bag.touch, "a link to nothing": lambda: bag.symlink_to("nothing")}[there]()
    with pytest.raises(OutputError, match="there is something called") as refused:
        pack(transfer, bag, LABEL)
    assert "--to" in refused.value.remedy
    assert not bag.is_dir() or not list(bag.iterdir())


def test_impossible_places_are_refused(transfer: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = _content(tmp_path)
    with pytest.raises(GramoscopeError, match="would lie in the transfer"):
        pack(transfer, transfer / "pictures" / "bag", LABEL)
    with pytest.raises(OutputError, match="create the folder first"):
        pack(transfer, tmp_path / "no" / "bag", LABEL)
    full = shutil.disk_usage(tmp_path)._replace(free=1000)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: full)
    with pytest.raises(OutputError, match="0 MB free"):
        pack(transfer, tmp_path / "bag", LABEL)
    assert _content(tmp_path) == before


@pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError(28, "No space left on device"), ValueError("a defect")])
@pytest.mark.parametrize("at", ["copying", "checking"])
@pytest.mark.parametrize("move", [False, True], ids=["copy", "move"])
def test_whatever_goes_wrong_leaves_no_half_bag_and_the_transfer_as_it_was(
    transfer: Path, tmp_path: Path, error: BaseException, at: str, move: bool
) -> None:
    before = _content(tmp_path)
    told: list[str] = []

    def progress(done: int, total: int, what: str) -> None:
        told.append(what)
        assert 0 <= done <= total
        if (at == "copying" and len(told) == 4) or (at == "checking" and "Checking" in what):
            raise error

    with pytest.raises((type(error), OutputError)):
        pack(transfer, tmp_path / "bag", LABEL, move=move, progress=progress)
    assert _content(tmp_path) == before
    assert {path.name for path in tmp_path.iterdir()} == {"transfer"}


def test_a_disk_that_gives_back_something_else_makes_no_bag(
    transfer: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(logging.getLogger(), "handlers", [])  # as outside of the tests

    def progress(_: int, __: int, what: str) -> None:
        if "Checking" in what:
            (copy,) = tmp_path.glob(".bag.*.part/data/groove.png")
            copy.write_bytes(copy.read_bytes()[:-1] + b"!")

    with pytest.raises(OutputError, match="the bag does not hold what was written"):
        pack(transfer, tmp_path / "bag", LABEL, progress=progress)
    assert {path.name for path in tmp_path.iterdir()} == {"transfer"}
    assert capsys.readouterr().err == "", "one message, and not the library's log"


def test_without_the_library_the_remedy_is_said(
    transfer: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "bagit", None)
    with pytest.raises(GramoscopeError, match="is not installed") as refused:
        pack(transfer, tmp_path / "bag", LABEL)
    assert refused.value.remedy == "pip install 'gramoscope[archive]'"
    assert not (tmp_path / "bag").exists()
