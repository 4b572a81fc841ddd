from __future__ import annotations

import pytest

from parcours.abtc import combinations, interaction_paths, meetings, rendezvous_pairs
from parcours.errors import BadRequest
from parcours.model.structure import Cefsm, Channel, Component, Machine, Receive, Send, Transition
from parcours.paths import internal_paths


def step(id: str, receives: str = "", sends: str = "") -> Machine:
    """A machine of one loop, so one internal path, that receives and sends on at most one channel."""
    event = Receive(receives) if receives else None
    loop = Transition(id, "s", "s", event=event, sends=(Send(sends),) if sends else ())
    return Machine(id, "s", ("s",), (loop,))


def model(*components: tuple[str, tuple[Machine, ...]], channels: str, name: str = "m") -> Cefsm:
    """Channels are spelled ask:AB, that is channel ask from component A to component B."""
    ends = [spelled.split(":") for spelled in channels.split()]
    links = tuple(Channel(name, pair[0], pair[1], "Text") for name, pair in ends)
    return Cefsm(name, tuple(Component(*component) for component in components), links)


ASK = model(
    ("A", (step("a1", "answer", "ask"), step("a2"))), ("B", (step("b1", "ask", "answer"),)), channels="ask:AB answer:BA"
)


def test_a_pair_joins_each_send_with_each_receive_of_a_channel() -> None:
    assert [str(pair) for pair in rendezvous_pairs(ASK)] == ["a1 -> b1 on ask", "b1 -> a1 on answer"]


def test_a_send_that_nobody_receives_is_listed_without_a_partner() -> None:
    deaf = model(("A", (step("a1", "", "ask"),)), ("B", (step("b1"),)), channels="ask:AB")
    assert [str(pair) for pair in rendezvous_pairs(deaf)] == ["a1 -> (nobody) on ask"]
    assert meetings(deaf, internal_paths(deaf)) == ()


def test_who_talks_with_the_sender_stands_in_for_a_missing_receiver() -> None:
    half = model(
        ("A", (step("a1", "", "ask"), step("a2"))), ("B", (step("b1", "ask", "answer"),)), channels="ask:AB answer:BA"
    )
    found = [(m.channel, m.sender.name, m.receiver.name, m.stand_in) for m in meetings(half, internal_paths(half))]
    assert found == [("ask", "tp11", "tp21", False), ("answer", "tp21", "tp11", True)]


def test_a_path_that_cannot_meet_is_dropped_with_the_missing_rendezvous() -> None:
    (trip,) = interaction_paths(ASK)
    result = combinations(ASK, trip)
    assert [str(combination) for combination in result.kept] == ["(tp11, tp21, tp11)"]
    assert [str(dropped) for dropped in result.dropped] == [
        "ITP1 (tp12, tp21, tp12): "
        "A -> B: tp12 and tp21 have no rendezvous on ask (tp11 and tp21 have); "
        "B -> A: tp21 and tp12 have no rendezvous on answer (tp21 and tp11 have)"
    ]


def test_two_paths_that_can_each_serve_alone_make_two_combinations() -> None:
    either = model(
        ("A", (step("a1", "answer", "ask"),)),
        ("B", (step("b1", "ask", "answer"), step("b2", "ask", "answer"))),
        channels="ask:AB answer:BA",
    )
    (trip,) = interaction_paths(either)
    result = combinations(either, trip)
    assert [str(combination) for combination in result.kept] == ["(tp11, tp21, tp11)", "(tp11, tp22, tp11)"]
    assert result.dropped == ()


def test_paths_that_serve_only_jointly_share_the_visit() -> None:
    joint = model(
        ("A", (step("a1", "answer", "ask"),)),
        ("B", (step("b1", "ask"), step("b2"), step("b3", "", "answer"))),
        channels="ask:AB answer:BA",
    )
    (trip,) = interaction_paths(joint)
    result = combinations(joint, trip)
    assert [str(combination) for combination in result.kept] == ["(tp11, tp21+tp23, tp11)"]
    assert len(result.dropped) == 3


def test_a_hop_that_no_path_can_make_leaves_nothing() -> None:
    mute = model(("A", (step("a1", "answer"),)), ("B", (step("b1", "ask"),)), channels="ask:AB answer:BA")
    (trip,) = interaction_paths(mute)
    result = combinations(mute, trip)
    assert result.kept == ()
    assert "A -> B: tp11 and tp21 have no rendezvous, nor have any other paths of the two" in result.dropped[0].reason


def test_components_side_by_side_need_no_rendezvous() -> None:
    apart = model(("A", (step("a1"), step("a2"))), ("B", (step("b1"),)), channels="")
    (together,) = interaction_paths(apart)
    kept = combinations(apart, together).kept
    assert [str(combination) for combination in kept] == ["(tp11, tp21)", "(tp12, tp21)"]


def test_too_many_candidates_are_refused_before_they_are_made() -> None:
    many = tuple((name, tuple(step(f"{name}{n}") for n in range(50))) for name in "ABCD")
    crowd = model(*many, channels="")
    (together,) = interaction_paths(crowd)
    with pytest.raises(BadRequest, match=r"path together: may have at most 100000.*but has 6250000"):
        combinations(crowd, together)
