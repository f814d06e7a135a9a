"""Pictures show what was found where it was found, with units, and touch nothing global."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from gramoscope.errors import ArgumentError, OutputError
from gramoscope.listening.align import band_passed
from gramoscope.listening.compare import compare
from gramoscope.listening.figures import StripeLine, Waveform, comparison_figure, groove_figure, save_png
from gramoscope.listening.ink import svg_of
from gramoscope.listening.quality_figures import band_figure, share_figure

HEIGHT_PX, WIDTH_PX = 90, 211
PITCH_M = 0.5e-6
RATE_HZ = 32_000.0


def _sound(count: int, *, seed: int = 4) -> np.ndarray:
    rng = np.random.default_rng(seed)
    time_s = np.arange(count) / RATE_HZ
    return 0.03 * np.sin(2 * np.pi * 440 * time_s) + 0.004 * rng.standard_normal(count)


def _waveform(count: int) -> Waveform:
    interpolated = np.zeros(count, bool)
    interpolated[count // 3 : count // 2] = True
    interpolated[-7:] = True
    return Waveform(np.arange(count) / RATE_HZ, _sound(count), np.full(count, 0.002), interpolated)


def _stripe(row: float = 20.0) -> StripeLine:
    columns = np.arange(3.0, 200.0)
    measured = np.ones(len(columns), bool)
    measured[50:80] = False
    return StripeLine("outer wall", columns, row + 0.1 * columns, measured)


def _groove(*, waveform: Waveform | None = None, glass_edge_row: float | None = 61.0, stripes: int = 1) -> Figure:
    image = np.random.default_rng(1).integers(0, 200, (HEIGHT_PX, WIDTH_PX), dtype=np.uint8)
    return groove_figure(
        image,
        white_level=255,
        pixel_pitch_m=PITCH_M,
        stripes=[_stripe(20.0 + 15 * number) for number in range(stripes)],
        glass_edge_row=glass_edge_row,
        waveform=waveform or _waveform(700),
        title="a passage",
    )


def test_a_stripe_lies_where_it_was_found_in_micrometres() -> None:
    above = _groove().axes[0]
    solid = above.lines[0]
    arc_um, lateral_um = (np.asarray(part, float) for part in solid.get_data())
    assert arc_um[0] == pytest.approx(1.5)
    assert lateral_um[0] == pytest.approx((20.3 - 44.5) * 0.5)
    assert "(µm)" in above.get_xlabel()
    assert "(µm)" in above.get_ylabel()


def test_the_image_has_the_same_place_as_the_stripes() -> None:
    image = _groove().axes[0].images[0]
    assert image.origin == "lower"
    assert image.get_extent() == pytest.approx([-0.25, 105.25, -22.5, 22.5])


def test_measured_parts_are_solid_and_filled_in_parts_dashed() -> None:
    solid, dashed = _groove().axes[0].lines[:2]
    seen = np.isfinite(np.asarray(solid.get_ydata(), float))
    filled = np.isfinite(np.asarray(dashed.get_ydata(), float))
    assert np.flatnonzero(~seen).tolist() == list(range(50, 80))
    assert np.flatnonzero(filled).tolist() == list(range(49, 81)), "dashes should reach the measured points"
    assert (solid.get_linestyle(), dashed.get_linestyle()) == ("-", "--")
    assert to_hex(solid.get_color()) == to_hex(dashed.get_color())


def test_every_stripe_has_a_colour_of_its_own_and_a_name() -> None:
    above = _groove(stripes=3).axes[0]
    legend = above.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["outer wall"] * 3 + ["filled in"]
    assert len({to_hex(line.get_color()) for line in above.lines[:6:2]}) == 3


def test_edges_of_all_grooves_have_the_colours_of_those_that_the_legend_names() -> None:
    names = ("inner edge", "outer edge", "_inner edge of groove 2", "_outer edge of groove 2")
    lines = [_stripe(20.0 + 15 * number)._replace(name=name) for number, name in enumerate(names)]
    figure = groove_figure(
        np.zeros((HEIGHT_PX, WIDTH_PX), np.uint8),
        white_level=255,
        pixel_pitch_m=PITCH_M,
        stripes=lines,
        glass_edge_row=None,
        waveform=_waveform(700),
        title="a photograph",
    )
    colours = [to_hex(line.get_color()) for line in figure.axes[0].lines[:8:2]]
    assert colours[:2] == colours[2:]
    assert colours[0] != colours[1]


def test_a_groove_without_stripes_or_glass_is_drawn_all_the_same(tmp_path: Path) -> None:
    save_png(_groove(stripes=0, glass_edge_row=None), tmp_path / "groove.png")
    assert _groove(stripes=0, glass_edge_row=None).axes[0].get_legend() is None


def test_the_waveform_shows_two_sigma_and_shades_what_nobody_measured() -> None:
    sound = _waveform(700)
    below = _groove(waveform=sound).axes[1]
    band = below.collections[0].get_paths()[0].vertices
    assert np.max(np.asarray(band)[:, 1]) == pytest.approx(100 * (sound.velocity_m_s + 0.004).max())
    spans = [patch.get_extents().transformed(below.transData.inverted()) for patch in below.patches]
    assert [span.x0 for span in spans] == pytest.approx([1e3 * 233 / RATE_HZ, 1e3 * 693 / RATE_HZ])
    assert spans[0].x1 == pytest.approx(1e3 * 350 / RATE_HZ)
    assert below.get_xlabel() == "time (ms)"
    assert below.get_ylabel() == "groove velocity (cm/s)"


def test_a_long_waveform_keeps_its_highest_peak_with_fewer_dots() -> None:
    sound = _waveform(70_000)
    sound.velocity_m_s[34_567] = 0.3
    below = _groove(waveform=sound).axes[1]
    drawn = np.asarray(below.collections[1].get_paths()[0].vertices)
    assert np.max(drawn[:, 1]) == pytest.approx(30.0)
    assert len(drawn) < 3_000
    assert below.get_xlabel() == "time (s)"


def test_a_waveform_with_gaps_and_unknown_sigma_is_drawn(tmp_path: Path) -> None:
    sound = _waveform(700)
    sound.velocity_m_s[100:200] = np.nan
    sound.sigma_m_s[:] = np.nan
    save_png(_groove(waveform=sound), tmp_path / "groove.png")


def test_wrong_shapes_are_argument_errors() -> None:
    sound = _waveform(700)
    with pytest.raises(ArgumentError, match="differ in length"):
        _groove(waveform=sound._replace(time_s=sound.time_s[:-1]))
    with pytest.raises(ArgumentError, match="row, column"):
        groove_figure(
            np.zeros((2, 3, 4), np.uint8),
            white_level=255,
            pixel_pitch_m=PITCH_M,
            stripes=[],
            glass_edge_row=None,
            waveform=sound,
            title="",
        )


def test_a_comparison_draws_the_copy_aligned() -> None:
    a = _sound(9_000)
    b = -0.3 * band_passed(a, rate_hz=RATE_HZ, band_hz=(20.0, 15_000.0), advance_s=0.45 / RATE_HZ)[37:]
    found = compare(a, RATE_HZ, b, RATE_HZ, band_hz=(100.0, 9_000.0))
    figure = comparison_figure(a, b, RATE_HZ, found)
    reference, copy, difference = (np.asarray(line.get_ydata(), float) for line in figure.axes[0].lines)
    assert copy == pytest.approx(reference, abs=0.03)
    assert np.max(np.abs(difference)) < 0.03
    assert len(figure.axes) == 3
    assert all(axes.get_xlabel() and axes.get_ylabel() for axes in figure.axes)
    assert "upside down" in figure.get_suptitle()
    assert "−10.46 dB, −1170.3 µs" in figure.get_suptitle()


def test_a_very_short_comparison_is_drawn(tmp_path: Path) -> None:
    a = _sound(330)
    save_png(comparison_figure(a, 2 * a, RATE_HZ, compare(a, RATE_HZ, 2 * a, RATE_HZ)), tmp_path / "c.png")


def test_the_same_figure_gives_the_same_bytes_and_nothing_global_changes(tmp_path: Path) -> None:
    before = dict(mpl.rcParams)
    save_png(_groove(), tmp_path / "a.png")
    save_png(_groove(), tmp_path / "b.png")
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    assert dict(mpl.rcParams) == before
    assert len(list(tmp_path.iterdir())) == 2


def test_a_picture_that_cannot_be_written_is_an_output_error(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="create the folder"):
        save_png(_groove(), tmp_path / "nowhere" / "a.png")
    assert list(tmp_path.iterdir()) == []


def test_figures_of_a_passage_of_which_nothing_is_known_can_be_drawn() -> None:
    nothing, silent = [None, None, None], [0.0, 0.0, 0.0]
    along = {"step_s": 0.5, "measured": silent, "bridged": silent, "missing": [1.0, 1.0, 1.0]}
    bands = {"centre_hz": [500.0, 1000.0, 2000.0], "sound_rms_cm_s": nothing, "error_rms_cm_s": nothing}
    for figure in (
        share_figure({**along, "rms_cm_s": silent, "sigma_rms_cm_s": nothing}),
        band_figure(bands),
        band_figure({**bands, "sound_rms_cm_s": silent}),
    ):
        assert svg_of(figure).startswith(b"<?xml")
