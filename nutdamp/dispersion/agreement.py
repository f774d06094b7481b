"""How far the impulse sum (17) is from real widths: the first cases of a study, flown both ways."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from nutdamp import compliance
from nutdamp.compliance import Part
from nutdamp.dispersion.flown import RealWidths
from nutdamp.dispersion.outputs import OUTPUTS
from nutdamp.dispersion.rounds import STRIDE
from nutdamp.dispersion.study import Results, Study, run
from nutdamp.errors import BadRequest, Infeasible
from nutdamp.lightening import shed
from nutdamp.outcome import Deviation, tolerated

CASES = STRIDE
"""Cases that are flown both ways."""

WORTH_SAYING = math.radians(1e-4)
"""rad by which cases of falling moments must err for that to be said."""


def deviations(study: Study) -> tuple[Deviation, ...]:
    """By how much a ``study`` in closed form errs, part by part, against the same cases flown through real widths.

    Raises Infeasible where those cannot be flown.
    """
    body = study.model.spacecraft
    real = replace(study, fly=RealWidths(study.model), flown=True)
    summed, flown = (run(Results(one, CASES)) for one in (study, real))
    assert summed.values is not None
    assert flown.values is not None
    errors = np.abs(summed.values - flown.values)
    return tuple(
        Deviation(
            part,
            float(
                np.quantile(
                    errors[OUTPUTS.index("spin_change" if part is Part.SPIN else part.value)], flown.probability
                )
            ),
            most,
            flown.probability,
        )
        for part, most in tolerated(body, otherwise=math.inf).items()
    )


def check_impulses(study: Study, *, force: bool = False) -> str:
    """By how much a ``study`` in closed form errs, in words.

    Raises BadRequest where that is too much, or where nobody can tell, unless ``force``.
    """
    try:
        found = deviations(study)
    except Infeasible as reason:
        if force:
            return f"the error of the impulse sum (17) cannot be determined here: {reason}"
        raise BadRequest(
            f"--impulses: real widths cannot be flown to check it: {reason}; --force skips this check"
        ) from None
    level = f"{100.0 * found[0].probability:.10g} % of the first {CASES:,} cases"
    text = f"the impulse sum (17) errs by up to {' and '.join(map(str, found))} in {level}"
    beyond = [one for one in found if one.error > one.most]
    if beyond and not force:
        tenth = "a tenth of the requirement" if compliance.required(study.model.spacecraft) else "the most allowed"
        most = " and ".join(str(one._replace(error=one.most)) for one in beyond)
        raise BadRequest(
            f"--impulses: {text}; {tenth} is {most}. Leave --impulses out to fly real widths, or add --force"
        )
    return text


def lightening_error(study: Study) -> str:
    """By how much cases of falling moments err, as the nominal one shows; empty where that is nothing to speak of.

    They fall half as each pulse begins and half as it ends, which errs in second order; `flight.flown` lets them fall
    as the thrust goes.
    """
    body = study.model.spacecraft
    if shed(body) is None:
        return ""
    found, exact = study.outputs_of({}), study.nominal.residual
    part = compliance.aim(body)
    aim = exact.momentum_shift if part is Part.SHIFT else exact.axis_error
    errors = {Part.NUTATION: found[0] - exact.nutation, part: found[OUTPUTS.index(part.value)] - aim}
    if max(map(abs, errors.values())) < WORTH_SAYING:
        return ""
    said = " and ".join(f"{math.degrees(abs(error)):.2g} deg of {one.label}" for one, error in errors.items())
    return f"cases let the moments of inertia fall at the edges of pulses: in the nominal one that errs by {said}"
