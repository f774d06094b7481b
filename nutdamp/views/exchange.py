"""Plans as other tools read them: one entry for each format that `nutdamp export` writes."""

from __future__ import annotations

import datetime
from typing import TYPE_CHECKING

from nutdamp.errors import BadRequest, Unsuitable

if TYPE_CHECKING:
    from nutdamp.planning.plan import Plan


FORMATS = ("apm", "aem", "aem-spin", "opm", "stk", "spin-table", "basilisk", "json")
"""Formats by name."""

MESSAGES = ("apm", "aem", "aem-spin", "opm")
"""CCSDS messages, in either of two notations."""

TRACKS = ("aem", "aem-spin", "stk", "spin-table")


def export_text(plan: Plan, form: str, *, xml: bool = False, until: float | None = None) -> str:
    """The text of a plan in the format ``form``; messages in XML or else in keyword = value notation.

    ``until`` is the end of a track in s, by default the last pulse and an inertial period. Raises BadRequest where the
    format needs what the spacecraft file does not give, or cannot hold what the plan has.
    """
    if xml and form not in MESSAGES:
        raise BadRequest(f"{form} has no XML notation; {', '.join(MESSAGES)} have")
    if until is not None and form not in TRACKS:
        raise BadRequest(f"until is for {', '.join(TRACKS)}; {form} has no end time")
    if form == "json":
        from nutdamp.files.tabular import json_text
        from nutdamp.planning.decision import Comparison
        from nutdamp.views.plan_json import comparison_json

        return json_text(comparison_json(Comparison(plan.spacecraft, (plan,)), {"reason": "the plan exported"}))
    if form == "basilisk":
        from nutdamp.files.export import basilisk_script

        return basilisk_script(plan)
    if form == "spin-table":
        from nutdamp.views.spin_table import spin_table

        return spin_table(plan.spacecraft, plan.pulses, plan.pulses.end if until is None else until)
    return _with_epoch(plan, form, xml, until)


def lacking(plan: Plan, form: str) -> str | None:
    """What the format ``form`` needs to be complete and the spacecraft file does not give; None where it is."""
    if form != "opm" or plan.spacecraft.orbit is not None:
        return None
    return "the spacecraft file has no orbit: this is the part of an OPM with the manoeuvres, and no whole message"


def _with_epoch(plan: Plan, form: str, xml: bool, until: float | None) -> str:
    from nutdamp.files.export import reference
    from nutdamp.flight import propagation

    body = plan.spacecraft
    place = reference(body)
    end = plan.pulses.end + body.inertial_period if until is None else until
    last = end if form in TRACKS else plan.pulses.end
    if body.utc(last) is None:
        cure = "an earlier --until" if form in TRACKS else "a shorter horizon"
        raise Unsuitable(("attitude", "epoch"), f"{last:.4g} s after it the year 9999 is over; {cure} helps")
    if form == "stk":
        from nutdamp.files.export import stk_attitude

        return stk_attitude(propagation.flown(body, plan.pulses, end), end, place)
    from nutdamp.common.time import Epoch
    from nutdamp.files.ccsds.message import QUATERNION_ANGVEL, SPIN_NUTATION_MOM, to_kvn, to_xml
    from nutdamp.files.ccsds.write import aem, apm, opm

    created = Epoch.parse(datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%dT%H:%M:%SZ"))
    if form == "apm":
        message = apm(plan, place, created)
    elif form == "opm":
        message = opm(plan, place, created)
    else:
        kind = QUATERNION_ANGVEL if form == "aem" else SPIN_NUTATION_MOM
        message = aem(plan, propagation.flown(body, plan.pulses, end), end, place, created, kind)
    return to_xml(message) if xml else to_kvn(message)
