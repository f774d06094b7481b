"""Method, symbols and assumptions behind the numbers of a page, as the guide has them."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from nutdamp.page.document import Block, FactList, Listing, Points, Prose
from nutdamp.planning.decision import Comparison
from nutdamp.planning.plan import Plan
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.views import guide
from nutdamp.views.guide import Formula, Topic, TopicRows
from nutdamp.views.spacecraft import beyond_floors, turn_floor
from nutdamp.views.text import quantity

EQUATIONS = ("1", "17", "18", "19")
"""Equations of Magnus that every plan and flight rest on, as the guide numbers them."""


def method_blocks(compared: Comparison) -> Iterator[Block]:
    """A paragraph on the method, the equations used with their symbols, the sources."""
    unequal = "; with I1 ≠ I2 the true tensor moves freely in between" * (not compared.spacecraft.inertia.symmetric)
    yield Prose(
        f"Schemes plan on the nominal values of the input file ({', '.join(plan.scheme for plan in compared.plans)}). "
        "Each schedule is then flown: Euler's equations with the true principal moments are integrated through the "
        "real pulse widths by Taylor series, coasts of symmetric bodies as exact arcs. Recommendation, requirement and "
        "verdict go by that flight. By M(17), the impulse sum, each pulse acts at its centre with its effective "
        f"impulse{unequal}."
    )
    chosen = compared.recommended
    topics = [guide.found(number) for number in EQUATIONS]
    lines = [line for topic in topics for line in _listed(topic, _formulas(topic)[-1])]
    if chosen is not None and chosen.scheme in guide.NAMES:
        scheme = guide.found(chosen.scheme)
        lines += _listed(scheme, _formulas(scheme)[0])
    yield Listing("Equations", "\n".join(lines))
    symbols = _symbols(topics, chosen, " ".join([*lines, "θ"]))
    yield FactList("Symbols", (*symbols, *_floors(compared.spacecraft)))
    yield Points((("", guide.SOURCES[0]),))


def _formulas(topic: Topic) -> list[Formula]:
    """The formulas of a topic; the last one of a numbered equation is the one in use."""
    return [block for part in topic.parts for block in part.blocks if isinstance(block, Formula)]


def _listed(topic: Topic, formula: Formula) -> list[str]:
    return [f"{topic.name}  {topic.summary}", *(f"    {line}" for line in formula.lines), ""]


def _symbols(topics: list[Topic], chosen: Plan | None, listed: str) -> Iterator[tuple[str, str]]:
    """Each symbol of the equations that are ``listed`` once, and those of the formula of the scheme, as it has them."""
    blocks = (block for topic in topics for part in topic.parts for block in part.blocks)
    rows = (row for block in blocks if isinstance(block, TopicRows) for row in block.rows)
    yield from {symbol: text for symbol, text in rows if symbol.removesuffix(")") in listed}.items()
    if chosen is None or chosen.scheme not in guide.NAMES:
        return
    for part in guide.found(chosen.scheme).parts:
        if any(isinstance(block, Formula) for block in part.blocks):
            yield chosen.scheme, " ".join(block for block in part.blocks if isinstance(block, str))
            return


def _floors(body: Spacecraft) -> Iterator[tuple[str, str]]:
    """The bounds that the impulses of plans are compared with."""
    beyond = beyond_floors(body)
    holds = f"no floor here, with {beyond}" if beyond else "no schedule that does so takes less"
    yield "A|ω0|", f"{quantity(body.least_impulse, 'N m s')}, the impulse that takes out the nutation; {holds}"
    if body.goal.axis is not None:
        turning = quantity(body.turning_impulse, "N m s")
        yield (
            turn_floor(body),
            f"{turning}, the impulse that turns the spin by β, the angle from H to the target; {holds}",
        )


def _any_of(*schemes: str) -> Callable[[Comparison], bool]:
    return lambda compared: any(plan.scheme in schemes for plan in compared.plans)


CONDITIONS: dict[str, Callable[[Comparison], bool]] = {
    "The closed forms hold": lambda compared: not compared.spacecraft.inertia.symmetric,
    "Disturbances": lambda compared: bool(compared.spacecraft.disturbances),
    "Energy dissipation": lambda compared: compared.spacecraft.dissipation is not None,
    "`optimal`": _any_of("optimal"),
    "Small angles are magnified": lambda _: False,
    "`two-pulse`": _any_of("two-pulse", "half-cone", "rhumb-line"),
}
"""Beginnings of the limits of the guide that apply only to some comparisons, and to which."""


def assumptions(compared: Comparison) -> Iterator[str]:
    """Assumptions and limits of the guide that apply here."""
    for text in guide.limits():
        if all(applies(compared) for begin, applies in CONDITIONS.items() if text.startswith(begin)):
            yield text.replace("`", "")
