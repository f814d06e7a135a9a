"""`gramoscope pack`: a transfer in, a bag for the archive out."""

from __future__ import annotations

from pathlib import Path

from gramoscope.cli.terminal import FINE, Terminal, several


def pack(
    transfer: Path,
    /,
    *,
    to: Path | None = None,
    move: bool = False,
    organisation: str = "",
    contact: str = "",
    email: str = "",
    phone: str = "",
    identifier: str = "",
    description: str = "",
    quiet: bool = False,
    json: bool = False,
) -> int:
    """Pack a transfer for an archive: a BagIt bag (RFC 8493) with technical metadata.

    The bag holds everything in the folder, what you laid beside the sounds too (a picture of the label, say), SHA-256 and
    SHA-512 of every file, and `metadata/technical.json` and `.csv`: playing speed, groove size and direction,
    `phonoPreamp.eqTurnover` and `eqRolloff` of each sound, signal notes. Sums that the transfer has are checked on the way,
    and the finished bag is read again. It appears whole or not at all. Needs the extra `archive`.

    Parameters
    ----------
    transfer
        Folder that `gramoscope play` wrote. It stays as it is, unless you say --move.
    to
        The bag: a folder that is made, and must not exist; the transfer's name with `-bag`, beside it, when left out.
    move
        Move the files into the bag: they leave the folder once the bag is whole. Needs no room on the same disk.
    organisation
        Who sends the bag; the originator of the transfer when left out.
    contact
        Whom to ask, by name.
    email
        Whom to ask, by e-mail.
    phone
        Whom to ask, by telephone.
    identifier
        Your mark for it; the reference of the transfer, or the name of its capture, when left out.
    description
        What is in it; the description of the transfer, or what is known of the record, when left out.
    quiet
        Say nothing.
    json
        Print what is on the bag and its technical metadata as JSON.
    """
    from gramoscope.player.pack import BagLabel
    from gramoscope.player.pack import pack as pack_transfer

    terminal = Terminal(quiet, json)
    whole = transfer.resolve()
    bag = to or whole.with_name(f"{whole.name}-bag")
    label = BagLabel(organisation, contact, email, phone, identifier, description)
    with terminal.progress("Packing") as progress:
        packed = pack_transfer(transfer, bag, label, move=move, progress=progress)
    terminal.result(packed)
    moved = "moved" if move else "copied"
    rows = {
        "bag": packed["bag"],
        "payload": f"{several(packed['files'], 'file')}, {packed['bytes'] / 1e6:.1f} MB, {moved}; every sum holds",
        **{label.lower().replace("-", " "): value for label, value in packed["bag_info"].items() if label in _SHOWN},
    }
    terminal.table(rows)
    for name in packed["not_moved"]:
        terminal.say(f"[yellow]Note:[/] {name} was changed while it was packed: it is in the bag as it was, and stays")
    return FINE


_SHOWN = ("Source-Organization", "External-Identifier", "External-Description")
