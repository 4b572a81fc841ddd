"""Drafts of a graph: what is written is a binding of the model that is written beside it, and fits that graph."""

from __future__ import annotations

from pathlib import Path

from message_classes import defined_types
from parcours.model import check_text
from parcours.run.binding import RegisteredGraph, check_binding, graph_findings
from parcours.run.binding.drafting import draft
from parcours.run.binding.graph import Quality

TYPES = defined_types({
    "std_msgs/Bool": "bool data",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Twist": "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular",
    "demo_msgs/Bool": "int32 data\nint32[] more\nstring name",
    "std_srvs/EmptyRequest": "",
    "demo_msgs/Go_SendGoalRequest": "demo_msgs/Bool goal_id\ndemo_msgs/Bool goal",
})  # fmt: skip
GRAPH = RegisteredGraph(
    publishers={"/rosout": ["/a"], "/cmd_vel": ["/left/pilot"], "/seen": ["/eyes"], "/what": ["/eyes"],
                "/both": ["/eyes", "/left/pilot"], "/go/_action/feedback": ["/left/pilot"]},
    subscribers={"/cmd_vel": ["/left/pilot", "/wheels"], "/seen": ["/left/pilot", "/right/pilot"], "/odom": ["/wheels"],
                 "/both": ["/wheels"]},
    servers={"/stop": ["/wheels"], "/clear": ["/wheels"], "/wheels/get_parameters": ["/wheels"],
             "/go/_action/send_goal": ["/left/pilot"],
             "/go/_action/cancel_goal": ["/left/pilot"], "/go/_action/get_result": ["/left/pilot"]},
    types={"/rosout": "std_msgs/Bool", "/cmd_vel": "geometry_msgs/Twist", "/seen": "std_msgs/Bool", "/what": "*",
           "/odom": "demo_msgs/Bool", "/stop": "std_srvs/Nothing", "/clear": "std_srvs/Empty",
           "/go/_action/send_goal": "demo_msgs/Go_SendGoal",
           "/both": "std_msgs/Bool", "/go/_action/get_result": "demo_msgs/Go_GetResult",
           "/go/_action/cancel_goal": "action_msgs/CancelGoal", "/go/_action/feedback": "demo_msgs/Go_FeedbackMessage"},
    offered={"/seen": {"/eyes": Quality(reliable=False, latched=True)}},
)  # fmt: skip


def test_a_draft_is_a_binding_of_its_model_and_has_all_that_runs(tmp_path: Path) -> None:
    made = draft(GRAPH, TYPES, "ros2", "mine")
    assert not [one for one in check_text(made.model, "model.yaml").findings if one.severity == "error"]
    (tmp_path / "model.yaml").write_text(made.model)
    binding, found = check_binding(made.binding, str(tmp_path / "binding.yaml"))
    assert binding is not None and not found, found
    assert graph_findings(binding, GRAPH) == []
    ends = {channel.name: binding.ends(channel.name) for channel in binding.channels}
    assert ends == {
        "both": ("Eyes", "Wheels"), "cmd_vel": ("LeftPilot", "Wheels"), "odom": ("environment", "Wheels"),
        "seen": ("Eyes", "LeftPilot"), "seen_2": ("Eyes", "RightPilot"), "clear_request": ("environment", "Wheels"),
        "clear_response": ("Wheels", "environment"), "go_goal": ("environment", "LeftPilot"),
        "go_feedback": ("LeftPilot", "environment"), "go_result": ("LeftPilot", "environment"),
        "go_cancel": ("environment", "LeftPilot"),
    }  # fmt: skip
    seen, goal = binding.channel("seen"), binding.channel("go_goal")
    assert (seen.latch, seen.observe, goal.action, goal.type) == (True, True, "goal", "demo_msgs/Go_SendGoal")
    assert [name for name, _ in binding.channel("cmd_vel").fields][:2] == ["linear_x", "linear_y"]
    assert [(name, str(formula)) for name, formula in goal.fields] == [("data", "goal.data")]
    assert [message.name for message in binding.model.messages if "Bool" in message.name] == ["Bool", "DemoMsgsBool"]
    assert "# /eyes offers best effort, transient local" in made.binding
    assert made.notes == (
        "/both is bound as of Eyes alone: what LeftPilot publishes is not told apart",
        "/what was left out: its type * is not known here, see --interfaces",
        "/stop was left out: its type std_srvs/Nothing is not known here, see --interfaces",
    )
