"""Plan schemes, compare them, and read schedules."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from os import PathLike

from nutdamp import arguments, planning
from nutdamp.errors import printable
from nutdamp.library.craft import Spacecraft, core_of
from nutdamp.library.results import Comparison, Plan
from nutdamp.remarks import broken_limits
from nutdamp.schemes import Choice


def plan(spacecraft: Spacecraft, scheme: str, options: Choice = None) -> Plan:
    """Plan one scheme and judge it by flying it; an infeasible plan says why.

    Raises BadRequest for a scheme that there is not, or an option that makes no sense.
    """
    (name,) = arguments.scheme_names([scheme])
    return Plan(planning.plan(core_of(spacecraft), name, arguments.options(options)), spacecraft.source)


def compare(spacecraft: Spacecraft, names: Sequence[str] = (), options: Choice = None) -> Comparison:
    """Plan the schemes named and recommend one; raises as `plan` does.

    Default: the classic three, or those that point where the file has a target axis.
    """
    core = core_of(spacecraft)
    chosen = arguments.scheme_names(names) or planning.usual(core)
    return Comparison(planning.compare(core, chosen, arguments.options(options)), spacecraft.source)


def load_schedule(path: str | PathLike[str], spacecraft: Spacecraft) -> Plan:
    """The pulses of a CSV file as ``plan --csv`` writes it, as a plan of that name.

    Warns where columns contradict each other or a limit is broken. Raises CannotRead, or FaultyFile.
    """
    from nutdamp.files.schedule_file import read_pulses

    core, name = core_of(spacecraft), arguments.path("path", path)
    schedule, remarks = read_pulses(name, core)
    for remark in (*remarks, *broken_limits(core, schedule)):
        warnings.warn(remark, stacklevel=2)
    return Plan(planning.Plan(core, printable(name), schedule), spacecraft.source, from_file=True)
