"""The part of `report.html` that says from what, with what and how a transfer was made."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gramoscope.listening.page import bullets, facts, paragraph, section
from gramoscope.player.page_words import duration, flat_rows


def provenance_section(report: Mapping[str, Any]) -> str:
    """Return everything that a repetition needs, in words."""
    words = {name: text for name, text in report["catalogue"].items() if text}
    inputs = report["inputs"]
    sums = [
        *((name, digest or "could not be read") for name, digest in inputs["common_files"].items()),
        (
            "files of the groups",
            f"{inputs['group_files']['count']}; sum over their sums {inputs['group_files']['sha256_of_sha256sum_lines']}",
        ),
    ]
    made = [
        ("made", report["made"]),
        ("command", report["command"]),
        ("capture", f"{report['capture']} ({report['layout']})"),
        ("took", duration(report["elapsed_s"])),
        *flat_rows(words),
        *flat_rows(report["settings"]),
    ]
    return section(
        "provenance",
        "Provenance",
        paragraph("gramoscope play --again report.json repeats this transfer, bit for bit, from the same capture."),
        _again(report.get("again")),
        facts(made, caption="This transfer"),
        facts(sums, caption="Input, SHA-256"),
        facts(report["versions"].items(), caption="Versions"),
        facts(flat_rows(report["bench"]), caption="Apparatus, as the manifest says; SI units"),
        facts(flat_rows(report["recipe"]), caption="Recipe, with every parameter"),
    )


def _again(again: Mapping[str, Any] | None) -> str:
    if again is None:
        return ""
    lines = [f"This transfer repeats the one of {again['made']}."]
    if again["same_files"]:
        lines.append(f"The same bits as then: {', '.join(again['same_files'])}.")
    if again["other_files"]:
        lines.append(f"Other bits than then: {', '.join(again['other_files'])}.")
    if again["other_inputs"]:
        lines.append(f"The input is not the same: {', '.join(again['other_inputs'])}.")
    lines += [
        f"{name} was {one['then']} then, and is {one['now']} now." for name, one in again["other_versions"].items()
    ]
    return bullets(lines)
