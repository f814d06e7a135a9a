"""Pages of a TIFF that lie in the file as they are: found without a library's patience for everything that a TIFF may be.

Cameras and microscopes write film as one page after another, all alike. The first page is understood by tifffile; of those
whose directories say the same, only where their pixels begin is taken. A file that is the least bit different (compressed,
in strips, of changing sizes, with a broken chain) is left to tifffile, page by page.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt
import tifffile

from gramoscope.camera.contents import Bytes

_STRIP_OFFSETS = 273
_WORDS = (269, 270, 271, 272, 282, 283, 285, 305, 306, 315, 316, 33432)
"""Tags that say nothing about how pixels lie: names, dates, resolution."""
_TYPE_BYTES = np.array([0, 1, 1, 2, 4, 8, 1, 1, 2, 4, 8, 4, 8, 4, 0, 0, 8, 8, 8])
"""Of one value of each type (TIFF 6.0, section 2, and BigTIFF)."""


def plain_pages(tiff: tifffile.TiffFile, data: Bytes) -> list[npt.NDArray[Any]]:
    """Return the pages of a file that has nothing but plain ones, as views of its bytes.

    Parameters
    ----------
    tiff : TiffFile
    data : uint8 array
        The whole file.

    Returns
    -------
    list of uint8 or uint16 arrays, shape (row, column)
        In the file's byte order; empty if the file is not plain.
    """
    first: Any = tiff.pages[0]
    if not (first.is_final and len(first.dataoffsets) == 1 and first.samplesperpixel == 1 and first.photometric == 1):
        return []
    pixels = np.dtype(tiff.byteorder + first.dtype.char)
    size = first.shape[0] * first.shape[1] * pixels.itemsize if len(first.shape) == 2 else 0
    places = _places(tiff, data)
    if size == 0 or not places or min(places) < 0 or max(places) + size > data.size:
        return []
    return [data[place : place + size].view(pixels).reshape(first.shape) for place in places]


def _places(tiff: tifffile.TiffFile, data: Bytes) -> list[int]:
    """Where the pixels of all pages begin; nothing if their directories differ in more than that."""
    form: Any = tiff.tiff
    order = tiff.byteorder
    place_type = np.dtype(f"{order}u{form.offsetsize}")
    entry = np.dtype([("tag", f"{order}u2"), ("type", f"{order}u2"), ("count", place_type), ("value", place_type)])
    page, model, free, at = int(tiff.pages[0].offset), data[:0], np.zeros(0, np.bool_), 0
    places = list[int]()
    # a chain that comes back is longer than the file
    while page != 0 and len(places) <= data.size // entry.itemsize:
        head = page + form.tagnosize
        tags = int.from_bytes(data[page:head].tobytes(), "little" if order == "<" else "big")
        end = head + tags * entry.itemsize
        if end + form.offsetsize > data.size:
            return []
        directory = data[head:end]
        if not places:
            model = directory
            free, at = _free(model.tobytes(), entry, form.offsetsize)
        if directory.size != free.size or at < 0 or ((directory != model) & ~free).any():
            return []
        places.append(int(directory[at : at + form.offsetsize].view(place_type)[0]))
        page = int(data[end : end + form.offsetsize].view(place_type)[0])
    return places


@lru_cache(maxsize=16)
def _free(entries: bytes, entry: np.dtype[Any], place_bytes: int) -> tuple[npt.NDArray[np.bool_], int]:
    """Which bytes of a directory may be others on other pages, and where the place of the pixels is; −1 if it is not plain.

    Remembered, for it is the same in all files of a film.
    """
    directory = np.frombuffer(entries, entry)
    bytes_ = np.where(directory["type"] < _TYPE_BYTES.size, _TYPE_BYTES[directory["type"] % _TYPE_BYTES.size], 0)
    here = (bytes_ > 0) & (bytes_ * directory["count"] <= place_bytes)
    words, strip = np.isin(directory["tag"], _WORDS), directory["tag"] == _STRIP_OFFSETS
    whole = strip & (directory["count"] == 1) & (bytes_ == place_bytes)
    free = np.zeros((directory.size, directory.dtype.itemsize), np.bool_)
    free[words | strip, -place_bytes:] = True
    plain = np.count_nonzero(whole) == 1 and (words | whole | here).all()
    at = int(np.argmax(whole)) * directory.dtype.itemsize + directory.dtype.itemsize - place_bytes
    return free.reshape(-1), at if plain else -1
