"""Actions of ROS 2 as what they are on the wire, two topics and three services, and the goals that these speak of.

channel    name on the graph                 message
goal       ADDRESS/_action/send_goal         TYPE_SendGoal, its request: goal_id, goal
feedback   ADDRESS/_action/feedback          TYPE_FeedbackMessage: goal_id, feedback
result     ADDRESS/_action/get_result        TYPE_GetResult, its response: status, result
cancel     ADDRESS/_action/cancel_goal       action_msgs/CancelGoal, its request
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from parcours.run.binding.structure import Part

ActionPart = Literal["", "goal", "feedback", "result", "cancel"]
"""Which part of an action a channel is; empty for one that belongs to none."""

WIRE: Mapping[str, tuple[str, str, Part]] = {
    "goal": ("send_goal", "{}_SendGoal", "request"),
    "feedback": ("feedback", "{}_FeedbackMessage", "topic"),
    "result": ("get_result", "{}_GetResult", "response"),
    "cancel": ("cancel_goal", "action_msgs/CancelGoal", "request"),
}
"""Part of an action -> the end of its name, its type, and what it is on the wire."""

STATUS = "status", "action_msgs/GoalStatusArray"
"""What a server publishes besides: clients look for it, and nobody is bound to it."""

_ID = slice(4, 20)
"""Where the identifier of a goal lies in requests and feedback: first, behind the header of serialised data."""


def on_the_wire(action: str, type_: str, part: str) -> tuple[str, str, Part]:
    """Return the name, the type and the kind of a part of an action.

    >>> on_the_wire("/navigate", "nav2_msgs/NavigateToPose", "result")
    ('/navigate/_action/get_result', 'nav2_msgs/NavigateToPose_GetResult', 'response')
    """
    end, kind, wire = WIRE[part]
    return f"{action}/_action/{end}", kind.format(type_), wire


class ActionGoals:
    """Which goal each process speaks of: in an abstract case feedback and cancellations change hands."""

    def __init__(self) -> None:
        self._of: dict[str, bytes] = {}

    def note(self, slot: str, data: bytes) -> None:
        """Take note of a goal that a slot has sent or got."""
        self._of[slot] = data[_ID]

    def fitted(self, slot: str, data: bytes) -> bytes:
        """Return feedback, or a cancellation, as if it spoke of the slot's own goal."""
        own = self._of.get(slot)
        return data if own is None or len(data) < _ID.stop else data[: _ID.start] + own + data[_ID.stop :]

    @staticmethod
    def is_accepted(answer: bytes) -> bool:
        """Return whether the answer to a goal says that it was accepted: its first field."""
        return bool(answer[4:5].strip(b"\0"))

    @staticmethod
    def asking(goal: bytes) -> bytes:
        """Return the request for the result of a goal that was sent."""
        return goal[: _ID.stop]
