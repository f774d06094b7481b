"""Fits whose values and sigmas are given, as if a record had told them."""

from collections.abc import Mapping

import numpy as np

from nutdamp.estimation.model import Model
from nutdamp.estimation.parameters import Record
from nutdamp.estimation.search import Fit
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.schedule import Schedule


def silent(
    *signals: str, until: float = 10.0, count: int = 11, schedule: Schedule | None = None
) -> Record:
    """A record of ``signals`` that are all zero but for the axis, which points along z."""
    zeros = {name: np.full(count, float(name == "axis_z")) for name in signals}
    return Record(np.linspace(0.0, until, count), zeros, schedule=schedule or Schedule())


def told(
    body: Spacecraft,
    record: Record,
    given: Mapping[str, float],
    sigmas: Mapping[str, float],
    *,
    unequal: bool = False,
) -> Fit:
    """The ``given`` values of parameters, others as in the file; known to a step if alone."""
    model = Model(body, record, unequal=unequal)
    parameters = model.parameters
    unknown = ({*given} | {*sigmas}) - {one.name for one in parameters}
    assert not unknown, unknown
    values = np.array([given.get(one.name, one.file) for one in parameters])
    covariance = np.diag([sigmas.get(one.name, one.step) ** 2 for one in parameters])
    count = len(model.measured)
    used = np.ones(count, dtype=bool)
    noise = np.ones(len(model.signals))
    return Fit(
        model, values, covariance, noise, used, np.zeros(count), np.zeros((count, len(parameters)))
    )
