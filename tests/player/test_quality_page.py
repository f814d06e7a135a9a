"""`report.html`: whole, alone, the same from the file as from memory, and not too wide for a phone."""

from __future__ import annotations

import re
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

from gramoscope.player.page_words import decibels, duration, flat_rows, hertz, number, percent
from gramoscope.player.quality_page import quality_page

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
SECTIONS = ["look", "seen", "spectrum", "walls", "speed", "calibration", "worst", "applied", "files", "provenance"]


class _Page(HTMLParser):
    def __init__(self, html: str) -> None:
        super().__init__()
        self.sections: list[str] = []
        self.images: list[dict[str, str | None]] = []
        self.words = ""
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag == "section":
            self.sections.append(str(dict(attrs)["id"]))
        if tag == "img":
            self.images.append(dict(attrs))

    def handle_data(self, data: str) -> None:
        self.words += data


@pytest.fixture(scope="module")
def html(transfer: Any) -> str:
    return (transfer.folder / "report.html").read_text(encoding="utf-8")


def test_it_has_every_part_and_needs_nothing_from_elsewhere(html: str) -> None:
    page = _Page(html)
    assert page.sections == SECTIONS
    assert len(page.images) >= 5
    assert all(image["alt"] and (image["src"] or "").startswith("data:image/") for image in page.images)
    outside = re.sub(r'src="data:[^"]*"', "", html)
    assert not re.search(r"<script|<link|@import|url\(|https?:|src=", outside)


def test_its_figures_are_those_of_the_report(html: str, transfer: Any) -> None:
    report, words = transfer.report, _Page(html).words
    assert percent(report["share"]["measured"]) in words
    assert decibels(report["noise_estimate"]["signal_to_noise_db"]) in words
    assert "only the" in words
    for said in (
        report["files"]["flat.wav"]["sha256"],
        report["inputs"]["common_files"]["capture.toml"],
        report["inputs"]["group_files"]["sha256_of_sha256sum_lines"],
        report["recipe"]["sha256"],
        report["versions"]["numba"],
    ):
        assert said in words
    assert "corner_limits_hz" in words


def test_it_can_be_made_again_from_the_file(html: str, transfer: Any) -> None:
    again = quality_page(transfer.report, [])
    worst = re.compile(r'<section id="worst">.*?</section>', re.DOTALL)
    assert worst.sub("", again) == worst.sub("", html)


def test_speed_wow_and_hints_are_told_in_words(transfer: Any) -> None:
    words = _Page(quality_page(transfer.report, [])).words
    assert "playing speed78 rpm, as the capture says" in words
    assert "off-centre holenot known: the passage covers" in words
    assert "hint of mains humnone: too short" in words
    assert "removal of the wow" not in words
    wow = {
        **transfer.report["wow"],
        **dict.fromkeys(("amplitude_um", "percent", "phase_deg", "pitch_um"), 12.3),
        **dict.fromkeys(("amplitude_sigma_um", "sigma_percent", "phase_sigma_deg", "pitch_sigma_um"), 0.42),
        "determined": True,
        "removal": {"asked": True, "applied": True, "survey": None},
    }
    chosen = {"rpm": 78.2609, "chosen": "78-us", "origin": "60 Hz mains", "capture_rpm": 78.0, "curve": None}
    hints = {"mains_hum": {"words": "a steady line"}, "tuning": {"words": "sharp"}}
    words = _Page(quality_page({**transfer.report, "speed": chosen, "wow": wow, "hints": hints}, [])).words
    for said in (
        "playing speed78.261 rpm, chosen as 78-us (60 Hz mains); the capture says 78",
        "off-centre hole12.3 ± 0.42 µm off",
        "its wow, peak12.3 ± 0.42 %",
        "removal of the wowasked for, and done",
        "hint of mains huma steady line",
        "hint of the tuningsharp",
    ):
        assert said in words


def test_repairs_are_told_by_their_kind(transfer: Any) -> None:
    repair = {
        "history": ["clicks", "rumble below 20 Hz"],
        "spans": {"declick": 3, "rumble": 1, "interpolated": 2},
        "seconds": {"declick": 0.0042, "rumble": 0.016, "interpolated": 0.001},
    }
    words = _Page(quality_page({**transfer.report, "repair": repair}, [])).words
    assert "repaired: clicks; rumble below 20 Hz" in words
    assert "clicks replaced34.2 ms" in words
    assert "bridged while reading, left so21 ms" in words
    words = _Page(quality_page({**transfer.report, "repair": {**repair, "spans": {}, "seconds": {}}}, [])).words
    assert "Nothing was found to repair." in words
    words = _Page(quality_page(transfer.report, [])).words
    assert "nothing was repaired" in words
    assert "Nothing was repaired." in words


def _chromium(page: Path, folder: Path, *arguments: str) -> bytes:
    if CHROMIUM is None:
        pytest.skip("Chromium is not installed")
    quiet = ("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync")
    still = ("--disable-background-networking", "--disable-component-update", "--hide-scrollbars")
    command = [CHROMIUM, *quiet, *still, f"--user-data-dir={folder / 'profile'}", *arguments, page.as_uri()]
    done = subprocess.run(command, capture_output=True, check=False, timeout=120, cwd=folder)
    assert done.returncode == 0, done.stderr[-500:]
    return done.stdout


def test_it_is_printed_on_a_few_sheets(transfer: Any, tmp_path: Path) -> None:
    _chromium(transfer.folder / "report.html", tmp_path, f"--print-to-pdf={tmp_path / 'report.pdf'}")
    pdf = (tmp_path / "report.pdf").read_bytes()
    assert pdf.startswith(b"%PDF")
    assert 3 <= len(re.findall(rb"/Type\s*/Page\b", pdf)) <= 12


@pytest.mark.parametrize("width_px", [360, 390, 1400])
def test_nothing_sticks_out_on_a_phone_or_a_desk(html: str, tmp_path: Path, width_px: int) -> None:
    # a frame as wide as a phone, for a browser's own window cannot be made so narrow
    inner = html.replace("&", "&amp;").replace('"', "&quot;")
    tell = (
        "const d = document.querySelector('iframe').contentDocument.documentElement;"
        "document.title = `${d.scrollWidth} of ${d.clientWidth}`;"
    )
    frame = f'<iframe style="border:0;width:{width_px}px;height:900px" srcdoc="{inner}"></iframe>'
    (tmp_path / "frame.html").write_text(
        f'<!DOCTYPE html><meta charset="utf-8"><body style="margin:0">{frame}'
        f"<script>window.onload = () => {{ {tell} }};</script>",
        encoding="utf-8",
    )
    told = _chromium(tmp_path / "frame.html", tmp_path, "--window-size=1600,1000", "--dump-dom")
    title = re.search(rb"<title>(\d+) of (\d+)</title>", told)
    assert title is not None
    assert int(title[1]) <= int(title[2]) == width_px


@pytest.mark.parametrize(
    ("shown", "expected"),
    [
        (number(0.10321, "cm/s"), "0.103 cm/s"),
        (number(-0.5, "dB"), "−0.5 dB"),
        (number(1234.5, "Hz"), "1234 Hz"),
        (number(2.2e-4, "m"), "2.20e−04 m"),
        (number(None), "–"),
        (number(float("nan"), "s"), "–"),
        (number(0.0, "s"), "0 s"),
        (percent(0.9999), "above 99.9 %"),
        (percent(1.0), "100 %"),
        (percent(0.0001), "below 0.1 %"),
        (percent(0.0), "0 %"),
        (percent(0.123), "12.3 %"),
        (hertz(14_125.4), "14.1 kHz"),
        (hertz(31.5), "31.5 Hz"),
        (hertz(None), "–"),
        (decibels(-3.04), "−3.0 dB"),
        (duration(0.0163), "0.016 s"),
        (duration(192.04), "3 min 12.0 s"),
    ],
)
def test_numbers_are_written_for_people(shown: str, expected: str) -> None:
    assert shown == expected


def test_nested_tables_become_rows() -> None:
    table = {"a": {"b": 1.5, "c": [1, 2]}, "d": [{"e": None}, {"e": "x"}], "f": True, "g": list(range(20))}
    rows = dict(flat_rows(table))
    assert rows["a.b"] == "1.5"
    assert rows["a.c"] == "1, 2"
    assert (rows["d[0].e"], rows["d[1].e"]) == ("–", "x")
    assert rows["f"] == "yes"
    assert rows["g"].endswith("… (20 in all)")
