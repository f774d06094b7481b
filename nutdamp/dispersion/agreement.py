"""How far the impulse sum (17) is from real widths: the first cases of a study, flown both ways."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from nutdamp import compliance
from nutdamp.compliance import Part
from nutdamp.dispersion.flown import RealWidths
from nutdamp.dispersion.outputs import OUTPUTS, aim_output
from nutdamp.dispersion.study import STRIDE, Results, Study, run
from nutdamp.errors import BadRequest, Infeasible

CASES = STRIDE
"""Cases that are flown both ways."""

SHARE = 0.1
"""Of a bound of the requirement, by which the impulse sum may err."""

ANGLE = math.radians(0.01)
"""rad by which it may err where nothing is required."""


class Deviation(NamedTuple):
    """By how much the impulse sum errs in a part (rad, rad/s); ``probability`` of the cases do not exceed it.

    ``most``: by how much it may; infinite for a part that nothing bounds where something else is required.
    """

    part: Part
    error: float
    most: float
    probability: float

    def __str__(self) -> str:
        name, unit = {
            Part.NUTATION: ("nutation", "deg"),
            Part.SHIFT: ("shift of H", "deg"),
            Part.DISTANCE: ("axis error", "deg"),
            Part.SPIN: ("spin", "rad/s"),
        }[self.part]
        error = self.error if self.part is Part.SPIN else math.degrees(self.error)
        return f"{error:.2g} {unit} of {name}"


def deviations(study: Study) -> tuple[Deviation, ...]:
    """By how much a ``study`` in closed form errs, part by part, against the same cases flown through real widths.

    Raises Infeasible where those cannot be flown.
    """
    body = study.model.spacecraft
    real = replace(study, fly=RealWidths(study.model), flown=True)
    summed, flown = (run(Results(one, CASES)) for one in (study, real))
    assert summed.values is not None
    assert flown.values is not None
    aim = Part.SHIFT if body.goal.axis is None else Part.DISTANCE
    rows = {Part.NUTATION: 0, aim: OUTPUTS.index(aim_output(body)[0])}
    if body.goal.spin is not None:
        rows[Part.SPIN] = OUTPUTS.index("spin_change")
    required = {bound.part: SHARE * bound.most for bound in compliance.required(body)}
    return tuple(
        Deviation(
            part,
            float(np.quantile(np.abs(summed.values[row] - flown.values[row]), flown.probability)),
            required.get(part, math.inf) if required else ANGLE,
            flown.probability,
        )
        for part, row in rows.items()
    )


def check_impulses(study: Study, *, force: bool = False) -> str:
    """By how much a ``study`` in closed form errs, in words.

    Raises BadRequest where that is too much, or where nobody can tell, unless ``force``.
    """
    try:
        found = deviations(study)
    except Infeasible as reason:
        if force:
            return f"nobody can tell how far the impulse sum (17) errs here: {reason}"
        raise BadRequest(
            f"--impulses: real widths cannot be flown to check it: {reason}; --force does without"
        ) from None
    level = f"{100.0 * found[0].probability:.10g} % of the first {CASES:,} cases"
    told = f"the impulse sum (17) errs by up to {' and '.join(map(str, found))} in {level}"
    beyond = [one for one in found if one.error > one.most]
    if beyond and not force:
        tenth = "a tenth of the requirement" if compliance.required(study.model.spacecraft) else "the most allowed"
        most = " and ".join(str(one._replace(error=one.most)) for one in beyond)
        raise BadRequest(
            f"--impulses: {told}; {tenth} is {most}. Leave --impulses out to fly real widths, or add --force"
        )
    return told
