"""Messages merged into a spacecraft file: its attitude, epoch and rates, and its inertia where that is asked for.

All else of the file stays, with its comments and units.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from nutdamp.common.time import Epoch
from nutdamp.errors import BadRequest, FaultyFile
from nutdamp.files.ccsds.history import History
from nutdamp.files.ccsds.read import ApmContents
from nutdamp.files.editing import Edits, Later, attitude_edits, carry_text, epoch_after, inertia_edits, rate_edits
from nutdamp.files.reader import Source
from nutdamp.files.yaml import Node
from nutdamp.physics import attitude
from nutdamp.physics.body import principal_axes
from nutdamp.spacecraft.model import Attitude, Inertia, SpinState, Vector


class MessageMotion(NamedTuple):
    """Motion at an ``epoch`` in body axes: ``quaternion`` (4,) body -> frame, ``rates`` (3,) rad/s, ``tensor`` (3, 3).

    None for what the message does not give.
    """

    epoch: Epoch
    frame: str | None
    quaternion: Vector | None
    rates: Vector | None
    tensor: Vector | None


def motion_of(message: ApmContents | History, at: float = 0.0) -> MessageMotion:
    """Motion in a message; of a history that of the first record from ``at`` s after its first on."""
    if isinstance(message, ApmContents):
        return MessageMotion(message.epoch, message.frame, message.quaternion, message.rates, message.tensor)
    index = message.at(at)
    rates = None if message.rates is None else message.rates[index]
    epoch = message.epoch.plus(float(message.times[index]))
    return MessageMotion(epoch, message.frame, message.quaternions[index], rates, None)


def merged_text(source: Source, motion: MessageMotion, *, inertia: bool) -> str:
    """The text of a spacecraft file with the ``motion`` of a message; with its ``inertia`` where that is asked for.

    Raises BadRequest where the message does not give what is asked for, or nothing; FaultyFile where the file would be
    none for nutdamp.
    """
    if inertia and motion.tensor is None:
        raise BadRequest("the message has no inertia to merge")
    if motion.quaternion is None and motion.rates is None:
        raise BadRequest("the message has neither an attitude nor rates to merge")
    before = source.read(lambda _: None)
    after = before
    if inertia and motion.tensor is not None:
        after = replace(after, inertia=Inertia(*principal_axes(motion.tensor), before.inertia.wheel))
    axes = after.inertia.axes
    rates = before.rates if motion.rates is None else motion.rates
    after = replace(after, omega0=axes.T @ rates)
    first, second, third = after.omega0.tolist()
    quaternion = before.initial.quaternion
    if motion.quaternion is not None:
        quaternion = attitude.multiply(motion.quaternion, attitude.from_matrix(axes))
        given = Attitude(motion.quaternion, epoch_after(motion.epoch.text, 0.0), motion.frame)
        after = replace(after, attitude=given)
    later = Later(before, after, SpinState(complex(first, second), third, quaternion))

    def edits(tree: Node) -> Edits:
        if inertia:
            yield from inertia_edits(tree, later)
        if motion.rates is not None:
            yield from rate_edits(tree, later)
        if motion.quaternion is not None:
            yield from attitude_edits(tree, later)

    text = carry_text(*source, edits)
    try:
        Source(text, source.name).read(lambda _: None)
    except FaultyFile as wrong:
        listed = "; ".join(f"{fault.where}: {fault.problem}" for fault in wrong.faults)
        raise BadRequest(f"the message does not fit {source.name}: {listed}") from None
    return text
