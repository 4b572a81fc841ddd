"""The frame of the formats: which one a file has, what is refused before it is read, and the command that converts."""

from __future__ import annotations

import json
import time
from pathlib import Path

import pytest
from click.testing import CliRunner

from parcours.cli import parcours
from parcours.cli.convert import command
from parcours.errors import BadModel, BadRequest
from parcours.model import model_file, parse_model, read_model
from parcours.model.formats import format_of, formats, read_any, write_as
from parcours_formats.xml_lines import parse_xml

SEEDS = Path(__file__).parents[1] / "fuzz" / "seeds"
ROOTS = {"uppaal": "gate.xml", "scxml": "player.scxml"}


@pytest.mark.parametrize("name", ROOTS)
def test_an_xml_file_is_told_by_its_root(name: str, tmp_path: Path) -> None:
    file = tmp_path / "any.xml"
    file.write_text("\ufeff<!-- a comment -->\n" + (SEEDS / ROOTS[name]).read_text().partition("?>")[2], "utf-8")
    assert read_any(file).cefsm.components == read_any(SEEDS / ROOTS[name], name).cefsm.components


def test_graphml_is_told_from_the_others(tmp_path: Path) -> None:
    file = tmp_path / "any.xml"
    file.write_text(write_as(read_model(SEEDS / "lift.yaml"), "graphml").text)
    assert read_any(file).cefsm.components


@pytest.mark.parametrize(
    ("name", "text", "slug"),
    [
        ("a.xml", "<html/>", "format"),
        ("a.xml", "nothing", "format"),
        ("a.png", "", "unknown-format"),
        ("a.puml", "@startuml", "unknown-format"),
        ("a.scxml", "<scxml", "xml-syntax"),
        ("a.scxml", "<nta/>", "format"),
        ("a.scxml", "<scxml>\x00</scxml>", "xml-syntax"),
    ],
)
def test_a_file_of_no_format_is_refused(name: str, text: str, slug: str, tmp_path: Path) -> None:
    file = tmp_path / name
    file.write_text(text)
    with pytest.raises((BadModel, BadRequest), match=rf"{name}.*\[{slug}\]"):
        read_any(file)


SISMIC = """\
# A microwave, as sismic writes it.
statechart:
  name: microwave
  preamble: power = 0
  root state:
    name: controller
    initial: closed
    states:
      - name: closed
        transitions: [{target: opened, event: door_opened, guard: power > 0}]
      - name: opened
"""


def test_a_sismic_statechart_is_called_one(tmp_path: Path) -> None:
    file = tmp_path / "microwave.yaml"
    file.write_text(SISMIC)
    for reader in (read_any, read_model):
        with pytest.raises(BadModel) as caught:
            reader(file)
        assert caught.value.slug == "sismic-statechart"
        assert str(caught.value) == (
            f"{file}:2: a model has the key 'parcours', but 'statechart' makes this a sismic statechart, "
            "which is not read; write it as SCXML, or in the format of docs/model-format.md [sismic-statechart]"
        )
    file.write_text("parcours: model/1\n" + SISMIC)
    with pytest.raises(BadModel, match="a model has no key 'statechart'"):
        read_model(file)


@pytest.mark.parametrize("name", [name for name, each in formats().items() if each.reads])
def test_a_hundred_megabytes_are_refused_before_they_are_read(name: str, tmp_path: Path) -> None:
    file = tmp_path / f"large{formats()[name].suffixes[0]}"
    with file.open("wb") as handle:
        handle.truncate(100_000_000)
    began = time.process_time()
    with pytest.raises(BadModel, match="file-size"):
        read_any(file, name)
    assert time.process_time() - began < 0.5


@pytest.mark.parametrize(
    ("encoding", "declared"), [("utf-16", "utf-16"), ("latin-1", "ISO-8859-1"), ("utf-8-sig", "utf-8")]
)
def test_xml_says_its_encoding(encoding: str, declared: str, tmp_path: Path) -> None:
    file = tmp_path / "umlaut.scxml"
    text = f'<?xml version="1.0" encoding="{declared}"?><scxml><state id="für"/></scxml>'
    file.write_bytes(text.encode(encoding))
    assert read_any(file).cefsm.components[0].machines[0].states == ("für",)


def test_text_in_another_encoding_than_it_says_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "umlaut.scxml"
    file.write_bytes('<scxml><state id="für"/></scxml>'.encode("latin-1"))
    with pytest.raises(BadModel, match="encoding"):
        read_any(file)


BOMB = "<!DOCTYPE a [<!ENTITY a0 'ha'>" + "".join(f"<!ENTITY a{n} '{f'&a{n - 1};' * 10}'>" for n in range(1, 10)) + "]>"


@pytest.mark.parametrize(
    ("text", "slug"),
    [
        (BOMB + "<a>&a9;</a>", "xml-entity"),
        ("<!DOCTYPE a [<!ENTITY b SYSTEM 'file:///etc/hostname'>]><a>&b;</a>", "xml-entity"),
        ("<!DOCTYPE a [<!ENTITY % b SYSTEM 'file:///etc/hostname'> %b;]><a/>", "xml-entity"),
        ("<!DOCTYPE a SYSTEM 'file:///etc/hostname'><a>&b;</a>", "xml-entity"),
        ("<a>" * 100_000, "xml-size"),
        ("<a><b></a></b>", "xml-syntax"),
        ("", "xml-syntax"),
        ("<a>\ud800</a>", "encoding"),
        ("<a/>" * 2, "xml-syntax"),
    ],
)
def test_hostile_xml_is_one_error_at_once(text: str, slug: str) -> None:
    began = time.process_time()
    with pytest.raises(BadModel, match=rf"^here(:[0-9]+)?: .*\[{slug}\]"):
        parse_xml(text, "here")
    assert time.process_time() - began < 1


def test_a_document_type_is_named_and_not_fetched() -> None:
    root = parse_xml(
        "<!DOCTYPE nta SYSTEM 'http://nowhere.invalid/flat.dtd'>\n<x:nta y:at='1'>a<b/>\nc</x:nta>", "here"
    )
    assert (root.tag, root.prefix, root.get("at"), root.text, root.line) == ("nta", "x", "1", "a\nc", 2)


@pytest.mark.parametrize("name", [name for name in formats() if name not in ("aut", "native")])
def test_every_format_names_what_it_loses_of_a_rich_model(name: str) -> None:
    writing = write_as(read_model(SEEDS / "lift.yaml"), name)
    assert writing.text and writing.losses and all(loss.what and loss.where for loss in writing.losses)


@pytest.mark.parametrize(
    "text", ["", "a: [", "name: m", "{parcours: model/1, name: m, components: {A: {machines: {}}}}"]
)
def test_our_own_format_complains_as_it_does_elsewhere(text: str) -> None:
    with pytest.raises(BadModel) as here:
        model_file.read(text, "m.yaml")
    with pytest.raises(BadModel) as there:
        parse_model(text, "m.yaml")
    assert str(here.value) == str(there.value)


def test_new_files_have_the_first_format_of_their_suffix() -> None:
    assert [format_of(Path(f"new{each.suffixes[0]}")) for each in formats().values()] == list(formats())


def test_convert_writes_the_file_and_says_what_is_lost(tmp_path: Path) -> None:
    out = tmp_path / "new" / "gate.yaml"
    result = CliRunner().invoke(command, [str(SEEDS / "gate.xml"), str(out)], catch_exceptions=False)
    assert result.exit_code == 0 and "line 46: location 'id6' of 'Keeper': is committed" in result.output
    assert result.output.rstrip().endswith("losses")
    assert read_any(out).cefsm.components == read_any(SEEDS / "gate.xml").cefsm.components


LOSSY = """<scxml name="lamp"><state id="off"><transition event="press" target="on"><log/></transition></state>
<state id="on"/></scxml>"""


@pytest.mark.parametrize("arguments", ["feasible", "walk --until steps>=1", "abtc --dropped", "model show", "explore"])
def test_every_command_that_reads_a_model_says_what_it_does_not_keep(arguments: str, tmp_path: Path) -> None:
    file = tmp_path / "lamp.scxml"
    file.write_text(LOSSY)
    done = CliRunner().invoke(parcours, [*arguments.split(), str(file)])
    assert "not kept: line 1: <log>: log is left out" in done.stderr


def test_convert_prints_json(tmp_path: Path) -> None:
    arguments = [str(SEEDS / "lift.yaml"), str(tmp_path / "lift"), "--to", "dot", "--json"]
    said = json.loads(CliRunner().invoke(command, arguments, catch_exceptions=False).output)
    assert said["format"] == "dot" and {"file", "line", "where", "what"} == set(said["losses"][0])


def test_convert_leaves_the_old_file_when_the_new_one_cannot_be_made(tmp_path: Path) -> None:
    out = tmp_path / "old.aut"
    out.write_text("kept")
    with pytest.raises(BadRequest):
        CliRunner().invoke(command, [str(SEEDS / "lift.yaml"), str(out)], catch_exceptions=False)
    assert out.read_text() == "kept" and [file.name for file in tmp_path.iterdir()] == ["old.aut"]
