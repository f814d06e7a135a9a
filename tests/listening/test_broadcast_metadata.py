"""What a file says of itself stands where the EBU put it, byte for byte."""

from __future__ import annotations

import struct
from datetime import datetime

import pytest

from gramoscope.errors import ArgumentError
from gramoscope.listening.broadcast_metadata import (
    BroadcastMetadata,
    CodingStep,
    ascii_text,
    basic_umid,
    bext_chunk,
    info_chunk,
)
from gramoscope.listening.loudness import Loudness

METADATA = BroadcastMetadata(
    description="Jánošík, a ballad",
    originator="Slovenský archív",
    originator_reference="SK-4711",
    made=datetime(2031, 7, 9, 5, 4, 3),
    time_reference=2**33 + 5,
    coding_history=(
        CodingStep("ANALOGUE", "mono", "gramophone record, 78 rpm"),
        CodingStep("PCM", "dual-mono", "Gramoscope", 96_000, 24),
    ),
    umid=bytes(range(64)),
)
LOUDNESS = Loudness(-23.456, 7.0, float("-inf"), float("nan"), 1.5)


def test_every_field_lies_at_its_offset() -> None:
    """Offsets of EBU Tech 3285 v2, counted from the start of the chunk's content."""
    chunk = bext_chunk(METADATA, LOUDNESS)
    content = chunk[8:]
    assert chunk[:8] == b"bext" + struct.pack("<I", len(content))
    assert content[0:256].rstrip(b"\0") == b"Janosik, a ballad"
    assert content[256:288].rstrip(b"\0") == b"Slovensky archiv"
    assert content[288:320].rstrip(b"\0") == b"SK-4711"
    assert content[320:330] == b"2031-07-09"
    assert content[330:338] == b"05:04:03"
    assert struct.unpack_from("<II", content, 338) == (5, 2), "low word first"
    assert struct.unpack_from("<H", content, 346) == (2,)
    assert content[348:412] == bytes(range(64))
    assert struct.unpack_from("<5h", content, 412) == (-2346, 700, 0x7FFF, 0x7FFF, 150)
    assert content[422:602] == bytes(180)
    assert content[602:].startswith(b"A=ANALOGUE,M=mono,T=gramophone record; 78 rpm\r\n")
    assert content[602:].rstrip() == (
        b"A=ANALOGUE,M=mono,T=gramophone record; 78 rpm\r\nA=PCM,F=96000,W=24,M=dual-mono,T=Gramoscope"
    )


@pytest.mark.parametrize("text", ["odd", "even"])
def test_the_history_ends_its_lines_and_fills_an_even_number_of_bytes_itself(text: str) -> None:
    metadata = BroadcastMetadata(coding_history=(CodingStep("PCM", "mono", text),))
    chunk = bext_chunk(metadata, None)
    assert chunk.endswith(b"\r\n")
    assert struct.unpack_from("<I", chunk, 4)[0] % 2 == 0
    assert len(chunk) == 8 + struct.unpack_from("<I", chunk, 4)[0]


def test_the_size_does_not_depend_on_the_loudness_and_unknown_is_said() -> None:
    before, after = bext_chunk(METADATA, None), bext_chunk(METADATA, LOUDNESS)
    assert len(before) == len(after)
    assert struct.unpack_from("<5h", before, 8 + 412) == (0x7FFF,) * 5


@pytest.mark.parametrize(("value", "field"), [(-99.99, -9999), (-100.0, 0x7FFF), (99.999, 0x7FFF), (0.004, 0)])
def test_a_loudness_that_does_not_fit_is_not_said(value: float, field: int) -> None:
    chunk = bext_chunk(METADATA, Loudness(value, 0.0, 0.0, 0.0, 0.0))
    assert struct.unpack_from("<h", chunk, 8 + 412) == (field,)


def test_fields_may_be_full_to_the_brim() -> None:
    chunk = bext_chunk(BroadcastMetadata("d" * 256, "o" * 32, "r" * 32), None)
    assert chunk[8 : 8 + 320] == b"d" * 256 + b"o" * 32 + b"r" * 32
    assert chunk[8 + 320 : 8 + 338] == bytes(18), "no date is no date"


@pytest.mark.parametrize(
    "wrong",
    [
        {"description": "d" * 257},
        {"originator": "ﬀ" * 17},
        {"originator_reference": "r" * 33},
        {"time_reference": -1},
        {"umid": bytes(32)},
        {"info": {"inam": "x"}},
    ],
)
def test_what_does_not_fit_is_refused_with_what_would(wrong: dict[str, object]) -> None:
    with pytest.raises(ArgumentError) as caught:
        BroadcastMetadata(**wrong)  # type: ignore[arg-type]
    assert caught.value.needed


def test_ascii_keeps_letters_drops_accents_and_breaks_no_line() -> None:
    assert ascii_text("Dvořák: Größe\r\n№ 5 – αβ") == "Dvorak: Gro?e  No 5 ? ??"


def test_a_umid_is_laid_out_by_smpte_330() -> None:
    one, other = basic_umid("one", channels=1), basic_umid("other", channels=2)
    assert one[:10] == bytes.fromhex("060a2b34010101050101")
    assert (one[10], other[10]) == (0x08, 0x09), "audio of one component, of several"
    assert one[11:16] == bytes.fromhex("2013000000"), "numbers made as UUID; 19 bytes follow; instance 0"
    assert one[16:32] != other[16:32]
    assert one[22] >> 4 == 5, "a UUID made of a name"
    assert one[32:] == bytes(32), "basic, not extended"
    assert basic_umid("one", channels=1) == one


def test_the_info_list_holds_texts_that_end_and_leaves_out_empty_ones() -> None:
    chunk = info_chunk({"INAM": "ř", "IART": "", "ICMT": "abc"})
    assert chunk == b"LIST" + struct.pack("<I", 4 + 12 + 12) + b"INFO" + (
        b"INAM\x03\0\0\0\xc5\x99\0\0" + b"ICMT\x04\0\0\0abc\0"
    )
    assert info_chunk({"IART": ""}) == b""
