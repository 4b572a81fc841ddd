"""The components of a study as programs of nodes: each node makes the study's components in a process of its own."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import msgspec

from parcours.errors import BadRequest
from parcours.run.port import Component, Step
from parcours.study.components.messages import INPUTS
from parcours.study.components.tester import Sent, Wrapped, prompted

if TYPE_CHECKING:
    from parcours.run.hosts.ros1.packing import Ros1Codec, Ros1NodeProgram
    from parcours.study.components.study import ComponentStudy


class StudyNodeProgram:
    """One component of a study."""

    def __init__(self, component: str, where: str) -> None:
        from parcours.study.finding import find_components

        self.study: ComponentStudy = find_components(where)
        self._component = component
        messages = self.study.messages
        self.encode, self.decode = messages.encode, messages.decode

    def instance(self, case: bytes) -> Component:
        """Return a fresh component for the case."""
        sent = msgspec.json.decode(case, type=Sent)
        system = self.study.system
        if system is None:
            raise BadRequest(self.study.name, "its components are not made by `system`", slug="node-program-unknown")
        modelled = self.study.model.component(self._component)
        return _InputsByMessage(system.component(modelled, sent.case, self.study.known(sent.case, sent.settings)))

    def prompt(self, name: str, component: Component, now: int) -> Iterator[Step]:
        """Ask the component for the transition of that name."""
        return prompted(name, component, now)

    def view(self, component: Component) -> tuple[str, object] | None:
        """Show nothing."""
        return None


class _InputsByMessage(Wrapped):
    """A component that gets its input variables by a message on a channel of their own."""

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[Step]:
        """Take up a message; one of input variables starts no transition."""
        if channel == INPUTS:
            assert isinstance(message, dict)
            self.set_inputs(message)
            return iter(())
        return super().handle(channel, message, now)


def ros1_codec(where: str) -> Ros1Codec:
    """Return the codec of a study's messages on ROS 1."""
    from parcours.run.hosts.ros1.packing import Ros1Codec
    from parcours.study.finding import find_components

    messages = find_components(where).messages
    forms = {channel: messages.form(channel) or () for channel in messages.channels}
    return Ros1Codec(forms, messages.flatten, messages.restore)


def ros1_node_program(component: str, where: str) -> Ros1NodeProgram:
    """Return the node_program of one component of a study on ROS 1."""
    from parcours.run.hosts.ros1.packing import Ros1NodeProgram

    return Ros1NodeProgram(StudyNodeProgram(component, where), ros1_codec(where))
