"""`edges.npz`: the edges of every groove in every picture, for whoever wants the traces themselves, and for the player.

NumPy's own format, an array an entry: ``p000003_g02_row_px`` is the rows of both walls (inner first) of groove 2 in picture
3, one for each column of the canonical picture; likewise ``row_sigma_px``, ``flags``, ``bottom_row_px``,
``bottom_row_sigma_px``, ``correlation_samples``. The player writes it while it looks at the pictures, and reads it back
groove by groove, so that no more than one picture's worth of either is in memory.
"""

from __future__ import annotations

import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from gramoscope.listening.whole_file import output_error
from gramoscope.signal_path import GrooveEdges

ARRAYS = ("row_px", "row_sigma_px", "flags", "bottom_row_px", "bottom_row_sigma_px", "correlation_samples")


class EdgeWriter:
    """Writes the edges picture by picture.

    Parameters
    ----------
    path : Path
        Overwritten.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._zip = zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1)

    def write(self, picture: int, grooves: Sequence[GrooveEdges]) -> None:
        """Append the edges of one picture; OutputError if the disk is full."""
        try:
            for edges in grooves:
                for name in ARRAYS:
                    with self._zip.open(f"{entry(picture, edges.number)}_{name}.npy", "w", force_zip64=True) as file:
                        np.lib.format.write_array(file, np.asarray(getattr(edges, name)), allow_pickle=False)
        except OSError as error:
            raise output_error(self._path, error.strerror or str(error), number=error.errno) from error

    def close(self) -> None:
        """Complete the file."""
        self._zip.close()


@contextmanager
def edge_writer(path: Path) -> Iterator[EdgeWriter]:
    """Yield a writer that is closed in any case."""
    writer = EdgeWriter(path)
    try:
        yield writer
    finally:
        writer.close()


def entry(picture: int, groove: int) -> str:
    """Return what the entries of a groove in a picture begin with."""
    return f"p{picture:06d}_g{groove:02d}"


def read_edges(path: Path, picture: int, groove: int) -> GrooveEdges:
    """Read the edges of one groove in one picture."""
    with np.load(path, allow_pickle=False) as file:
        found: dict[str, Any] = {name: file[f"{entry(picture, groove)}_{name}"] for name in ARRAYS}
    return GrooveEdges(number=groove, **{**found, "correlation_samples": float(found["correlation_samples"])})
