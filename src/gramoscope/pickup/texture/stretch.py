"""One stretch of groove on its way through the reading: its picture, and where its walls are believed to run."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from gramoscope.conventions import BoolArray, FloatArray, IntArray
from gramoscope.pickup.device import Device, Kept
from gramoscope.pickup.processor import Processor
from gramoscope.pickup.texture.tone import Tone

AS_IT_IS = Tone()


@dataclass(frozen=True, eq=False)
class Stretch:
    """A stretch laid ready for reading.

    Attributes
    ----------
    columns : float32 array, shape (column, row)
        The registered picture, transposed; where the device keeps it.
    usable : bool array, shape (column,)
        Columns that rest on enough frames.
    burnt : int64 array, shape (place, 2)
        Column and row of each place at full scale.
    displacement_px : float64 array, shape (2, column)
        The present path of each wall.
    support : float64 array, shape (stripe, column)
        How sharp the coarse search found each stripe.
    tone : Tone
        In which the picture is seen: before it is interpolated, for bright grains ring less then.
    device : Device
        Where the picture lies and is heard.
    first_column : int
        Where it begins, in columns of the first frame.
    """

    columns: Kept
    usable: BoolArray
    burnt: IntArray
    displacement_px: FloatArray
    support: FloatArray
    tone: Tone = AS_IT_IS
    device: Device = field(default_factory=Processor)
    first_column: int = 0

    def in_tone(self, tone: Tone) -> Stretch:
        """Return the same stretch seen in a tone; only a picture that is as it was can be seen in another one."""
        if tone == self.tone or tone.compression == self.tone.compression == 0:
            return self
        assert self.tone.compression == 0
        return replace(self, columns=self.device.in_tone(self.columns, tone), tone=tone)

    def moved(self, step_px: FloatArray) -> Stretch:
        """Return the same stretch with its paths moved, shape (2, column)."""
        return replace(self, displacement_px=self.displacement_px + step_px)
