"""The attitude history as spin, nutation and momentum: what it says is the motion of the reference integrator."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from support import messages, reference
from support.builders import events
from support.cases import spread

from nutdamp.epoch import Epoch
from nutdamp.errors import BadRequest
from nutdamp.files.exchange import export_text
from nutdamp.files.spacecraft_file import read_spacecraft
from nutdamp.schedule import Schedule
from nutdamp.spacecraft import Vector

pytestmark = pytest.mark.usefixtures("plans_shared")

BODIES = ("prolate", "prolate, backwards", "oblate", "oblate, backwards", "sphere")


def unit(right_ascension: float, declination: float) -> Vector:
    """The direction of two angles in deg."""
    alpha, delta = math.radians(right_ascension), math.radians(declination)
    return np.array([math.cos(delta) * math.cos(alpha), math.cos(delta) * math.sin(alpha), math.sin(delta)])


def first_axis(alpha: float, delta: float, angle: float) -> Vector:
    """Body axis 1 by the turns Z-X-Z of annex F5, deg: about z by 90 + alpha, about x by 90 - delta, then angle."""
    third = unit(alpha, delta)
    node = np.array([-math.sin(math.radians(alpha)), math.cos(math.radians(alpha)), 0.0])
    turned = math.radians(angle)
    return np.asarray(math.cos(turned) * node + math.sin(turned) * np.cross(third, node))


@spread("case", BODIES, quick=1)
def test_records_are_the_motion_under_torque_and_without(case: str) -> None:
    plan = messages.planned(case)
    body = plan.spacecraft
    assert body.attitude is not None
    text = export_text(plan, "aem-spin")
    assert "ANGVEL_FRAME" not in text
    assert re.search("^ATTITUDE_TYPE += SPIN/NUTATION_MOM$", text, re.MULTILINE)
    start = Epoch.parse(body.attitude.epoch or "")
    rows = re.findall(r"^([0-9]{4}-\S+) (.*)$", text, re.MULTILINE)
    axes = np.array(messages.columns(body, body.initial.quaternion))
    under_torque = 0
    for moment, numbers in rows[:: max(len(rows) // 40, 1)]:
        t = Epoch.parse(moment).since(start)
        under_torque += any(pulse.start < t < pulse.end for pulse in plan.pulses)
        found = reference.fly(body.inertia.moments, body.omega0, events(plan.pulses.pulses), t, axes)
        alpha, delta, angle, own, momentum_alpha, momentum_delta, about = map(float, numbers.split())
        momentum = reference.momentum(body.inertia.moments, found)
        assert unit(alpha, delta) == pytest.approx(found.rotation[:, 2], abs=1e-8)
        assert first_axis(alpha, delta, angle) == pytest.approx(found.rotation[:, 0], abs=1e-8)
        assert unit(momentum_alpha, momentum_delta) == pytest.approx(momentum / np.linalg.norm(momentum), abs=1e-10)
        turned = math.radians(about) * unit(momentum_alpha, momentum_delta) + math.radians(own) * unit(alpha, delta)
        assert turned == pytest.approx(found.rotation @ found.rates, abs=2e-8)
    assert under_torque > 3


def test_what_is_not_symmetric_about_the_third_axis_is_refused() -> None:
    tilted = messages.planned("tilted tensor, backwards")
    with pytest.raises(BadRequest, match="symmetric about the third axis"):
        export_text(tilted, "aem-spin")
    small = math.radians(1.0)
    rotation = np.array([[1, 0, 0], [0, math.cos(small), -math.sin(small)], [0, math.sin(small), math.cos(small)]])
    tensor = (rotation @ np.diag([120.0, 120.0, 80.0]) @ rotation.T).tolist()
    leaning = read_spacecraft(messages.BODIES["prolate"].replace("{A: 120, C: 80}", f"{{tensor: {tensor}}}"), "leaning")
    assert leaning.inertia.symmetric
    with pytest.raises(BadRequest, match="symmetric about the third axis"):
        export_text(replace(tilted, spacecraft=leaning, schedule=Schedule()), "aem-spin")
