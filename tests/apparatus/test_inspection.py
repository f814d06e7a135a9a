import json
from dataclasses import replace

import numpy as np
import pytest

from gramoscope.apparatus.bench import Bench
from gramoscope.apparatus.capture import open_capture
from gramoscope.apparatus.capture_writer import CaptureWriter
from gramoscope.apparatus.inspection import findings_of_stripes, inspect
from gramoscope.camera.sensor import Sensor
from gramoscope.microscope.cover_glass import CoverGlass


def test_a_sound_capture_has_nothing_wrong(tmp_path, bench, film, write):
    seen = inspect(open_capture(write(tmp_path / "c", bench, film(bench))))
    assert seen.groups == ()
    assert seen.findings == ()
    assert seen.sound
    assert (seen.frames_found, seen.frames_expected, seen.groups_expected) == (15, 15, 5)
    assert seen.passage_m == pytest.approx(4 * 310e-6 + 2 * 0.7e-6 + 70 * 5e-6)
    assert seen.seconds == pytest.approx(seen.passage_m / 0.939336, rel=1e-5)
    assert seen.pixel_rate_hz == pytest.approx(0.939336 / 5e-6, rel=1e-5)
    assert seen.overlap_m == pytest.approx(71 * 5e-6 - 310e-6, abs=1e-11)
    assert seen.size_bytes > 15 * 71 * 46


@pytest.mark.parametrize("quick", [False, True])
def test_what_is_missing_is_named(tmp_path, bench, film, write, quick):
    folder = write(tmp_path / "c", bench, film(bench), layout="png")
    (folder / "frames" / "g000001_f02.png").unlink()
    (folder / "frames" / "g000003_f00.png").unlink()
    (folder / "frames" / "g000003_f01.png").unlink()
    seen = inspect(open_capture(folder), quick=quick)
    assert seen.frames_found == 12
    assert [(group.number, group.frames_found) for group in seen.groups] == [(1, 2), (3, 1)]
    assert "g000001_f02.png is missing" in seen.groups[0].problems[0]


def test_a_quick_look_reads_a_few_groups_only(tmp_path, bench, film, write, monkeypatch):
    bench = replace(bench, sequence=replace(bench.sequence, groups=40))
    folder = write(tmp_path / "c", bench, film(bench))
    (folder / "frames" / "g000013.tif").unlink()
    capture = open_capture(folder)
    read = []
    source_read = capture.source.read_group
    monkeypatch.setattr(
        type(capture.source),
        "read_group",
        lambda self, number, *more: read.append(number) or source_read(number, *more),
    )
    seen = inspect(capture, quick=True)
    assert len(read) == 5
    assert not seen.complete
    assert (seen.frames_found, [group.number for group in seen.groups]) == (39 * 3, [13])


def test_dark_and_overexposed_frames_are_told_apart(tmp_path, bench, film, write):
    pictures = film(bench)
    pictures[1, 2] = 0
    pictures[2, 0] = 120  # light, and nothing to see
    pictures[3, 1, :9] = 255
    seen = inspect(open_capture(write(tmp_path / "c", bench, pictures)))
    assert [(group.number, group.dark, group.saturated) for group in seen.groups] == [
        (1, (2,), ()),
        (2, (0,), ()),
        (3, (), (1,)),
    ]
    assert seen.frames_found == 15


def test_a_lost_frame_is_not_called_dark(tmp_path, bench, film, write):
    folder = write(tmp_path / "c", bench, film(bench))
    (folder / "frames" / "g000002.tif").unlink()
    (group,) = inspect(open_capture(folder)).groups
    assert (group.frames_found, group.dark) == (0, ())


def test_groups_that_do_not_overlap_are_a_finding(tmp_path, bench, film):
    with CaptureWriter(tmp_path / "c", bench) as writer:
        for number, images in enumerate(film(bench)):
            start = number * 310e-6 + (60e-6 if number >= 3 else 0.0)
            writer.write_group(number, images, arc_start_m=start + np.arange(3) * 0.7e-6)
    seen = inspect(open_capture(tmp_path / "c"))
    assert seen.overlap_m == pytest.approx(45e-6, abs=1e-11)
    assert seen.smallest_overlap_m == pytest.approx(-15e-6, abs=1e-11)
    assert any("between group 2 and the next 15.0 µm" in finding for finding in seen.findings)


def test_the_stripes_of_the_paper_lie_where_they_should():
    assert list(findings_of_stripes(Bench(cover_glass=CoverGlass(edge_row=580.0)))) == []


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"cover_glass": CoverGlass(edge_row=530.0)}, "should be seen through the glass"),
        ({"cover_glass": CoverGlass(edge_row=700.0)}, "should be seen beside the glass"),
        ({"cover_glass": CoverGlass(edge_row=580.0, side="high")}, "should be seen"),
        ({"cover_glass": CoverGlass(edge_row=580.0), "sensor": Sensor(height_px=200)}, "outside the 200 rows"),
        ({"focus_below_land_m": 60e-6}, "only 75.0 µm deep"),
    ],
)
def test_stripes_that_cannot_be_seen_are_a_finding(change, word):
    assert any(word in finding for finding in findings_of_stripes(Bench(**change)))


def test_the_inspection_is_plain_data(tmp_path, bench, film, write):
    bench = replace(bench, sequence=replace(bench.sequence, groups=1))
    told = []
    seen = inspect(open_capture(write(tmp_path / "c", bench, film(bench))), progress=lambda *done: told.append(done))
    assert json.loads(json.dumps(seen.as_dict(), allow_nan=False))["overlap_m"] is None
    assert told == [(1, 1)]


def test_a_stripe_at_the_edge_of_the_glass_is_found():
    bench = Bench()
    _, deep_row, shallow_row = bench.stripe_rows()
    between = replace(bench, cover_glass=CoverGlass(edge_row=(deep_row + shallow_row) / 2))
    near = replace(bench, cover_glass=CoverGlass(edge_row=deep_row + 8))
    assert list(findings_of_stripes(between)) == []
    (finding,) = findings_of_stripes(near)
    assert f"row {deep_row:.0f} lies at the edge" in finding
