"""Bindings over several domains of ROS 2: names told apart, bridges, clocks."""

from __future__ import annotations

from pathlib import Path

from edited_bindings import bound, edited
from parcours.run.binding import RegisteredGraph, check_binding, graph_findings
from parcours.run.binding.domains import at_home
from parcours.run.binding.slots import apart, whole

ROOT = Path(__file__).parents[2]
ROS1, ROS2 = (ROOT / "examples" / name / "binding.yaml" for name in ("ros1_python", "ros2_python"))
FLEET, BRIDGE = (ROOT / "tests_ros2" / name / "binding.yaml" for name in ("fleet", "bridge"))


def rules(path: Path, *changes: tuple[str, str]) -> list[str]:
    _, found = check_binding(edited(path, *changes), str(path))
    return [finding.rule for finding in found]


def test_nodes_on_two_domains_are_met_there_and_their_names_need_not_be_parted() -> None:
    on = {"/obstacle_filter": 1, "/avoider": 2}
    moved = tuple(
        (f"ros_node: {name}\n", f"ros_node: {name}\n    domain: {on[name]}\n    remap: false\n") for name in on
    )
    binding = bound(ROS2, *moved)
    ends = {(spoke.slot, spoke.side): spoke.address for spoke in whole(binding).spokes if "obstacles" in spoke.channels}
    assert ends == {("ObstacleFilter", "out"): "/obstacles@1", ("Planner", "into"): "/obstacles@2"}
    assert not [spoke for spoke in whole(binding).spokes if spoke.slot == "Follower" and "@" in spoke.address]
    at_2 = at_home(binding, 2)
    assert [node.domain for node in at_2.nodes] == [1, None, None]
    one = {
        name: (given, instead.replace("domain: 2", "domain: 1"))
        for name, (given, instead) in zip(on, moved, strict=True)
    }
    assert set(rules(ROS2, *one.values())) == {"binding-separation"}


def test_only_ros_2_has_domains_and_a_stack_is_on_one() -> None:
    given = ("ros_node: /avoider\n", "ros_node: /avoider\n    domain: 3\n")
    assert rules(ROS1, given) == ["binding-domain"]
    stack = ROOT / "examples" / "ros2_navigation" / "dwa.yaml"
    assert rules(stack, ("ros_node: /dwa", "ros_node: /dwa\n    domain: 3")) == ["binding-domain"]


def test_names_that_are_taken_are_free_on_another_domain() -> None:
    assert rules(FLEET) == []
    assert {"binding-action-part", "binding-service"} & set(rules(FLEET, ("domain: 67", "domain: 66")))
    overheard = ("quiescence", "observe:\n  heard: {topic: /shown, type: geometry_msgs/PointStamped}\nquiescence")
    assert rules(BRIDGE, overheard) == []
    assert rules(BRIDGE, overheard, ("Stamped}", "Stamped, domain: 69}")) == ["binding-observed"]
    assert rules(BRIDGE, overheard, ("/shown, type: geometry_msgs/PointStamped}", "/shown, type: std_msgs/Bool}")) == []


def test_a_step_says_which_of_two_nodes_of_one_name_it_asks() -> None:
    assert rules(FLEET, ("is: true, domain: 66}", "is: true}")) == ["binding-domain"]


def test_nodes_that_follow_clock_are_not_timed() -> None:
    timed = ("quiescence", 'timing: {show: {from: tick, to: shown, bound: "p99 < 1 s over 10 repeats"}}\nquiescence')
    assert rules(BRIDGE, timed) == []
    assert rules(BRIDGE, timed, ("transport: ros2", "transport: ros2\nclock: 100 Hz")) == ["clock-domains"]


def test_a_node_that_hears_and_says_one_name_on_two_domains_is_not_moved() -> None:
    seen = ("nodes:\n", "nodes:\n  Eye: {command: [python3, eye.py], components: []}\n")
    both = (
        "channels:\n",
        "between:\n  seen: {topic: /tick, type: geometry_msgs/PointStamped, from: Sensor, to: Eye}\nchannels:\n",
    )
    assert rules(BRIDGE, seen, both) == ["binding-loop"]
    assert rules(BRIDGE, seen, both, ("to: Eye}", "to: Eye, observe: true}")) == []


def test_a_bridge_without_components_is_run_in_abstract_cases_and_notices_of_it_are_single() -> None:
    bridge = ("nodes:\n", "nodes:\n  Bridge: {command: [python3, bridge.py], components: []}\n")
    binding = bound(BRIDGE, bridge, ("queue: 10, fields: {x: point.x}}\n  shown", "observe: true}\n  shown"))
    plan = apart(binding, {0: "Sensor", 1: "Display"})
    assert [slot.name for slot in plan.slots] == ["Sensor#0", "Display#1", "Bridge"]
    [overheard] = [spoke for spoke in plan.spokes if spoke.overheard]
    assert (overheard.address, overheard.channels) == ("/reading@68", ("reading",))


def test_a_bridge_that_does_what_the_tester_does_is_named() -> None:
    binding = bound(BRIDGE, ("timeout: 120 s", "remap: false"))
    there = {"/reading@68": ["/bridge_68"], "/reading@69": ["/display"], "/tick@68": ["/sensor"]}
    says = {"/reading@68": ["/sensor"], "/shown@69": ["/display"]}
    alone, beside = (
        graph_findings(binding, RegisteredGraph({**says, **more}, there))
        for more in ({}, {"/reading@69": ["/bridge_69"]})
    )
    assert (alone, [one.rule for one in beside]) == ([], ["bridged-twice"])


def test_who_says_the_time_beside_the_tester_is_named() -> None:
    clocks = RegisteredGraph({"/clock@68": ["/gazebo"]})
    led, free = bound(BRIDGE, ("transport: ros2", "transport: ros2\nclock: 100 Hz")), bound(BRIDGE)
    said = [[one.message for one in graph_findings(on, clocks) if one.rule == "clock-twice"] for on in (led, free)]
    assert said == [["the tester says the time on /clock@68, but /gazebo says it, too"], []]
