"""Bytes that should be an APM: unreadable, other messages, encodings of XML, too large."""

from __future__ import annotations

import encodings.aliases
import re
from pathlib import Path

import messages
import pytest
from cases_dir import case

from nutdamp.errors import CannotRead, Fault, FaultyFile
from nutdamp.files.ccsds.apm_reader import MOST_BYTES, read_apm
from nutdamp.files.exchange import export_text

ENCODINGS = sorted({*encodings.aliases.aliases.values(), "nonsense", "utf-16", "undefined", "aliases", "a" * 300})


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "not an APM"),
        ("hello\n", "not an APM"),
        ("CCSDS_AEM_VERS = 2.0\n", "another message; expected CCSDS_APM_VERS"),
        ("CCSDS_APM_VERS = 1.0\nQ_FRAME_A = X\n", "version '1.0' is not read"),
        ("<apm id='CCSDS_APM_VERS' version='1.0'></apm>", "version '1.0' is not read"),
        ("<aem id='CCSDS_AEM_VERS' version='2.0'></aem>", "expected <apm>, got <aem>"),
        ("<apm", "not XML"),
        ("<!DOCTYPE apm [<!ENTITY a 'b'>]><apm version='2.0'>&a;</apm>", "the file has a document type"),
    ],
)
def test_what_is_no_such_message(tmp_path: Path, text: str, problem: str) -> None:
    (tmp_path / "a.apm").write_text(text, encoding="utf-8")
    with pytest.raises(FaultyFile, match=re.escape(problem)):
        read_apm(str(tmp_path / "a.apm"))


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(CannotRead):
        read_apm(str(tmp_path / "missing.apm"))
    (tmp_path / "a.apm").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FaultyFile, match="not UTF-8"):
        read_apm(str(tmp_path / "a.apm"))


def declared(encoding: str) -> tuple[str, bytes]:
    """A message that declares an encoding, and its bytes in it where that is one of texts."""
    text = export_text(messages.planned("prolate"), "apm", xml=True)
    text = text.replace('encoding="UTF-8"', f'encoding="{encoding}"').replace(">PROLATE<", ">MÜLLER<")
    try:
        return text, text.encode(encoding, "xmlcharrefreplace")
    except (LookupError, UnicodeError):
        return text, text.encode("ascii", "xmlcharrefreplace")


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.parametrize("encoding", ENCODINGS)
def test_xml_is_read_in_the_encoding_it_declares_or_refused(tmp_path: Path, encoding: str) -> None:
    _, data = declared(encoding)
    (tmp_path / "in.xml").write_bytes(data)
    faults: list[Fault] = []
    names: list[str] = []
    try:
        names.append(read_apm(str(tmp_path / "in.xml")).name)
    except FaultyFile as wrong:
        faults = wrong.faults
    assert names == ["MÜLLER"] or faults[0].line == 1
    if encoding in ("ascii", "cp1252", "gb18030", "latin_1", "shift_jis", "utf-16", "utf_16", "utf_7", "utf_8"):
        assert names


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be", "utf-8-sig"])
def test_xml_tells_its_encoding_by_its_first_bytes(tmp_path: Path, encoding: str) -> None:
    text, _ = declared("UTF-16" if "16" in encoding else "UTF-8")
    (tmp_path / "in.xml").write_bytes(text.encode(encoding))
    assert read_apm(str(tmp_path / "in.xml")).manoeuvres


@pytest.mark.parametrize(
    ("data", "problem"),
    [
        (b'<?xml version="1.0" encoding="nonsense"?><apm/>', "the encoding 'nonsense' is not known; save it as UTF-8"),
        (b'<?xml version="1.0" encoding="rot13"?><apm/>', "the encoding 'rot13' is not known"),
        (b'<?xml version="1.0" encoding="ascii"?><apm>\xe4</apm>', "the text is not ascii, as it says (byte 43)"),
        (b"<apm>\xe4</apm>", "the text is not utf-8, as it says (byte 5)"),
        ("CCSDS_APM_VERS = 2.0".encode("utf-16"), "not UTF-8 text (byte 0)"),
    ],
)
def test_what_is_not_in_its_encoding_is_refused(tmp_path: Path, data: bytes, problem: str) -> None:
    (tmp_path / "in.xml").write_bytes(data)
    with pytest.raises(FaultyFile, match=re.escape(f"in.xml:1:1: {problem}")):
        read_apm(str(tmp_path / "in.xml"))


def test_the_message_in_shift_jis_is_read_up_to_what_it_lacks() -> None:
    with pytest.raises(FaultyFile, match="INERTIA: missing"):
        read_apm(str(case("crash-xml-encoding.apm.txt")))


@pytest.mark.parametrize("start", [b"CCSDS_APM_VERS = 2.0\n", b"<?xml version='1.0'?>\n"])
def test_a_message_that_is_none_by_its_size_is_refused(tmp_path: Path, start: bytes) -> None:
    path = tmp_path / "huge.apm"
    with path.open("wb") as stream:
        stream.write(start)
        stream.truncate(MOST_BYTES + 1)
    with pytest.raises(FaultyFile, match="larger than 16 MiB"):
        read_apm(str(path))
