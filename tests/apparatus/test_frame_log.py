import numpy as np
import pytest

from gramoscope.apparatus.bench import Sequence
from gramoscope.apparatus.capture import open_capture
from gramoscope.apparatus.capture_writer import CaptureWriter
from gramoscope.apparatus.frame_log import FrameLog, believed_places, nominal_arc_m, read_log, stands_alone

SEQUENCE = Sequence(groups=3, frames_per_group=2, frame_step_m=0.8e-6, group_step_m=469e-6)
HEADER = "group,frame,arc_um,time_s"


@pytest.fixture
def log(tmp_path):
    def log(text):
        (tmp_path / "frames.csv").write_text(text, encoding="utf-8")
        return read_log(tmp_path / "frames.csv", sequence=SEQUENCE)

    return log


def test_the_log_says_where_each_frame_was(log):
    read = log(f"{HEADER},stage_um\n1,0,470.25,0.1,12.5\n1,1,471.0,0.2,-3\n")
    np.testing.assert_allclose(read.arc_m[1], [470.25e-6, 471e-6], rtol=1e-14)
    np.testing.assert_allclose(read.stage_m[1], [12.5e-6, -3e-6], rtol=1e-14)
    assert np.isnan(read.arc_m[[0, 2]]).all()
    assert read.has_stage
    assert read.problems == ()


@pytest.mark.parametrize(
    ("row", "word"),
    [
        ("1,0,abc,0", "not a row of numbers"),
        ("1,0", "not a row of numbers"),
        ("1.5,0,3,0", "not a row of numbers"),
        ("1,0,nan,0", "not a finite number"),
        ("1,0,inf,0", "not a finite number"),
        ("3,0,5,0", "no frame 0 in a group 3"),
        ("-1,0,5,0", "no frame 0 in a group -1"),
        ("0,2,5,0", "no frame 2 in a group 0"),
    ],
)
def test_a_bad_row_is_told_with_its_line_and_left_out(log, row, word):
    read = log(f"{HEADER}\n0,0,1.5,0\n{row}\n0,1,2.5,0\n")
    assert len(read.problems) == 1
    assert "line 3" in read.problems[0]
    assert word in read.problems[0]
    np.testing.assert_allclose(read.arc_m[0], [1.5e-6, 2.5e-6], rtol=1e-14)
    assert np.isnan(read.arc_m[1:]).all()


def test_the_last_of_two_entries_counts(log):
    read = log(f"{HEADER}\n0,0,1.5,0\n0,0,2.5,0\n")
    assert read.arc_m[0, 0] == pytest.approx(2.5e-6)
    assert "once more" in read.problems[0]


@pytest.mark.parametrize("text", ["", "frame,group,arc_um,time_s\n0,0,1,2\n", "group;frame;arc_um;time_s\n0;0;1;2\n"])
def test_a_log_with_another_header_is_not_guessed_at(log, text):
    read = log(text)
    assert np.isnan(read.arc_m).all()
    assert HEADER in read.problems[0]


def test_thousands_of_bad_rows_make_a_short_story(log):
    assert len(log(HEADER + "\n" + "x\n" * 5000).problems) == 21


def test_a_missing_log_is_told(tmp_path):
    assert "missing" in read_log(tmp_path / "frames.csv", sequence=SEQUENCE).problems[0]


def test_a_byte_order_mark_and_blank_lines_do_no_harm(log):
    read = log(f"\ufeff{HEADER}\n\n0,0,1.5,\n")
    assert read.problems == ()
    assert read.arc_m[0, 0] == pytest.approx(1.5e-6)


def test_the_log_wins_and_gaps_in_it_are_filled_with_nominal_places(tmp_path, bench, film):
    truth_m = nominal_arc_m(3, sequence=bench.sequence) + np.array([5e-6, -2e-6, 7e-6])
    stage_m = np.array([1e-6, 2e-6, -4e-6])
    with CaptureWriter(tmp_path / "c", bench) as writer:
        for number, images in enumerate(film(bench)):
            places = {"arc_start_m": truth_m, "stage_m": stage_m} if number == 3 else {}
            writer.write_group(number, images, **places)
    path = tmp_path / "c" / "frames.csv"
    path.write_text("\n".join(line for line in path.read_text().splitlines() if not line.startswith("2,1,")))
    capture = open_capture(tmp_path / "c")
    np.testing.assert_allclose(capture.group(3).arc_start_m, truth_m, atol=1e-12)
    np.testing.assert_allclose(capture.group(3).stage_m, stage_m, atol=1e-12)
    group = capture.group(2)
    np.testing.assert_allclose(group.arc_start_m, 2 * 310e-6 + np.arange(3) * 0.7e-6, atol=1e-12)
    assert group.problems == ("frame 1: no place in the log: the nominal one is used",)
    assert group.valid.all()


def test_a_capture_whose_log_is_gone_plays_at_nominal_places(tmp_path, bench, film, write):
    folder = write(tmp_path / "c", bench, film(bench))
    (folder / "frames.csv").unlink()
    capture = open_capture(folder)
    assert capture.problems == ("frames.csv is missing; nominal places are used",)
    np.testing.assert_allclose(capture.group(4).arc_start_m, nominal_arc_m(4, sequence=bench.sequence))


def test_a_slip_of_the_encoder_is_put_where_the_other_frames_lead_to_expect_it():
    nominal = 16e-6 * np.arange(6)
    logged = nominal + 3e-3 + 1e-6 * np.array([0, 1, -1, 0, 2, 0])
    found, slipped = believed_places(logged, nominal, width_m=500e-6)
    np.testing.assert_array_equal(found, logged)
    assert not slipped.any()
    for wrong in (5e-3, -2e-3, 1.0):
        one = logged.copy()
        one[3] += wrong
        found, slipped = believed_places(one, nominal, width_m=500e-6)
        assert np.flatnonzero(slipped).tolist() == [3]
        np.testing.assert_allclose(found, logged, atol=3e-6)
    half = logged.copy()
    half[4:] += 1e-3
    found, slipped = believed_places(half, nominal, width_m=500e-6)
    assert np.flatnonzero(slipped).tolist() == [4, 5]
    np.testing.assert_allclose(found, logged, atol=10e-6)


def test_what_is_not_known_is_not_doubted_and_two_frames_far_apart_are_not_believed():
    nominal = 16e-6 * np.arange(4)
    gaps = np.array([np.nan, 16e-6, np.nan, 48e-6])
    found, slipped = believed_places(gaps, nominal, width_m=500e-6)
    np.testing.assert_array_equal(found, gaps)
    assert not slipped.any()
    one = np.array([np.nan, 7.0, np.nan, np.nan])
    np.testing.assert_array_equal(believed_places(one, nominal, width_m=500e-6)[0], one)
    found, slipped = believed_places(np.array([0.0, 5e-3]), nominal[:2], width_m=500e-6)
    np.testing.assert_array_equal(found, nominal[:2])
    assert slipped.all()


def test_a_slip_in_the_log_of_a_capture_is_told(tmp_path, bench, film, write):
    folder = write(tmp_path / "c", bench, film(bench))
    rows = (folder / "frames.csv").read_text("utf-8").splitlines()
    header, place = rows[0].split(","), next(i for i, row in enumerate(rows) if row.startswith("2,1,"))
    fields = rows[place].split(",")
    fields[header.index("arc_um")] = "99999999"
    rows[place] = ",".join(fields)
    before = open_capture(folder).group(2)
    (folder / "frames.csv").write_text("\n".join(rows) + "\n", "utf-8")
    group = open_capture(folder).group(2)
    assert group.valid.all()
    np.testing.assert_allclose(group.arc_start_m, before.arc_start_m, atol=1e-9)
    (problem,) = group.problems
    assert "frame 1" in problem
    assert "far from where the other frames are: not believed" in problem
    assert before.problems == open_capture(folder).group(1).problems == ()


def _log_of(off_m):
    sequence = Sequence(groups=len(off_m), frames_per_group=3, frame_step_m=0.8e-6, group_step_m=469e-6)
    places = np.array([nominal_arc_m(group, sequence=sequence) + off for group, off in enumerate(off_m)])
    return FrameLog(places, np.zeros_like(places)), sequence


def test_a_group_that_no_neighbour_agrees_with_is_put_among_them():
    log, sequence = _log_of([0.001, 0.001, 0.0012, 10.0, 0.0009, 0.001, np.nan, 0.001])
    told = [stands_alone(group, log, sequence=sequence, width_m=500e-6) for group in range(8)]
    assert told[3] == pytest.approx(0.001, abs=1e-4)
    assert told[:3] + told[4:] == [None] * 7


def test_a_group_is_believed_as_long_as_nobody_behind_it_is_known():
    growing, sequence = _log_of([0, 0, 0, 3.0, np.nan, np.nan])
    assert stands_alone(3, growing, sequence=sequence, width_m=500e-6) is None
    done, sequence = _log_of([0, 0, 0, 3.0])
    assert stands_alone(3, done, sequence=sequence, width_m=500e-6) == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize(
    "off_m", [[0, 0, 0, 0.004, 0, 0], [0, 0, 0, 3.0, 3.0, 3.0], [0, 5.0], [7.0], [0, 0, 3.0, 3.0, 0, 0]]
)
def test_a_jump_that_neighbours_agree_on_is_believed(off_m):
    log, sequence = _log_of(off_m)
    assert all(stands_alone(group, log, sequence=sequence, width_m=500e-6) is None for group in range(len(off_m)))


def test_a_group_that_slipped_in_the_log_of_a_capture_is_told(tmp_path, bench, film, write):
    folder = write(tmp_path / "c", bench, film(bench))
    before = open_capture(folder).group(2)
    rows = [row.split(",") for row in (folder / "frames.csv").read_text("utf-8").splitlines()]
    for row in rows[1:]:
        row[2] = str(float(row[2]) + 1e7 * (row[0] == "2"))
    (folder / "frames.csv").write_text("\n".join(",".join(row) for row in rows) + "\n", "utf-8")
    capture = open_capture(folder)
    group = capture.group(2)
    np.testing.assert_allclose(group.arc_start_m, before.arc_start_m, atol=1e-9)
    assert any("near to that of no group before or after it" in problem for problem in group.problems)
    assert capture.group(1).problems == capture.group(3).problems == ()


def test_a_place_beyond_any_groove_is_a_bad_row(log):
    read = log(f"{HEADER}\n0,0,1.5,0\n0,1,1e300,0\n")
    assert np.isnan(read.arc_m[0, 1])
    assert "longer than any" in read.problems[0]
