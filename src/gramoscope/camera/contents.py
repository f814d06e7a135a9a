"""What is in the files of a group: each is read once, and added up while it is at hand."""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

PIECE_BYTES = 1 << 20
"""Files are read in such pieces: smaller ones ask for the interpreter too often, larger ones fall out of the cache."""

Bytes = npt.NDArray[np.uint8]


@dataclass
class Contents:
    """Reads whole files.

    Parameters
    ----------
    summed : bool
        Whether each file is added up.

    Attributes
    ----------
    sums : dict
        Path → SHA-256 in hexadecimal of each file that was read.
    """

    summed: bool = False
    sums: dict[Path, str] = field(default_factory=dict)

    def of(self, path: Path) -> Bytes:
        """Return the bytes of a file, uint8 array; raises OSError if it cannot be read."""
        total = hashlib.sha256()
        with path.open("rb", buffering=0) as file:
            # of the file that is open, whatever lies there by now
            room = np.empty(os.fstat(file.fileno()).st_size, np.uint8)
            done = 0
            while done < room.size and (count := file.readinto(room[done : done + PIECE_BYTES].data)):
                if self.summed:
                    total.update(room[done : done + count].data)
                done += count
        if self.summed:
            self.sums[path] = total.hexdigest()
        return room[:done]
