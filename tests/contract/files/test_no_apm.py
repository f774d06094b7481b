"""Bytes that should be an APM: unreadable, other messages, XML, too large."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from support.places import case

from nutdamp.errors import CannotRead, FaultyFile
from nutdamp.files.ccsds.apm_reader import MOST_BYTES, read_apm


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "not an APM"),
        ("hello\n", "not an APM"),
        ("CCSDS_AEM_VERS = 2.0\n", "another message; expected CCSDS_APM_VERS"),
        ("CCSDS_APM_VERS = 1.0\nQ_FRAME_A = X\n", "version '1.0' is not read"),
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


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be"])
@pytest.mark.parametrize("text", ["<?xml version='1.0'?>\n<apm/>", " \n<apm", "<!DOCTYPE apm [<!ENTITY a 'b'>]>"])
def test_xml_is_refused_with_the_cure(tmp_path: Path, text: str, encoding: str) -> None:
    (tmp_path / "in.xml").write_bytes(text.encode(encoding))
    with pytest.raises(
        FaultyFile, match=r"in\.xml:1:1: XML is not read; write the message in keyword = value notation"
    ):
        read_apm(str(tmp_path / "in.xml"))


def test_xml_that_declares_another_encoding_is_refused_too() -> None:
    with pytest.raises(FaultyFile, match="1:1: XML is not read"):
        read_apm(str(case("crash-xml-encoding.apm.txt")))


@pytest.mark.parametrize(
    "data", ["CCSDS_APM_VERS = 2.0".encode("utf-16"), b"CCSDS_APM_VERS = 2.0\nORIGINATOR = M\xdcLLER\n"]
)
def test_what_is_not_utf_8_is_refused(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "in.apm").write_bytes(data)
    with pytest.raises(FaultyFile, match=r"in\.apm:1:1: not UTF-8 text \(byte"):
        read_apm(str(tmp_path / "in.apm"))


@pytest.mark.parametrize("start", [b"CCSDS_APM_VERS = 2.0\n", b"<?xml version='1.0'?>\n"])
def test_a_message_that_is_none_by_its_size_is_refused(tmp_path: Path, start: bytes) -> None:
    path = tmp_path / "huge.apm"
    with path.open("wb") as stream:
        stream.write(start)
        stream.truncate(MOST_BYTES + 1)
    with pytest.raises(FaultyFile, match="larger than 16 MiB"):
        read_apm(str(path))
