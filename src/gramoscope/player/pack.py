"""A transfer into a package that an archive accepts: the sleeve of a record."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, date, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

from gramoscope.errors import OutputError, require
from gramoscope.interruption import ctrl_c_waits
from gramoscope.listening.report import json_text
from gramoscope.listening.whole_file import output_error, temporary_sibling
from gramoscope.player.bag import BagFolder, removed, require_judge, require_valid
from gramoscope.player.catalogue import record_in_words
from gramoscope.player.outputs import REPORT
from gramoscope.player.speed import speed_in_words
from gramoscope.player.technical_metadata import csv_text, technical_metadata
from gramoscope.player.transfer import Transfer, TransferFile, open_transfer

METADATA, TABLE = "metadata/technical.json", "metadata/technical.csv"
Progress = Callable[[int, int, str], None]


@dataclass(frozen=True)
class BagLabel:
    """The archive's words on a bag; what is empty comes from the transfer, or is left out.

    Parameters
    ----------
    organisation : str
        Who sends it; the originator of the transfer when empty.
    contact, email, phone : str
        Whom to ask.
    identifier : str
        The archive's own mark; the transfer's reference, or the name of its capture, when empty.
    description : str
        The description of the transfer, or what is known of the record, when empty.
    bagged : date
    """

    organisation: str = ""
    contact: str = ""
    email: str = ""
    phone: str = ""
    identifier: str = ""
    description: str = ""
    bagged: date = field(default_factory=lambda: datetime.now(UTC).date())


def pack(
    folder: Path, bag: Path, label: BagLabel, *, move: bool = False, progress: Progress | None = None
) -> dict[str, Any]:
    """Pack a transfer into a bag, which appears whole or not at all.

    Parameters
    ----------
    folder : Path
        With a transfer. Nothing in it is changed, unless `move` is asked for.
    bag : Path
        The folder that becomes the bag; must not exist, and lie outside of `folder`.
    label : BagLabel
    move : bool
        Move the files: those that are in the bag, and unchanged since, are taken away from `folder` once the bag is whole.
        Nothing is copied within one disk.
    progress : callable, optional
        Told how much is done, of how much, and of what.

    Returns
    -------
    dict
        The bag's place, its number of files and bytes, its tags, its technical metadata, and the files that were to be moved
        and stay because somebody changed them.

    Raises
    ------
    TransferError
        If `folder` holds no whole transfer, or a file has another sum than it must have.
    OutputError
        If the bag exists, or cannot be written.
    GramoscopeError
        If the library bagit is not installed.
    """
    require_judge()
    transfer = open_transfer(folder)
    _require_place(transfer, bag, copies=not move)
    metadata = technical_metadata(transfer)
    with _made_whole(bag) as place:
        filling = BagFolder(place)
        _fill(filling, transfer, link=move, progress=progress)
        filling.tag(METADATA, json_text(metadata))
        filling.tag(TABLE, csv_text(metadata))
        info = _bag_info(transfer, label, filling)
        filling.finish(info)
        if progress is not None:
            progress(len(transfer.files), len(transfer.files), "Checking the bag")
        require_valid(place)
    with ctrl_c_waits():
        stay = removed(_report_first(transfer), transfer.folder) if move else []
    size = {"files": len(transfer.files), "bytes": filling.size_bytes}
    return {"bag": str(bag), **size, "bag_info": info, "technical": metadata, "not_moved": stay}


def _require_place(transfer: Transfer, bag: Path, *, copies: bool) -> None:
    if os.path.lexists(bag):
        raise OutputError(f"there is something called {bag}", "a name that is free", "choose another --to")
    inside = transfer.folder.resolve() in bag.resolve().parents
    require(not inside, f"the bag {bag} would lie in the transfer", "a place outside of it", "choose another --to")
    if copies and bag.parent.is_dir():
        free = shutil.disk_usage(bag.parent).free
        if free < transfer.size_bytes:
            raise OutputError(
                f"there are {free / 1e6:.0f} MB free for {bag}",
                f"{transfer.size_bytes / 1e6:.0f} MB",
                "choose another disk for --to, or --move the files",
            )


@contextmanager
def _made_whole(bag: Path) -> Iterator[Path]:
    """Yield a new folder under a temporary name; it becomes the bag if the block succeeds, and vanishes if it does not."""
    place = temporary_sibling(bag)
    try:
        try:
            place.mkdir()
            yield place
            place.rename(bag)
        except OSError as error:
            raise output_error(bag, error.strerror or str(error), number=error.errno) from error
    except BaseException:
        with ctrl_c_waits():
            shutil.rmtree(place, ignore_errors=True)
        raise


def _fill(filling: BagFolder, transfer: Transfer, *, link: bool, progress: Progress | None) -> None:
    done = 0
    megabytes = max(1, round(transfer.size_bytes / 1e6))

    def told(size_bytes: int) -> None:
        nonlocal done
        done += size_bytes
        if progress is not None:
            progress(min(round(done / 1e6), megabytes), megabytes, "Packing (MB)")

    for file in transfer.files:
        filling.add(file, link=link, told=told)


def _bag_info(transfer: Transfer, label: BagLabel, filling: BagFolder) -> dict[str, str]:
    """Return what is on the bag: RFC 8493's reserved labels, those that somebody gave or that the transfer tells."""
    catalogue = transfer.report["catalogue"]
    reference = Path(transfer.report["capture"]).name or transfer.folder.resolve().name
    info = {
        "Source-Organization": label.organisation or catalogue.get("originator", ""),
        "Contact-Name": label.contact,
        "Contact-Phone": label.phone,
        "Contact-Email": label.email,
        "External-Identifier": label.identifier or catalogue.get("reference", "") or reference,
        "External-Description": label.description or catalogue.get("description", "") or _described(transfer.report),
        "Bagging-Date": label.bagged.isoformat(),
        "Bag-Size": _in_words(filling.size_bytes),
        "Payload-Oxum": filling.oxum,
        "Bag-Software-Agent": f"Gramoscope {version('gramoscope')}",
    }
    return {name: value for name, value in info.items() if value}


def _in_words(size_bytes: int) -> str:
    return f"{size_bytes / 1e6:.1f} MB" if size_bytes >= 1e6 else f"{size_bytes / 1e3:.1f} kB"


def _described(report: Mapping[str, Any]) -> str:
    disc = report["bench"]["disc"]
    words = record_in_words(report["catalogue"].get("title") or disc["notes"].get("title", ""), disc["notes"])
    speed = speed_in_words(report["speed"])
    what = f"optical transfer of a gramophone record, {disc['cut']} cut, {speed}, {report['seconds']:.3f} s"
    return f"{words}; {what}" if words else what


def _report_first(transfer: Transfer) -> list[TransferFile]:
    """A report means a whole transfer: it goes before any of its files does."""
    return sorted(transfer.files, key=lambda file: file.name != REPORT)
