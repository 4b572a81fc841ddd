"""What travels is held against the model's classes before anything runs: on each host, by the bytes of that host."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import cast

import pytest

from parcours.errors import HostFailure
from parcours.model.model_file import parse_model
from parcours.model.structure import Cefsm, Field
from parcours.run.hosts.node_program import Codec
from parcours.study.components.messages import ModelMessages
from parcours.study.hosting import started
from parcours.study.parameters import settings_of
from parcours.study.payload_fields import require_carried, uncarried
from parcours.study.protocol import Request
from parcours.verdict.contracts import plain
from parcours_ramp.components.node_program import RampCodec
from parcours_ramp.components.ros1 import codec as ros1_codec
from parcours_ramp.components.study import component_study
from parcours_ramp.planner.wire import FORMS, flatten, restore
from parcours_ramp.system.live_running import system_nodes

CODECS: dict[str, Codec | None] = {"simulated": None, "processes": RampCodec(), "ros1": ros1_codec()}

TREE = """
parcours: model/1
name: tree
messages:
  Leaf: {fields: {colour: {type: text}, area: {type: real, unit: m2}}}
  Branch: {fields: {age: {type: int}, dead: {type: bool}, sizes: {type: real, shape: [2, 3]},
                    leaves: {type: Leaf, shape: [n]}, branches: {type: Branch, shape: [n]}}}
channels: {grow: {from: environment, to: Tree, message: Branch}}
components: {Tree: {machines: {m: {initial: s, transitions: {t1: {from: s, to: s, event: grow}}}}}}
"""


def changed(of: str, name: str, field: Field | None) -> Cefsm:
    """Return RAMP's model with one field of a class put in the place of that of its name; without it if None."""
    model = component_study().model
    classes = []
    for message in model.messages:
        kept = tuple(one for one in message.fields if one.name != name)
        made = (*kept, field) if field is not None else kept
        classes.append(replace(message, fields=made) if message.name == of else message)
    return replace(model, messages=tuple(classes))


def shown_leaves(value: object, where: str) -> Iterator[tuple[str, bool]]:
    if isinstance(value, Mapping):
        for name, one in value.items():
            yield from shown_leaves(one, f"{where}.{name}")
    elif isinstance(value, list):
        yield where, bool(value)
        for one in value:
            yield from shown_leaves(one, f"{where}[]")
    else:
        yield where, bool(value)


@pytest.mark.parametrize("host", CODECS)
def test_what_ramp_sends_is_what_the_classes_of_its_model_say_on_every_host(host: str) -> None:
    for nodes in (component_study().nodes(), system_nodes()):
        require_carried(nodes.model, nodes.shown, nodes.specimens, CODECS[host])


def test_the_specimens_of_ramp_show_every_field_with_a_value_that_would_be_missed() -> None:
    nodes = component_study().nodes()
    seen: dict[str, bool] = {}
    for channel, payload in nodes.specimens():
        for where, is_something in shown_leaves(nodes.shown(channel, payload), channel):
            seen[where] = seen.get(where, False) or is_something
    assert [where for where, is_something in seen.items() if not is_something] == []
    assert {one.partition(".")[0] for one in seen} == {one.name for one in nodes.model.carriers}


@pytest.mark.parametrize("host", CODECS)
@pytest.mark.parametrize(
    ("of", "name", "field", "said"),
    [
        ("RampTrajectory", "colour", Field("colour", "int"), "must be a RampTrajectory, but lacks colour: int"),
        ("EvaluationResponse", "fitness", None, "must be a EvaluationResponse, which has no 'fitness'"),
        ("SpeedLimit", "limit", Field("limit", "text"), "it.limit must be text, but is 0.12"),
        ("Path", "points", Field("points", "Point", shape=(9,)), "points must be a list of 9"),
        ("Leg", "stray", Field("stray", "bool"), "stray must be bool"),
    ],
)
def test_a_class_that_says_something_else_than_travels_is_a_finding_that_names_both(
    host: str, of: str, name: str, field: Field | None, said: str
) -> None:
    nodes = component_study().nodes()
    found = list(uncarried(changed(of, name, field), nodes.shown, nodes.specimens, CODECS[host]))
    assert found and all(said in one and one.startswith("on '") for one in found), found


def test_what_a_hosts_form_leaves_out_of_a_message_is_a_finding_on_that_host_alone() -> None:
    class Forgets(RampCodec):
        @staticmethod
        def encode(channel: str, payload: object) -> bytes:
            values = dict(zip((field.name for field in FORMS[channel]), flatten(channel, payload), strict=True))
            values.update({name: values[name] * 0 for name in ("starts", "fitness") if name in values})  # type: ignore[operator]
            return RampCodec.encode(channel, restore(channel, tuple(values.values())))

    nodes = component_study().nodes()
    assert not list(uncarried(nodes.model, nodes.shown, nodes.specimens))
    found = list(uncarried(nodes.model, nodes.shown, nodes.specimens, cast(Codec, Forgets())))
    assert "on 'trajectory_request' TrajectoryRequest.starts[0].x is sent as 0.1, but comes as 0.0" in found
    assert "on 'evaluation_response' EvaluationResponse.fitness[0] is sent as 0.2, but comes as 0.0" in found


@pytest.mark.parametrize("host", ["processes", "ros1"])
def test_no_host_starts_with_messages_that_are_not_what_the_model_says(host: str) -> None:
    nodes = replace(component_study().nodes(), model=changed("MotionState", "v", Field("v", "real", shape=(3,))))
    with (
        pytest.raises(HostFailure, match=r"on 'update' it.v must be a list of 3, but is 0.2") as caught,
        started(nodes, host),
    ):
        raise AssertionError("it started")
    assert caught.value.slug == "message-carried"


def test_no_case_runs_in_simulated_time_with_such_messages_and_the_battery_says_so(tmp_path: Path) -> None:
    study = replace(component_study(), model=changed("Velocity", "v", Field("v", "bool")))
    settings = settings_of(study.parameters, {})
    with pytest.raises(HostFailure, match=r"on 'cmd_vel' it.v must be bool, but is 0.2"):
        study.run(Request(settings, 1, tmp_path / "out", 1), lambda *_: None)
    assert not (tmp_path / "out" / "cases.jsonl").exists()
    assert [one.level for one in study.check(lambda *_: None)] == ["error"]


def test_classes_of_a_plain_study_travel_as_they_are_in_every_form_also_those_that_hold_themselves() -> None:
    from parcours.run.hosts.ros1.packing import Ros1Codec

    model = parse_model(TREE, "tree.yaml")
    messages = ModelMessages(model)
    forms = {channel: messages.form(channel) or () for channel in messages.channels}
    for codec in (messages, Ros1Codec(forms, messages.flatten, messages.restore)):
        require_carried(model, plain, messages.specimens, codec)
    other = replace(model, messages=tuple(replace(one, fields=one.fields[1:]) for one in model.messages))
    assert list(uncarried(other, plain, messages.specimens, messages)) == [
        "on 'grow' it must be a Branch, which has no 'age'"
    ]


def test_a_channel_on_which_nothing_is_shown_to_travel_is_a_finding() -> None:
    model = parse_model(TREE, "tree.yaml")
    assert list(uncarried(model, plain, tuple)) == ["on 'grow' nothing travels that could be a Branch"]
