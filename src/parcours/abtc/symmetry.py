"""One abstract case for each orbit under the exchange of components that are alike.

Components are interchangeable if the model stays the same when two of them change places, together with their
channels: the transposition is an automorphism of the model. Transpositions generate every permutation, so a
class of k such components has k! symmetries, and cases that differ only by one test the same behaviour.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from math import factorial, perm, prod

from parcours.abtc.combining import Combination
from parcours.abtc.interactions import TOGETHER, hub
from parcours.abtc.serialising import AbstractCase
from parcours.model.structure import Cefsm, Component, Transition
from parcours.paths.covering import internal_paths

Key = tuple[object, ...]


def interchangeable(cefsm: Cefsm) -> tuple[tuple[str, ...], ...]:
    """Return the classes of two or more components that are alike, in the order of the file.

    Alike means: the same machines up to the names of states and transitions, the same variables, and channels
    that others treat alike. The test is by structure in the order of the file, so it may miss a likeness
    that is written in another order, but it never finds one that is not there. The hub, whose paths have
    points of their own, is like no other.
    """
    centre, classes = hub(cefsm), list[list[Component]]()
    shapes = {component.name: _shape(component) for component in cefsm.components}
    for component in cefsm.components:
        home = next(
            (
                members
                for members in classes
                if component.name != centre != members[0].name
                and shapes[component.name] == shapes[members[0].name]
                and _may_swap(cefsm, members[0], component)
            ),
            None,
        )
        if home is None:
            classes.append([component])
        else:
            home.append(component)
    return tuple(tuple(member.name for member in members) for members in classes if len(members) > 1)


def representatives(cefsm: Cefsm, cases: Iterable[AbstractCase]) -> Iterator[tuple[AbstractCase, int]]:
    """Yield one case for each orbit, the first one met, and how many different cases the orbit has.

    The orbit is counted in full: all cases that exchanging the names of interchangeable components makes of
    it, also those that were not given. Three alike obstacles have nine start vectors that are in order of
    starting; with the names kept apart they are 37, and the nine already represent them.

    Args:
        cefsm: the model.
        cases: its abstract cases, as `abstract_cases` yields them; they are taken one by one.
    """
    classes = interchangeable(cefsm)
    home = {name: at for at, members in enumerate(classes) for name in members}
    paths = internal_paths(cefsm)
    shape = {path.name: at for found in paths.values() for at, path in enumerate(found)}
    first: dict[Key, Combination] = {}
    for case in cases:
        combination = case.combination
        if combination.interaction.criterion == TOGETHER:
            runs = _runs(case, home, shape)
            if all(_is_sorted(run) for run in runs):
                yield case, _arrangements(runs, classes)
        elif first.setdefault(_key(combination, home, shape), combination) == combination:
            visited = Counter(home[name] for name in {*combination.interaction.components} if name in home)
            yield case, prod(perm(len(classes[at]), count) for at, count in visited.items())


def _shape(component: Component) -> Key:
    # All of a component except the names of its states, transitions and channels.
    roles = {name: at for at, name in enumerate(_channels(component))}
    machines = []
    for machine in component.machines:
        number = {state: at for at, state in enumerate(machine.states)}
        transitions = tuple(
            (number.get(t.source), number.get(t.target), *_label(t, roles)) for t in machine.transitions
        )
        ends = tuple(number.get(state) for state in machine.final)
        bounds = tuple((number.get(state), str(bound)) for state, bound in machine.invariants)
        machines.append((len(number), number.get(machine.initial), ends, bounds, transitions))
    variables = tuple((v.name, v.type, repr(v.initial), v.role, repr(v.domain), v.unit) for v in component.variables)
    return (*machines, variables)


def _label(transition: Transition, role: Mapping[str, object]) -> Key:
    event = transition.event
    return (
        None if event is None else (role.get(event.channel, event.channel), event.name),
        str(transition.guard),
        tuple(map(str, transition.actions)),
        tuple((role.get(send.channel, send.channel), tuple(map(str, send.payload))) for send in transition.sends),
        transition.duration,
        transition.weight,
    )


def _channels(component: Component) -> tuple[str, ...]:
    # In the order of first use.
    used: dict[str, None] = {}
    for transition in component.transitions():
        if transition.event is not None:
            used[transition.event.channel] = None
        used.update(dict.fromkeys(send.channel for send in transition.sends))
    return tuple(used)


def _may_swap(cefsm: Cefsm, one: Component, other: Component) -> bool:
    """Return whether exchanging two components of one shape, and their channels, leaves the model as it is."""
    renamed: dict[str, str] = {}
    for mine, yours in zip(_channels(one), _channels(other), strict=True):
        if renamed.setdefault(mine, yours) != yours or renamed.setdefault(yours, mine) != mine:
            return False
    places = {one.name: other.name, other.name: one.name}
    for channel in cefsm.channels:
        image = cefsm.channel(renamed.get(channel.name, channel.name))
        ends = places.get(channel.sender, channel.sender), places.get(channel.receiver, channel.receiver)
        if (*ends, channel.message, channel.capacity) != (image.sender, image.receiver, image.message, image.capacity):
            return False
    return all(
        Counter(_placed(component, {})) == Counter(_placed(component, renamed))
        for component in cefsm.components
        if component.name not in places
    )


def _placed(component: Component, renamed: Mapping[str, str]) -> Iterator[Key]:
    for machine in component.machines:
        for transition in machine.transitions:
            yield machine.name, transition.source, transition.target, *_label(transition, renamed)


def _key(combination: Combination, home: Mapping[str, int], shape: Mapping[str, int]) -> Key:
    # Members of a class are numbered as they appear: the same for all images under a permutation.
    met: dict[str, tuple[int, int]] = {}
    counts: Counter[int] = Counter()
    for name in combination.interaction.components:
        if name in home and name not in met:
            met[name] = home[name], counts[home[name]]
            counts[home[name]] += 1
    visits = tuple(
        (met.get(name, name), tuple(shape[path.name] for path in paths))
        for name, paths in zip(combination.interaction.components, combination.visits, strict=True)
    )
    return combination.interaction.criterion, visits


Run = list[tuple[int | str, int, bool]]
"""References that start together: (class or name, shape, whether the next run starts at a point of this one)."""


def _runs(case: AbstractCase, home: Mapping[str, int], shape: Mapping[str, int]) -> list[Run]:
    runs: list[Run] = []
    for at, (_, path) in enumerate(case.combination.references):
        if not at or case.start_vector[at] != case.start_vector[at - 1]:
            if runs:
                kind, form, _ = runs[-1][-1]
                runs[-1][-1] = (kind, form, True)
            runs.append([])
        runs[-1].append((home.get(path.component, path.component), shape[path.name], False))
    return runs


def _is_sorted(run: Run) -> bool:
    # References of one class that start together may stand in any order: one order represents all.
    for kind in {kind for kind, _, _ in run}:
        forms = [form for other, form, leads in run if other == kind and not leads]
        if forms != sorted(forms):
            return False
    return True


def _arrangements(runs: list[Run], classes: tuple[tuple[str, ...], ...]) -> int:
    # References that start together and run the same path differ by name only.
    alike = Counter((at, kind, form) for at, run in enumerate(runs) for kind, form, _ in run)
    ways = prod(factorial(len(members)) for members in classes)
    return ways // prod(factorial(count) for (_, kind, _), count in alike.items() if isinstance(kind, int))
