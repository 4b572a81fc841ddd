"""How channels are parted, what a live graph lacks, how messages are read: on the bindings under examples/."""

from __future__ import annotations

import ast
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from edited_bindings import bound, edited
from message_classes import defined_types
from parcours.errors import BadRequest
from parcours.model import check_file
from parcours.run.binding import (
    Binding,
    RegisteredGraph,
    arguments,
    check_binding,
    compile_binding,
    graph_findings,
    read_binding,
    remappings,
    routes,
)

EXAMPLES = Path(__file__).parents[2] / "examples"
PYTHON = EXAMPLES / "ros1_python" / "binding.yaml"
CPP = EXAMPLES / "ros1_cpp" / "binding.yaml"
RAMP = EXAMPLES / "ramp_msgs_binding.yaml"

DEFINITIONS = {
    "std_msgs/Header": "uint32 seq\ntime stamp\nstring frame_id",
    "std_msgs/Bool": "bool data",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w",
    "geometry_msgs/Pose": "Point position\nQuaternion orientation",
    "geometry_msgs/PoseStamped": "Header header\nPose pose",
    "geometry_msgs/PoseArray": "Header header\nPose[] poses",
    "geometry_msgs/PoseWithCovariance": "Pose pose\nfloat64[36] covariance",
    "geometry_msgs/Twist": "Vector3 linear\nVector3 angular",
    "geometry_msgs/TwistWithCovariance": "Twist twist\nfloat64[36] covariance",
    "nav_msgs/Odometry": "Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n"
    "geometry_msgs/TwistWithCovariance twist",
    "nav_msgs/Path": "Header header\ngeometry_msgs/PoseStamped[] poses",
    "nav_msgs/GetPlan": "geometry_msgs/PoseStamped start\ngeometry_msgs/PoseStamped goal\nfloat32 tolerance\n"
    "---\nPath plan",
}
TYPES = defined_types(DEFINITIONS)


@pytest.mark.parametrize("path", [PYTHON, CPP, RAMP], ids=lambda path: path.parent.name + "/" + path.name)
def test_the_shipped_bindings_have_nothing_wrong(path: Path) -> None:
    binding, found = check_binding(path.read_text(encoding="utf-8"), str(path))
    assert binding is not None
    assert found == ()


def test_the_model_of_the_examples_has_nothing_wrong() -> None:
    assert check_file(PYTHON.parent / "model.yaml").findings == ()


@pytest.mark.parametrize("path", [PYTHON, CPP])
def test_the_shipped_bindings_fit_the_standard_messages(path: Path) -> None:
    compiled = compile_binding(read_binding(path), TYPES)
    assert set(compiled.writers) == {"detections", "odometry", "goal", "plan_request", "plan_response"}


RAMP_DEFINITIONS = {
    **DEFINITIONS,
    "ramp_msgs/MotionState": "float64[] positions\nfloat64[] velocities",
    "ramp_msgs/KnotPoint": "ramp_msgs/MotionState motionState",
    "ramp_msgs/Path": "ramp_msgs/KnotPoint[] points",
    "ramp_msgs/Circle": "geometry_msgs/Point center\nfloat64 radius",
    "ramp_msgs/CircleGroup": "ramp_msgs/Circle fitCir",
    "ramp_msgs/Obstacle": "ramp_msgs/MotionState ob_ms\nramp_msgs/CircleGroup cirGroup",
    "ramp_msgs/ObstacleList": "ramp_msgs/Obstacle[] obstacles",
    "trajectory_msgs/JointTrajectoryPoint": "float64[] positions\nfloat64[] velocities\nduration time_from_start",
    "trajectory_msgs/JointTrajectory": "trajectory_msgs/JointTrajectoryPoint[] points",
    "ramp_msgs/RampTrajectory": "uint16 id\ntrajectory_msgs/JointTrajectory trajectory\nuint16[] i_knotPoints\n"
    "ramp_msgs/Path holonomic_path\nbool feasible\nfloat64 fitness\nduration t_firstCollision",
    "ramp_msgs/TrajectoryRequest": "ramp_msgs/Path path\nuint8 type\nint8 segments\nfloat64 max_speed_linear\n"
    "float64 max_speed_angular",
    "ramp_msgs/TrajectoryResponse": "ramp_msgs/RampTrajectory trajectory\nbool error",
    "ramp_msgs/EvaluationRequest": "ramp_msgs/RampTrajectory trajectory\nfloat64 robot_radius\nfloat64 currentTheta\n"
    "bool imminent_collision\nbool full_eval",
    "ramp_msgs/EvaluationResponse": "float64 fitness\nbool feasible\nduration t_firstCollision",
    "ramp_msgs/TrajectorySrv": "ramp_msgs/TrajectoryRequest[] reqs\n---\nramp_msgs/TrajectoryResponse[] resps",
    "ramp_msgs/EvaluationSrv": "ramp_msgs/EvaluationRequest[] reqs\n---\nramp_msgs/EvaluationResponse[] resps",
    "ramp_msgs/ModificationRequest": "ramp_msgs/Path[] paths\nstring op\nfloat64 repair_dist\nfloat64 repair_dir\n"
    "---\nramp_msgs/Path[] mod_paths",
}
"""The fields of the published RAMP's messages that its binding names."""


def test_every_service_of_the_published_ramp_is_answered_as_long_as_it_asks() -> None:
    types = defined_types(RAMP_DEFINITIONS)
    compiled = compile_binding(read_binding(RAMP), types)
    assert all(compiled.writers[f"{name}_{half}"] for name in ("trajectory", "evaluation", "modification")
               for half in ("request", "response"))  # fmt: skip
    request: Any = types.create("ramp_msgs/TrajectorySrvRequest")
    for x in (0.5, 1.5, 2.5):
        asked: Any = types.create("ramp_msgs/TrajectoryRequest")
        for step in (0.0, 0.25):
            knot: Any = types.create("ramp_msgs/KnotPoint")
            knot.motionState.positions = [x + step, 0.0, 0.0]
            asked.path.points.append(knot)
        request.reqs.append(asked)
    writer = compiled.writers["trajectory_response"]
    values, items = writer.of_request(request)
    answer: Any = writer.message(values, items)
    ends = [[point.positions[0] for point in one.trajectory.trajectory.points] for one in answer.resps]
    assert ends == [[0.5, 0.75], [1.5, 1.75], [2.5, 2.75]]
    assert [len(one.trajectory.holonomic_path.points) for one in answer.resps] == [2, 2, 2]
    assert answer.resps[0].trajectory.holonomic_path is not request.reqs[0].path


@pytest.mark.parametrize(
    ("given", "instead", "said"),
    [
        ("for each: paths", "for each: roads", "ModificationRequestRequest has no 'roads'"),
        (
            '{for each: paths, set: {"mod_paths[*]": item}}',
            "{set: {'mod_paths[*]': item}}",
            "stands without 'for each'",
        ),
        ("fitness: 1.0", "fitness: item.trajectori.fitness", "did you mean 'trajectory'?"),
        ("fitness: 1.0", "fitness: item.full_eval", "fitness is float64 and 'item.full_eval' is bool"),
    ],
)
def test_what_a_request_does_not_have_is_said_with_its_line(given: str, instead: str, said: str) -> None:
    with pytest.raises(BadRequest) as caught:
        compile_binding(bound(RAMP, (given, instead)), defined_types(RAMP_DEFINITIONS))
    assert said in str(caught.value).replace("\n", " ")


def test_nodes_start_in_an_order_that_can_be() -> None:
    line = "    ros_node: /path_modification\n"
    found = check_binding(edited(RAMP, (line, f"{line}    after: [Planner]\n")), str(RAMP))[1]
    assert ["is in a circle of 'after'" in str(one) for one in found] == [True, True]


def test_the_example_nodes_import_nothing_of_parcours() -> None:
    for path in sorted(PYTHON.parent.glob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        imported = {name.name for node in ast.walk(tree) if isinstance(node, ast.Import) for name in node.names}
        imported |= {str(node.module) for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
        assert {name.partition(".")[0] for name in imported} <= {
            "geometry_msgs", "math", "nav_msgs", "rospy", "std_msgs", "threading",
        }  # fmt: skip


def test_every_message_between_two_nodes_passes_the_tester() -> None:
    binding = read_binding(PYTHON)
    for route in routes(binding):
        if route.sender and route.receiver:
            assert route.access == "relay"
            assert route.out != route.into
            assert route.out.startswith(f"/parcours/out/{'Follower' if route.part != 'topic' else route.sender}/")


def test_receivers_of_one_topic_are_parted_so_that_each_may_wait_alone() -> None:
    moved = remappings(read_binding(PYTHON))
    assert moved["Planner"] == (("/obstacles", "/parcours/in/Planner/obstacles"),)
    assert moved["ObstacleFilter"] == (("/obstacles", "/parcours/out/ObstacleFilter/obstacles"),)
    alone = remappings(read_binding(PYTHON), absent=["Planner"])
    assert "Planner" not in alone
    assert alone["ObstacleFilter"] == (("/obstacles", "/parcours/out/ObstacleFilter/obstacles"),)


def test_a_topic_beside_the_model_can_be_relayed_between_two_nodes() -> None:
    binding = read_binding(RAMP)
    route = next(route for route in routes(binding) if route.channel == "imminent_collision")
    assert (route.access, route.sender, route.receiver) == ("relay", "Planner", "Control")
    assert (route.out, route.into) == ("/parcours/out/Planner/imminent_collision", "/imminent_collision")
    assert "/imminent_collision:=/parcours/out/Planner/imminent_collision" in arguments(binding, "Planner")
    alone = next(r for r in routes(binding, absent=["Control"]) if r.channel == "imminent_collision")
    assert (alone.access, alone.out) == ("collect", "/imminent_collision")
    refused, found = check_binding(edited(RAMP, ("to: Control}", "to: Contrl}")), str(RAMP))
    assert refused is None
    assert "did you mean 'Control'?" in str(found[0])


def test_the_tester_takes_the_ends_of_a_node_that_is_not_run() -> None:
    by_name = {route.channel: route for route in routes(read_binding(PYTHON), absent=["Planner"])}
    request = by_name["plan_request"]
    assert (request.access, request.out, request.into) == ("collect", "/plan", "")
    assert by_name["plan_response"].access == "inject"
    without_client = {route.channel: route for route in routes(read_binding(PYTHON), absent=["Follower"])}
    request = without_client["plan_request"]
    assert (request.access, request.out, request.into) == ("inject", "", "/plan")


def test_arguments_have_the_form_of_the_transport() -> None:
    ros1 = read_binding(PYTHON)
    ros2 = replace(ros1, transport="ros2")
    assert arguments(ros1, "Planner") == ("/obstacles:=/parcours/in/Planner/obstacles",)
    assert arguments(ros2, "Planner") == ("--ros-args", "-r", "/obstacles:=/parcours/in/Planner/obstacles")
    assert arguments(read_binding(RAMP), "PathModification") == ()


CONTROL = '[rosrun, ramp_control, ramp_control, "odometry:=odom", "_simulation:=true", "_orientation:=0.785"]'
RUNNING = (f"command: {CONTROL}", "running: true")


def test_a_node_that_the_user_starts_needs_its_names_parted_by_hand() -> None:
    refused, found = check_binding(edited(RAMP, RUNNING), str(RAMP))
    assert refused is None
    assert ["channel 'update'" in str(one) and one.rule for one in found] == ["binding-separation"]
    accepted = bound(RAMP, RUNNING, ("    topic: /update\n", "    topic: /update\n    out: /control/update\n"))
    route = next(route for route in routes(accepted) if route.channel == "update")
    assert (route.out, route.into) == ("/control/update", "/update")
    overheard = bound(RAMP, RUNNING, ("    topic: /update\n", "    topic: /update\n    observe: true\n"))
    assert next(route for route in routes(overheard) if route.channel == "update").access == "observe"


def test_both_ends_in_one_process_cannot_be_relayed() -> None:
    planner = "  Planner:\n    command: [/usr/bin/python3, avoider.py]\n    ros_node: /avoider\n"
    both = (planner + "  Follower:\n", "  Follower:\n    components: [Planner, Follower]\n")
    refused, found = check_binding(edited(PYTHON, both), str(PYTHON))
    assert refused is None
    assert {one.rule for one in found} == {"binding-inner"}


def test_a_node_that_sends_and_receives_one_topic_is_refused() -> None:
    alike = edited(
        RAMP, ("topic: /bestTrajec", "topic: /update"), ("ramp_msgs/RampTrajectory", "ramp_msgs/MotionState")
    )
    refused, found = check_binding(alike, str(RAMP))
    assert refused is None
    assert {one.rule for one in found} == {"binding-loop"}


def graph(binding: Binding, **changes: dict[str, Any]) -> RegisteredGraph:
    """What is registered when all nodes of the binding are up."""
    publishers: dict[str, list[str]] = {}
    subscribers: dict[str, list[str]] = {}
    servers: dict[str, list[str]] = {}
    types: dict[str, str] = {}
    for route in routes(binding):
        types |= {route.out: route.type, route.into: route.type}
        if route.part == "topic":
            publishers |= {route.out: ["/a"]} if route.out else {}
            subscribers |= {route.into: ["/b"]} if route.into else {}
        elif route.into:
            servers[route.into] = ["/c"]
    tables: dict[str, Any] = {"publishers": publishers, "subscribers": subscribers, "servers": servers, "types": types}
    for name, change in changes.items():
        tables[name] = {**tables[name], **change}
    return RegisteredGraph(**tables)


@pytest.mark.parametrize("path", [PYTHON, RAMP])
def test_a_complete_graph_lacks_nothing(path: Path) -> None:
    binding = read_binding(path)
    assert graph_findings(binding, graph(binding)) == []


@pytest.mark.parametrize(
    ("changes", "channel", "said"),
    [
        ({"publishers": {"/cmd_vel": [], "/cmd_vell": ["/a"]}}, "command", "did you mean '/cmd_vell'?"),
        ({"servers": {"/plan": []}}, "plan_request", "needs a node that serves /plan, but none does"),
        ({"subscribers": {"/odom": []}}, "odometry", "needs a node that subscribes to /odom"),
        ({"types": {"/cmd_vel": "a/B"}}, "command", "bound as geometry_msgs/Twist, but /a publishes /cmd_vel as a/B"),
        (
            {"publishers": {"/parcours/out/ObstacleFilter/obstacles": [], "/obstacles": ["/a"]}},
            "obstacles",
            "the node does not obey the remapping: /obstacles is there under its own name",
        ),
    ],
)
def test_what_a_graph_lacks_is_said_with_the_line_of_its_channel(
    changes: dict[str, dict[str, Any]], channel: str, said: str
) -> None:
    binding = read_binding(PYTHON)
    found = graph_findings(binding, graph(binding, **changes))
    assert said in str(found[0])
    assert found[0].line == binding.channel(channel).line > 0


def test_messages_become_the_models() -> None:
    fields = compile_binding(read_binding(PYTHON), TYPES).fields["plan_request"]
    request: Any = TYPES.create("nav_msgs/GetPlanRequest")
    request.start.pose.position.x, request.goal.pose.position.y = 0.5, 2.0
    read = {name: reading.value({"plan_request": request}) for name, reading in fields.items()}
    assert read == {"start_x": 0.5, "start_y": 0.0, "goal_x": 0.0, "goal_y": 2.0}
