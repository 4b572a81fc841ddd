"""Channels and flat forms become .msg and .srv files, without any ROS; what cannot become one is refused."""

from __future__ import annotations

import re
import socket
import time
from dataclasses import dataclass
from pathlib import Path

import pytest

from parcours.errors import HostFailure
from parcours.model.structure import Cefsm, Channel
from parcours.run.hosts.interfaces import interfaces
from parcours.run.hosts.ros1.interfaces import TYPES, read_index, write_package
from parcours.run.hosts.ros1.master import require_master
from parcours.run.port import Link


@dataclass(frozen=True)
class _Field:
    name: str
    kind: str
    doc: str = ""


_MODEL = Cefsm(
    "m",
    (),
    (
        Channel("ask", "A", "B", "Question", "/path_modification"),
        Channel("reply", "B", "A", "Answer", "/path_modification"),
        Channel("news", "A", "B", "ObstacleList", "/obstacles"),
        Channel("more_news", "A", "C", "ObstacleList", "/more_obstacles"),
    ),
)
_NEWS = (_Field("stamp", "int", "when [ns]"), _Field("states", "floats", "x, y [m]\nv [m/s]"))
_FORMS = {
    "ask": (_Field("operator", "int", "which"),),
    "reply": (_Field("empty", "bool", "1 if it cannot be"), _Field("counts", "ints"), _Field("way", "float", "[m]")),
    "news": _NEWS,
    "more_news": _NEWS,
}


def test_a_topic_becomes_a_message_file_that_says_what_its_fields_mean(tmp_path: Path) -> None:
    write_package(tmp_path, "parcours_ramp", interfaces(_MODEL), _FORMS)
    assert (tmp_path / "msg/ObstacleList.msg").read_text() == (
        "# news: A -> B, on /obstacles\n\n# when [ns]\nint64 stamp\n\n# x, y [m]\n# v [m/s]\nfloat64[] states\n"
    )
    assert sorted(path.name for path in tmp_path.rglob("*.*sg")) == ["ObstacleList.msg"], "one for both channels"


def test_two_ways_of_one_topic_become_a_service_file_request_first_free_of_words_of_cpp(tmp_path: Path) -> None:
    write_package(tmp_path, "parcours_ramp", interfaces(_MODEL), _FORMS)
    text = (tmp_path / "srv/PathModification.srv").read_text()
    fields = [line for line in text.splitlines() if line and not line.startswith("#")]
    assert fields == ["int64 operator_", "---", "bool empty", "int64[] counts", "float64 way"]


def test_the_index_gives_back_what_was_written(tmp_path: Path) -> None:
    channels = interfaces(_MODEL)
    write_package(tmp_path, "parcours_ramp", channels, _FORMS)
    assert read_index(tmp_path) == ("parcours_ramp", channels)


def test_a_link_beside_the_model_becomes_a_topic_of_its_name_and_one_of_the_model_stays() -> None:
    found = interfaces(_MODEL, [Link("cmd_vel", "Control", "World"), Link("news", "A", "World")])
    assert found[:-1] == interfaces(_MODEL)
    assert (found[-1].topic, found[-1].role, found[-1].type) == ("/cmd_vel", "topic", "CmdVel")


def _refusal(folder: Path, forms: dict[str, tuple[_Field, ...]], model: Cefsm = _MODEL, name: str = "p") -> str:
    with pytest.raises(HostFailure, match=r"\[ros1-interface\]$") as caught:
        write_package(folder, name, interfaces(model), forms)
    assert not list(folder.rglob("*")), "nothing is written"
    return str(caught.value)


def test_every_form_that_ros_cannot_carry_is_refused_by_name(tmp_path: Path) -> None:
    told = _refusal(tmp_path, {name: form for name, form in _FORMS.items() if name != "news"})
    assert "channel 'news': must have a flat form" in told
    told = _refusal(tmp_path, {name: form for name, form in _FORMS.items() if name != "reply"})
    assert "channel 'reply': must have a flat form" in told
    told = _refusal(tmp_path, _FORMS | {"more_news": (_Field("stamp", "float"),)})
    assert "msg/ObstacleList.msg: must be one form, but that of 'more_news' differs" in told
    for name in ("a b", "2nd", "_x", "a__b", "x\n---\n", ""):
        assert repr(name) in _refusal(tmp_path, _FORMS | {"ask": (_Field(name, "int"),)})
    assert "named once" in _refusal(tmp_path, _FORMS | {"ask": (_Field("a", "int"), _Field("a", "int"))})
    told = _refusal(tmp_path, _FORMS | {"ask": (_Field("a", "string"),)})
    assert f"one of {', '.join(TYPES)}, but a is 'string'" in told
    assert "lower case" in _refusal(tmp_path, _FORMS, name="Parcours")


def test_a_message_named_as_half_of_a_service_is_refused(tmp_path: Path) -> None:
    model = Cefsm("m", (), (*_MODEL.channels, Channel("x", "A", "B", "PathModificationRequest")))
    assert "also makes a PathModificationRequest" in _refusal(tmp_path, _FORMS | {"x": _NEWS}, model)


def test_a_topic_that_goes_both_ways_belongs_to_two_channels_only() -> None:
    model = Cefsm("m", (), (*_MODEL.channels, Channel("late", "A", "B", "Question", "/path_modification")))
    with pytest.raises(HostFailure, match="shared by ask, reply, late"):
        interfaces(model)


def test_a_folder_without_a_package_is_told(tmp_path: Path) -> None:
    for text in (None, "", "[]", '{"package": "p", "channels": [{"channel": "x"}]}'):
        if text is not None:
            (tmp_path / "channels.json").write_text(text)
        with pytest.raises(HostFailure, match=re.escape(str(tmp_path))):
            read_index(tmp_path)


def test_an_index_whose_names_lead_out_of_its_folder_is_refused(tmp_path: Path) -> None:
    write_package(tmp_path, "parcours_ramp", interfaces(_MODEL), _FORMS)
    index = tmp_path / "channels.json"
    whole = index.read_text()
    for name in ("parcours_ramp", "ObstacleList"):
        index.write_text(whole.replace(f'"{name}"', '"../../OUTSIDE"'))
        with pytest.raises(HostFailure, match="OUTSIDE"):
            read_index(tmp_path)


def _told(uri: str, within: float) -> str:
    began = time.monotonic()
    with pytest.raises(HostFailure) as caught:
        require_master(uri, within)
    assert time.monotonic() - began < within + 2.0
    return str(caught.value)


def test_a_master_that_is_not_there_is_told_with_its_address() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    told = _told(f"http://127.0.0.1:{port}", 0.2)
    assert f"ROS master http://127.0.0.1:{port}: must answer within 0.2 s, but: Connection refused" in told
    assert "roscore" in told and told.endswith("[no-master]")


def test_a_port_that_accepts_and_keeps_silent_is_no_master() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        assert "[no-master]" in _told(f"http://127.0.0.1:{server.getsockname()[1]}", 0.3)


def test_another_server_is_no_master() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        import threading

        def answer() -> None:
            connection, _ = server.accept()
            with connection:
                connection.recv(65_536)
                connection.sendall(b"HTTP/1.0 200 OK\r\n\r\n<html>hello</html>")

        threading.Thread(target=answer, daemon=True).start()
        told = _told(f"http://127.0.0.1:{server.getsockname()[1]}", 0.3)
        assert told.endswith("[no-master]")


def test_addresses_that_cannot_be_read_are_refused_at_once() -> None:
    for uri in ("", "127.0.0.1:11311", "http://127.0.0.1", "http://127.0.0.1:x", "rosrpc://h:1", "http://:11311"):
        assert "[master-uri]" in _told(uri, 0.1)
