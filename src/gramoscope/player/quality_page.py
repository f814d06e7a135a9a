"""`report.html`: the statement of quality of a transfer, for an archivist to read."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from gramoscope.listening.ink import png_of, svg_of
from gramoscope.listening.page import bullets, facts, figure, figures, page, paragraph, section, table
from gramoscope.listening.quality_figures import band_figure, density_figure, response_figure, share_figure
from gramoscope.listening.report import plain
from gramoscope.player.page_provenance import provenance_section
from gramoscope.player.page_speed import speed_section
from gramoscope.player.page_words import decibels, duration, hertz, number, percent
from gramoscope.player.picture import Place
from gramoscope.player.speed import speed_in_words

Report = Mapping[str, Any]
SHOWN_PROBLEMS = 20


def quality_page(report: Report, places: Sequence[Place]) -> str:
    """Return the page of a transfer.

    Parameters
    ----------
    report : mapping
        As in `report.json`, and nothing else: a page can be made again from the file.
    places : sequence of Place
        Pictures of the worst groups.
    """
    told = plain(report)
    sections = (
        _look_at(told),
        _seen(told),
        _spectra(told),
        _walls(told),
        speed_section(told),
        _calibration(told),
        _worst(told, places),
        _applied(told),
        _files(told),
        provenance_section(told),
    )
    return page(_title(told), f'<div class="summary">{facts(_summary(told))}</div>', sections)


def _title(report: Report) -> str:
    name = report["catalogue"]["title"] or report["bench"]["disc"]["notes"].get("title") or report["capture_name"]
    return f"Transfer of {name}"


def _summary(report: Report) -> Iterator[tuple[str, str]]:
    noise, share, groups = report["noise_estimate"], report["share"], report["groups"]
    usable = report["quality"]["spectrum"]["usable_to_hz"]
    cut, walls = report["bench"]["disc"]["cut"], " and ".join(report["walls_read"])
    yield (
        "Heard",
        f"{duration(report['seconds'])} of a {cut} cut at {speed_in_words(report['speed'])}; {walls} wall; "
        f"recipe “{report['recipe']['name']}”; {report['rate_hz'] / 1e3:g} kHz",
    )
    yield (
        "How good",
        f"claimed error {number(noise['sigma_rms_cm_s'], 'cm/s')} rms, {decibels(noise['signal_to_noise_db'])} below the "
        f"sound; the sound is above its error up to {hertz(usable['0_db'])}, 10 dB above it up to {hertz(usable['10_db'])}",
    )
    yield (
        "What is missing",
        f"{percent(share['measured'])} measured, {percent(share['bridged'])} bridged, {percent(share['missing'])} without "
        f"film; {groups['lost']} of {groups['lost'] + groups['read']} groups lost",
    )
    yield "What to look at", _first_look(report)
    yield (
        "What was applied",
        f"to equalised.wav: {report['response']['title']}; {_repairs(report)}; nothing was normalised, and flat.wav is as it "
        "was read",
    )


def _repairs(report: Report) -> str:
    repair = report["repair"]
    return f"repaired: {'; '.join(repair['history'])}" if repair else "nothing was repaired"


def _first_look(report: Report) -> str:
    doubtful = [row["what"] for row in report["calibration_check"] if row["verdict"] != "as stated"]
    problems = len(report["problems"]) + report["problems_not_listed"] + len(report["capture_problems"])
    found = [
        *([f"{_several(len(report['remarks']), 'remark')} below"] if report["remarks"] else []),
        *([f"{_several(problems, 'problem')} of the film"] if problems else []),
        *([f"apparatus not as stated: {', '.join(doubtful)}"] if doubtful else []),
    ]
    return "; ".join(found) or "nothing stands out; see the worst places below"


def _several(number_of: int, thing: str) -> str:
    return f"{number_of} {thing}" if number_of == 1 else f"{number_of} {thing}s"


def _look_at(report: Report) -> str:
    problems = [*report["capture_problems"], *report["problems"]]
    hidden = len(problems) - SHOWN_PROBLEMS + report["problems_not_listed"]
    more = [f"… and {hidden} more; report.json has them"] if hidden > 0 else []
    lines = [*report["remarks"], *problems[:SHOWN_PROBLEMS], *more]
    return section(
        "look", "What to look at", bullets(lines) or paragraph("There are no remarks, and no problems were found.")
    )


def _seen(report: Report) -> str:
    along, flags, total = (
        report["quality"]["along_time"],
        report["flagged_samples"],
        report["seconds"] * report["rate_hz"],
    )
    rows = [
        (name.replace("_", " "), report["flags"][name], percent(count / total if total else None))
        for name, count in flags.items()
        if count
    ]
    picture = figure(
        svg_of(share_figure(along)),
        alt=f"Shares along time: {percent(report['share']['measured'])} measured in all, and the rms of sound and error.",
        caption="Share of the sound that was measured, bridged or missing, and the rms of sound and claimed error, along time.",
    )
    return section(
        "seen",
        "How much was seen",
        paragraph(
            "Measured: the groove was seen on the film. Bridged: there is film, but the groove was not seen on it (a chip, "
            "dust, a scratch), and its surroundings fill in. Missing: there is no usable film, and its surroundings fill in."
        ),
        figures([picture]),
        table(("flag", "meaning", "share of the sound"), rows, caption="Flags that occur; a sample may carry several.")
        if rows
        else paragraph("No sample carries a flag."),
    )


def _spectra(report: Report) -> str:
    spectrum, level = report["quality"]["spectrum"], report["level"]
    density, thirds, bands = spectrum["error_density"], spectrum["third_octaves"], spectrum["octaves"]
    frequency, values = (np.asarray(density[key], np.float64) for key in ("frequency_hz", "density_m2_s2_per_hz"))
    names = ("sound_rms_cm_s", "error_rms_cm_s")
    rows = [
        (hertz(centre), *(number(bands[name][i]) for name in names), decibels(bands["signal_to_noise_db"][i]))
        for i, centre in enumerate(bands["centre_hz"])
        if bands["signal_to_noise_db"][i] is not None
    ]
    pictures = [
        figure(
            svg_of(band_figure(thirds)),
            alt="Sound and claimed error in each third of an octave; the table below has the figures by octave.",
            caption="Sound (as it was recovered) and claimed error in thirds of an octave.",
        )
    ]
    if np.isfinite(values).any():
        highest_hz = report["rate_hz"] / 2
        pictures.append(
            figure(
                svg_of(density_figure(frequency, values, highest_hz=highest_hz)),
                alt="Density of the claimed error against frequency.",
                caption="Density of the claimed error. While the readings have the word it is theirs: white errors of places "
                "rise by 6 dB an octave, those of slopes stay level. It falls where the sound drowns and only what is usual "
                "of records is known.",
            )
        )
    return section(
        "spectrum",
        "Level, noise and bandwidth",
        facts(
            [
                ("level", f"{number(level['rms_cm_s'], 'cm/s')} rms, {number(level['peak_cm_s'], 'cm/s')} peak"),
                ("claimed error", number(report["noise_estimate"]["sigma_rms_cm_s"], "cm/s rms")),
                ("sound above its error", f"up to {hertz(spectrum['usable_to_hz']['0_db'])}"),
                ("sound 10 dB above it", f"up to {hertz(spectrum['usable_to_hz']['10_db'])}"),
            ]
        ),
        figures(pictures),
        table(
            ("octave", "sound, cm/s rms", "error, cm/s rms", "signal to noise"),
            rows,
            caption="The groove's velocity before equalisation. The error is what the reading claims: dirt, wear and warp move "
            "the groove too, and count as sound.",
        )
        if rows
        else paragraph("The passage is too short, or too little of it was measured, for a spectrum."),
    )


def _walls(report: Report) -> str:
    found = report["quality"]["wall_agreement"]
    if found is None:
        words = "Both walls were not read at the same places, or the record is stereo: there is nothing to compare."
        return section("walls", "Do both walls agree?", paragraph(words))
    return section(
        "walls",
        "Do both walls agree?",
        paragraph(
            "What each wall alone says of the sound, as a change of velocity over 50 µm of groove. A square of 1 is agreement "
            "within the claimed errors; more is motion across the cut, dirt or wear on one wall, or an error claimed too small."
        ),
        facts(
            [
                ("correlation", number(found["correlation"], digits=4)),
                ("difference", number(found["rms_difference_cm_s"], "cm/s rms")),
                ("expected by the error bars", number(found["expected_difference_cm_s"], "cm/s rms")),
                ("square over its variance", f"{number(found['chi_squared_per_sample'])} a sample"),
                ("beyond 5 standard errors", percent(found["share_beyond_5_sigma"])),
                ("samples compared", f"{found['samples']}"),
            ]
        ),
    )


def _calibration(report: Report) -> str:
    rows = [
        (
            row["what"],
            number(row["manifest"], row["unit"], digits=4),
            number(row["found"], row["unit"], digits=4),
            f"{row['difference_percent']:+.1f} %".replace("-", "−"),
            row["verdict"],
        )
        for row in report["calibration_check"]
    ]
    head = ("quantity", "manifest", "film", "difference", "verdict")
    told = table(head, rows) if rows else paragraph("Nothing that is stated of the apparatus was measured.")
    return section("calibration", "The apparatus: manifest and film", told)


def _worst(report: Report, places: Sequence[Place]) -> str:
    at_s = {group["group"]: group["at_s"] for group in report["quality"]["worst_groups"]}
    stills = report["layout"] == "stills"
    what, lines = ("Picture", "edges") if stills else ("Group", "stripes")
    drawn = [
        figure(
            png_of(place.figure),
            alt=f"{what} {place.group.number} with the {lines} that were found.",
            caption=f"{what} {place.group.number}, at {duration(at_s[place.group.number])}: "
            f"{percent(place.group.unread)} of the walls not read; places known to "
            f"{number(1e9 * place.group.sigma_m, 'nm')}. Dashed lines are filled in.",
        )
        for place in places
    ]
    words = f"The {what.lower()}s of which least was read, or, where all was read, with the largest claimed errors."
    return section("worst", "The worst places", paragraph(words), figures(drawn))


def _applied(report: Report) -> str:
    response = report["response"]
    frequency, curve, made = (np.asarray(response[key]) for key in ("frequency_hz", "curve_db", "filter_db"))
    corners = [(name, hertz(corner)) for name, corner in response["corners_hz"].items() if corner is not None]
    picture = figure(
        svg_of(response_figure(frequency, curve, made)),
        alt=f"Response of the playback curve {response['title']} and of the filter that was used.",
        caption="The playback curve as it is written down, and the filter as it is.",
    )
    return section(
        "applied",
        "The response that was applied",
        paragraph("To equalised.wav only; no other file is equalised."),
        facts(
            [
                ("curve", response["title"]),
                *corners,
                ("filter and curve differ by", _deviation(response)),
            ]
        ),
        figures([picture]),
        _touched(report),
    )


def _touched(report: Report) -> str:
    repair = report["repair"]
    if repair is None:
        return paragraph("Nothing was repaired.")
    rows = [
        (_KINDS[kind], f"{spans}", number(1e3 * repair["seconds"][kind], "ms"))
        for kind, spans in repair["spans"].items()
    ]
    words = "What was repaired before it; cues.json and labels.txt say where, difference.wav what was taken off."
    return (
        table(("repair", "spans", "in all"), rows, caption=words) if rows else paragraph("Nothing was found to repair.")
    )


_KINDS = {
    "declick": "clicks replaced",
    "decrackle": "crackle taken off",
    "rumble": "rumble taken off",
    "interpolated": "bridged while reading, left so",
}


def _deviation(response: Report) -> str:
    largest_db, frequency = response["largest_deviation_db"], response["frequency_hz"]
    most = "less than 0.001 dB" if largest_db < 1e-3 else f"at most {largest_db:.3f} dB"
    return f"{most}, {hertz(frequency[0])} … {hertz(frequency[-1])}"


def _files(report: Report) -> str:
    rows = [
        (
            name,
            number(file["loudness"]["integrated_lufs"], "LUFS"),
            number(file["loudness"]["max_true_peak_dbtp"], "dBTP"),
            f"{file['clipped_samples']}",
            f"{number(100 * file['full_scale_m_s'], 'cm/s')}",
        )
        for name, file in report["files"].items()
    ]
    sums = [(name, f"{file['what']}. SHA-256 {file['sha256']}") for name, file in report["files"].items()]
    return section(
        "files",
        "The files",
        table(("file", "loudness", "true peak", "clipped samples", "full scale"), rows),
        facts(sums, caption="What they hold, and their sums"),
    )
