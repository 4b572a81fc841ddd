"""What the tester may choose where a model leaves values open, so that a transition can be taken."""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Collection, Iterator, Mapping, Sequence
from math import prod

from parcours.model.candidates import is_linear, is_plain, likely, may_hold
from parcours.model.configuration import Configuration, Layout, Message, TransitionSite
from parcours.model.expression import Binary, Expression, evaluate
from parcours.model.solutions import EFFORT, Question, Values, comparisons, hold, with_terms

_CACHED = 100_000


class Choices:
    """The choices at each transition of one model, remembered by the values that they depend on.

    Attributes:
        layout: the tables of the model.
        doubts: for each transition where a choice was asked for that leaves out some that may lead on differently, why.
    """

    def __init__(self, layout: Layout) -> None:
        self.layout = layout
        self.doubts: dict[str, str] = {}
        self._remembered: dict[object, tuple[Values, ...]] = {}

    def of(
        self, configuration: Configuration, site: TransitionSite, arrived: Message, given: Mapping[str, object]
    ) -> tuple[Values, ...]:
        """Return the choices under which the transition can be taken, one for each different effect.

        Fields of the message `arrived` that are not said are open; `given` are choices already made, by term.

        Raises:
            BadModel: a guard that reads nothing open has no value.
        """
        if site.transition.guard is None and not site.assigned and not site.contents:
            return ((),)
        read = tuple(configuration.values[at] for _, at in site.reads)
        key = (site.transition.id, read, arrived, tuple(sorted(given.items(), key=lambda pair: pair[0])))
        # What a choice depends on is a small part of the configuration, so most steps find it here.
        if key not in self._remembered:
            if len(self._remembered) >= _CACHED:
                self._remembered.clear()
            known = self.known(configuration, site, arrived)
            fixed = self._read(site, known, given)
            chosen = (dict(values) | fixed for values in self._choose(site, with_terms(known, fixed)))
            self._remembered[key] = tuple(tuple(sorted(each.items())) for each in chosen)
        return self._remembered[key]

    def shared(
        self,
        configuration: Configuration,
        sender: TransitionSite,
        receiver: TransitionSite,
        arrived: Message,
        given: Mapping[str, object],
    ) -> tuple[dict[str, object], ...]:
        """Return the choices of what both transitions read, where a sender meets a receiver of its own component.

        The sender acts first and takes the message `arrived`; `given` are choices already made, by term.
        """
        scopes, transitions = self.layout.scopes, (sender.transition, receiver.transition)
        inputs = scopes.types(sender.component)
        known = with_terms(self.known(configuration, sender, arrived), given)
        for at, _ in sender.assigned:
            known.pop(self.layout.variables[at][1].name, None)  # the receiver reads it only after the assignment
        types = ChainMap(*(dict(scopes.types(sender.component, each)) for each in transitions))
        question = Question(types, scopes.classes, scopes.domains(sender.component), known)
        guards = [each.guard for each in transitions if each.guard is not None]
        terms = [set(question.terms(_expressions(site))) for site in (sender, receiver)]
        both = sorted(term for term in terms[0] & terms[1] if term.removeprefix("size(").split(".")[0] in inputs)
        if not both:
            return ({},)
        effects = [*sender.effects(), *receiver.effects()]
        if why := keeps(question, effects, both, f"{sender.transition.id}/{receiver.transition.id}"):
            self.doubts.setdefault(sender.transition.id, why)
        found = [values for values, holds in question.valuations(guards, effects) if holds]
        if not found and guards:
            together = guards[0] if len(guards) == 1 else Binary("&&", *guards)
            found = [*likely(question, together)] or [values for values, _ in question.valuations((), effects)]
        chosen = dict.fromkeys(tuple((term, dict(values).get(term)) for term in both) for values in found)
        return tuple({term: value for term, value in each if value is not None} for each in chosen)

    def _read(
        self, site: TransitionSite, known: Mapping[str, object], given: Mapping[str, object]
    ) -> dict[str, object]:
        # Those of the choices already made that this transition reads.
        types = self.layout.scopes.types(site.component, site.transition)
        question = Question(types, self.layout.scopes.classes, known=known)
        terms = question.terms(_expressions(site))
        return {term: value for term, value in given.items() if term in terms}

    def _choose(self, site: TransitionSite, known: Mapping[str, object]) -> Iterator[Values]:
        scopes, guard = self.layout.scopes, site.transition.guard
        types = scopes.types(site.component, site.transition)
        question = Question(types, scopes.classes, scopes.domains(site.component), known)
        guards, effects = ([guard] if guard is not None else []), site.effects()
        if guard is not None and not question.terms(guards):
            if not evaluate(guard, known, f"guard of {site.transition.id!r}"):
                return
            guards = []
        found, is_sure = self._found(question, guards, effects)
        if (found or not is_sure) and site.transition.id not in self.doubts:
            why = inexact(question, guards, effects, site.transition.id)
            if why and not (guards and is_sure and _is_all(question, guards[0], effects, found)):
                self.doubts[site.transition.id] = why
        yield from found.values()

    def _found(
        self, question: Question, guards: list[Expression], effects: list[Expression]
    ) -> tuple[dict[Values, Values], bool]:
        # The choices by what they keep, and whether there is no other kind of them.
        kept = question.terms(effects)
        found: dict[Values, Values] = {}
        if not guards or is_plain(question, guards[0]) or not (kept and is_linear(question, guards[0])):
            for values, is_met in question.valuations(guards, effects):
                if is_met is None:
                    break
                found.setdefault(_of(values, kept), values)
                if not kept:
                    break
            else:
                return found, not guards or is_plain(question, guards[0])
            if found:
                return found, True
        return self._solved(question, guards[0], effects), is_linear(question, guards[0])

    def _solved(self, question: Question, guard: Expression, effects: list[Expression]) -> dict[Values, Values]:
        kept = question.terms(effects)
        found: dict[Values, Values] = {}
        for values in likely(question, guard):
            known = with_terms(question.known, dict(values))
            beside = Question(question.types, question.classes, question.domains, known)
            for more, _ in beside.valuations((), effects):
                all_ = tuple(sorted((*values, *more)))
                found.setdefault(_of(all_, kept), all_)
            if not kept:
                break
        if is_linear(question, guard) or (found and question.endless(effects)):
            return found
        # What nobody can decide counts as possible, but no choice that is wrong for sure.
        for values, _ in question.valuations((), effects):
            if may_hold(guard, with_terms(question.known, dict(values))):
                found.setdefault(_of(values, kept), values)
        return found

    def known(self, configuration: Configuration, site: TransitionSite, arrived: Message) -> dict[str, object]:
        """Return the values of the names that a transition reads, as far as the model says them."""
        known = self.layout.local(configuration, site.component)
        if site.transition.event is not None and site.transition.event.name:
            known[site.transition.event.name] = dict(arrived)
        return known


def inexact(question: Question, guards: Sequence[Expression], effects: Sequence[Expression], id: str) -> str:
    """Return why the step relation may not try every different choice at a transition; empty if it does."""
    kept = question.terms(effects)
    if why := keeps(question, effects, kept, id):
        return why
    # An open number is tried at, and beside, each value that it is compared with.
    tried = 9 + 8 * sum(len(comparisons(guard)) for guard in guards)
    terms = question.terms([*guards, *effects]).items()
    if prod(len(question.listed(term, type_)) or tried for term, type_ in terms) > EFFORT:
        return f"{id} has too many open values to try them all"
    if kept and not all(is_plain(question, guard) for guard in guards):
        return f"{id} computes with open values, and not all that it may keep are found"
    return ""


def keeps(question: Question, effects: Sequence[Expression], among: Collection[str], id: str) -> str:
    """Return which of these open terms, that cannot all be tried, lives on in the effects, in words; empty if none."""
    for term in question.endless(effects):
        if term in among:
            return f"{id} keeps the open value {term!r}"
    return ""


def _of(values: Values, kept: Collection[str]) -> Values:
    return tuple(pair for pair in values if pair[0] in kept)


def _is_all(question: Question, guard: Expression, effects: list[Expression], found: Mapping[Values, Values]) -> bool:
    # Whether an integer has no other values than those found: no neighbour of one fits that is not found itself.
    terms = question.terms([guard, *effects])
    if len(terms) != 1 or not is_linear(question, guard):
        return False
    [term] = terms
    domain = question.domains.get(term, ())
    tried = {value for values in found.values() for _, value in values}
    beside = {value + step for value in tried if isinstance(value, int) for step in (-1, 1)} - tried
    return not any(
        hold([guard], with_terms(question.known, {term: value})) for value in beside if not domain or value in domain
    )


def _expressions(site: TransitionSite) -> list[Expression]:
    guard = site.transition.guard
    return ([guard] if guard is not None else []) + site.effects()
