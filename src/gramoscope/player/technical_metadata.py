"""Technical metadata of a transfer in the words of archives, made from its report.

Words and units follow the metadata of the New York Public Library's Audio and Moving Image Preservation (measure and unit,
`phonoPreamp.eqTurnover`, roll-off below 0 dB) and ISBD's elements for discs (playing speed, groove size, groove direction,
recording method). What a transfer does not tell is absent, or said to be not assessed.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from typing import Any

from gramoscope.disc.characteristics import Characteristic, characteristic
from gramoscope.errors import ArgumentError
from gramoscope.player.transfer import Transfer

PACKAGE_FORMAT = "gramoscope-package/1"
FOUND, NOT_FOUND, NOT_ASSESSED = "found", "not found", "not assessed"
_DIRECTIONS = {"lateral": "lateral", "vertical": "vertical", "stereo": "lateral and vertical (45/45)"}
_ELSEWHERE = ("frame_lost", "dark", "saturated")
_UNTOLD = {
    "Cracks": "a crack is not told from a chip or from dust; where a wall was not seen is counted as groove damage",
    "Delamination": "the surface of the disc was not looked at",
    "Centre start disc": "a film does not tell where the record starts",
    "Incorrect speed": "the playing speed is what the capture or whoever played it says; hints of the sound are in report.json",
    "Surface noise": "the error bars (see quality) are those of the reading; noise of the record is part of the sound",
}


def technical_metadata(transfer: Transfer) -> dict[str, Any]:
    """Return the technical metadata of a transfer.

    Parameters
    ----------
    transfer : Transfer

    Returns
    -------
    dict
        Plain values. The page docs/reference/package.md has every key.
    """
    report = transfer.report
    disc = report["bench"]["disc"]
    title = report["catalogue"].get("title") or disc["notes"].get("title", "")
    sizes = {file.name: file.size_bytes for file in transfer.files}
    return {
        "format": PACKAGE_FORMAT,
        "bibliographic": {**disc["notes"], **({"title": title} if title else {})},
        **_speed(report["speed"]),
        "grooveSize": _measure(_rounded(1e6 * disc["groove_width_m"]), "µm"),
        "grooveDirection": _DIRECTIONS[disc["cut"]],
        "recordingMethod": "analogue",
        "durationMilli": _measure(_rounded(1e3 * report["seconds"]), "ms"),
        "signalNotes": signal_notes(report),
        "quality": _quality(report["share"], report["noise_estimate"]),
        "captureSoftware": {
            "productName": "Gramoscope",
            "version": report["versions"]["gramoscope"],
            "platform": report["versions"]["system"],
        },
        "dateCreated": report["made"],
        "files": _files(report, sizes),
    }


def _speed(speed: Mapping[str, Any]) -> dict[str, Any]:
    """The speed at which the record turned; of one that changed the lowest and the highest beside that at the start."""
    playing = {"playingSpeed": _measure(speed["rpm"], "rpm")}
    if speed["curve"] is None:
        return playing
    low, high = min(speed["curve"]["rpm"]), max(speed["curve"]["rpm"])
    return {**playing, "playingSpeedRange": {"lowest": low, "highest": high, "unit": "rpm"}}


def _quality(share: Mapping[str, float], noise: Mapping[str, float | None]) -> dict[str, Any]:
    """What the error bars say of the reading; without those that nobody could give."""
    measures = (("sigmaRms", "sigma_rms_cm_s", "cm/s"), ("signalToNoise", "signal_to_noise_db", "dB"))
    known = {name: _measure(value, unit) for name, key, unit in measures if (value := noise[key]) is not None}
    return {"measuredShare": share["measured"], "interpolatedShare": share["interpolated"], **known}


def signal_notes(report: Mapping[str, Any]) -> list[dict[str, str]]:
    """Return the archive's signal notes, each with what was found and why: from flags, or not assessed.

    Parameters
    ----------
    report : mapping
        Of a transfer.
    """
    notes = [{"note": note, "status": NOT_ASSESSED, "basis": why} for note, why in _UNTOLD.items()]
    return sorted([*notes, _groove_damage(report), _crackle(report["repair"])], key=lambda note: note["note"])


def _groove_damage(report: Mapping[str, Any]) -> dict[str, str]:
    """Damage is where the stripes of the walls were not found; what else can be behind it is said."""
    flagged = report["flagged_samples"]
    samples = max(file["samples"] for file in report["files"].values())
    unseen = flagged["no_stripe"]
    lost = sum(flagged[name] for name in _ELSEWHERE)
    basis = f"the stripes of the walls were not found at {unseen} of {samples} samples (flag no_stripe)"
    if lost:
        basis += f"; {lost} samples are flagged for lost, dark or burnt-out frames"
    if unseen:
        basis += "; chips, cracks and dust look alike here, and so does a groove that leaves the picture or the focus"
    return {"note": "Groove damage", "status": FOUND if unseen else NOT_FOUND, "basis": basis}


def _crackle(repair: Mapping[str, Any] | None) -> dict[str, str]:
    """Crackle is known where somebody asked for it to be taken off."""
    if repair is None or not any("small pulses" in line for line in repair["history"]):
        why = "crackle was not looked for: that is done by --decrackle alone"
        return {"note": "Crackle", "status": NOT_ASSESSED, "basis": why}
    spans, seconds = repair["spans"].get("decrackle", 0), repair["seconds"].get("decrackle", 0.0)
    basis = f"decrackling took small pulses off at {spans} spans, {seconds:.3f} s in all (see cues.json)"
    return {"note": "Crackle", "status": FOUND if spans else NOT_FOUND, "basis": basis}


def _files(report: Mapping[str, Any], sizes: Mapping[str, int]) -> list[dict[str, Any]]:
    """An entry for each sound, FLAC too."""
    found = []
    for name, file in report["files"].items():
        found.append(_sound(name, "Broadcast Wave", file, file["sha256"], report["rate_hz"], sizes))
        if "flac" in file:
            flac = file["flac"]
            found.append(_sound(flac["name"], "FLAC", file, flac["sha256"], report["rate_hz"], sizes))
    return found


def _sound(
    name: str, kind: str, file: Mapping[str, Any], digest: str, rate_hz: float, sizes: Mapping[str, int]
) -> dict[str, Any]:
    curve = _curve(file)
    preamp = {} if curve is None else {"phonoPreamp": _phono_preamp(curve)}
    return {
        "filename": f"data/{name}",
        "fileFormat": kind,
        "what": file["what"],
        "fileSize": _measure(sizes[name], "B"),
        "sha256": digest,
        "sampleRate": _measure(rate_hz, "Hz"),
        "bitDepth": file["bits"],
        "channels": file["channels"],
        "durationMilli": _measure(_rounded(1e3 * file["samples"] / rate_hz), "ms"),
        "fullScale": _measure(file["full_scale_m_s"], "m/s"),
        "clippedSamples": file["clipped_samples"],
        "interpolatedSamples": file["interpolated_samples"],
        "codingHistory": file["coding_history"],
        **({"madeOf": f"data/{file['made_of']}"} if "made_of" in file else {}),
        **preamp,
    }


def _curve(file: Mapping[str, Any]) -> Characteristic | None:
    """Return the characteristic that was undone; None where the report does not tell."""
    try:
        return characteristic(file["characteristic"])
    except ArgumentError:
        return None


def _phono_preamp(curve: Characteristic) -> dict[str, Any]:
    """Return a characteristic as archives write it: 0 Hz for no turnover, decibels of playback at 10 kHz."""
    shelf = {} if curve.shelf_hz is None else {"eqShelf": _measure(_rounded(curve.shelf_hz, 1), "Hz")}
    return {
        "eq": "none" if curve.is_flat else curve.title,
        "eqTurnover": _measure(_rounded(curve.turnover_hz or 0.0, 1), "Hz"),
        # 0.0 − …, so that a flat record has no minus sign
        "eqRolloff": _measure(_rounded(0.0 - curve.rolloff_db, 1), "dB"),
        **shelf,
    }


def _measure(value: float, unit: str) -> dict[str, Any]:
    return {"measure": value, "unit": unit}


def _rounded(value: float, digits: int = 3) -> float:
    return round(value, digits)


COLUMNS: tuple[str, ...] = (
    "filename",
    "fileFormat",
    "fileSize (B)",
    "sha256",
    "sampleRate (Hz)",
    "bitDepth",
    "channels",
    "durationMilli (ms)",
    "fullScale (m/s)",
    "clippedSamples",
    "interpolatedSamples",
    "phonoPreamp.eq",
    "phonoPreamp.eqTurnover (Hz)",
    "phonoPreamp.eqRolloff (dB)",
    "playingSpeed (rpm)",
    "grooveSize (µm)",
    "grooveDirection",
    "recordingMethod",
)


def csv_text(metadata: Mapping[str, Any]) -> str:
    """Return the metadata of the sounds as a table: RFC 4180 with line feeds, a row a sound, units in the head.

    Parameters
    ----------
    metadata : mapping
        From `technical_metadata`.
    """
    text = io.StringIO()
    table = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    table.writeheader()
    record = _cells(
        {key: metadata[key] for key in ("playingSpeed", "grooveSize", "grooveDirection", "recordingMethod")}
    )
    for file in metadata["files"]:
        cells = {**record, **_cells(file)}
        table.writerow({column: cells.get(column, "") for column in COLUMNS})
    return text.getvalue()


def _cells(values: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return values by column: a measure has its unit in the name, lists and counts are put in one cell."""
    cells: dict[str, Any] = {}
    for key, value in values.items():
        if isinstance(value, Mapping) and "unit" in value:
            cells[f"{prefix}{key} ({value['unit']})"] = value["measure"]
        elif key == "phonoPreamp":
            cells |= _cells(value, "phonoPreamp.")
        elif isinstance(value, Mapping):
            cells[prefix + key] = "; ".join(f"{name} {number}" for name, number in value.items())
        else:
            cells[prefix + key] = "; ".join(value) if isinstance(value, list) else value
    return cells
