"""A reading is kept exactly, found again, and no longer believed when anything that it depends on is another."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gramoscope.apparatus.capture import open_capture
from gramoscope.errors import OutputError
from gramoscope.pickup.processor import PROCESSOR
from gramoscope.player import pieces as pieces_module
from gramoscope.player.folder_lock import folder_lock
from gramoscope.player.kept_reading import Work
from gramoscope.player.kept_records import DamagedRecordError, bytes_of, record_of
from gramoscope.player.pieces import read_group
from gramoscope.player.play import Settings, play
from gramoscope.player.reading_manifest import manifest_of
from gramoscope.player.reading_store import (
    STORE,
    GroupReading,
    Piece,
    ReadingStore,
    create_store,
    groups_a_piece,
    open_store,
)
from gramoscope.player.recipe import load_recipe
from gramoscope.signal_path import Texture, WallTrace

RECIPE = load_recipe("seed-paper")
SOUNDS = ("flat.wav", "walls.wav", "vertical.wav", "equalised.wav")


def _same(one: Any, other: Any) -> bool:
    """To the last bit, NaN and −0 included."""
    if isinstance(one, np.ndarray):
        return one.dtype == other.dtype and one.shape == other.shape and one.tobytes() == other.tobytes()
    if isinstance(one, WallTrace | Texture | GroupReading):
        return all(_same(getattr(one, field.name), getattr(other, field.name)) for field in fields(one))
    return bool(one == other) or (one != one and other != other)


def _trace(rng: np.random.Generator, number: int, samples: int, strip: tuple[int, int] | None) -> WallTrace:
    walls = rng.normal(size=(4, 2, samples))
    walls[0, 1, 3:5], walls[2:] = np.nan, np.nan
    if samples:
        walls[1, 0, 0] = -0.0
    texture = None if strip is None else Texture(rng.normal(size=strip).astype(np.float32), 1.5e-3, 3.9e-7, -0.0)
    flags = rng.integers(0, 2**15, (2, samples)).astype(np.uint16)
    steps = np.array([8e-7, np.nan, 8.1e-7])[:number]
    return WallTrace(
        number,
        1e-3 * rng.random(),
        3e-6,
        *walls,
        5.0,
        flags,
        texture,
        None,
        steps,
        np.array([0.7, np.nan]),
        ("frame 3: ä", "b"),
    )


@pytest.fixture
def store(capture: Path, tmp_path: Path) -> ReadingStore:
    """An empty store for 130 groups."""
    bench = open_capture(capture).bench
    return create_store(tmp_path / "r.zarr", bench, group_count=130, manifest={"a": "b"}, recipe={"name": "x"})


def test_what_is_written_is_read_to_the_bit_however_ragged(store: ReadingStore) -> None:
    rng = np.random.default_rng(3)
    assert store.piece_groups == 8
    shapes: list[tuple[int, tuple[int, int] | None]] = [(131, (448, 140)), (0, None), (700, (448, 400)), (40, (3, 9))]
    groups = tuple(GroupReading(_trace(rng, n, *shape), n) for n, shape in enumerate(shapes))
    # the last piece is a short one: 130 = 16 · 8 + 2
    for number, piece in ((3, Piece(groups * 2, ("group 1 …",), "cpu")), (16, Piece(groups[:2]))):
        store.write(number, piece)
        found = (open_store(store.root) or store).read(number)
        assert found is not None
        assert (found.failed, found.processor) == (piece.failed, piece.processor)
        assert all(_same(one, other) for one, other in zip(piece.groups, found.groups, strict=True))
    assert [number for number in store.pieces if store.is_written(number)] == [3, 16]
    assert store.read(4) is None


@pytest.mark.parametrize("name", ["walls", "flags", "places", "strips", "words"])
def test_a_chunk_that_was_cut_off_or_changed_makes_the_piece_unwritten(store: ReadingStore, name: str) -> None:
    rng = np.random.default_rng(4)
    store.write(0, Piece(tuple(GroupReading(_trace(rng, n, 50, (448, 100))) for n in range(8))))
    assert store.read(0) is not None
    (chunk, *_) = [path for path in (store.root / name / "c").rglob("*") if path.is_file()]
    chunk.write_bytes(chunk.read_bytes()[:-1000])
    assert store.read(0) is None


@pytest.mark.parametrize("name", ["walls", "flags", "places", "strips"])
def test_a_whole_chunk_in_the_wrong_place_makes_the_piece_unwritten(store: ReadingStore, name: str) -> None:
    """As when somebody is killed while a piece is written anew."""
    rng = np.random.default_rng(6)
    for number in (0, 1):
        store.write(number, Piece(tuple(GroupReading(_trace(rng, n, 50, (448, 100))) for n in range(8))))
    for path in [path for path in (store.root / name / "c" / "1").rglob("*") if path.is_file()]:
        path.replace(store.root / name / "c" / "0" / path.relative_to(store.root / name / "c" / "1"))
    assert store.read(0) is None


def test_of_strips_only_the_rows_with_texture_are_kept(store: ReadingStore) -> None:
    rng = np.random.default_rng(8)

    def piece(rows: list[slice]) -> Piece:
        trace = _trace(rng, 0, 9, (448, 100))
        assert trace.head is not None
        strip = np.zeros((448, 100), np.float32)
        for some in rows:
            strip[some] = trace.head.strip[some]
        return Piece(tuple([GroupReading(replace(trace, head=replace(trace.head, strip=strip)))] * 8))

    pieces = [piece([slice(0, 448)]), piece([slice(30, 60), slice(90, 91), slice(440, 448)]), piece([])]
    for number, one in enumerate(pieces):
        store.write(number, one)
        found = store.read(number)
        assert found is not None
        assert all(_same(a, b) for a, b in zip(one.groups, found.groups, strict=True))
    room = [sum(path.stat().st_size for path in (store.root / "strips" / "c" / str(n)).rglob("*")) for n in range(3)]
    assert room[0] >= 8 * 448 * 100 * 4
    assert room[1] < 0.2 * room[0]
    assert room[2] == 0


def test_chunks_of_nothing_but_negative_zeros_come_back_as_such(store: ReadingStore) -> None:
    rng = np.random.default_rng(7)
    trace = _trace(rng, 0, 9, (5, 6))
    assert trace.head is not None
    trace = replace(trace, head=replace(trace.head, strip=np.full((5, 6), -0.0, np.float32)))
    store.write(0, Piece(tuple([GroupReading(trace)] * 8)))
    found = (open_store(store.root) or store).read(0)
    assert found is not None
    assert all(_same(trace, one.trace) for one in found.groups)


def test_a_group_of_which_nothing_was_seen_comes_back_whatever_its_nans_are(store: ReadingStore) -> None:
    """A difference of NaNs has a sign on some processors."""
    trace = _trace(np.random.default_rng(5), 0, 9, None)
    nothing = np.full((2, 9), -np.nan)
    blind = replace(trace, offset_m=nothing, offset_sigma_m=nothing, slope=nothing, slope_sigma=nothing)
    store.write(0, Piece((GroupReading(blind),) * len(store.groups_of(0))))
    read = store.read(0)
    assert read is not None
    assert np.isnan(read.groups[0].trace.offset_m).all()


def test_what_an_earlier_reading_left_behind_is_not_taken_for_this_one(store: ReadingStore) -> None:
    rng = np.random.default_rng(5)
    late = replace(store, manifest={"a": "another"})
    late.write(0, Piece(tuple(GroupReading(_trace(rng, n, 50, None)) for n in range(8))))
    assert store.is_written(0)
    assert store.read(0) is None


@pytest.mark.parametrize(("count", "piece"), [(1, 1), (8, 1), (64, 4), (1024, 64), (250_000, 64)])
def test_short_passages_have_enough_pieces_and_long_ones_no_longer_pieces(count: int, piece: int) -> None:
    assert groups_a_piece(count) == piece


@dataclass(frozen=True, eq=False)
class _Inner:
    values: Any
    level: float


@dataclass(frozen=True, eq=False)
class _Record:
    inner: tuple[_Inner | None, ...]
    fold: dict[int, int]
    scalar: Any
    name: str


def test_a_record_comes_back_as_it_was() -> None:
    values = np.array([[1.5, -0.0], [np.nan, np.inf]], np.float32)
    record = _Record((_Inner(values, 0.1), None), {7: 1}, np.float64(0.3), "ä")
    back = record_of(bytes_of(record), _Record)
    inner = back.inner[0]
    assert inner is not None
    assert inner.values.tobytes() == values.tobytes()
    assert inner.values.flags.writeable
    assert (inner.level, back.inner[1], back.fold, back.name) == (0.1, None, {7: 1}, "ä")
    assert type(back.scalar) is np.float64
    assert bytes_of(back) == bytes_of(record)


def test_a_record_that_was_cut_off_or_changed_is_refused() -> None:
    data = bytes_of(_Record((_Inner(np.arange(9.0), 0.1),), {}, None, ""))
    for spoilt in (data[:-1], data[:-1] + b"x", b"", b"{}\n", data[5:]):
        with pytest.raises(DamagedRecordError):
            record_of(spoilt, _Record)


def test_a_manifest_knows_what_matters_and_nothing_else(copy_of: Path) -> None:
    def manifest(recipe: Any = RECIPE) -> dict[str, str]:
        return manifest_of(open_capture(copy_of), recipe, PROCESSOR)

    first, toml = manifest(), copy_of / "capture.toml"
    text = toml.read_text(encoding="utf-8")
    assert manifest(replace(RECIPE, passband=0.9, name="another")) == first
    toml.write_text(text.replace("[disc]", '[disc]\ntitle = "A song"'), encoding="utf-8")
    assert manifest() == first
    toml.write_text(text.replace("frame_step_um = 0.8", "frame_step_um = 0.81"), encoding="utf-8")
    other = manifest()
    assert {name for name in first if first[name] != other[name]} == {"the apparatus in capture.toml"}
    changed = load_recipe("seed-paper")
    other = manifest_of(open_capture(copy_of), replace(changed, pickup={"smoothing_px": 1.1}), PROCESSOR)
    assert first["[pickup] of the recipe"] != other["[pickup] of the recipe"]


class _Stop(BaseException):
    """As sudden as Ctrl-C."""


@pytest.fixture
def count_reads(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The numbers of the groups that are read, as they are."""
    numbers: list[int] = []

    def counted(capture: Any, pickup: Any, number: int) -> GroupReading:
        numbers.append(number)
        return read_group(capture, pickup, number)

    monkeypatch.setattr(pieces_module, "read_group", counted)
    return numbers


@pytest.fixture
def told() -> list[str]:
    return []


def _play(folder: Path, out: Path, stop_after: int | None = None, recipe: Any = RECIPE, **work: Any) -> dict[str, Any]:
    def progress(done: int, total: int, what: str) -> None:
        if done == stop_after:
            raise _Stop

    return play(open_capture(folder), recipe, out, Settings(workers=2), progress=progress, work=Work(**work))


def _sound(out: Path) -> bytes:
    """The samples of the flat transfer; headers tell the moment."""
    import soundfile

    return soundfile.read(out / "flat.wav", dtype="int32")[0].tobytes()


def test_a_stopped_transfer_goes_on_where_it_stopped(
    copy_of: Path, transfer: Any, tmp_path: Path, count_reads: list[int], told: list[str]
) -> None:
    with pytest.raises(_Stop):
        _play(copy_of, tmp_path, stop_after=5)
    assert {path.name for path in tmp_path.iterdir()} - {"spoilt"} == {STORE}
    first = set(count_reads)
    count_reads.clear()
    report = _play(copy_of, tmp_path, told=told.append)
    assert not first & set(count_reads)
    assert first | set(count_reads) == set(range(8))
    assert _sound(tmp_path) == _sound(transfer.folder)
    assert report["inputs"]["group_files"] == transfer.report["inputs"]["group_files"]
    assert told == []
    assert not (tmp_path / STORE).exists()


def test_a_kept_reading_serves_another_transfer_and_a_new_start_throws_it_away(
    copy_of: Path, transfer: Any, tmp_path: Path, count_reads: list[int]
) -> None:
    _play(copy_of, tmp_path, keep_reading=True)
    count_reads.clear()
    _play(copy_of, tmp_path, keep_reading=True, recipe=replace(RECIPE, passband=0.5))
    assert count_reads == []
    assert _sound(tmp_path) != _sound(transfer.folder)
    _play(copy_of, tmp_path, restart=True)
    assert sorted(count_reads) == list(range(8))


def _rewrite(frame: Path) -> None:
    content = bytearray(frame.read_bytes())
    content[-1000] ^= 1
    frame.write_bytes(bytes(content))


def test_a_replaced_frame_is_noticed_and_its_piece_read_again(
    copy_of: Path, played: Callable[..., Any], tmp_path: Path, count_reads: list[int], told: list[str]
) -> None:
    with pytest.raises(_Stop):
        _play(copy_of, tmp_path / "out", stop_after=6)
    count_reads.clear()
    _rewrite(copy_of / "frames" / "g000002.tif")
    os.utime(copy_of / "frames" / "g000003.tif")  # touched, not changed
    _play(copy_of, tmp_path / "out", told=told.append)
    assert 2 in count_reads
    assert 3 not in count_reads
    assert told == ["changed since they were read, and read again: frames/g000002.tif"]
    assert _sound(tmp_path / "out") == _sound(played(copy_of, tmp_path / "undisturbed").folder)


def test_a_frame_changed_behind_its_size_and_time_is_found_by_adding_up(
    copy_of: Path, tmp_path: Path, count_reads: list[int]
) -> None:
    frame = copy_of / "frames" / "g000001.tif"
    with pytest.raises(_Stop):
        _play(copy_of, tmp_path / "out", stop_after=6)
    status = frame.stat()
    _rewrite(frame)
    os.utime(frame, ns=(status.st_atime_ns, status.st_mtime_ns))
    count_reads.clear()
    _play(copy_of, tmp_path / "out", verify=True)
    assert 1 in count_reads
    assert 0 not in count_reads


def test_a_frame_replaced_while_playing_is_named_in_the_report(copy_of: Path, transfer: Any, tmp_path: Path) -> None:
    def replaced(monitor: Any, _: Any) -> None:
        if monitor.groups == 8:
            _rewrite(copy_of / "frames" / "g000001.tif")

    report = _play(copy_of, tmp_path / "out", watched=replaced)
    (remark,) = (one for one in report["remarks"] if "changed after" in one)
    assert "frames/g000001.tif" in remark
    assert _sound(tmp_path / "out") == _sound(transfer.folder)


def test_another_recipe_is_told_and_everything_read_again(
    copy_of: Path, tmp_path: Path, count_reads: list[int], told: list[str]
) -> None:
    with pytest.raises(_Stop):
        _play(copy_of, tmp_path / "out", stop_after=6)
    count_reads.clear()
    _play(copy_of, tmp_path / "out", recipe=replace(RECIPE, pickup={"smoothing_px": 1.2}), told=told.append)
    assert sorted(count_reads) == list(range(8))
    assert told == ["what was read before is stale and read again: [pickup] of the recipe is another"]


def test_a_group_that_fails_is_tried_three_times_flagged_and_tried_again_next_time(
    copy_of: Path, transfer: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tries: list[int] = []

    def failing(capture: Any, pickup: Any, number: int) -> GroupReading:
        if number == 3:
            tries.append(number)
            raise RuntimeError("a cosmic ray")
        return read_group(capture, pickup, number)

    monkeypatch.setattr(pieces_module, "read_group", failing)
    report = _play(copy_of, tmp_path / "out", keep_reading=True)
    assert len(tries) == 3
    assert report["lost_groups"] == [3]
    (remark,) = (one for one in report["remarks"] if "not read" in one)
    assert "group 3" in remark
    assert "a cosmic ray" in remark
    monkeypatch.undo()
    report = _play(copy_of, tmp_path / "out")
    assert report["lost_groups"] == []
    assert _sound(tmp_path / "out") == _sound(transfer.folder)


def test_two_transfers_at_once_into_one_folder_are_refused(copy_of: Path, tmp_path: Path) -> None:
    with folder_lock(tmp_path), pytest.raises(OutputError, match="another transfer is being made"):
        _play(copy_of, tmp_path)
