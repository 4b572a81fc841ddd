"""Every error that Parcours raises on purpose, in one grammar: where: the rule; what was given; what to do [slug].

The slug is an anchor in docs/messages.md, where each message is explained with its remedy.
"""

from __future__ import annotations

from collections.abc import Sequence


class ParcoursError(Exception):
    """A complaint about something given to Parcours.

    Args:
        where: the file and line, the model element or the option that is at fault.
        rule: what must hold, and what was given instead.
        remedy: what to do about it; may be empty when the rule says it.
        slug: the anchor in docs/messages.md.

    >>> str(ParcoursError("domain 'v'", "edges must increase, but 0.25 m/s follows 0.5 m/s",
    ...                   "sort the edges", slug="edges-order"))
    "domain 'v': edges must increase, but 0.25 m/s follows 0.5 m/s; sort the edges [edges-order]"
    """

    def __init__(self, where: str, rule: str, remedy: str = "", *, slug: str) -> None:
        self.where, self.rule, self.remedy, self.slug = where, rule, remedy, slug
        tail = f"; {remedy}" if remedy else ""
        super().__init__(f"{where}: {rule}{tail} [{slug}]")

    def __reduce__(self) -> tuple[object, ...]:
        return _rebuild, (type(self), self.where, self.rule, self.remedy, self.slug)


def _rebuild(kind: type[ParcoursError], where: str, rule: str, remedy: str, slug: str) -> ParcoursError:
    return kind(where, rule, remedy, slug=slug)


class BadModel(ParcoursError):
    """A model file cannot be read, or what it says does not make a CEFSM."""


class BadDomain(ParcoursError):
    """An input domain, a block or a constraint on test data is not well formed or cannot be met."""


class BadSuite(ParcoursError):
    """A suite file, or a request for cases, does not make sense."""


class BadResults(ParcoursError):
    """A results folder or file is missing, cut short, or was written by something else."""


class BadRequest(ParcoursError):
    """An option or argument is out of its range, or names something unknown."""


class HostFailure(ParcoursError):
    """A host could not run what it was given: a component is missing, or broke the port's contract."""


def require_known(given: str, known: Sequence[str], what: str, *, slug: str) -> None:
    """Raise BadRequest unless `given` is among the known names of `what`.

    >>> require_known("hubb", ["hub", "all-states"], "serialization policy", slug="unknown-policy")
    Traceback (most recent call last):
    parcours.errors.BadRequest: serialization policy: must be a known name, but 'hubb' was given; did you mean 'hub'? \
Known: hub, all-states [unknown-policy]
    """
    if given not in known:
        rule = f"must be a known name, but {given!r} was given"
        raise BadRequest(what, rule, one_of(given, known), slug=slug)


def one_of(given: str, known: Sequence[str]) -> str:
    """Return the remedy that lists what may be named, nearest first.

    >>> one_of("lift_thread", ["lift", "lift_threads"])
    "did you mean 'lift_threads'? Known: lift, lift_threads"
    """
    import difflib

    near = difflib.get_close_matches(given, known, n=1)
    hint = f"did you mean {near[0]!r}? " if near else ""
    return f"{hint}Known: {', '.join(known)}"
