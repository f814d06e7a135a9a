"""How grooves look in a photograph: what the light makes of land, wall and edge.

Light from above, or at a low angle along the groove, leaves the land bright and the walls dark; light thrown in from the
side that a wall faces does the opposite; a dark field shows the edges alone, as thin bright lines.
"""

from __future__ import annotations

from enum import Enum, auto


class Appearance(Enum):
    """What an edge looks like."""

    DARK_GROOVES = auto()
    """Walls are darker than the land beside them, or than the bright line at its edge."""
    BRIGHT_GROOVES = auto()
    """Walls are brighter than the land beside them."""
    BRIGHT_LINES = auto()
    """Edges are thin bright lines, with nothing to tell land from wall: what is wider is taken for the groove."""
