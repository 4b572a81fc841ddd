"""The finished cases of a run as a table: one row per case; columns have units and are made when they are asked for.

Filtered by a condition, summed up by groups, and handed to other tools as Arrow, Parquet or CSV, or to SQL.
"""

from __future__ import annotations

import functools
import importlib
import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from parcours.data import InputModel
from parcours.errors import BadRequest, one_of
from parcours.model.expression import Binary, Expression, Name, Unary, names, parse_expression
from parcours.model.expression.evaluation import compiled
from parcours.run.locations import location
from parcours.study.protocol import Results
from parcours.verdict.statistics import Rate, wilson

if TYPE_CHECKING:
    import pandas
    import pyarrow

FORMAT = "results/1"
_MOST_GROUPS = 1000


@dataclass(frozen=True, slots=True)
class TableColumn:
    """One value of every case: numbers, truth values or texts, made when they are asked for, shape (n_cases,)."""

    make: Callable[[], NDArray[Any]]
    unit: str = "1"


@runtime_checkable
class Tabled(Protocol):
    """Results that know more of their cases than verdicts and measures."""

    def table_columns(self) -> Mapping[str, TableColumn]:
        """Return columns by name, in the order of `measures`; `case` (ids) and `verdict` are among them."""


@runtime_checkable
class Divided(Protocol):
    """Results that can be had part by part, since all of them may not fit into memory."""

    def in_parts(self) -> Iterator[Results]:
        """Yield results of some cases after the other, in their order; of none at least once."""


@dataclass(frozen=True)
class ResultTable:
    """The cases of a run, some or all of them.

    >>> table = ResultTable({"n": TableColumn(lambda: np.array([1, 2, 3, 4])), "far": TableColumn(
    ...     lambda: np.array([False, True, True, True]))}, ("far",))
    >>> [(key, rates["far"].count, rates["far"].n) for key, rates in table.where("n < 4").by(["n"]).items()]
    [((1,), 0, 1), ((2,), 1, 1), ((3,), 1, 1)]
    """

    columns: Mapping[str, TableColumn]
    rates: tuple[str, ...]  # columns of 0 and 1 that are shares of the cases, NaN where it is not known
    label: str = ""
    chosen: NDArray[np.int64] | None = None  # rows of the table; all if None
    _made: dict[str, NDArray[Any]] = field(default_factory=dict, compare=False)

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Return a column. Raises BadRequest if there is none of that name."""
        if name not in self.columns:
            rule = f"the results must have a column of that name, but have no {name!r}"
            raise BadRequest("results", rule, one_of(name, list(self.columns)), slug="results-column")
        if name not in self._made:
            self._made[name] = self.columns[name].make()
        return self._made[name] if self.chosen is None else self._made[name][self.chosen]

    def __len__(self) -> int:
        return len(self[next(iter(self.columns))])

    def where(self, condition: str) -> ResultTable:
        """Return the cases of which a condition in the guard language holds.

        A word that is compared with a column of texts stands for itself: `outcome == stuck`.

        Raises BadRequest: it reads no column. BadModel: it cannot be parsed, or is neither true nor false.
        """
        formula = parse_expression(condition, "--where")
        read = [name for name in names(formula) if name in self.columns]
        formula = _worded(formula, {name for name in read if self[name].dtype.kind == "U"})
        words = {name: name[1:] for name in names(formula) if name.startswith("'")}
        known = {name: self[name].tolist() for name in names(formula) if name not in words}
        code = compiled(formula, "--where")
        kept = np.empty(len(self), bool)
        for k in range(len(kept)):
            holds = code(words | {name: values[k] for name, values in known.items()})
            if not isinstance(holds, bool):
                raise BadRequest("--where", f"must be true or false, but is {holds!r}", slug="results-where-form")
            kept[k] = holds
        rows = np.flatnonzero(kept)
        return ResultTable(
            self.columns, self.rates, self.label, rows if self.chosen is None else self.chosen[rows], self._made
        )

    def by(self, keys: Sequence[str]) -> dict[tuple[Any, ...], dict[str, Rate]]:
        """Return the rates of each group of cases, in ascending order of their keys; of all cases without any key.

        Raises BadRequest: there is no such column, or its values make too many groups.
        """
        group, heads = np.zeros(len(self), np.int64), [()] if len(self) else []
        for key in keys:
            values, places = np.unique(self[key], return_inverse=True)
            codes, group = np.unique(group * len(values) + places, return_inverse=True)
            heads = [(*heads[code // len(values)], values[code % len(values)].item()) for code in codes.tolist()]
            _require_few(len(heads), keys)
        known = {name: ~np.isnan(self[name].astype(float)) for name in self.rates}
        counts = {name: np.bincount(group, np.nan_to_num(self[name].astype(float)), len(heads)) for name in self.rates}
        ns = {name: np.bincount(group, known[name], len(heads)) for name in self.rates}
        return {
            head: {name: wilson(int(counts[name][k]), int(ns[name][k])) for name in self.rates}
            for k, head in enumerate(heads)
        }

    def arrow(self) -> pyarrow.Table:
        """Return it as an Arrow table: the unit of a column in its metadata, NaN as null.

        Raises BadRequest: pyarrow is not installed.
        """
        pa = imported("pyarrow")
        arrays, fields = [], []
        for name, column in self.columns.items():
            array = pa.array(self[name], from_pandas=True)
            array = array.dictionary_encode() if pa.types.is_string(array.type) and name != "case" else array
            arrays.append(array)
            fields.append(pa.field(name, array.type, metadata={"unit": column.unit}))
        about = {"parcours": FORMAT, "label": self.label, "rates": ",".join(self.rates)}
        found: pyarrow.Table = pa.Table.from_arrays(arrays, schema=pa.schema(fields, metadata=about))
        return found

    def frame(self) -> pandas.DataFrame:
        """Return it as a data frame of pandas: the units of its columns are `frame.attrs["units"]`, by name.

        Raises BadRequest: pyarrow or pandas is not installed.
        """
        imported("pandas")
        found: pandas.DataFrame = self.arrow().to_pandas()
        found.attrs["units"] = {name: column.unit for name, column in self.columns.items()}
        return found


def _worded(node: Expression, texts: Collection[str]) -> Expression:
    """Return a condition in which words compared with columns of texts are marked: `stuck` becomes `'stuck`."""
    match node:
        case Binary("==" | "!=", Name(column), Name(word)) if column in texts:
            return replace(node, right=Name(f"'{word}"))
        case Binary(_, left, right):
            return replace(node, left=_worded(left, texts), right=_worded(right, texts))
        case Unary(_, operand):
            return replace(node, operand=_worded(operand, texts))
        case _:
            return node


def imported(module: str) -> Any:
    """Return a module of an extra. Raises BadRequest: it is not installed."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        rule = f"it needs the package {module.partition('.')[0]}, which is not installed"
        raise BadRequest("results", rule, "pip install 'parcours[results]'", slug="no-results-extra") from error


def table_of(results: Results) -> ResultTable:
    """Return the table of results of any study."""
    measures = results.measures()
    columns: dict[str, TableColumn] = {}
    if isinstance(results, Tabled):
        columns |= results.table_columns()
    else:
        cases = list(results.cases())
        columns["case"] = TableColumn(lambda: np.array([one.id for one in cases]))
        columns["verdict"] = TableColumn(lambda: np.array([str(one.verdict) for one in cases]))
    for name, measure in measures.items():
        columns.setdefault(name, TableColumn(functools.partial(np.asarray, measure.values), measure.unit))
    rates = tuple(name for name, measure in measures.items() if measure.kind == "rate")
    return ResultTable(columns, rates, results.label)


def read_parts(folder: Path | str, study: str = "") -> Iterator[ResultTable]:
    """Yield the finished cases in a folder that a study wrote, as one table or as several after each other.

    Raises BadRequest, BadResults: as `read_table`.
    """
    from parcours.study.finding import study_of

    results = study_of(location(folder), study).read(location(folder))
    yield from map(table_of, results.in_parts() if isinstance(results, Divided) else [results])


def grouped(tables: Iterable[ResultTable], keys: Sequence[str]) -> dict[tuple[Any, ...], dict[str, Rate]]:
    """Return the rates of each group of cases in all tables together, as `ResultTable.by` does for one.

    Raises BadRequest: as `ResultTable.by`.
    """
    found: dict[tuple[Any, ...], dict[str, Rate]] = {}
    for table in tables:
        for given, rates in table.by(keys).items():
            head = tuple(math.nan if value != value else value for value in given)  # one NaN, which equals itself
            had = found.get(head)
            found[head] = rates if had is None else {
                name: wilson(of.count + had[name].count, of.n + had[name].n) for name, of in rates.items()
            }  # fmt: skip
        _require_few(len(found), keys)
    return dict(sorted(found.items(), key=lambda one: [(value != value, value) for value in one[0]]))


def _require_few(groups: int, keys: Sequence[str]) -> None:
    if groups > _MOST_GROUPS:
        rule = f"there may be {_MOST_GROUPS} groups, but {' and '.join(keys)} make {groups}"
        remedy = "name the block of an input (`x1_block`), or ask with --sql"
        raise BadRequest("--by", rule, remedy, slug="results-groups")


def read_table(folder: Path | str, study: str = "") -> ResultTable:
    """Return the finished cases in a folder that a study wrote; `.arrow()` of it is for other tools.

    Raises BadRequest, BadResults: as `parcours.study.finding.study_of` and `Study.read`.
    """
    from parcours.study.finding import study_of

    return table_of(study_of(location(folder), study).read(location(folder)))


def input_columns(
    inputs: InputModel, values: Callable[[], NDArray[np.float64]], taken: Iterable[str]
) -> dict[str, TableColumn]:
    """Return columns of test inputs, and of the blocks that their values lie in (`NAME_block`).

    Args:
        inputs: what is drawn for a case.
        values: gives the drawn values, shape (n_cases, n_inputs); called once, when a column is asked for.
        taken: names of other columns; an input of the same name becomes `input_NAME`.
    """
    drawn, others = functools.cache(values), set(taken)
    columns = {}
    for k, domain in enumerate(inputs.domains):
        name = f"input_{domain.name}" if domain.name in others else domain.name
        labels = np.array([*(one.label for one in domain.choices), "outside"])

        def value(k: int = k, words: tuple[str, ...] = domain.values, kind: str = domain.kind) -> NDArray[Any]:
            column = drawn()[:, k]
            if words:
                return np.asarray(np.array(words)[column.astype(int)])
            return np.asarray(column, np.int64 if kind == "integer" else np.float64)

        def block(k: int = k, labels: NDArray[np.str_] = labels) -> NDArray[Any]:
            return np.asarray(labels[inputs.domains[k].blocks_of(drawn()[:, k])])  # OUTSIDE is -1, the last

        columns[name] = TableColumn(value, domain.unit)
        columns[f"{name}_block"] = TableColumn(block)
    return columns


def field_columns(
    facts: NDArray[np.void], units: Mapping[str, str], skip: Sequence[str] = ()
) -> dict[str, TableColumn]:
    """Return a column for each plain field of structured facts, also of a record within them, by its name."""
    columns: dict[str, TableColumn] = {}
    for name in facts.dtype.names or ():
        kind = facts.dtype[name]
        if kind.names is not None and not kind.shape:
            columns |= field_columns(facts[name], units, skip)
        elif not kind.shape and kind.kind in "?if" and name not in skip:
            columns[name] = TableColumn(functools.partial(np.ascontiguousarray, facts[name]), units.get(name, "1"))
    return columns
