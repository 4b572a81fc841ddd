"""Simulates the cases of a campaign study in worker processes."""

from __future__ import annotations

import contextlib
import dataclasses
import inspect
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadRequest
from parcours.kernels import is_compiled
from parcours.run import canaries as canaries
from parcours.run import heartbeat as heartbeat
from parcours.run.exception_text import Overdue, is_ctrl_c, reason_bytes, words_of
from parcours.run.store import Campaign
from parcours.study.campaign.calling import (
    HUNG,
    LOADING,
    Alarm,
    Faulty,
    ProgramCaller,
    PythonCaller,
    facts_in,
    lost_reason,
)
from parcours.study.campaign.rules import ABSTRACT, Fault, Rows
from parcours.study.components.systems import ProgramPart
from parcours.study.loading import SourceFile, read_source
from parcours.study.parameters import Scalar, Settings
from parcours.suite import Case

if TYPE_CHECKING:
    from parcours.study.campaign.study import CampaignStudy


@dataclass(frozen=True, slots=True)
class Simulation:
    """The cases of a study with its parameters set; callable as a campaign's `simulate`, in worker processes."""

    study: CampaignStudy
    settings: Settings
    seed: int
    source: SourceFile | None = None  # of a function that a file defines
    lost: tuple[heartbeat.LostCase, ...] = ()

    @property
    def heartbeat_words(self) -> int:
        """How many words a worker shares with its parent."""
        return 3

    @property
    def patience_to_load(self) -> float:
        """How long a worker may give no sign of life while it is on no case [s]."""
        return 2.0 * max(LOADING, 6.0 * self.study.patience)

    def prepare(self) -> bool:
        """Load what draws cases, for all workers; these may be forked: no file that a study names is loaded here."""
        is_compiled()
        return True

    def without(self, lost: tuple[heartbeat.LostCase, ...]) -> Self:
        """Return the same, which gives the facts of these cases as errors and does not simulate them."""
        return dataclasses.replace(self, lost=lost)

    @property
    def label(self) -> str:
        """What is simulated, and the parameters that are not at their default."""
        what = self.study.simulate
        if isinstance(what, ProgramPart):
            what = " ".join(what.command)
        elif not isinstance(what, str):
            what = str(getattr(what, "__qualname__", type(what).__qualname__))
        changed = {one.name: self.settings[one.name] for one in self.study._set(self.settings)}
        return ", ".join([what, *self.study.shown(changed)])

    @property
    def decides(self) -> dict[str, Scalar]:
        """The settings that results depend on."""
        return {one.name: self.settings.get(one.name, one.default) for one in self.study.own if one.decides}

    @property
    def files(self) -> dict[str, str]:
        """The digests of what results depend on: those of the study, and of a Python file that it does not list."""
        files = dict(self.study.digests)
        if self.source is not None:
            files.setdefault(self.source.path.name, self.source.digest)
        elif callable(self.study.simulate):
            with contextlib.suppress(TypeError, BadRequest):
                read = read_source(self.label, Path(inspect.getfile(self.study.simulate)))
                files.setdefault(read.path.name, read.digest)
        return files

    def campaign(self, n_cases: int, shard_size: int | None = None) -> Campaign:
        """Return the campaign of cases 0 .. n_cases - 1; by default in shards of 4 to 256 cases."""
        return Campaign(
            self.study.name, self.label, self.seed, n_cases, self.study.dtype,
            {"settings": self.decides, "files": self.files, "inputs": self.study.inputs_digest,
             "patience": self.study.patience},
            shard_size or min(max(n_cases // 16, 4), max(64, min(n_cases // 256, 256))),
        )  # fmt: skip

    def __call__(self, first: int, count: int) -> Rows:
        """Return the facts of cases first .. first + count - 1, array of the study's dtype."""
        return self.run(np.arange(first, first + count))

    def run(self, numbers: NDArray[np.int64]) -> Rows:
        """Return the facts of the cases of these numbers, array of the study's dtype, shape (n,)."""
        study, lost = self.study, {one.number: one for one in self.lost}
        rows = []
        with Alarm() as alarm:
            caller: PythonCaller | ProgramCaller
            if isinstance(study.simulate, ProgramPart):
                caller = ProgramCaller(study, study.simulate, self.settings)
            else:
                caller = PythonCaller(study, study.simulate, "simulate", self.settings, self.seed, alarm, self.source)
                canaries.accept()
            for number, values in zip(numbers.tolist(), study.values(numbers, self.seed), strict=True):
                if number in lost:
                    facts, fault, why = None, *lost_reason(lost[number], study.patience)
                else:
                    names = study.inputs.names
                    case = Case(study.name, number, ABSTRACT, number, names, values, study.patience, self.seed)
                    facts, fault, why = self._one(caller, case, alarm)
                nothing = (np.nan if fact.kind == "real" else 0 for fact in study.facts)
                rows.append((number, *(nothing if facts is None else facts), int(fault), reason_bytes(why)))
        return np.array(rows, study.dtype)

    def _one(
        self, caller: PythonCaller | ProgramCaller, case: Case, alarm: Alarm
    ) -> tuple[tuple[Scalar, ...] | None, Fault, str]:  # fmt: skip
        """Return the facts of a case, or what was wrong and why."""
        pid, limit = os.getpid(), self.study.patience
        try:
            try:
                alarm.set(case.number, limit, rings=isinstance(caller, PythonCaller))
                return facts_in(self.study.facts, caller(case)), Fault.NONE, ""
            except Overdue:
                return None, Fault.HUNG, HUNG.format(limit)
            except Faulty as error:
                return None, error.fault, str(error)
            except BaseException as error:
                # A program that cannot be started costs all cases.
                if is_ctrl_c(error) or isinstance(caller, ProgramCaller):
                    raise
                return None, Fault.RAISED, f"raised: {words_of(error, caller.file)}"
            finally:
                if os.getpid() != pid:
                    os._exit(0)  # a child that the simulation forked: the case is its parent's
                canaries.after_case()
                alarm.off()
        except Overdue:  # it rang while an exception was put into words
            alarm.off()
            return None, Fault.HUNG, HUNG.format(limit)
