"""Works out what executable content of SCXML does: branches of assignments and sent events."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from typing import TypeAlias

from parcours.errors import BadModel
from parcours.model.expression import Apply, Expression, FieldAccess, Literal, Name
from parcours_formats.guard_languages import (
    Branch,
    ForeignTokens,
    Scope,
    Translation,
    performed,
    refusal,
    sized,
    values,
)
from parcours_formats.guard_languages.foreign_syntax import Set as Assign
from parcours_formats.guard_languages.foreign_syntax import Statement
from parcours_formats.guard_languages.foreign_texts import MAX_ACTIONS
from parcours_formats.guard_languages.values import FALSE, TRUE, Cases, always, conjunction, literal, negation
from parcours_formats.losses import Losses
from parcours_formats.scxml.datamodel import ChartParser, Whole, parsed, part_at, refused, spread
from parcours_formats.xml_lines import Element

_DELAY = re.compile(r"([0-9]{0,9}\.?[0-9]{1,9})(s|ms)?")
_IGNORED = {"log": "log is left out", "cancel": "cancel is left out: what was sent arrives"}


Option: TypeAlias = tuple[str, str, Sequence[Element]]
"""A condition, where it stands, and what is done if it holds."""


@dataclass(frozen=True, slots=True)
class SentEvent:
    """An event sent: to the document itself, or (`is_outward`) to what lies outside, after a delay [s]."""

    event: str
    is_outward: bool
    delay: float = 0.0


@dataclass(frozen=True, slots=True)
class ContentOutcome:
    """What content does when the guard of `branch` holds beforehand."""

    branch: Branch = field(default_factory=lambda: Branch(TRUE, ()))
    sent: tuple[SentEvent, ...] = ()

    def under(self, guard: Expression) -> ContentOutcome:
        """Return the same under another guard."""
        return replace(self, branch=replace(self.branch, guard=guard))


@dataclass
class DataScope(Scope):
    """The data of a document, where some states are active and an event has arrived."""

    missing: Mapping[str, BadModel] = field(default_factory=dict)
    wholes: Mapping[str, Whole] = field(default_factory=dict)
    parts: Set[str] = frozenset()
    active: Set[str] = frozenset()
    event: str = ""
    document: str = ""

    def read(self, tree: Expression, where: str) -> Cases:
        """Return what a place holds."""
        if tree == FieldAccess(Name("_event"), "name"):
            return always(literal(self.event))
        if tree == Name("_name"):
            return always(literal(self.document))
        self._demand(tree, where)
        match part_at(tree, self.wholes, where):
            case int() as length:
                return always(literal(length))
            case str() as variable:
                return always(Name(variable))
            case Whole(name, _, _):
                raise refused(where, f"{name!r} as a whole", "use its parts")
        return super().read(tree, where)

    def target(self, tree: Expression, where: str) -> list[tuple[Expression, Name]]:
        """Return the variable that an assignment to a place changes."""
        self._demand(tree, where)
        if isinstance(variable := part_at(tree, self.wholes, where), str):
            return [(TRUE, Name(variable))]
        if isinstance(tree, Name) and (tree.id not in self.kinds or tree.id in self.parts):
            rule = f"a location must be data of the document, but {tree.id!r} is not"
            raise BadModel(where, rule, "declare it in <datamodel>", slug="unknown-name")
        return super().target(tree, where)

    def _demand(self, tree: Expression, where: str) -> None:
        """Raise the reason why the data that a place belongs to could not be translated, if so."""
        while isinstance(tree, FieldAccess) or (isinstance(tree, Apply) and tree.function == "[]"):
            tree = tree.of if isinstance(tree, FieldAccess) else tree.arguments[0]
        if isinstance(tree, Name) and tree.id in self.missing:
            error = self.missing[tree.id]
            raise BadModel(where, f"{tree.id!r} cannot be used: {error.rule}", error.remedy, slug=error.slug)

    def applied(self, tree: Apply, where: str) -> Cases:
        """Return the value of a function; `In(id)` is known in every configuration."""
        if tree.function == "In" and len(tree.arguments) == 1 and isinstance(tree.arguments[0], Literal):
            return always(literal(tree.arguments[0].value in self.active))
        return super().applied(tree, where)


class ContentRunner:
    """Runs the executable content of one document symbolically; `losses` grows."""

    def __init__(self, origin: str, losses: Losses) -> None:
        self.origin, self.losses = origin, losses
        self._trees: dict[str, Expression] = {}

    def where(self, element: Element) -> str:
        """Return the place of an element for messages."""
        return f"{self.origin}:{element.line}: <{element.tag}>"

    def condition(self, text: str, scope: Scope, where: str) -> Expression:
        """Return a condition."""
        return sized(Translation(scope, where).truth(self.tree(text, where)), where) if text else TRUE

    def tree(self, text: str, where: str) -> Expression:
        """Return the syntax tree of an expression; each text is parsed once."""
        if text not in self._trees:
            self._trees[text] = parsed(text, where)
        return self._trees[text]

    def run(
        self, elements: Iterable[Element], scope: Scope, before: Iterable[ContentOutcome] = (ContentOutcome(),)
    ) -> list[ContentOutcome]:
        """Return what elements do, one after the other, behind what was done before."""
        now = list(before)
        for element in elements:
            if element.tag in ("raise", "send", "script", "if", "foreach", "assign", *_IGNORED):
                now = [after for outcome in now for after in self._after(element, scope, outcome)]
            else:
                self.lose(element, f"<{element.tag}> is left out", alters=True)
            if len(now) > values.MAX_CASES:
                rule = f"content has at most {values.MAX_CASES} branches, but this has more"
                raise BadModel(self.where(element), rule, "split it", slug="expression-size")
        return now

    def chosen(self, options: Iterable[Option], scope: Scope, outcome: ContentOutcome) -> list[ContentOutcome]:
        """Return what the first option whose condition holds does behind what was done before, or none of them."""
        # if / elseif / else: `rest` says that none of the options so far was taken.
        found, rest = list[ContentOutcome](), outcome.branch.guard
        for condition, where, block in options:
            choice = outcome.branch.before(self.condition(condition, scope, where), where)
            guard = sized(conjunction((rest, choice)), where)
            if guard != FALSE:
                found += self.run(block, scope, [outcome.under(guard)])
            rest = sized(conjunction((rest, negation(choice))), where)
        return found if rest == FALSE else [*found, outcome.under(rest)]

    def lose(self, element: Element, what: str, *, alters: bool = False) -> None:
        """Note that something is left out."""
        self.losses.add(f"<{element.tag}>", element.line, what, alters=alters)

    def _after(self, element: Element, scope: Scope, outcome: ContentOutcome) -> list[ContentOutcome]:
        where = self.where(element)
        match element.tag:
            case "assign":
                place = self.tree(element.get("location"), where)
                value = self.tree(element.get("expr") or element.text.strip(), where)
                return self._performed([Assign(place, value)], scope, where, outcome)
            case "script":
                if element.get("src"):
                    raise refusal(where, "a script in another file")
                statements = ChartParser(ForeignTokens(element.text, "javascript", where)).statements()
                return self._performed(statements, scope, where, outcome)
            case "if":
                return self.chosen(self._options(element), scope, outcome)
            case "raise" | "send":
                if len(outcome.sent) >= MAX_ACTIONS:
                    rule = f"content sends at most {MAX_ACTIONS} events, but this sends more"
                    raise BadModel(where, rule, "split it", slug="expression-size")
                return [replace(outcome, sent=(*outcome.sent, self._sent(element, where)))]
            case "foreach":
                raise refusal(where, "the loop 'foreach'")
        self.lose(element, _IGNORED[element.tag], alters=element.tag != "log")
        return [outcome]

    def _performed(
        self, statements: Iterable[Statement], scope: Scope, where: str, outcome: ContentOutcome
    ) -> list[ContentOutcome]:
        if isinstance(scope, DataScope):
            statements = tuple(spread(tuple(statements), scope.wholes, where))
        return [replace(outcome, branch=each) for each in performed(statements, scope, where, outcome.branch)]

    def _options(self, element: Element) -> Iterable[Option]:
        options: list[tuple[str, str, list[Element]]] = [(element.get("cond"), self.where(element), [])]
        for child in element.children:
            if child.tag in ("else", "elseif"):
                options.append((child.get("cond") if child.tag == "elseif" else "", self.where(child), []))
            else:
                options[-1][2].append(child)
        return options

    def _sent(self, element: Element, where: str) -> SentEvent:
        event = element.get("event")
        if not event and element.get("eventexpr"):
            tree = self.tree(element.get("eventexpr"), where)
            if not (isinstance(tree, Literal) and isinstance(tree.value, str)):
                raise refusal(where, "an event whose name is computed")
            event = tree.value
        if element.children or element.get("namelist"):
            self.lose(element, "what the event carries is left out")
        is_outward = element.tag == "send" and not is_inward(element)
        said = element.get("delay") or element.get("delayexpr").strip("'\"")
        delay = seconds(said)
        if delay is None or (is_outward and delay):
            self.lose(element, f"its delay {said!r} is left out: the event may go at any time", alters=True)
        return SentEvent(event, is_outward, delay or 0.0)


def is_astray(element: Element) -> bool:
    """Return whether a `send` names a target that is neither a session nor an address."""
    target = element.get("target")
    computed = element.get("targetexpr").strip()
    if not target and (computed.isdecimal() or computed[:1] in ("'", '"')):
        target = computed.strip("'\"")
    return element.tag == "send" and bool(target) and not target.startswith("#_") and ":" not in target


def is_inward(element: Element) -> bool:
    """Return whether a `raise` or `send` goes to the document itself."""
    target = element.get("target") or element.get("targetexpr").strip("'\"")
    return element.tag == "raise" or (element.tag == "send" and target in ("", "#_internal"))


def seconds(delay: str) -> float | None:
    """Return a delay in seconds, 0 for none, None for one that is not a constant.

    >>> seconds("1.5s"), seconds("20ms"), seconds(""), seconds("Var1")
    (1.5, 0.02, 0.0, None)
    """
    found = _DELAY.fullmatch(delay.strip())
    if found is None:
        return None if delay.strip() else 0.0
    return float(found[1]) * (0.001 if found[2] == "ms" else 1.0)
