"""Translates guards and actions of GraphWalker's edges to transitions, and finds the types of their variables."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from parcours.errors import BadModel
from parcours.model.expression import Assignment, Binary, Expression, FieldAccess, Literal, Name, Unary, names
from parcours.model.expression.syntax import COMPARISONS, walk
from parcours.model.structure import Transition, Variable
from parcours_formats.guard_languages import Branch, Scope, branches, condition, variables
from parcours_formats.guard_languages.values import TRUE, conjunction, kind_of
from parcours_formats.losses import Losses
from parcours_formats.naming import UniqueNames


@dataclass(frozen=True, slots=True)
class TransitionDraft:
    """A transition whose guard and actions are still texts; `model` is where their variables belong."""

    id: str
    source: str
    target: str
    model: str
    guard: str = ""
    actions: tuple[str, ...] = ()
    weight: float = 1.0
    line: int = 0
    tags: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class StartActions:
    """Actions of a model before the first step."""

    model: str
    actions: tuple[str, ...]
    line: int


@dataclass
class _Variables(Scope):
    """What names mean in one model: its own variables, and behind `global.` those of all models."""

    model: str = ""
    given: dict[tuple[str, str], str] = field(default_factory=dict)
    names: UniqueNames = field(default_factory=UniqueNames)

    def target(self, tree: Expression, where: str) -> list[tuple[Expression, Name]]:
        match tree:
            case FieldAccess(Name("global"), name):
                key = ("", name)
            case Name(name):
                key = (self.model, name)
            case _:
                return super().target(tree, where)
        if key not in self.given:
            self.given[key] = self.names.identifier(name)
        return [(TRUE, Name(self.given[key]))]


def translated(
    drafts: Sequence[TransitionDraft], starts: Sequence[StartActions], ids: UniqueNames, origin: str
) -> tuple[list[list[Transition]], tuple[Variable, ...], Losses]:
    """Return the transitions of each draft, several where an action has branches, and the variables."""
    scope = _Variables("javascript")
    initial: list[Assignment] = []  # a variable is declared by the first value it gets
    for start in starts:
        scope.model = start.model
        for branch in _performed(start.actions, scope, f"{origin}:{start.line}: actions of {start.model!r}"):
            initial += branch.actions
    variables, _ = declared(initial, (), (), origin)
    while True:
        scope.kinds = {each.name: "text" if each.type == "enum" else each.type for each in variables}
        meant = [_meant(draft, scope, origin) for draft in drafts]
        later = [action for found in meant for branch in found for action in branch.actions]
        guards = [branch.guard for found in meant for branch in found if branch.guard != TRUE]
        before, (variables, losses) = variables, declared(initial, later, guards, origin)
        # Numbers, texts and truth values are translated differently: once their types are known, again.
        if {each.name for each in before} == {each.name for each in variables}:
            break
    for (_, name), given in scope.given.items():
        if name != given:
            losses.add(f"variable {name!r}", 0, f"it is called {given!r}, to be told from others")
    made = [_transitions(draft, found, ids) for draft, found in zip(drafts, meant, strict=True)]
    return made, variables, losses


def _performed(texts: Sequence[str], scope: Scope, where: str) -> tuple[Branch, ...]:
    text = ";\n".join(text.strip().rstrip(";") for text in texts if text.strip(" ;\n\t"))
    return branches(text, scope, where) if text else (Branch(TRUE, ()),)


def _meant(draft: TransitionDraft, scope: _Variables, origin: str) -> list[Branch]:
    scope.model = draft.model
    where = f"{origin}:{draft.line}" if draft.line else origin
    holds = condition(draft.guard, scope, f"{where}: guard of {draft.id!r}") if draft.guard.strip() else TRUE
    found = _performed(draft.actions, scope, f"{where}: actions of {draft.id!r}")
    return [Branch(conjunction((holds, branch.guard)), branch.actions) for branch in found]


def _transitions(draft: TransitionDraft, found: Sequence[Branch], ids: UniqueNames) -> list[Transition]:
    made: list[Transition] = []
    for branch in found:
        ends = (ids.label(draft.id) if made else draft.id, draft.source, draft.target, None)
        held = None if branch.guard == TRUE else branch.guard
        made.append(Transition(*ends, held, branch.actions, weight=draft.weight, line=draft.line, tags=draft.tags))
    return made


_FIRST: dict[str, bool | int | float | str] = {"bool": False, "int": 0, "real": 0.0, "text": ""}


def declared(
    initial: Sequence[Assignment], later: Sequence[Assignment], guards: Sequence[Expression], where: str
) -> tuple[tuple[Variable, ...], Losses]:
    """Return the variables of a component, and what had to be assumed of them.

    A variable has the type of its first value; an integer that is given a real is a real. One that is only read is an
    input, and one that only transitions set starts as false, 0 or ''. A text that is only set to constants and only
    compared with constants is an enumeration of these.
    """
    known = variables(initial, later, where)
    kinds = {each.name: each.type for each in known}
    read = [*guards, *(action.value for action in later)]
    used = [*(action.target for action in later), *(name for each in read for name in sorted(names(each)))]
    rest = dict.fromkeys(name for name in used if name not in kinds)
    if rest:
        _infer(kinds, later, read)
    losses = Losses()
    found = list(known)
    assigned = {action.target for action in later}
    for name in rest:
        if name not in kinds:
            rule = f"a variable must have a type, but nothing tells that of {name!r}"
            raise BadModel(where, rule, "set it in the model's actions", slug="unknown-type")
        if name in assigned:
            found.append(Variable(name, kinds[name], _FIRST[kinds[name]]))
            value = Literal(_FIRST[kinds[name]])
            losses.add(f"variable {name!r}", 0, f"it is not set at the start; it starts as {value}")
        else:
            found.append(Variable(name, kinds[name], None, "input"))
            losses.add(f"variable {name!r}", 0, "it is read but never set; it is an input of the environment")
    for action in later:
        given, wanted = kind_of(action.value, kinds), kinds[action.target]
        if given and given != wanted and (wanted, given) != ("real", "int"):
            uses = f'{action.target!r} is {wanted}, and is set to "{action.value}", {given}'
            rule = f"a variable has one type, but {uses}"
            raise BadModel(where, rule, "use two variables", slug="type")
    values = _enumerated(initial, later, read)
    return tuple(_as_enum(each, values.get(each.name)) for each in found), losses


def _infer(kinds: dict[str, str], later: Sequence[Assignment], read: Iterable[Expression]) -> None:
    """Add to `kinds` what use tells of the others, until nothing new is found."""
    nodes = [node for expression in read for node in walk(expression)]
    guards = [node for node in read if isinstance(node, Name)]
    before = -1
    while before != len(kinds):
        before = len(kinds)
        for action in later:
            if kind := kind_of(action.value, kinds):
                if kinds.setdefault(action.target, kind) == "int" and kind == "real":
                    kinds[action.target] = "real"
            elif isinstance(action.value, Name) and action.target in kinds:
                kinds[action.value.id] = kinds[action.target]
        for node in nodes:
            for name, kind in _told(node, kinds):
                kinds.setdefault(name, kind)
    for guard in guards:
        kinds.setdefault(guard.id, "bool")


def _told(node: Expression, kinds: dict[str, str]) -> Iterator[tuple[str, str]]:
    match node:
        case Unary(operator, Name(id)):
            yield id, "bool" if operator == "!" else "int"
        case Binary(operator, left, right):
            for one, other in ((left, right), (right, left)):
                if isinstance(one, Name):
                    if operator in ("&&", "||"):
                        yield one.id, "bool"
                    elif kind := kind_of(other, kinds):
                        yield one.id, kind
                    elif operator not in COMPARISONS:
                        yield one.id, "int"
        case _:
            pass


def _enumerated(
    initial: Iterable[Assignment], later: Iterable[Assignment], read: Iterable[Expression]
) -> dict[str, tuple[str, ...]]:
    """Return the values of variables that are only set to, and compared with, constant texts."""
    values: dict[str, dict[str, None]] = {}
    uses: Counter[str] = Counter()
    for action in (*initial, *later):
        found = values.setdefault(action.target, {})
        if isinstance(action.value, Literal) and isinstance(action.value.value, str):
            found[action.value.value] = None
        else:
            uses[action.target] += 1
    for expression in read:
        for node in walk(expression):
            match node:
                case Name(id):
                    uses[id] += 1
                case Binary("==" | "!=", Name(id), Literal(str(text))) | Binary(
                    "==" | "!=", Literal(str(text)), Name(id)
                ):
                    uses[id] -= 1
                    values.setdefault(id, {})[text] = None
                case _:
                    pass
    return {name: tuple(found) for name, found in values.items() if uses[name] == 0 and "" not in found}


def _as_enum(variable: Variable, values: tuple[str, ...] | None) -> Variable:
    if variable.type != "text" or variable.role == "input" or values is None or variable.initial not in values:
        return variable
    return Variable(variable.name, "enum", variable.initial, domain=values)
