"""A second independent reader of the messages, ccsds-ndm-py (written in Rust): strict about form, knows no attitude."""

from __future__ import annotations

import re
from importlib import import_module
from typing import Any

import numpy as np
import pytest
from support import messages

from nutdamp.files.exchange import export_text

pytestmark = [pytest.mark.orekit, pytest.mark.usefixtures("plans_shared")]

CASES = pytest.mark.parametrize("case", messages.CASES)
NOTATIONS = pytest.mark.parametrize("notation", ["kvn", "xml"])


@pytest.fixture
def reader() -> Any:
    try:
        return import_module("ccsds_ndm")
    except ImportError as reason:
        pytest.skip(f"NOT CHECKED against ccsds-ndm-py: pip install 'nutdamp[interop]' ({reason})")


def parsed(reader: Any, case: str, form: str, notation: str) -> Any:
    text = export_text(messages.planned(case), form, xml=notation == "xml")
    message = getattr(reader, form[:3].capitalize()).from_str(text, notation)
    message.validate()
    return message


@CASES
@NOTATIONS
def test_parameters(reader: Any, case: str, notation: str) -> None:
    plan = messages.planned(case)
    data = parsed(reader, case, "apm", notation).segment.data
    found = data.inertia[0]
    tensor = plan.spacecraft.inertia.tensor
    assert [found.ixx, found.iyy, found.izz] == pytest.approx(np.diag(tensor).tolist(), rel=1e-15)
    assert [found.ixy, found.ixz, found.iyz] == pytest.approx([-tensor[0, 1], -tensor[0, 2], -tensor[1, 2]], rel=1e-15)
    assert len(data.maneuver_parameters) == len(plan.pulses)
    for manoeuvre, pulse in zip(data.maneuver_parameters, plan.pulses, strict=True):
        assert manoeuvre.man_duration == pytest.approx(pulse.on_time, rel=1e-15)


@CASES
@NOTATIONS
@pytest.mark.parametrize("form", ["aem", "aem-spin"])
def test_history(reader: Any, case: str, notation: str, form: str) -> None:
    if form == "aem-spin" and not messages.spacecraft(case).inertia.symmetric:
        return
    text = export_text(messages.planned(case), form)
    segments = parsed(reader, case, form, notation).segments
    assert len(segments) == text.count("META_START")
    rows = len(re.findall(r"^[0-9]{4}-\S+ ", text, re.MULTILINE))
    assert sum(len(segment.data.attitude_states) for segment in segments) == rows
