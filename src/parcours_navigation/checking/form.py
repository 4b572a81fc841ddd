"""Checks whether a planner keeps the protocol's form: it can be made, is called rightly, answers in form, silently."""

from __future__ import annotations

import contextlib
import inspect
import io
from collections.abc import Iterator

from parcours.errors import BadRequest
from parcours.run.exception_text import is_ctrl_c, place, said
from parcours.run.workers import Crew, Done, Lost, failure_of
from parcours_navigation.checking.remark import OutOfPatience, Remark, error, note, warning
from parcours_navigation.checking.scenes import copied, script
from parcours_navigation.checking.subject import Speeds, Subject, load_subject, replayed
from parcours_navigation.guests.answers import BadAnswer, read_answer
from parcours_navigation.guests.planners import asked_alone, batch_of
from parcours_navigation.robots.kinds import Body

_PATIENCE = 60.0
"""How long a process of its own may take to answer a script [s]."""


def is_a_planner(subject: Subject) -> Iterator[Remark]:
    """It can be made, and is an object with reset and observe, or a function of one observation."""
    remedy = "give a class without required arguments that has reset(task) and observe(observation), or a function"
    try:
        planner = subject.make()
    except BadRequest as refused:
        yield error("planner-shape" if refused.slug == "planner-form" else "planner-raises", refused.rule, remedy)
        return
    except OutOfPatience:
        raise
    except BaseException as raised:  # also SystemExit
        if is_ctrl_c(raised):
            raise
        yield error("planner-raises", f"making it raised {where_raised(raised)}", remedy)
        return
    try:
        planner = asked_alone(planner, batch_of(subject.name or "that is checked", planner))
    except BadRequest as refused:
        yield error("planner-shape", refused.rule, remedy)
        return
    observe, reset = getattr(planner, "observe", None), getattr(planner, "reset", None)
    if callable(observe):
        if reset is None:
            yield note("no-reset", "it has no reset", "fine if it remembers nothing; else one case leaks into the next")
        elif not callable(reset):
            yield error("planner-shape", "its reset cannot be called", "make it a method that takes the task")
        else:
            yield from _takes_one(reset, "reset", "task")
        yield from _takes_one(observe, "observe", "observation")
    elif callable(planner) and reset is None:
        yield from _takes_one(planner, "the function", "observation")
    else:
        yield error("planner-shape", f"a {type(planner).__name__} without an observe that can be called", remedy)


def _takes_one(function: object, what: str, argument: str) -> Iterator[Remark]:
    try:
        inspect.signature(function).bind(None)  # type: ignore[arg-type]
    except TypeError as refused:
        seen = f"{what} cannot be called with the {argument} alone: {refused}"
        yield error("planner-shape", seen, f"make it take one argument, the {argument}")
    except ValueError:
        return  # compiled functions may have no signature: the next check calls it


def answers_in_form(subject: Subject) -> Iterator[Remark]:
    """It answers pairs of finite numbers, trajectories or None, and not always None."""
    task = subject.task()
    slot = subject.slot(task)
    silent = []
    for seen in script(task):
        answer = slot.answer(seen)
        silent.append(answer is None)
        try:
            if answer is not None:
                read_answer(answer)
        except BadAnswer as wrong:
            yield malformed(wrong, f"at {seen.time:.1f} s of a winding way past three obstacles")
            return
    if all(silent):
        seen_none = f"None to each of {len(silent)} observations, so nothing was ever commanded"
        yield error("never-answers", seen_none, "return a Command; None only leaves the last one standing")
    elif silent[0]:
        yield note("answers-late", "None to the first observation: the robot keeps its initial speeds until it answers")


def malformed(wrong: BadAnswer, where: str) -> Remark:
    """Return the finding that an answer is not in form, and where that was."""
    if wrong.finite:
        remedy = "return a pair of numbers (v, w), a Trajectory of points (n, 4), or None"
        return error("answer-type", f"{wrong}, {where}", remedy)
    remedy = "look for divisions by zero and roots of negative numbers there"
    return error("answer-finite", f"{wrong}, {where}", remedy)


def same_in_own_process(subject: Subject) -> Iterator[Remark]:
    """A process of its own gives the same answers, and ends."""
    if not subject.name:
        yield note("not-found-elsewhere", "it has no name that another process could find it by, so that was not tried")
        return
    task = subject.task()
    with contextlib.closing(Crew(_answer_script, 1, patience=_PATIENCE, strangers=True)) as crew:
        crew.pending.append((0, (subject.name, subject.body)))
        [(_, answer)] = crew.answers()
    if isinstance(answer, Lost):
        if answer.how == "tampered":
            yield error("process-changed", f"it {answer.place}", "leave modules, descriptors and limits as they are")
        elif answer.how == "died":
            seen = f"a process of its own died before it had answered: it {answer.ending}"
            yield error("process-dies", seen, "look for crashes of compiled code, and for calls of sys.exit")
        else:
            remedy = "look for waiting and endless loops in reset and observe"
            yield error("process-hangs", f"no answers within {_PATIENCE:.0f} s", remedy)
        return
    if not isinstance(answer, Done):
        raise failure_of("a process of its own", answer)
    there = answer.result
    try:
        here = replayed(subject, task, script(task))  # what it raises here too is not for want of a caller
    except BadAnswer:
        return  # the next check says so
    if isinstance(there, str):
        remedy = "make it importable and independent of its caller"
        yield error("planner-raises", f"in a process of its own: {there}", remedy)
    elif there != here:
        k, one, two = next((k, *pair) for k, pair in enumerate(zip(here, there, strict=True)) if pair[0] != pair[1])
        pairs = [f"(v, w) = ({v:.6g}, {w:.6g})" for v, w in (one, two)]
        seen = f"observation {k}: {pairs[0]} here, {pairs[1]} in a fresh process"
        remedy = "draw random numbers from task.seed only; do not iterate over sets or use hash() of texts"
        yield error("process-differs", seen, remedy)


def _answer_script(name: str, body: Body) -> list[Speeds] | str:
    """Return the speeds that answer the script in a process of its own, or what was raised."""
    try:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            subject = load_subject(name, body)
            task = subject.task()
            return replayed(subject, task, script(task))
    except BaseException as raised:  # also SystemExit, which would end the process without a word
        return where_raised(raised)


def is_quiet(subject: Subject) -> Iterator[Remark]:
    """It prints nothing."""
    task = subject.task()
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
        replayed(subject, task, [copied(seen) for seen in script(task)])
    text = out.getvalue().strip()
    if text:
        seen = f"{len(text)} characters in 30 observations, starting with {text.splitlines()[0][:60]!r}"
        yield warning("prints", seen, "use logging: a campaign of 10 000 cases would print millions of lines")


def where_raised(raised: BaseException) -> str:
    """Return an exception with the place that raised it, in one line.

    >>> where_raised(ValueError("no way"))
    'ValueError: no way'
    """
    name, where = place(raised)
    return f"{said(raised)} (in {name}, {where})" if where else said(raised)
