"""Does a planner keep the protocol's form: it can be made, is called rightly, answers in form, in silence."""

from __future__ import annotations

import contextlib
import inspect
import io
from collections.abc import Iterator

from parcours.errors import BadRequest
from parcours.run.workers import Crew, Done, Lost, failure_of
from parcours_navigation.checking.finding import Finding, OutOfPatience, error, note, warning
from parcours_navigation.checking.scenes import copied, script, standard_task
from parcours_navigation.checking.subject import Malformed, Speeds, Subject, replayed, require_form
from parcours_navigation.protocol import Observation

_PATIENCE = 60.0
"""How long a process of its own may take to answer a script [s]."""


def is_a_planner(subject: Subject) -> Iterator[Finding]:
    """It can be made, and is an object with reset and observe, or a function of one observation."""
    remedy = "give a class without required arguments that has reset(task) and observe(observation), or a function"
    try:
        planner = subject.make()
    except BadRequest as refused:
        slug = "planner-shape" if refused.slug == "planner-form" else "planner-raises"
        yield error(slug, refused.rule, remedy)
        return
    except (KeyboardInterrupt, OutOfPatience):
        raise
    except BaseException as raised:  # also SystemExit
        yield error("planner-raises", f"making it raised {told(raised)}", remedy)
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


def _takes_one(function: object, what: str, argument: str) -> Iterator[Finding]:
    try:
        inspect.signature(function).bind(None)  # type: ignore[arg-type]
    except TypeError as refused:
        yield error(
            "planner-shape",
            f"{what} cannot be called with the {argument} alone: {refused}",
            f"make it take one argument, the {argument}",
        )
    except ValueError:
        return  # compiled functions may have no signature: the next check calls it


def answers_in_form(subject: Subject) -> Iterator[Finding]:
    """It answers pairs of finite numbers, trajectories or None, and not always None."""
    task = standard_task()
    slot = subject.slot(task)
    answers = []
    for seen in script(task):
        answer = slot.answer(seen)
        try:
            require_form(answer)
        except Malformed as wrong:
            yield malformed(wrong, f"at {seen.time:.1f} s of a winding way past three obstacles")
            return
        answers.append(answer)
    if all(answer is None for answer in answers):
        yield error(
            "never-answers",
            f"None to each of {len(answers)} observations, so nothing was ever commanded",
            "return a Command; None only leaves the last one standing",
        )
    elif answers[0] is None:
        yield note("answers-late", "None to the first observation: the robot keeps its initial speeds until it answers")


def malformed(wrong: Malformed, where: str) -> Finding:
    """Return the finding that an answer is not in form, and where that was."""
    remedy = {
        "answer-finite": "look for divisions by zero and roots of negative numbers there",
        "answer-type": "return a pair of numbers (v, w), a Trajectory of points (n, 4), or None",
    }
    return error(wrong.slug, f"{wrong.seen}, {where}", remedy[wrong.slug])


def same_in_own_process(subject: Subject) -> Iterator[Finding]:
    """A process of its own gives the same answers, and ends."""
    if not subject.name:
        yield note("not-found-elsewhere", "it has no name that another process could find it by, so that was not tried")
        return
    task = standard_task()
    with contextlib.closing(Crew(_answer_script, 1, patience=_PATIENCE)) as crew:
        crew.pending.append((0, (subject.name,)))
        [(_, answer)] = crew.answers()
    if isinstance(answer, Lost) and answer.how == "died":
        yield error(
            "process-dies",
            f"a process of its own died with exit code {answer.status} before it had answered",
            "look for crashes of compiled code, and for calls of sys.exit",
        )
        return
    if isinstance(answer, Lost):
        yield error(
            "process-hangs",
            f"no answers within {_PATIENCE:.0f} s",
            "look for waiting and endless loops in reset and observe",
        )
        return
    if not isinstance(answer, Done):
        raise failure_of("a process of its own", answer)
    there = answer.result
    try:
        here = replayed(subject, task, script(task))  # what it raises here too is not for want of a caller
    except Malformed:
        return  # told by the next check
    if isinstance(there, str):
        yield error(
            "planner-raises", f"in a process of its own: {there}", "make it importable and independent of its caller"
        )
    elif there != here:
        first = next(k for k, pair in enumerate(zip(here, there, strict=True)) if pair[0] != pair[1])
        yield error(
            "process-differs",
            f"observation {first}: {_pair(here[first])} here, {_pair(there[first])} in a fresh process",
            "draw random numbers from task.seed only; do not iterate over sets or use hash() of texts",
        )


def _answer_script(name: str) -> list[Speeds] | str:
    """Return the speeds that answer the script in a process of its own, or what was raised."""
    from parcours_navigation.checking.loading import load_subject

    try:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            task = standard_task()
            return replayed(load_subject(name), task, script(task))
    except BaseException as raised:  # also SystemExit, which would end the process without a word
        return told(raised)


def is_quiet(subject: Subject) -> Iterator[Finding]:
    """It prints nothing."""
    task = standard_task()
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        replayed(subject, task, [copied(seen) for seen in script(task)])
    text = (out.getvalue() + err.getvalue()).strip()
    if text:
        first = text.splitlines()[0][:60]
        yield warning(
            "prints",
            f"{len(text)} characters in 30 observations, beginning {first!r}",
            "use logging: a campaign of 10 000 cases would print millions of lines",
        )


def changes_observation(before: Observation, after: Observation) -> str:
    """Return which array differs, or ""."""
    for name in ("robot", "obstacles"):
        if getattr(before, name).tobytes() != getattr(after, name).tobytes():
            return name
    return ""


def told(raised: BaseException) -> str:
    """Return an exception with the place that raised it, in one line.

    >>> told(ValueError("no way"))
    'ValueError: no way'
    """
    import traceback

    frames = traceback.extract_tb(raised.__traceback__)
    place = f" (in {frames[-1].name}, {frames[-1].filename.rpartition('/')[2]}:{frames[-1].lineno})" if frames else ""
    return f"{type(raised).__name__}: {raised}{place}".replace("\n", " ")


def _pair(speeds: Speeds) -> str:
    return f"(v, w) = ({speeds[0]:.6g}, {speeds[1]:.6g})"
