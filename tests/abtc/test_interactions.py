from __future__ import annotations

from parcours.abtc import component_graph, interaction_paths
from parcours.abtc.interactions import hub
from parcours.model.structure import ENVIRONMENT, Cefsm, Channel, Component


def model(*links: tuple[str, str], interactions: tuple[tuple[str, tuple[str, ...]], ...] = ()) -> Cefsm:
    channels = tuple(Channel(f"c{n}", a, b, "Text") for n, (a, b) in enumerate(links))
    return Cefsm("m", tuple(Component(name, ()) for name in "ABCD"), channels, interactions=interactions)


def test_the_environment_is_no_node_of_the_component_graph() -> None:
    assert list(component_graph(model((ENVIRONMENT, "A"), ("A", "B"), ("B", ENVIRONMENT)))) == [("A", "B")]


def test_two_channels_one_way_are_one_edge() -> None:
    ((_, channels),) = component_graph(model(("A", "B"), ("A", "B"))).items()
    assert [channel.name for channel in channels] == ["c0", "c1"]


def test_round_trips_start_at_the_component_with_more_partners() -> None:
    trips = interaction_paths(model(("A", "B"), ("B", "A"), ("C", "B"), ("B", "C")))
    assert [trip.components for trip in trips] == [("B", "A", "B"), ("B", "C", "B")]


def test_a_pair_that_talks_one_way_has_no_round_trip() -> None:
    assert interaction_paths(model(("A", "B"), ("C", "B"), ("B", "C")))[0].components == ("B", "C", "B")


def test_names_of_round_trips_avoid_those_of_specified_paths() -> None:
    specified = (("ITP1", ("A", "B")),)
    names = [path.name for path in interaction_paths(model(("A", "B"), ("B", "A"), interactions=specified))]
    assert names == ["ITP2", "ITP1"]


def test_components_without_channels_run_together_without_hops() -> None:
    (path,) = interaction_paths(model())
    assert path.components == ("A", "B", "C", "D")
    assert path.hops == ()


def test_a_model_without_channels_has_no_hub_and_among_equals_the_first_is_it() -> None:
    assert hub(model()) is None
    assert hub(model(("C", "B"), ("B", "C"))) == "B"
