"""Input models as files: what is written reads back equal."""

from __future__ import annotations

from dataclasses import replace
from importlib.resources import files

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.data import Block, Domain, InputModel, enumeration, parse_input_model, read_input_model, split
from parcours.data.boundaries import at_boundaries
from parcours.data.writing import write_input_model
from parcours.errors import BadRequest

WORDS = st.text("abé \"'\\:#[]{}-0,", min_size=1, max_size=6).filter(lambda text: text == text.strip())


def read_back(model: InputModel) -> InputModel:
    return parse_input_model(write_input_model(model), "m.yaml")


def alike(model: InputModel) -> InputModel:
    constraints = tuple(replace(c, name="") for c in model.constraints)
    return replace(model, source="", repeat=1, constraints=constraints)


@pytest.mark.parametrize(("package", "name"), [("parcours_navigation", "cases"), ("parcours_ramp", "components")])
def test_the_models_of_the_studies_read_back_equal(package: str, name: str) -> None:
    model = read_input_model(str(files(package) / name / "domains.yaml"))
    assert alike(read_back(model)) == alike(model)
    boundaries = at_boundaries(model)
    assert alike(read_back(boundaries)) == alike(boundaries)


@settings(max_examples=60, deadline=None)
@given(
    st.lists(WORDS, min_size=1, max_size=4, unique=True),
    st.lists(st.floats(-1e9, 1e9), min_size=2, max_size=5, unique=True).map(sorted),
    st.sampled_from(["left", "right"]),
    WORDS,
)
def test_any_names_numbers_and_units_read_back_equal(
    values: list[str], edges: list[float], closed: str, unit: str
) -> None:
    numbers = split("x", unit, edges, closed="left" if closed == "left" else "right")
    domains = (
        replace(enumeration("mode", values, doc=unit), bases=(len(values) - 1,)),
        replace(numbers, invalid=(Block(edges[-1] + 1e6, edges[-1] + 2e6),), step=0.5),
        Domain("size", unit, tuple(Block(edge, edge) for edge in edges)),
    )
    model = InputModel("m", domains, source="m.yaml", doc=unit)
    assert read_back(model) == model


def test_vectors_are_written_as_vectors_and_scattered_components_refused() -> None:
    x, y = (split(f"at.{part}", "m", [0, 1, 2]) for part in "xy")
    model = InputModel("m", (x, y), source="m.yaml")
    assert "components: [x, y]" in write_input_model(model) and read_back(model) == model
    with pytest.raises(BadRequest, match="components"):
        write_input_model(InputModel("m", (x, split("v", "m", [0, 1]), y)))
