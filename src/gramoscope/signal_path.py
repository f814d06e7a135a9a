"""The types that pass along the player, in playing order. Read this first.

    capture on disk
      │ apparatus.capture          lazy; one stretch in memory at a time
    FrameGroup                     the film of one stretch of groove
      │ pickup                     flow → focus → stripes → where each wall runs
    WallTrace                      both walls of one stretch, with error bars
      ╎ (a photograph goes StillPicture → GrooveEdges → WallTrace: apparatus.still, pickup.edges)
      │ tonearm                    splice → smooth
    GrooveMotion                   the groove's velocity along the whole passage, piece by piece
      │ preamp                     place → time
    GrooveSound                    both directions in time, piece by piece
      │ preamp                     the sound of the cut, of the walls; repair; recording characteristic
    Audio                          sound, piece by piece
      │ listening                  files, comparison, figures, report

Each is a frozen record of arrays. A part reads one and returns the next; nobody changes one in place. From the pickup on
every sample carries its standard error (`…_sigma`, one standard deviation, NaN where unknown) and its flags
(`gramoscope.quality`), so that a filled gap never passes for a measurement. SI units inside.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from gramoscope.conventions import FloatArray
from gramoscope.quality import FlagArray

ImageArray = npt.NDArray[np.uint8] | npt.NDArray[np.uint16]


@dataclass(frozen=True, eq=False)
class FrameGroup:
    """The film of one stretch of groove: a few frames taken a small step apart.

    Attributes
    ----------
    number : int
        Which group of the capture this is, from 0.
    images : uint8 or uint16 array, shape (frame, row, column)
        Grey, canonical (see `gramoscope.conventions`): s grows with the column, l with the row. A frame that could not
        be read is all zeros and not `valid`. Each frame lies in one piece; from one to the next there may be a gap.
    arc_start_m : float64 array, shape (frame,)
        Nominal place s of column 0 in each frame: what the encoder or the manifest says. The pictures know better.
    stage_m : float64 array, shape (frame,)
        Radial position of the microscope, positive inwards; 0 when it did not move.
    pixel_pitch_m : float
        One pixel, measured on the record.
    white_level : int
        The pixel value of full scale, 2**bits − 1.
    valid : bool array, shape (frame,)
        Whether each frame was read.
    problems : tuple of str
        What was found wrong while reading, in words, empty when all is well.
    """

    number: int
    images: ImageArray
    arc_start_m: FloatArray
    stage_m: FloatArray
    pixel_pitch_m: float
    white_level: int
    valid: npt.NDArray[np.bool_]
    problems: tuple[str, ...] = ()

    @property
    def usable_images(self) -> ImageArray:
        """The valid frames; a view when all are."""
        return self.images if self.valid.all() else self.images[self.valid]


@dataclass(frozen=True, eq=False)
class StillPicture:
    """A plain photograph of grooves whose edges are sharp: one micrograph, one line scan, one stretch of an unrolled disc.

    Attributes
    ----------
    number : int
        Which picture of the capture this is, from 0.
    image : uint8 or uint16 array, shape (row, column)
        Grey, canonical (see `gramoscope.conventions`): s grows with the column, l with the row, so that the groove that
        plays first has the smallest row.
    arc_start_m : float
        Nominal place s of column 0.
    lateral_start_m : float
        Nominal place l of row 0.
    pixel_pitch_m : float
        One pixel, measured on the record; an arbitrary one when nobody knows.
    white_level : int
        The pixel value of full scale, 2**bits − 1.
    seen : bool array, shape (row, column)
        Which pixels show the record; False in corners that an unrolled disc does not reach.
    problems : tuple of str
        What was found wrong while reading, in words, empty when all is well.
    """

    number: int
    image: ImageArray
    arc_start_m: float
    lateral_start_m: float
    pixel_pitch_m: float
    white_level: int
    seen: npt.NDArray[np.bool_]
    problems: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class GrooveEdges:
    """The edges of one groove in one picture, column by column.

    Attributes
    ----------
    number : int
        Which groove of the picture, from 0, in playing order: by growing row.
    row_px, row_sigma_px : float64 arrays, shape (2, column)
        Row at which the wall meets the land, of the inner and the outer wall (`INNER`, `OUTER`), sub-pixel, and its
        standard error; NaN where nothing was seen of it. One entry for each column of the picture.
    correlation_samples : float
        How many neighbouring columns share one error.
    flags : uint16 array, shape (2, column)
    bottom_row_px, bottom_row_sigma_px : float64 arrays, shape (column,)
        The line along the bottom of the groove, NaN where it is not seen.
    """

    number: int
    row_px: FloatArray
    row_sigma_px: FloatArray
    correlation_samples: float
    flags: FlagArray
    bottom_row_px: FloatArray
    bottom_row_sigma_px: FloatArray


@dataclass(frozen=True, eq=False)
class Texture:
    """A strip of registered, filtered picture, for matching with its neighbour.

    Attributes
    ----------
    strip : float32 array, shape (row, column)
        Zero mean where nothing is to be seen.
    arc_start_m : float
        Nominal place s of column 0, on the same footing as `WallTrace.arc_start_m`.
    pixel_pitch_m : float
    stage_m : float
        Where the microscope stood.
    """

    strip: npt.NDArray[np.float32]
    arc_start_m: float
    pixel_pitch_m: float
    stage_m: float = 0.0


@dataclass(frozen=True, eq=False)
class WallTrace:
    """Where both walls of one stretch run.

    Attributes
    ----------
    number : int
        The group it was read from.
    arc_start_m : float
        Nominal place s of the first sample.
    arc_step_m : float
        From one sample to the next; equal for all samples of a passage.
    offset_m, offset_sigma_m : float64 arrays, shape (2, sample)
        Lateral place of each wall (`INNER`, `OUTER`), up to a constant of that wall, and its standard error. NaN for a
        wall that the pickup does not read.
    slope, slope_sigma : float64 arrays, shape (2, sample)
        d(offset)/ds, dimensionless, and its standard error. Times the groove speed it is the velocity of the wall.
    correlation_samples : float
        How many neighbouring samples share one error: the information of n samples is n / `correlation_samples` times
        that of one. 1 when errors are independent.
    flags : uint16 array, shape (2, sample)
    head, tail : Texture or None
        The texture at the start and the end of the stretch, by which the tonearm finds out how far the record really
        turned from one stretch to the next.
    frame_step_m : float64 array, shape (frame − 1,)
        How far the record really turned from frame to frame, by the flow; NaN where it could not be seen.
    wall_angle_rad : float64 array, shape (2,)
        Angle of each wall against the land, by the distance of its stripes and their depths; NaN for a wall that does not
        show two. A wrong angle means a wrong glass, pixel pitch or wall.
    problems : tuple of str
    """

    number: int
    arc_start_m: float
    arc_step_m: float
    offset_m: FloatArray
    offset_sigma_m: FloatArray
    slope: FloatArray
    slope_sigma: FloatArray
    correlation_samples: float
    flags: FlagArray
    head: Texture | None = None
    tail: Texture | None = None
    frame_step_m: FloatArray = field(default_factory=lambda: np.empty(0))
    wall_angle_rad: FloatArray = field(default_factory=lambda: np.full(2, np.nan))
    problems: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class ErrorSpectrum:
    """How the claimed error of a piece of motion is spread over the frequencies, where the groove was seen.

    Attributes
    ----------
    frequency_hz : float64 array, shape (frequency,)
        Rising, the same for all pieces of a passage.
    density : float64 array, shape (2, frequency)
        (m/s)²/Hz, one-sided, of the lateral and the vertical velocity at nominal speed; NaN for a direction that is not
        smoothed.
    samples : int
        Grid samples that it stands for; 0 where nothing was seen, and then the density is 0.
    """

    frequency_hz: FloatArray
    density: FloatArray
    samples: int


@dataclass(frozen=True, eq=False)
class GrooveMotion:
    """A piece of the groove's motion; pieces follow each other without gap or overlap.

    Attributes
    ----------
    arc_start_m : float
        Place s of the first sample.
    arc_step_m : float
        From one sample to the next.
    lateral_velocity_m_s, lateral_sigma_m_s : float64 arrays, shape (sample,)
        Velocity of the groove towards +l at nominal speed, and its standard error; NaN when the cut cannot be read from
        the walls that were seen.
    vertical_velocity_m_s, vertical_sigma_m_s : float64 arrays, shape (sample,)
        The same towards +z.
    flags : uint16 array, shape (sample,)
    error_spectrum : ErrorSpectrum or None
        None where the tonearm cannot tell.
    """

    arc_start_m: float
    arc_step_m: float
    lateral_velocity_m_s: FloatArray
    lateral_sigma_m_s: FloatArray
    vertical_velocity_m_s: FloatArray
    vertical_sigma_m_s: FloatArray
    flags: FlagArray
    error_spectrum: ErrorSpectrum | None = None


@dataclass(frozen=True, eq=False)
class Audio:
    """A piece of sound; pieces follow each other without gap or overlap.

    Attributes
    ----------
    start_sample : int
        Number of the first sample; sample 0 is s = 0.
    rate_hz : float
    samples : float64 array, shape (sample,)
        Velocity of the groove in the direction of the cut, in metres a second.
    sigma : float64 array, shape (sample,)
        Standard error of each sample, same unit.
    flags : uint16 array, shape (sample,)
    history : tuple of str
        What was done to it since the groove, in order.
    """

    start_sample: int
    rate_hz: float
    samples: FloatArray
    sigma: FloatArray
    flags: FlagArray
    history: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class GrooveSound:
    """A piece of the groove's motion in time, both directions at the same moments.

    Attributes
    ----------
    lateral, vertical : Audio
        Velocity towards +l and +z. Samples of a direction that could not be read are 0, flagged `INTERPOLATED`, with NaN
        for their sigma.
    """

    lateral: Audio
    vertical: Audio


@dataclass(frozen=True)
class Cue:
    """A span of sound that a repair has touched, or that nobody measured.

    Attributes
    ----------
    kind : {"declick", "decrackle", "rumble", "interpolated"}
        By what; "interpolated" was bridged while reading, and not touched since.
    start_sample, stop_sample : int
        The first sample, and the first after the last; sample 0 is s = 0.
    rate_hz : float
    peak_change_m_s, rms_change_m_s : float
        Largest and root-mean-square size of what was taken off.
    change_db : float
        Rms of what was taken off against that of what stood there; NaN in silence.
    reason : str
        Why: flags by name, and how many standard errors the largest change is.
    """

    kind: str
    start_sample: int
    stop_sample: int
    rate_hz: float
    peak_change_m_s: float
    rms_change_m_s: float
    change_db: float
    reason: str

    @property
    def start_s(self) -> float:
        """Time of the first sample."""
        return self.start_sample / self.rate_hz

    @property
    def stop_s(self) -> float:
        """Time of the first sample after the last."""
        return self.stop_sample / self.rate_hz
