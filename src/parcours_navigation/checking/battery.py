"""All checks of a planner, as data, and their run, here or in a process of its own: remarks, gravest first."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

from parcours.errors import require_known
from parcours.report.pieces import Cell, Column, Table
from parcours.run import canaries as canaries
from parcours.run.exception_text import is_ctrl_c
from parcours.run.limiting import limited
from parcours.run.serving import tell
from parcours.run.workers import Crew, Done, Lost, failure_of
from parcours_navigation.checking import batches, conduct, form, geometry, memory
from parcours_navigation.checking.remark import Level, OutOfPatience, Remark, error, warning
from parcours_navigation.checking.subject import Subject, load_subject
from parcours_navigation.guests.answers import BadAnswer
from parcours_navigation.robots.kinds import Body
from parcours_navigation.worlds.family import WorldCases
from parcours_navigation.worlds.file import find_world

Check = Callable[[Subject], Iterator[Remark]]

GATES: dict[str, Check] = {
    check.__name__: check for check in (form.is_a_planner, form.same_in_own_process, form.answers_in_form)
}
"""Checks without which the others mean nothing: an error in one of them ends the battery.

Before a planner is asked in this process, it is asked in one of its own, which it may take down.
"""

CHECKS: dict[str, Check] = GATES | {
    check.__name__: check
    for check in (
        form.is_quiet,
        memory.repeats_itself,
        memory.forgets_the_last_case,
        memory.rolls_its_own_dice,
        memory.leaves_observations_alone,
        memory.keeps_no_observation,
        memory.takes_obstacles_in_any_order,
        batches.answers_batches_as_alone,
        conduct.survives_odd_scenes,
        conduct.decides_in_time,
        geometry.turns_towards_the_goal,
        geometry.commands_in_units,
        geometry.no_place_is_special,
        geometry.left_is_as_good_as_right,
        conduct.reaches_a_free_goal,
        conduct.passes_a_standing_obstacle,
    )
}
"""All checks by name, in the order in which they are made."""


@dataclass(frozen=True, slots=True)
class BatteryReport:
    """What the battery found."""

    planner: str  # its name
    findings: tuple[Remark, ...]  # gravest first
    made: tuple[str, ...]  # names of the checks that were made
    left: tuple[str, ...]  # names of those that were not, since an earlier one failed

    @property
    def passed(self) -> bool:
        """Whether there is no error."""
        return all(finding.level is not Level.ERROR for finding in self.findings)


def run_battery(
    subject: Subject,
    names: Sequence[str] | None = None,
    *,
    patience: float = 120.0,
    progress: Callable[[str, int, int], None] = lambda name, done, total: None,
) -> BatteryReport:
    """Return what the checks, all if none are named, find of a planner. What it prints meanwhile is swallowed.

    A check may take `patience` [s]; only on a main thread can it be given up. `progress` is called with (name of the
    next check, checks made, in all). Raises BadRequest if a check is unknown.
    """
    wanted = list(CHECKS) if names is None else list(names)
    for name in wanted:
        require_known(name, list(CHECKS), "check", slug="unknown-check")
    findings: list[Remark] = []
    made: list[str] = []
    for name in wanted:
        progress(name, len(made), len(wanted))
        found = _made(CHECKS[name], subject, patience)
        made.append(name)
        findings += [replace(finding, check=name) for finding in found]
        if name in GATES and any(finding.level is Level.ERROR for finding in found):
            break
    progress("done", len(made), len(wanted))
    unique = {(f.slug, f.level): f for f in reversed(findings)}  # one fault breaks several checks: the first reports it
    ordered = sorted((f for f in findings if unique[f.slug, f.level] is f), key=lambda f: list(Level).index(f.level))
    return BatteryReport(subject.name, tuple(ordered), tuple(made), tuple(name for name in wanted if name not in made))


def _made(check: Check, subject: Subject, patience: float) -> list[Remark]:
    """Make one check; what the planner raises in it is a finding too."""
    sink = io.StringIO()
    findings: list[Remark] = []
    try:
        with limited(patience, OutOfPatience), contextlib.redirect_stdout(sink), contextlib.redirect_stderr(sink):
            findings.extend(check(subject))
    except OutOfPatience:
        remedy = "make decisions faster, or look for an endless loop"
        level = error if check in GATES.values() else warning  # each check that follows would wait as long
        findings.append(level("unfinished", f"given up after {patience:g} s", remedy))
    except BadAnswer as wrong:
        findings.append(form.malformed(wrong, "while it drove"))
    except BaseException as raised:  # also SystemExit
        if is_ctrl_c(raised):
            raise
        findings.append(error("planner-raises", form.where_raised(raised), _remedy_for(raised)))
    return findings


def _remedy_for(raised: BaseException) -> str:
    """Return what to do about an exception: a planner is given a scan, a map and a path only if it declares them."""
    if "NoneType" in str(raised):
        return 'make it answer, whatever it sees; if it reads a scan, map or path, declare it: needs = ("scan",)'
    return "make it answer, whatever it sees"


_GRACE = 60.0
"""A process may be silent for so much longer than one check may take [s]: it imports, and compiles."""


def check_apart(
    planner: str,
    names: Sequence[str] | None = None,
    *,
    world: str = "",
    patience: float = 120.0,
    grace: float = _GRACE,
    progress: Callable[[str, int, int], None] = lambda name, done, total: None,
) -> BatteryReport:
    """Return what `run_battery` finds of a planner in a process of its own, also where it ends or blocks that process.

    The process is ended when a check takes `grace` [s] longer than its patience, and ends itself after a check in which
    the planner has changed it. It is shown the kind and the limits of the robot of a world, if one is named: of its
    case 0, where they are drawn. Raises BadRequest if the planner's name leads nowhere, or a check is unknown; BadWorld
    if the world is bad.
    """
    body = WorldCases(1, find_world(world)).plan(0).robot if world else Body()
    wanted = list(CHECKS) if names is None else list(names)
    done = -1  # while it is loaded

    def heard(said: tuple[str, int, int]) -> None:
        nonlocal done
        done = said[1]
        progress(*said)

    crew = Crew(_check, 1, forks=True, patience=patience + grace, strangers=True, heard=heard)
    with contextlib.closing(crew):
        crew.pending.append((0, (planner, names, patience, body)))
        [(_, answer)] = crew.answers()
    if isinstance(answer, Done):
        return answer.result
    if not isinstance(answer, Lost):
        raise failure_of(f"planner {planner}", answer)
    if answer.how == "hung":
        seen = f"no sign of life for {patience + grace:g} s, and no signal ended it"
        found = error("process-hangs", seen, "look for endless loops in compiled code, or give it more patience")
    elif answer.how == "tampered":
        found = error("process-changed", f"it {answer.place}", "leave modules, descriptors and limits as they are")
    else:
        seen = f"it ended the process that it was checked in: it {answer.ending}"
        found = error("process-dies", seen, "look for crashes of compiled code, and for calls of os._exit")
    check = wanted[done] if 0 <= done < len(wanted) else ""
    where, made = f"in {check}" if check else "while it was loaded", max(done, 0)
    whole = replace(found, seen=f"{where}: {found.seen}", check=check)
    return BatteryReport(planner, (whole,), tuple(wanted[:made]), tuple(wanted[made:]))


def _check(planner: str, names: Sequence[str] | None, patience: float, body: Body) -> BatteryReport:
    def said(*what: object) -> None:
        canaries.require_unchanged()
        tell(what)

    subject = load_subject(planner, body)
    canaries.accept()
    return run_battery(subject, names, patience=patience, progress=said)


def report_lines(report: BatteryReport) -> str:
    """Return the findings as text: two lines each, then a summary.

    >>> found = (error("turns-away", "turned right", "flip a sign"),)
    >>> print(report_lines(BatteryReport("mine", found, ("a",), ("b",))))
    error: turned right [turns-away]
        flip a sign
    mine: 1 error, 0 warnings, 0 notes; 1 check made, not made since an earlier one failed: b
    """
    lines = []
    for finding in report.findings:
        lines.append(f"{finding.level}: {finding.seen} [{finding.slug}]")
        if finding.remedy:
            lines.append(f"    {finding.remedy}")
    counts = (_count(sum(f.level is level for f in report.findings), str(level)) for level in Level)
    left = f", not made since an earlier one failed: {', '.join(report.left)}" if report.left else ""
    lines.append(f"{report.planner}: {', '.join(counts)}; {_count(len(report.made), 'check')} made{left}")
    return "\n".join(lines)


def _count(n: int, what: str) -> str:
    return f"{n} {what}" if n == 1 else f"{n} {what}s"


def checks_table() -> Table:
    """Return all checks with what they demand."""
    rows: list[tuple[Cell, ...]] = [(name, (check.__doc__ or "").strip()) for name, check in CHECKS.items()]
    return Table("Checks of a planner", (Column("check", code=True), Column("what it demands")), tuple(rows))
