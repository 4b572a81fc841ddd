"""Signals: what travels outside transitions has a class and formulas, and no part in behaviour."""

from dataclasses import replace

import pytest

from parcours.abtc import abstract_cases
from parcours.model import check_text, parse_model, write_model
from parcours.run.trace import Trace, TraceEvent
from parcours.verdict.conformance import check
from parcours.verdict.contracts import Contracts, plain
from parcours.verdict.judgement import Verdict
from parcours_ramp.components.model import component_model

TEXT = """
parcours: model/1
name: cart
messages:
  Order: {fields: {target: {type: int}}}
  Speed: {fields: {v: {type: real}}}
channels:
  go: {from: environment, to: Cart, message: Order}
signals:
  limit: {from: environment, to: Cart, message: Speed}
  drive: {from: Cart, to: environment, message: Speed, ensures: {allowed: it.v <= received.limit.v}}
components:
  Cart:
    machines:
      m: {initial: idle, transitions: {c1: {from: idle, to: idle, event: go(it)}}}
"""
MODEL = parse_model(TEXT)


def ride(v: object) -> Trace:
    """Return a trace in which the cart is allowed 1 m/s and drives."""
    return Trace("simulated", (
        TraceEvent(0, "receive", "Cart#0", channel="limit", payload={"v": 1.0}),
        TraceEvent(1, "send", "Cart#0", channel="drive", payload={"v": v}),
        TraceEvent(2, "receive", "Cart#0", channel="go", payload={"target": 1}),
        TraceEvent(2, "take", "Cart#0", "c1"),
    ))  # fmt: skip


@pytest.mark.parametrize(
    ("v", "said"), [(1.0, ""), (1.5, "it.v is 1.5, but must be <= received.limit.v is 1"), ("1", "it.v must be real")]
)
def test_a_signal_is_judged_outside_of_transitions(v: object, said: str) -> None:
    violation, _ = Contracts(MODEL).judge(ride(v))
    assert (said in str(violation)) if said else violation is None


def test_conformance_passes_signals_over_but_judges_their_data() -> None:
    assert check(ride(1.0), MODEL, data=plain).judgement.verdict is Verdict.PASS
    assert "drive/allowed" in check(ride(2.0), MODEL, data=plain).judgement.why


def test_a_model_with_signals_reads_back() -> None:
    assert parse_model(write_model(MODEL)) == MODEL
    assert [one.name for one in MODEL.carriers] == ["go", "limit", "drive"]


@pytest.mark.parametrize(
    ("old", "new", "rule"),
    [
        ("event: go(it)", "event: limit(it)", "unknown-channel"),
        ("  limit: {", "  go: {", "duplicate"),
        ("to: Cart, message: Speed}", "to: Cart, message: Sped}", "unknown-message"),
        ("to: environment, message: Speed,", "to: environment, message: Speed, topic: /t,", "unknown-key"),
    ],
)
def test_a_signal_is_checked(old: str, new: str, rule: str) -> None:
    assert old in TEXT
    findings = check_text(TEXT.replace(old, new), "cart.yaml").findings
    assert rule in [one.rule for one in findings], findings


def test_signals_change_no_case() -> None:
    model = component_model()
    assert model.signals
    assert list(abstract_cases(model)) == list(abstract_cases(replace(model, signals=())))
