"""What stands on the page of ``report``: spacecraft, schemes, schedule, pictures, error budget, how to repeat it."""

from __future__ import annotations

import platform
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, NamedTuple

from nutdamp import __version__
from nutdamp.planning import Comparison, Plan, unrounded
from nutdamp.presentation import verdicts
from nutdamp.presentation.check_tables import channel_table, disturbance_table
from nutdamp.presentation.end_tables import end_table
from nutdamp.presentation.page.document import (
    Block,
    Facts,
    Figure,
    Listing,
    Page,
    Prose,
    Remarks,
    Section,
    blocks_of,
    facts_of,
    sheet_of,
)
from nutdamp.presentation.page.moving import moving_of
from nutdamp.presentation.page.pictures import dispersion_pictures_of, pictures_of
from nutdamp.presentation.page.sheets import comparison_sheet, pulse_sheet, spacecraft_facts
from nutdamp.presentation.text import degrees, mass, moment, quantity
from nutdamp.presentation.verify_tables import budget_note, budget_table, conservation, methods_table, verdict
from nutdamp.recommendation import Standing
from nutdamp.remarks import said
from nutdamp.spacecraft import Spacecraft
from nutdamp.verification import verify

if TYPE_CHECKING:  # few reports disperse
    from nutdamp.dispersion.study import Results


class Repeat(NamedTuple):
    """What it takes to make the page again: the command in its ``language``, and the input file by name and text.

    ``settings``: keys that the command sets in place of what the file says, and their values.
    """

    command: str
    name: str
    text: str
    settings: tuple[tuple[str, str], ...] = ()
    language: str = "console"


def report_page(
    compared: Comparison,
    repeat: Repeat,
    *,
    pictured: bool,
    dispersed: Results | None = None,
    note: str = "",
) -> Page:
    """The page; ``pictured``: with pictures of the recommended schedule, which raises MissingExtra without matplotlib.

    ``dispersed``: the recommended schedule flown in dispersed cases; ``note``: a remark on how.
    """
    body, chosen = compared.spacecraft, compared.recommended
    sections = [_spacecraft(body), _schemes(compared)]
    if chosen is not None:
        sections.append(_schedule(chosen))
        if pictured:
            sections.append(Section("pictures", "Pictures", (moving_of(chosen), *pictures_of(chosen))))
        sections.append(_budget(chosen))
        if dispersed is not None:
            sections.append(_dispersion(chosen, dispersed, note, pictured=pictured))
    good = chosen is not None and chosen.standing is Standing.COMPLIES
    if dispersed is not None and dispersed.meets_requirement is False:
        good = False
    return Page(
        title=f"{body.name}: damping {degrees(body.nutation)} of nutation",
        verdict=_verdict(compared, dispersed),
        good=good,
        figures=() if chosen is None else tuple(_figures(chosen, dispersed)),
        sections=(*sections, _repeat(repeat)),
        made_by=f"Made by nutdamp {__version__}.",
    )


def _verdict(compared: Comparison, dispersed: Results | None) -> str:
    chosen, reason = compared.recommended, verdicts.reason(compared)
    if chosen is None:
        return f"No recommendation: {reason}."
    verdict = " ".join((f"Recommended: {chosen.scheme} – {reason}.", *verdicts.warnings(compared)))
    if dispersed is None or dispersed.met_fraction is None:
        return verdict
    cases = verdicts.cases_verdict(dispersed.met_fraction, dispersed.probability)
    return f"{verdict} Requirement with dispersions ({dispersed.done:,} cases) {cases}."


def _figures(chosen: Plan, dispersed: Results | None) -> Iterator[Figure]:
    """The numbers to read first."""
    body, left, pulses = chosen.spacecraft, chosen.flown, chosen.pulses
    assert left is not None
    yield Figure("nutation", f"{degrees(body.nutation)} → {degrees(left.nutation)}")
    if body.goal.axis is None:
        yield Figure("shift of H", degrees(left.momentum_shift))
    else:
        yield Figure("off the target", f"{degrees(body.to_turn)} → {degrees(left.axis_error)}")
    yield Figure("pulses", f"{len(pulses)}, until {moment(pulses.end)}" if len(pulses) else "none")
    if pulses.propellant is None:
        yield Figure("impulse", quantity(pulses.total_impulse, "N m s"))
    else:
        yield Figure("propellant", mass(pulses.propellant))
    if chosen.meets_requirement is None:
        return
    share = None if dispersed is None else dispersed.met_fraction
    if dispersed is None or share is None:
        yield Figure("requirement", verdicts.VERDICT[chosen.meets_requirement])
        return
    if not chosen.meets_requirement:
        yield Figure("requirement, nominal", verdicts.VERDICT[False])
    yield Figure("requirement", verdicts.cases_verdict(share, dispersed.probability))


def _spacecraft(body: Spacecraft) -> Section:
    blocks: list[Block] = [spacecraft_facts(body)]
    if body.channels:
        blocks.append(
            sheet_of("Channels, and the nutation that their shortest and longest pulse takes", channel_table(body))
        )
    if body.disturbances:
        blocks.append(sheet_of("Disturbances, and what each does alone", disturbance_table(body)))
    return Section("spacecraft", "Spacecraft", tuple(blocks))


def _schemes(compared: Comparison) -> Section:
    """The comparison, why a scheme is infeasible, and the remarks of the others."""
    remarks = tuple((plan.scheme, remark) for plan in compared.plans for remark in said(plan))
    note = Prose(
        "By (17), Magnus' impulse sum, each pulse acts at its centre with its effective impulse. The other figures "
        "integrate Euler's equations through the real widths; recommendation and requirement go by them."
    )
    hints = tuple(Prose(hint) for hint in verdicts.hints(compared))
    blocks: tuple[Block, ...] = (comparison_sheet(compared), *hints, note)
    return Section("schemes", "Schemes compared", (*blocks, Remarks(remarks)) if remarks else blocks)


def _schedule(chosen: Plan) -> Section:
    title = f"Recommended schedule: {chosen.scheme}"
    end = facts_of("Where it points after the last pulse", end_table(chosen.flight))
    if not len(chosen.pulses):
        return Section("schedule", title, (Prose("No pulse is needed."), end))
    note = Prose(
        "A pulse is on from its start for its on-time; the centre lies halfway. "
        "Nutation: before the pulse, and after it."
    )
    return Section("schedule", title, (pulse_sheet(chosen), note, end))


def _budget(chosen: Plan) -> Section:
    expected = chosen.options.with_disturbances
    verified = verify(chosen.spacecraft, chosen.pulses, unrounded(chosen), expected=expected)
    missing = tuple((method.name, f"not flown; {method.missing}") for method in verified.methods if method.missing)
    blocks: list[Block] = [
        sheet_of(
            "What each imperfection alone leaves, everything else ideal", budget_table(chosen.spacecraft, verified)
        ),
        *[Prose(note) for note in (budget_note(verified),) if note],
        sheet_of("The schedule flown by independent means", methods_table(verified)),
        Prose(f"{verdict(verified)} {conservation(chosen.spacecraft, verified)}"),
    ]
    if missing:
        blocks.append(Remarks(missing))
    return Section("budget", "Error budget", tuple(blocks))


def _dispersion(chosen: Plan, dispersed: Results, note: str, *, pictured: bool) -> Section:
    from nutdamp.presentation.dispersion_tables import dispersion_screen

    blocks = [*blocks_of("What is left, by cases", dispersion_screen(dispersed, scheme=chosen.scheme, worst=5))]
    if note:
        blocks.append(Prose(f"Note: {note}."))
    if pictured:
        blocks += dispersion_pictures_of(dispersed, chosen.scheme)
    return Section("dispersion", "Dispersion", tuple(blocks))


def _repeat(repeat: Repeat) -> Section:
    blocks: list[Block] = [Listing("Command", repeat.command, repeat.language), Facts("Versions", tuple(_versions()))]
    if repeat.text:
        blocks.append(Listing(f"Input file {repeat.name}", repeat.text.rstrip("\n"), "yaml"))
    if repeat.settings:
        blocks.append(Facts("Set in place of what the file says", repeat.settings))
    return Section("repeat", "To repeat it", tuple(blocks))


def _versions() -> Iterator[tuple[str, str]]:
    """What the numbers and pictures depend on."""
    yield "nutdamp", __version__
    yield "Python", platform.python_version()
    for package in ("numpy", "scipy", "highspy", "matplotlib"):
        try:
            yield package, version(package)
        except PackageNotFoundError:
            yield package, "not installed"
