"""Exchange formats of plans: a row of `FORMATS` for each format that `nutdamp export` writes."""

from __future__ import annotations

import datetime
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from nutdamp.errors import BadRequest, Unsuitable

if TYPE_CHECKING:
    from nutdamp.common.results import Note
    from nutdamp.planning.plan import Plan


def _plan_json(plan: Plan, _until: float | None) -> str:
    from nutdamp.files.tabular import json_text
    from nutdamp.planning.decision import compare_plans
    from nutdamp.views.decisions import comparison_json

    return json_text(comparison_json(compare_plans((plan,))))


def _spin_table(plan: Plan, until: float | None) -> str:
    from nutdamp.views.simulation import spin_table

    return spin_table(plan.spacecraft, plan.pulses, plan.end if until is None else until)


def _basilisk(plan: Plan, _until: float | None) -> str:
    from nutdamp.files.export import basilisk_script

    return basilisk_script(plan)


class Format(NamedTuple):
    """A format: its ``name``, and a ``summary`` for help pages.

    ``text`` of a plan and of the end of a track, s: of formats without dates; the others need the
    epoch and the frame of the attitude. ``message``: a CCSDS message, in either notation.
    ``track``: ends when requested. ``needs_orbit``: incomplete without one. ``nutates``: as
    symmetric bodies do.
    """

    name: str
    summary: str
    text: Callable[[Plan, float | None], str] | None = None
    message: bool = False
    track: bool = False
    needs_orbit: bool = False
    nutates: bool = False


FORMATS = {  # formats by name
    row.name: row
    for row in (
        Format("apm", "state and pulses (CCSDS)", message=True),
        Format("aem", "attitude history (CCSDS) as quaternions", message=True, track=True),
        Format(
            "aem-spin", "as spin, nutation and momentum", message=True, track=True, nutates=True
        ),
        Format("opm", "velocity change of each pulse (CCSDS)", message=True, needs_orbit=True),
        Format("stk", "attitude history as .a", track=True),
        Format("spin-table", "CSV, one row a spin", _spin_table, track=True),
        Format("basilisk", "a script that flies the schedule", _basilisk),
        Format("json", "as `plan --json`", _plan_json),
    )
}


def expect_possible(form: str, *, xml: bool, until: float | None) -> None:
    """Raise BadRequest for an XML notation or an end that the format has not."""
    if xml and not FORMATS[form].message:
        raise BadRequest(f"{form} has no XML notation; {', '.join(_names_where('message'))} have")
    if until is not None and not FORMATS[form].track:
        raise BadRequest(f"until is for {', '.join(_names_where('track'))}; {form} has no end time")


def _names_where(flag: str) -> list[str]:
    return [name for name, row in FORMATS.items() if getattr(row, flag)]


def export_text(plan: Plan, form: str, *, xml: bool = False, until: float | None = None) -> str:
    """The text of a plan in the format ``form``; messages in XML or else in keyword = value
    notation.

    ``until`` is the end of a track in s, by default the last pulse and an inertial period. Messages
    are created now to the second. Formats with dates are the only place where directions leave the
    frame of the file: for one of `AXES`. Raises BadRequest where the format needs data that the
    spacecraft file lacks, or cannot hold those of the plan.
    """
    expect_possible(form, xml=xml, until=until)
    row = FORMATS[form]
    if row.text is not None:
        return row.text(plan, until)
    from nutdamp.common.time import Epoch
    from nutdamp.files.ccsds import message, write
    from nutdamp.files.export import reference, stk_attitude
    from nutdamp.flight.propagation import flown
    from nutdamp.spacecraft import directions

    until = plan.spacecraft.watched_until(plan.end) if until is None else until
    place = reference(plan.spacecraft)  # refuses a file without epoch or frame
    spacecraft = directions.seen_in(plan.spacecraft, place.frame)
    plan = replace(plan, spacecraft=spacecraft)
    last = until if row.track else plan.pulses.end
    if spacecraft.utc(last) is None:
        cure = "an earlier --until" if row.track else "a shorter horizon"
        raise Unsuitable(
            ("attitude", "epoch"), f"{last:.4g} s after it the year 9999 is over; {cure} helps"
        )
    if not row.message:
        about = f"{plan.scheme}, status {plan.verdict.status.value}"
        return stk_attitude(flown(spacecraft, plan.pulses, until), until, place, about)
    now = Epoch.parse(datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%dT%H:%M:%SZ"))
    if row.track:
        kind = message.SPIN_NUTATION_MOM if row.nutates else message.QUATERNION_ANGVEL
        written = write.aem(plan, flown(spacecraft, plan.pulses, until), until, place, now, kind)
    else:
        written = (write.opm if row.needs_orbit else write.apm)(plan, place, now)
    return write.to_xml(written) if xml else write.to_kvn(written)


def export_notes(plan: Plan, form: str) -> list[Note]:
    """Notes on the motion that the format ``form`` does not hold."""
    from nutdamp.common.results import note
    from nutdamp.files.ccsds.write import spinning

    alone = FORMATS[form].nutates and not spinning(plan.spacecraft.inertia)
    return [note("spin-alone")] if alone else []


def lacking(plan: Plan, form: str) -> str | None:
    """Data that the format ``form`` needs to be complete and the spacecraft file lacks; None where
    it is complete.
    """
    if not FORMATS[form].needs_orbit or plan.spacecraft.orbit is not None:
        return None
    return (
        "the spacecraft file has no orbit: the OPM holds the manoeuvres only, and is not complete"
    )
