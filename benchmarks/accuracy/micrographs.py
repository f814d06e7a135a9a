"""Two micrographs of a stereo test record: what their edges and their sound hold of the tones that were cut.

    python -m benchmarks.accuracy.micrographs [--folder ../shared/data/micrographs] --table benchmarks/accuracy/micrographs.md

The pictures lie beside the repository, not in it; their scale is unknown. All that was decided about photographs of real
grooves was decided on these two (docs/decisions/0018 and 0019): other pictures may read worse.
"""

from __future__ import annotations

import argparse
import csv
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import soundfile

from benchmarks.accuracy.table import line_of
from gramoscope.apparatus.manifest_still import StillManifest
from gramoscope.apparatus.still import open_picture
from gramoscope.conventions import INNER, MICROMETRES_PER_METRE, OUTER, FloatArray, rad
from gramoscope.disc.formats import Disc
from gramoscope.pickup.edges.edge_cartridge import EdgeCartridge
from gramoscope.player.play import Settings, play
from gramoscope.player.recipe import load_recipe
from gramoscope.quality import NOT_MEASURED
from gramoscope.signal_path import GrooveEdges

WALLS = {"outer": OUTER, "inner": INNER}
RATE_HZ, FULL_SCALE_M_S = 96_000, 1.0
SCALES_UM = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0)
WHOLE = 0.6
"""A groove of which more than this share was measured is one of which both walls were seen."""


@dataclass(frozen=True, eq=False)
class Edge:
    """What was measured of one edge: columns, rows and their errors."""

    column: FloatArray
    row: FloatArray
    sigma: FloatArray
    columns: int

    @classmethod
    def of(cls, groove: GrooveEdges, wall: int) -> Edge:
        """Return one edge of a groove."""
        seen = (groove.flags[wall] & np.uint16(NOT_MEASURED)) == 0
        column = np.flatnonzero(seen).astype(np.float64)
        return cls(column, groove.row_px[wall][seen], groove.row_sigma_px[wall][seen], seen.size)

    def tones(self, *periods_px: float) -> tuple[FloatArray, float]:
        """Return complex amplitudes of tones over a parabola, and R² of the tones."""
        turning = np.exp(2j * np.pi * self.column[:, None] / np.array(periods_px))
        x = 2 * self.column / self.columns - 1
        design = np.column_stack([turning.real, turning.imag, x**0, x, x**2])
        found = np.linalg.lstsq(design / self.sigma[:, None], self.row / self.sigma, rcond=None)[0]
        n, weight = len(periods_px), self.sigma**-2
        left = self.row - design[:, 2 * n :] @ found[2 * n :]
        scatter = np.sum(weight * (left - np.average(left, weights=weight)) ** 2)
        rest = np.sum(weight * (left - design[:, : 2 * n] @ found[: 2 * n]) ** 2)
        return np.asarray(found[:n] - 1j * found[n : 2 * n]), float(1 - rest / scatter)

    def period_px(self, low: float, high: float) -> float:
        """Return the period that explains most."""
        periods = 1 / np.linspace(1 / high, 1 / low, 1200)
        return float(periods[np.argmax([self.tones(period)[1] for period in periods])])


def edges_of(path: Path) -> list[GrooveEdges]:
    """Return all grooves of a picture of which both edges were found."""
    found = EdgeCartridge().find(open_picture(path).group(0))
    return [groove for groove in found if np.isfinite(groove.row_px).any(axis=1).all()]


def above_db(tones: FloatArray, periods_px: FloatArray) -> FloatArray:
    """Return how far each wall's own tone stands above the other one, all grooves in step.

    Parameters
    ----------
    tones : complex array, shape (groove, wall, tone)
        The outer wall first, and its own tone first; displacements, or velocities with `periods_px` of 1.
    periods_px : float64 array, shape (tone,)
        Displacements over these are velocities.
    """
    found = []
    for wall in (0, 1):
        own, other = tones[:, wall, wall] / periods_px[wall], tones[:, wall, 1 - wall] / periods_px[1 - wall]
        step = np.exp(-1j * np.angle(tones[:, 1 - wall, 1 - wall]))
        found.append(20 * np.log10(np.abs(own).mean() / np.abs(np.mean(other * step))))
    return np.array(found)


def track_05(path: Path) -> list[str]:
    """600 Hz on both walls, in phase."""
    grooves = edges_of(path)
    lines = [
        f"## track_05: 600 Hz on both walls, {len(grooves)} grooves with both edges",
        "",
        line_of(("groove, wall", "measured", "σ of a column, px", "period, columns", "R²")),
        "|" + "---|" * 5,
    ]
    periods = []
    for number, groove in enumerate(grooves):
        for name, wall in WALLS.items():
            edge = Edge.of(groove, wall)
            periods.append(edge.period_px(172, 182))
            share, sigma = edge.column.size / edge.columns, float(np.median(edge.sigma))
            explained = edge.tones(periods[-1])[1]
            lines.append(
                line_of(
                    (f"{number + 1}, {name}", f"{share:.0%}", f"{sigma:.2f}", f"{periods[-1]:.2f}", f"{explained:.3f}")
                )
            )
    apart, off = max(periods) / min(periods) - 1, np.abs(np.array(periods) / np.median(periods) - 1).max()
    return [
        *lines,
        "",
        f"Periods: {apart:.2%} between extremes (1 % promised), {off:.2%} from their median at most.",
        "",
    ]


def track_09(path: Path) -> list[str]:
    """800 Hz on the outer wall, 3000 Hz on the inner one."""
    edges = [[Edge.of(groove, wall) for wall in WALLS.values()] for groove in edges_of(path)]
    limits = ((140.0, 170.0), (38.0, 44.0))
    periods = np.array(
        [np.median([pair[wall].period_px(*limits[wall]) for pair in edges]) for wall in range(len(limits))]
    )
    tones = np.array([[edge.tones(*periods)[0] for edge in pair] for pair in edges])
    outer, inner = (np.abs(tones[:, wall, wall]).mean() for wall in (0, 1))
    rows = [
        f"## track_09: 800 Hz on the outer wall, 3000 Hz on the inner one, {len(edges)} grooves with both edges",
        "",
        f"By the edges: periods {periods[0]:.2f} and {periods[1]:.2f} columns, ratio {periods[0] / periods[1]:.3f} (3.75 ± 2 % "
        f"promised); own tones {outer:.2f} and {inner:.2f} px. Own tone above the other, outer and inner wall: as velocity "
        f"{_decibels(above_db(tones, periods))} dB, as displacement {_decibels(above_db(tones, np.ones(2)))} dB.",
        "",
        "By `walls.wav`, the same grooves (20 dB promised; *of the edges'*: own tone over what the edges swing):",
        "",
        line_of(
            (
                "one pixel taken for",
                "walls",
                "own tone, of the edges': outer, inner",
                "own tone above the other, dB: outer, inner",
            )
        ),
        "|" + "---|" * 4,
    ]
    for pitch_um, angle_deg in (*((scale, None) for scale in SCALES_UM), (4.0, 45.0)):
        heard, speeds, taken_deg = heard_tones(path, pitch_um, angle_deg, periods)
        # a wall's own velocity along its normal, where it stands at 45°
        share = np.abs(heard[:, (0, 1), (0, 1)]).mean(axis=0) / (np.array([outer, inner]) * speeds)
        rows.append(
            line_of(
                (
                    f"{pitch_um:g} µm" + (" (assumed)" if pitch_um == 4 else ""),
                    f"{taken_deg:.1f}°, " + ("by their tones" if angle_deg is None else "as was said"),
                    f"{share[0]:.2f}, {share[1]:.2f}",
                    _decibels(above_db(heard, np.ones(2))).replace(" and", ","),
                )
            )
        )
    return [*rows, ""]


def heard_tones(
    path: Path, pitch_um: float, angle_deg: float | None, periods_px: FloatArray
) -> tuple[FloatArray, FloatArray, float]:
    """Return velocities of both tones, shape (groove, wall, tone), of a pixel's swing at each, and the angle of the walls."""
    disc = Disc(cut="stereo") if angle_deg is None else Disc(cut="stereo", wall_angle_rad=rad(angle_deg))
    known = StillManifest(
        (), disc=disc, wall_angle_known=angle_deg is not None, pixel_pitch_m=pitch_um / MICROMETRES_PER_METRE
    )
    capture = open_picture(path, known)
    pitch_m = capture.bench.sensor.pixel_pitch_m
    tones_hz = float(capture.bench.rotation.speed_at_m_s(0.0)) / (periods_px * pitch_m)
    with tempfile.TemporaryDirectory() as folder:
        report = play(
            capture, load_recipe("stills"), Path(folder), Settings(rate_hz=RATE_HZ, full_scale_m_s=FULL_SCALE_M_S)
        )
        sound = FULL_SCALE_M_S * soundfile.read(Path(folder) / "walls.wav")[0]
        rows = list(csv.DictReader((Path(folder) / "grooves.csv").read_text("utf-8").splitlines()))
    found = []
    for row in rows:
        if float(row["measured"]) > WHOLE:
            piece = sound[round(float(row["start_s"]) * RATE_HZ) : round(float(row["stop_s"]) * RATE_HZ)]
            time_s = np.arange(len(piece)) / RATE_HZ
            turning = np.exp(2j * np.pi * np.outer(time_s, tones_hz))
            window = np.hanning(len(piece) + 2)[1:-1, None]
            design = np.column_stack([turning.real, turning.imag, time_s**0, time_s]) * window
            fit = np.linalg.lstsq(design, piece * window, rcond=None)[0]
            found.append((fit[:2] - 1j * fit[2:4]).T)
    taken_deg = report["calibration"]["wall_angle_deg"]["taken"]
    return np.array(found), 2 * np.pi * tones_hz * pitch_m / np.sqrt(2), taken_deg


def _decibels(both: FloatArray) -> str:
    return f"{both[0]:.1f} and {both[1]:.1f}"


def main() -> None:
    """Measure both."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--folder", type=Path, default=Path("../shared/data/micrographs"))
    parser.add_argument("--table", type=Path, help="page to write")
    given = parser.parse_args()
    about = (__doc__ or "").replace("Two micrographs", "# Two micrographs", 1)
    text = "\n".join([about, *track_05(given.folder / "track_05.png"), *track_09(given.folder / "track_09.png")])
    print(text)
    if given.table is not None:
        given.table.write_text(text, "utf-8")


if __name__ == "__main__":
    main()
