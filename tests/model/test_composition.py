"""Classic systems have the state spaces they are known for, and faults planted in them are found with a witness."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np
import pytest

from parcours.errors import BadRequest
from parcours.model import Cefsm, Configuration, enabled, parse_model, step
from parcours.model.composition import Space, explore


def model(name: str, channels: str, components: str, messages: str = "  T: {fields: {}}") -> Cefsm:
    head = f"parcours: model/1\nname: {name}\nmessages:\n{messages}\n"
    return parse_model(f"{head}{f'channels:{channels}' if channels else ''}\ncomponents:{components}\n", name)


def philosophers(count: int) -> Cefsm:
    """Each takes the left fork, then the right one, and lays them down in that order; forks are rendezvous."""
    channels = components = ""
    for n in range(count):
        channels += f"\n  l{n}: {{from: P{n}, to: F{n}, message: T, capacity: 0}}"
        channels += f"\n  r{n}: {{from: P{(n - 1) % count}, to: F{n}, message: T, capacity: 0}}"
        components += f"""
  P{n}: {{machines: {{m: {{initial: thinks, transitions: {{
    p{n}1: {{from: thinks, to: waits, message: l{n}}}, p{n}2: {{from: waits, to: eats, message: r{(n + 1) % count}}},
    p{n}3: {{from: eats, to: leaves, message: l{n}}},
    p{n}4: {{from: leaves, to: thinks, message: r{(n + 1) % count}}}}}}}}}}}
  F{n}: {{machines: {{m: {{initial: free, transitions: {{
    f{n}1: {{from: free, to: left, event: l{n}}}, f{n}2: {{from: left, to: free, event: l{n}}},
    f{n}3: {{from: free, to: right, event: r{n}}}, f{n}4: {{from: right, to: free, event: r{n}}}}}}}}}}}"""
    return model("philosophers", channels, components)


def kinds(space: Space) -> set[str]:
    return {each.kind for each in space.findings}


def replayed(space: Space, state: int | None) -> Configuration:
    """Where the witness leads, each of its moves being enabled where it is taken."""
    assert state is not None
    here = space.configuration(0)
    for move in space.path_to(state):
        assert move in enabled(space.cefsm, here)
        here = step(space.cefsm, here, move)
    return here


def search(start: tuple[object, ...], after: Callable[..., Iterable[tuple[object, ...]]]) -> tuple[int, int]:
    """How many states and moves a system has that is written down as a function from a state to the next ones."""
    seen, waiting, moves = {start}, [start], 0
    while waiting:
        for there in after(*waiting.pop()):
            moves += 1
            if there not in seen:
                seen.add(there)
                waiting.append(there)
    return len(seen), moves


@pytest.mark.parametrize("count", [3, 4, 5, 7])
def test_philosophers_have_their_number_of_states_and_one_deadlock(count: int) -> None:
    # A philosopher thinks, has the left fork, both, or the right one; a fork is in one hand. Neighbours (a, b) may
    # not both hold the fork between them: trace(T^n) of these pairs, less the one where all hold the right fork only.
    allowed = np.array([[not (a in (2, 3) and b in (1, 2)) for b in range(4)] for a in range(4)], dtype=int)
    space = explore(philosophers(count))
    assert space.complete and space.n_states == np.trace(np.linalg.matrix_power(allowed, count)) - 1 == 3**count - 1
    (deadlock,) = space.findings
    assert (deadlock.kind, deadlock.severity, deadlock.count) == ("deadlock", "error", 1)
    assert sorted(move.transition for move in space.path_to(deadlock.state or 0)) == [f"p{n}1" for n in range(count)]
    end = replayed(space, deadlock.state)
    assert set(end.states) == {"waits", "left"} and enabled(space.cefsm, end) == ()


@pytest.mark.parametrize("count", [2, 3, 8])
def test_forks_may_as_well_be_variables_of_one_component(count: int) -> None:
    forks = ", ".join(f"f{n}: {{type: bool, initial: true}}" for n in range(count))
    text = f"\n  Table:\n    variables: {{{forks}}}\n    machines:"
    for n in range(count):
        right = f"f{(n + 1) % count}"
        text += f"""
      m{n}: {{initial: thinks, transitions: {{
        p{n}1: {{from: thinks, to: waits, guard: f{n}, action: f{n} := false}},
        p{n}2: {{from: waits, to: eats, guard: {right}, action: {right} := false}},
        p{n}3: {{from: eats, to: leaves, action: f{n} := true}},
        p{n}4: {{from: leaves, to: thinks, action: {right} := true}}}}}}"""
    space = explore(model("table", "", text))
    assert space.n_states == 3**count - 1
    assert [(each.kind, len(space.path_to(each.state or 0))) for each in space.findings] == [("deadlock", count)]


def test_a_philosopher_who_takes_the_right_fork_first_saves_them() -> None:
    table = philosophers(4)
    first, *others = table.components
    (machine,) = first.machines
    p1, p2, *down = machine.transitions
    turned = (replace(p1, sends=p2.sends), replace(p2, sends=p1.sends), *down)
    first = replace(first, machines=(replace(machine, transitions=turned),))
    assert explore(replace(table, components=(first, *others))).findings == ()


def test_a_two_phase_handshake_goes_round() -> None:
    channels = "\n  req: {from: A, to: B, message: T, capacity: 0}\n  ack: {from: B, to: A, message: T, capacity: 0}"
    space = explore(model("handshake", channels, """
  A: {machines: {m: {initial: idle, transitions: {
    a1: {from: idle, to: waits, message: req}, a2: {from: waits, to: idle, event: ack}}}}}
  B: {machines: {m: {initial: idle, transitions: {
    b1: {from: idle, to: busy, event: req}, b2: {from: busy, to: idle, message: ack}}}}}"""))  # fmt: skip
    assert (space.n_states, space.n_transitions, space.findings) == (2, 2, ())
    assert [str(move) for move in space.moves] == ["a1+b1", "b2+a2"]


ALTERNATING = """
  Sender:
    variables: {bit: {type: bool, initial: false}}
    machines:
      m:
        initial: ready
        transitions:
          s1: {from: ready, to: sent, message: data(bit)}
          s2: {from: sent, to: sent, message: data(bit)}
          s3: {from: sent, to: ready, event: ack(a), guard: a.bit == bit, action: bit := !bit}
          s4: {from: sent, to: sent, event: ack(a), guard: a.bit != bit}
          s5: {from: ready, to: ready, event: ack(a)}
  Receiver:
    variables: {want: {type: bool, initial: false}}
    machines:
      m:
        initial: waits
        transitions:
          r1: {from: waits, to: waits, event: data(d), guard: d.bit == want, action: want := !want, message: ack(d.bit)}
          r2: {from: waits, to: waits, event: data(d), guard: d.bit != want, message: ack(d.bit)}
"""


def alternating_bit(size: int) -> tuple[int, int]:
    """The same protocol, written down once more as a function."""

    def after(
        phase: str, bit: bool, want: bool, data: tuple[bool, ...], acks: tuple[bool, ...]
    ) -> Iterable[tuple[object, ...]]:
        if len(data) < size:
            yield "sent", bit, want, (*data, bit), acks
        if acks and phase == "sent" and acks[0] == bit:
            yield "ready", not bit, want, data, acks[1:]
        elif acks:
            yield phase, bit, want, data, acks[1:]
        if data and len(acks) < size:
            yield phase, bit, (not want if data[0] == want else want), data[1:], (*acks, data[0])

    return search(("ready", False, False, (), ()), after)


@pytest.mark.parametrize("size", [1, 2, 3])
def test_the_alternating_bit_protocol_has_the_states_of_its_definition(size: int) -> None:
    channels = f"""
  data: {{from: Sender, to: Receiver, message: Bit, capacity: {size}}}
  ack: {{from: Receiver, to: Sender, message: Bit, capacity: {size}}}"""
    space = explore(model("alternating", channels, ALTERNATING, "  Bit: {fields: {bit: {type: bool}}}"))
    assert (space.n_states, space.n_transitions) == alternating_bit(size)
    assert kinds(space) <= {"full-queue"}


PETERSON = """
  Both:
    variables:
      turn: {type: int, initial: 0, range: [0, 1]}
      want0: {type: bool, initial: false}
      want1: {type: bool, initial: false}
    machines:"""


def test_petersons_machines_are_never_critical_together_and_two_naive_ones_are() -> None:
    peterson, naive = PETERSON, PETERSON
    for me, other in ((0, 1), (1, 0)):
        head = f"\n      m{me}:\n        initial: rests\n        transitions:"
        peterson += (
            head
            + f"""
          w{me}: {{from: rests, to: wants, action: want{me} := true}}
          t{me}: {{from: wants, to: waits, action: turn := {other}}}
          c{me}: {{from: waits, to: critical, guard: "!want{other} || turn == {me}"}}
          e{me}: {{from: critical, to: rests, action: want{me} := false}}"""
        )
        naive += (
            head
            + f"""
          w{me}: {{from: rests, to: waits, guard: "!want{other}"}}
          c{me}: {{from: waits, to: critical, action: want{me} := true}}
          e{me}: {{from: critical, to: rests, action: want{me} := false}}"""
        )

    def after(*here: object) -> Iterable[tuple[object, ...]]:
        turn, at, want = here[0], list(here[1:3]), list(here[3:5])
        for me in (0, 1):
            there, wish, side = at.copy(), want.copy(), turn
            match at[me]:
                case "rests":
                    there[me], wish[me] = "wants", True
                case "wants":
                    there[me], side = "waits", 1 - me
                case "waits" if not want[1 - me] or turn == me:
                    there[me] = "critical"
                case "critical":
                    there[me], wish[me] = "rests", False
                case _:
                    continue
            yield side, *there, *wish

    safe, unsafe = explore(model("peterson", "", peterson)), explore(model("naive", "", naive))
    assert (safe.n_states, safe.n_transitions) == search((0, "rests", "rests", False, False), after)
    assert all(safe.configuration(n).states != ("critical", "critical") for n in range(safe.n_states))
    assert safe.findings == ()
    both = [n for n in range(unsafe.n_states) if unsafe.configuration(n).states == ("critical", "critical")]
    assert replayed(unsafe, both[0]).values == (0, True, True) and len(unsafe.path_to(both[0])) == 4


def pairs(count: int, capacity: int) -> Cefsm:
    """Producers that send without end to consumers of their own."""
    channels = components = ""
    for n in range(count):
        channels += f"\n  q{n}: {{from: A{n}, to: B{n}, message: T, capacity: {capacity}}}"
        components += (
            f"\n  A{n}: {{machines: {{m: {{initial: s, transitions: {{a{n}: {{from: s, to: s, message: q{n}}}}}}}}}}}"
        )
        components += (
            f"\n  B{n}: {{machines: {{m: {{initial: s, transitions: {{b{n}: {{from: s, to: s, event: q{n}}}}}}}}}}}"
        )
    return model("pairs", channels, components)


@pytest.mark.parametrize(("count", "capacity"), [(1, 1), (2, 3), (3, 4)])
def test_independent_queues_multiply(count: int, capacity: int) -> None:
    space = explore(pairs(count, capacity))
    assert space.n_states == (capacity + 1) ** count
    assert space.n_transitions == 2 * count * capacity * (capacity + 1) ** (count - 1)
    assert [len(space.path_to(each.state or 0)) for each in space.findings] == [capacity] * count
    assert kinds(space) == {"full-queue"}


def test_a_message_that_nobody_will_take_is_found_where_it_is_first_lost() -> None:
    channels = "\n  ab: {from: A, to: B, message: N, capacity: 2}\n  go: {from: environment, to: B, message: T}"
    space = explore(model("lost", channels, """
  A: {machines: {m: {initial: one, transitions: {
    a1: {from: one, to: two, message: ab(1)}, a2: {from: two, to: three, message: ab(2)}}}}}
  B: {machines: {m: {initial: waits, transitions: {
    b1: {from: waits, to: ready, event: go}, b2: {from: ready, to: done, event: ab(m), guard: m.k == 1}}}}}""",
        "  T: {fields: {}}\n  N: {fields: {k: {type: int}}}"))  # fmt: skip
    (lost,) = [each for each in space.findings if each.kind == "unspecified-reception"]
    assert "ab (k = 2)" in lost.message and "m in done" in lost.message
    assert replayed(space, lost.state).queues == (((("k", 2),),),)
    assert "deadlock" in kinds(space) and "rest" not in kinds(space)
    # While the first message waits for b1, nothing is wrong yet.
    waiting = [n for n in range(space.n_states) if space.configuration(n).states == ("two", "waits")]
    assert lost.state not in waiting and lost.count == 1


def test_machines_that_wait_for_room_in_each_others_queues_are_told_from_a_missing_reception() -> None:
    channels = "\n  ab: {from: A, to: B, message: T}\n  ba: {from: B, to: A, message: T}"
    space = explore(model("embrace", channels, """
  A: {machines: {m: {initial: s, transitions: {
    a1: {from: s, to: t, message: ab}, a2: {from: t, to: t, event: ba, message: ab}}}}}
  B: {machines: {m: {initial: s, transitions: {
    b1: {from: s, to: t, message: ba}, b2: {from: t, to: t, event: ab, message: ba}}}}}"""))  # fmt: skip
    assert kinds(space) == {"deadlock", "blocked-reception", "full-queue", "dead-transition"}
    for each in space.findings:
        if each.kind != "dead-transition":
            assert replayed(space, each.state) == space.configuration(each.state or 0)


def test_rest_is_no_deadlock() -> None:
    text = """
  A:
    variables: {n: {type: int, initial: 0}}
    machines: {m: {initial: s, FINAL transitions: {a1: {from: s, to: t}, a2: {from: t, to: u, guard: 'n > 0'}}}}"""
    stuck = explore(model("stuck", "", text.replace("FINAL", "")))
    meant = explore(model("meant", "", text.replace("FINAL", "final: [t],")))
    assert "deadlock" in kinds(stuck) and "rest" not in kinds(stuck)
    assert "rest" in kinds(meant) and "deadlock" not in kinds(meant)
    assert meant.rests() == [1]


def test_what_never_happens_is_named_but_only_if_everything_was_seen() -> None:
    text = """
  A:
    variables: {n: {type: int, initial: 0, range: [0, 5]}}
    machines:
      m:
        initial: s
        transitions:
          up: {from: s, to: s, guard: n < 5, action: n := n + 1}
          down: {from: s, to: s, guard: n > 0, action: n := n - 1}
          never: {from: s, to: lost, guard: n > 5}
          beyond: {from: lost, to: s}"""
    whole, part = explore(model("dead", "", text)), explore(model("dead", "", text), max_states=3)
    assert [each.message for each in whole.findings] == ["no run leads to state lost of A.m", "no run takes never of A"]
    assert part.findings == () and not part.complete
    assert part.stopped == "stopped at the bound of 3 states: 3 states known, 1 of them not expanded"


def test_a_bound_that_is_just_enough_is_enough() -> None:
    needed = explore(philosophers(3)).n_states
    assert explore(philosophers(3), max_states=needed).complete
    short = explore(philosophers(3), max_states=needed - 1)
    assert not short.complete and short.n_states <= needed - 1
    assert np.all(short.targets < short.n_states) and len(short.sources) == short.n_transitions


@pytest.mark.parametrize(("bounds"), [{"max_states": 0}, {"max_states": 2**40}])
def test_bounds_out_of_range_are_refused(bounds: dict[str, int]) -> None:
    with pytest.raises(BadRequest, match="explore-bound"):
        explore(pairs(1, 1), **bounds)  # type: ignore[arg-type]


def test_a_fault_of_the_model_is_a_finding_with_its_witness_and_no_crash() -> None:
    text = """
  A:
    variables: {n: {type: int, initial: 0, range: [0, 3]}}
    machines:
      m: {initial: s, transitions: {up: {from: s, to: s, action: n := n + 1}}}
      w: {initial: s, transitions: {half: {from: s, to: t, guard: 6 / (2 - n) > 5}}}"""
    space = explore(model("fault", "", text))
    faults = [each for each in space.findings if each.kind == "model-fault"]
    assert ["division-by-zero" in each.message for each in faults] == [True, False]
    here = replayed(space, faults[0].state)
    assert here.values == (2,)
    with pytest.raises(Exception, match="division-by-zero"):
        enabled(space.cefsm, here)
    alone = explore(model("fault", "", text.rpartition("\n      w:")[0]))
    (fault,) = alone.findings
    assert fault.move is not None and "out-of-range" in fault.message and len(alone.path_to(fault.state or 0)) == 3
    with pytest.raises(Exception, match="out-of-range"):
        step(alone.cefsm, replayed(alone, fault.state), fault.move)


def test_an_unknown_state_is_refused_and_progress_is_told() -> None:
    told: list[tuple[str, int, int]] = []
    space = explore(philosophers(7), max_states=5000, progress=lambda *said: told.append(said))
    assert told[0] == ("states", 1, 5000) and told[-1][1] > 1000
    with pytest.raises(BadRequest, match="unknown-configuration"):
        space.path_to(space.n_states)
