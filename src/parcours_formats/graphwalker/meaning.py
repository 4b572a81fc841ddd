"""Guards and actions of GraphWalker's edges, in JavaScript, to transitions and to the variables they are about."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from parcours.model.conversion import Loss
from parcours.model.expression import Assignment, Expression, Name
from parcours.model.structure import Transition, Variable
from parcours_formats.graphwalker.variables import declared
from parcours_formats.guard_languages import Branch, Scope, branches, condition
from parcours_formats.guard_languages.tree import Identifier, Member, Tree
from parcours_formats.guard_languages.values import TRUE, conjunction
from parcours_formats.naming import Names


@dataclass(frozen=True, slots=True)
class Draft:
    """A transition whose guard and actions are still texts; `model` is where their variables belong."""

    id: str
    source: str
    target: str
    model: str
    guard: str = ""
    actions: tuple[str, ...] = ()
    weight: float = 1.0
    line: int = 0


@dataclass(frozen=True, slots=True)
class Start:
    """Actions of a model before the first step."""

    model: str
    actions: tuple[str, ...]
    line: int


@dataclass
class _Variables(Scope):
    """What names mean in one model: its own variables, and behind `global.` those of all models."""

    model: str = ""
    given: dict[tuple[str, str], str] = field(default_factory=dict)
    names: Names = field(default_factory=Names)

    def target(self, tree: Tree, where: str) -> list[tuple[Expression, Name]]:
        match tree:
            case Member(Identifier("global"), name):
                key = ("", name)
            case Identifier(name):
                key = (self.model, name)
            case _:
                return super().target(tree, where)
        if key not in self.given:
            self.given[key] = self.names.identifier(name)
        return [(TRUE, Name(self.given[key]))]


def translated(
    drafts: Sequence[Draft], starts: Sequence[Start], ids: Names, origin: str
) -> tuple[list[list[Transition]], tuple[Variable, ...], tuple[Loss, ...]]:
    """Return the transitions of each draft, several where an action has branches, and the variables.

    Args:
        drafts: the transitions of one component.
        starts: the actions of its models.
        ids: gives out further ids where one draft becomes several transitions.
        origin: the file's name, for messages.

    Raises:
        BadModel: a text says what our language cannot, or its variables have no type.

    Example:
    >>> found, variables, _ = translated([Draft("e1", "a", "b", "m", "n < 2", ("n++; b = n > 1 ? 5 : 6",))],
    ...                                  [Start("m", ("n = 0; b = 0",), 1)], Names(["e1"]), "here")
    >>> for each in found[0]:
    ...     print(each.id, each.guard, *each.actions, sep=" | ")
    e1 | n < 2 && n + 1 > 1 | n := n + 1 | b := 5
    e1_2 | n < 2 && n + 1 <= 1 | n := n + 1 | b := 6
    """
    scope = _Variables("javascript")
    initial: list[Assignment] = []
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
    losses += tuple(
        Loss(f"variable {name!r}", 0, f"it is called {given!r}, to be told from others")
        for (_, name), given in scope.given.items()
        if name != given
    )
    made = [_transitions(draft, found, ids) for draft, found in zip(drafts, meant, strict=True)]
    return made, variables, losses


def _performed(texts: Sequence[str], scope: Scope, where: str) -> tuple[Branch, ...]:
    text = ";\n".join(text.strip().rstrip(";") for text in texts if text.strip(" ;\n\t"))
    return branches(text, scope, where) if text else (Branch(TRUE, ()),)


def _meant(draft: Draft, scope: _Variables, origin: str) -> list[Branch]:
    scope.model = draft.model
    where = f"{origin}:{draft.line}" if draft.line else origin
    holds = condition(draft.guard, scope, f"{where}: guard of {draft.id!r}") if draft.guard.strip() else TRUE
    found = _performed(draft.actions, scope, f"{where}: actions of {draft.id!r}")
    return [Branch(conjunction((holds, branch.guard)), branch.actions) for branch in found]


def _transitions(draft: Draft, found: Sequence[Branch], ids: Names) -> list[Transition]:
    made: list[Transition] = []
    for branch in found:
        id = ids.label(draft.id) if made else draft.id
        held = None if branch.guard == TRUE else branch.guard
        made.append(
            Transition(id, draft.source, draft.target, None, held, branch.actions, weight=draft.weight, line=draft.line)
        )
    return made
