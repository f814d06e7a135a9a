"""The flow methods that a cartridge may use on registered frames: derivatives in, flow out."""

from __future__ import annotations

from gramoscope.pickup.flow.horn_schunck import GrooveHornSchunck, HornSchunck
from gramoscope.pickup.flow.multigrid_horn_schunck import MultigridHornSchunck

FlowMethod = HornSchunck | GrooveHornSchunck | MultigridHornSchunck
