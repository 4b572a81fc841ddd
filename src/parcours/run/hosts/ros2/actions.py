"""A client of an action server: its three services, asked in the tester's own loop."""

from __future__ import annotations

from typing import Any, Literal

from parcours.run.hosts.ros2.participant import Ros2Participant

State = Literal["none", "sent", "refused", "accepted", "ended"]
"""How it stands with the last goal."""


class ActionCaller:
    """Sends goals, one after the other: a server gives the last one up when a new one comes.

    Args:
        participant: the tester's; answers are heard when it spins.
        kind: class of the action.
        address: of the action, such as `/navigate_to_pose`.

    Attributes:
        status: how the last goal ended, as `action_msgs/GoalStatus` numbers it; 0 before.
    """

    def __init__(self, participant: Ros2Participant, kind: Any, address: str) -> None:
        from action_msgs.srv import CancelGoal

        self._state: State = "none"
        self.status = 0
        self._kind, self._cancelling = kind, CancelGoal
        self._goals = 0
        self._waiting: dict[int, int] = {}
        impl, front = kind.Impl, f"{address}/_action"
        self._send = participant.inquire(impl.SendGoalService, f"{front}/send_goal", self._answered)
        self._result = participant.inquire(impl.GetResultService, f"{front}/get_result", self._ended)
        self._cancel = participant.inquire(CancelGoal, f"{front}/cancel_goal", lambda number, answer: None)

    @property
    def state(self) -> State:
        """How it stands with the last goal."""
        return self._state

    @property
    def is_busy(self) -> bool:
        """Whether the last goal was accepted and has not ended."""
        return self._state == "accepted"

    @property
    def is_served(self) -> bool:
        """Whether the server is there."""
        return all(client.service_is_ready() for client in (self._send, self._result, self._cancel))

    def send(self, goal: Any) -> None:
        """Send a goal. Its number is its identifier, so that runs are equal."""
        self._goals += 1
        request = self._kind.Impl.SendGoalService.Request(goal=goal)
        self._name(request.goal_id)
        self._state, self.status = "sent", 0
        self._waiting[self._send.handle.send_request(request)] = self._goals

    def cancel(self) -> None:
        """Ask that the last goal be given up."""
        request = self._cancelling.Request()
        self._name(request.goal_info.goal_id)
        self._cancel.handle.send_request(request)

    def _name(self, identifier: Any) -> None:
        identifier.uuid = list(self._goals.to_bytes(16, "big"))

    def _answered(self, number: int, answer: Any) -> None:
        if self._waiting.pop(number, 0) != self._goals:
            return
        self._state = "accepted" if answer.accepted else "refused"
        if answer.accepted:
            request = self._kind.Impl.GetResultService.Request()
            self._name(request.goal_id)
            self._waiting[-self._result.handle.send_request(request)] = self._goals

    def _ended(self, number: int, answer: Any) -> None:
        if self._waiting.pop(-number, 0) == self._goals:
            self._state, self.status = "ended", int(answer.status)
