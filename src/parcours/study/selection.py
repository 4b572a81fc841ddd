"""The cases that `--case ID` and `--cases-from FILE` choose."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from parcours.errors import BadRequest, one_of
from parcours.suite import Case, Plan

_MOST = 1_000_000


def ids_of(given: Sequence[str], file: Path | None) -> tuple[str, ...]:
    """Return the ids that were given, and those in a file: one per line, `#` begins a comment."""
    ids = list(given)
    if file is not None:
        try:
            lines = file.read_text(encoding="utf-8").splitlines()
        except (OSError, UnicodeDecodeError) as error:
            why = error.strerror if isinstance(error, OSError) and error.strerror else error
            rule = f"must be a readable list of cases, but: {why}"
            raise BadRequest(str(file), rule, "name a text file with one case id per line", slug="case-list") from error
        listed = [line.partition("#")[0].strip() for line in lines]
        ids += [one for one in listed if one]
        if not any(listed):
            raise BadRequest(str(file), "must name cases, one id per line, but names none", slug="case-list")
    if len(ids) > _MOST:
        raise BadRequest("cases", f"at most {_MOST} may be chosen, but {len(ids)} are", slug="case-list")
    return tuple(dict.fromkeys(ids))


def chosen_cases(plan: Plan, chosen: Sequence[str], study: str) -> list[Case]:
    """Return the cases of a plan: all, or those of the given ids, in the order of their numbers.

    An id may leave out the study: `ITP1-tp11.tp21-0.0/3`. One that names an abstract case alone is all its rows; a
    number is that of a case in the plan, from 0.
    """
    if not chosen:
        return list(plan.cases())
    numbers: set[int] = set()
    wrong = []
    for given in chosen:
        id = given.removeprefix("functional/").removeprefix("timing/").removeprefix(f"{study}/")
        if id.isdecimal() and len(id) < 16:
            numbers.add(int(id))
            continue
        abstract, _, row = id.partition("/")
        if abstract not in plan.abstracts or (row and not (row.isdecimal() and len(row) < 16)):
            wrong.append(given)
            continue
        place = plan.abstracts.index(abstract)
        rows = [int(row)] if row else range(-(-(len(plan) - place) // len(plan.abstracts)))
        numbers |= {each * len(plan.abstracts) + place for each in rows}
    if wrong:
        named = ", ".join(wrong[:5]) + ("" if len(wrong) <= 5 else f" and {len(wrong) - 5} more")
        rule = f"chosen cases must be the study's, but it has no {named}"
        remedy = one_of(wrong[0].split("/")[-2] if "/" in wrong[0] else wrong[0], plan.abstracts[:200])
        raise BadRequest(f"study {study!r}", rule, remedy[:300], slug="case-unknown")
    longer = replace(plan, n_cases=max(len(plan), max(numbers) + 1))  # rows beyond the plan have values, too
    return [longer.case(number) for number in sorted(numbers)]


def named(cases: Iterable[Case], chosen: Sequence[str]) -> Iterator[Case]:
    """Yield those of the cases that are named: by id, with or without the study, by abstract case, or by number.

    Raises BadRequest: a name is not one of theirs; all such names are listed.
    """
    left = set(chosen)
    for case in cases:
        names = {case.id, f"{case.abstract}/{case.row}", case.abstract, str(case.number)} & set(chosen)
        if names:
            left -= names
            yield case
    if left:
        rule = f"chosen cases must be among those of the study or suite, but there is no {', '.join(sorted(left)[:5])}"
        raise BadRequest("cases", rule, "see `parcours suite` for their ids", slug="case-unknown")
