"""The cartridge of the paper: flow → in-focus points → Hough transform → two centroid lines → orientation of the wall.

Sections 5 and 6 of B. Tian and J. L. Barron, *Sound from gramophone record groove surface orientation*. Where the paper
is silent the choices are ours and say so where they stand: `flow.horn_schunck` (the constraint), `wall` (the robust
estimator), `stripes` (which peak is which stripe), and one departure: the Hough transform may work on several segments of
the picture (`search`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from gramoscope.apparatus.bench import Bench, Stripe
from gramoscope.camera.exposure import Exposure
from gramoscope.conventions import INNER, MICROMETRES_PER_METRE, FloatArray, IntArray, lateral_of_row_m
from gramoscope.pickup.cartridge import Line, Sketch, Spread
from gramoscope.pickup.centreline import Centreline, centroids, discard_damaged_columns, fill_voids
from gramoscope.pickup.flow.derivatives import Derivatives, group_derivatives, texture_contrast
from gramoscope.pickup.flow.flow_method import FlowMethod
from gramoscope.pickup.flow.horn_schunck import Flow, GrooveHornSchunck
from gramoscope.pickup.in_focus import InFocus
from gramoscope.pickup.registration import Canvas, overlap_textures, registered
from gramoscope.pickup.search import HoughSearch, Segment, line_rows, line_slopes
from gramoscope.pickup.stripes import StripeModel, kept_stripes, walls_read
from gramoscope.pickup.wall import Planes, WallOrientation, wall_angle_rad
from gramoscope.pickup.wall_samples import WallSamples, samples_of_wall
from gramoscope.quality import Quality, no_flags
from gramoscope.signal_path import FrameGroup, WallTrace

NEARLY_WHITE = 0.97
"""Points brighter than this share of full scale are burnt out: their texture is the camera's."""


@dataclass(frozen=True, eq=False)
class Reading:
    """Everything that was seen on the way, for pictures and for doubters.

    Attributes
    ----------
    group : FrameGroup
        Without its useless frames.
    canvas : Canvas
    derivatives : Derivatives
        Scaled to the texture's contrast.
    contrast : float
        Grey levels a pixel, of the sharpest region.
    flow : Flow or None
    point_row, point_column : int arrays, shape (point,)
        In-focus points.
    label : int array, shape (point,)
        Number of the stripe; −1 in no region, −2 disputed, −3 in a damaged column.
    segments : list of Segment
    stripes : tuple of Stripe
        As expected from the bench.
    centrelines : list of Centreline
        One for each stripe.
    kept : tuple of int
        The stripes that make the wall; the others are set aside.
    planes : Planes
    trace : WallTrace
    """

    group: FrameGroup
    canvas: Canvas
    derivatives: Derivatives
    contrast: float
    flow: Flow | None
    point_row: IntArray
    point_column: IntArray
    label: IntArray
    segments: list[Segment]
    stripes: tuple[Stripe, ...]
    centrelines: list[Centreline]
    kept: tuple[int, ...]
    planes: Planes
    trace: WallTrace


@dataclass(frozen=True)
class SeedPaperPickup:
    """The cartridge of the paper.

    Parameters
    ----------
    bench : Bench
        What the apparatus is.
    flow : HornSchunck, GrooveHornSchunck or MultigridHornSchunck
        Weights are in units of the sharpest region's gradient.
    smoothing_px : float
        Gaussian before the derivatives.
    exposure, in_focus, hough, stripe_model, orientation
        The steps; see each.
    """

    bench: Bench
    flow: FlowMethod = field(default_factory=GrooveHornSchunck)
    smoothing_px: float = 1.0
    exposure: Exposure = field(default_factory=Exposure)
    in_focus: InFocus = field(default_factory=InFocus)
    hough: HoughSearch = field(default_factory=HoughSearch)
    stripe_model: StripeModel = field(default_factory=StripeModel)
    orientation: WallOrientation = field(default_factory=WallOrientation)

    def read(self, group: FrameGroup) -> WallTrace:
        """Return where the wall of one stretch runs.

        Parameters
        ----------
        group : FrameGroup

        Returns
        -------
        WallTrace
            One wall of a dual-focal capture (the one that shows two stripes), both walls without a cover glass. A
            stretch without a usable frame gives NaN and flags, never an exception.
        """
        group, exposure_flags = self.exposure.sort_out(group)
        if not group.valid.any():
            return self._lost(group, exposure_flags)
        return self._read(group, exposure_flags).trace

    def learn(
        self,
        group: Callable[[int], FrameGroup],
        group_count: int,
        spread: Spread,
        progress: Callable[[int, int], None] | None = None,
    ) -> SeedPaperPickup:
        """Return the cartridge as it is; see `pickup.cartridge.Cartridge`."""
        return self

    @property
    def walls(self) -> tuple[str, ...]:
        """The walls that the kept stripes make."""
        return walls_read(self.bench)

    @property
    def calibration(self) -> Mapping[str, Any]:
        """Nothing: wall angles and frame steps are told stretch by stretch."""
        return {}

    def sketch(self, group: FrameGroup) -> Sketch | None:
        """Return one frame and the stripes that were found in it; None when no frame is usable."""
        reading = self.inspect(group)
        if reading is None:
            return None
        image = reading.group.images[int(np.flatnonzero(reading.group.valid)[0])]
        width = image.shape[1]
        lines = zip(reading.stripes, reading.centrelines, strict=True)
        return Sketch(image, tuple(Line(_name(s), line.row[:width], line.measured[:width]) for s, line in lines))

    def inspect(self, group: FrameGroup) -> Reading | None:
        """Return everything that was seen on the way to a trace, None when no frame is usable."""
        group, exposure_flags = self.exposure.sort_out(group)
        return self._read(group, exposure_flags) if group.valid.any() else None

    def _read(self, group: FrameGroup, exposure_flags: Quality) -> Reading:
        canvas, step_m = registered(group)
        raw = group_derivatives(canvas, smoothing_px=self.smoothing_px)
        contrast = texture_contrast(raw.x)
        derivatives = raw.scaled(1 / contrast if contrast > 0 else 0.0)
        flow = self._flow(derivatives, step_m) if canvas.frame_index.size > 1 else None
        in_focus = self.in_focus.mask(derivatives, flow) & (canvas.mean < NEARLY_WHITE * group.white_level)
        rows, columns = np.nonzero(in_focus)
        stripes = self.bench.stripes()
        segments = self.hough.find(
            rows, columns, canvas.mean.shape, stripes=stripes, stripe_model=self.stripe_model, bench=self.bench
        )
        label = self.hough.label(rows, columns, segments)
        label = discard_damaged_columns(label, columns, width=canvas.mean.shape[1])
        weights = derivatives.x[rows, columns].astype(np.float64) ** 2
        lines = []
        for number in range(len(stripes)):
            mine = label == number
            row, _ = centroids(rows[mine], columns[mine], weights[mine], width=canvas.mean.shape[1])
            lines.append(fill_voids(row, line_rows(segments, number)))
        kept = kept_stripes(stripes)
        planes, samples = self._orient(stripes, lines, segments)
        head, tail = overlap_textures(
            group,
            first=int(canvas.frame_index[0]),
            width=canvas.mean.shape[1],
            group_step_m=self.bench.sequence.group_step_m,
            texture_of=lambda columns: derivatives.x[:, columns].copy(),
        )
        trace = replace(self._trace(group, samples, exposure_flags, step_m), head=head, tail=tail)
        return Reading(
            group,
            canvas,
            derivatives,
            contrast,
            flow,
            rows,
            columns,
            label,
            segments,
            stripes,
            lines,
            kept,
            planes,
            trace,
        )

    def _flow(self, derivatives: Derivatives, step_m: FloatArray) -> Flow:
        known = step_m[np.isfinite(step_m)]
        step = float(np.median(known)) if known.size else self.bench.sequence.frame_step_m
        return self.flow.flow(derivatives, shear=self._shear(derivatives.x.shape[0], step))

    def _shear(self, height: int, step_m: float) -> FloatArray:
        """g: how the flow changes down the rows on the walls of a groove at rest in the middle of the picture."""
        bench = self.bench
        lateral = lateral_of_row_m(np.arange(height), height_px=height, pixel_pitch_m=bench.sensor.pixel_pitch_m)
        on_wall = np.abs(lateral) < bench.disc.groove_width_m / 2
        # beyond the middle the wall rises towards the lens: nearer points move faster
        rise = np.sign(lateral) * np.tan(bench.disc.wall_angle_rad) * on_wall
        return np.asarray(step_m * rise / bench.objective.object_distance_m)

    def _orient(
        self, stripes: tuple[Stripe, ...], lines: list[Centreline], segments: list[Segment]
    ) -> tuple[Planes, dict[int, WallSamples]]:
        """Planes and samples of each wall that the kept stripes make; the planes are those of the last wall."""
        stations = self.orientation.stations(lines[0].row.size)
        samples = {}
        for wall in sorted({stripes[i].wall for i in kept_stripes(stripes)}):
            mine = [i for i in kept_stripes(stripes) if stripes[i].wall == wall]
            rows = np.array([lines[i].row for i in mine])
            measured = np.array([lines[i].measured for i in mine])
            planes = self.orientation.fit(rows, measured)
            sample = samples_of_wall(
                planes,
                rows,
                measured,
                stations,
                line_slope=line_slopes(segments, mine, stations),
                expected_row=np.array([stripes[i].row for i in mine]),
            )
            angle = wall_angle_rad(
                planes,
                depth_below_land_m=np.array([stripes[i].depth_below_land_m for i in mine]),
                pixel_pitch_m=self.bench.sensor.pixel_pitch_m,
            )
            samples[wall] = replace(sample, wall_angle_rad=angle)
        return planes, samples

    def _trace(
        self, group: FrameGroup, samples: dict[int, WallSamples], flags: Quality, step_m: FloatArray
    ) -> WallTrace:
        """Walls in metres; a wall that the method does not read is NaN."""
        first = int(np.flatnonzero(group.valid)[0])
        pitch = group.pixel_pitch_m
        stations = next(iter(samples.values())).slope.size
        offset, offset_sigma, slope, slope_sigma = (np.full((2, stations), np.nan) for _ in range(4))
        angle = np.full(2, np.nan)
        wall_flags = np.full((2, stations), Quality.NO_STRIPE | Quality.INTERPOLATED, np.uint16)
        for wall, sample in samples.items():
            offset[wall] = lateral_of_row_m(
                sample.row_px,
                height_px=group.images.shape[1],
                pixel_pitch_m=pitch,
                stage_m=float(group.stage_m[first]),
            )
            offset_sigma[wall] = pitch * sample.row_sigma_px
            slope[wall], slope_sigma[wall] = sample.slope, sample.slope_sigma
            wall_flags[wall] = sample.flags | np.uint16(flags)
            angle[wall] = sample.wall_angle_rad
        return WallTrace(
            number=group.number,
            arc_start_m=float(group.arc_start_m[first]),
            arc_step_m=pitch * self.orientation.stride_px,
            offset_m=offset,
            offset_sigma_m=offset_sigma,
            slope=slope,
            slope_sigma=slope_sigma,
            correlation_samples=self.orientation.correlation_samples,
            flags=wall_flags,
            wall_angle_rad=angle,
            frame_step_m=step_m,
            problems=group.problems,
        )

    def _lost(self, group: FrameGroup, flags: Quality) -> WallTrace:
        """A stretch without a usable frame: nothing but flags."""
        stations = self.orientation.stations(group.images.shape[2]).size
        nothing = np.full((2, stations), np.nan)
        return WallTrace(
            number=group.number,
            arc_start_m=float(group.arc_start_m[0]),
            arc_step_m=group.pixel_pitch_m * self.orientation.stride_px,
            offset_m=nothing,
            offset_sigma_m=nothing,
            slope=nothing,
            slope_sigma=nothing,
            correlation_samples=1.0,
            flags=no_flags(2, stations) | np.uint16(flags | Quality.INTERPOLATED),
            problems=group.problems,
        )


def _name(stripe: Stripe) -> str:
    wall = "inner" if stripe.wall == INNER else "outer"
    place = "through the glass" if stripe.through_glass else "beside the glass"
    return f"{wall} wall, {stripe.depth_below_land_m * MICROMETRES_PER_METRE:.0f} µm deep, {place}"
