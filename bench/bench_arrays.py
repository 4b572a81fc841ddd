"""Sizes of covering arrays and the seconds they take, against published sizes and those of other tools.

python bench/bench_arrays.py                 the default effort: a fixed amount of work, a few seconds
python bench/bench_arrays.py --budget 300    this many seconds for each array
python bench/bench_arrays.py --growth        cost against size, pair-wise, over three decades of tuples
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass

from parcours.data.arrays.building import CoveringArray, covering_array
from parcours.data.arrays.goals import goals_of


@dataclass(frozen=True)
class Instance:
    """A covering array that others have published sizes for.

    `short` and `long` are the sizes that must be reached within 10 s and 300 s; `best` is the best published one and
    `pict` that of PICT 3.7.4 with its default seed (pairwise.org/efficiency.html; walkframe/covertable).
    """

    name: str
    strength: int
    sizes: tuple[int, ...]
    short: int
    long: int
    best: int | None
    pict: int


INSTANCES = (
    Instance("3^4", 2, (3,) * 4, 9, 9, 9, 12),
    Instance("3^13", 2, (3,) * 13, 19, 15, 15, 19),
    Instance("4^15 3^17 2^29", 2, (4,) * 15 + (3,) * 17 + (2,) * 29, 38, 31, 28, 38),
    Instance("4^1 3^39 2^35", 2, (4,) + (3,) * 39 + (2,) * 35, 28, 21, 20, 28),
    Instance("2^100", 2, (2,) * 100, 15, 10, 10, 16),
    Instance("10^20", 2, (10,) * 20, 213, 190, 180, 213),
    Instance("4^10", 3, (4,) * 10, 156, 156, None, 156),
    Instance("2^20", 4, (2,) * 20, 68, 68, None, 68),
)

GROWTH = ((3, 10), (3, 30), (3, 100), (3, 300), (3, 1000))
"""Blocks and columns of the pair-wise arrays that show how cost grows."""


def built(sizes: tuple[int, ...], strength: int, budget: float | None, seed: int) -> tuple[CoveringArray, int, float]:
    """Return an array, its number of tuples and the seconds it took, after demanding that it holds everything."""
    begun = time.perf_counter()
    goals = goals_of(sizes, strength)
    array = covering_array(goals, budget=budget, seed=seed)
    taken = time.perf_counter() - begun
    if not goals.are_met_by(array.rows):
        raise AssertionError("an array must hold every tuple")
    return array, goals.n_tuples, taken


def main() -> None:
    """Build the arrays one after the other and print a line for each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--budget", type=float, help="seconds for each array; by default a fixed effort")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--growth", action="store_true", help="show cost against size instead")
    chosen = parser.parse_args()
    built((2, 2, 2, 3), 2, None, 0)  # compiles, untimed
    if chosen.growth:
        print(f"{'array':>10} {'tuples':>10} {'rows':>5} {'fewest':>6} {'seconds':>8} {'us a tuple':>10}")
        for blocks, columns in GROWTH:
            array, n, taken = built((blocks,) * columns, 2, chosen.budget, chosen.seed)
            name = f"{blocks}^{columns}"
            print(f"{name:>10} {n:>10} {len(array.rows):>5} {array.fewest:>6} {taken:>8.2f} {1e6 * taken / n:>10.1f}")
        return
    print(f"{'array':>16} {'t':>2} {'rows':>5} {'must be':>8} {'best':>5} {'PICT':>5} {'fewest':>6} {'seconds':>8}")
    worst = 0.0
    for each in INSTANCES:
        array, _, taken = built(each.sizes, each.strength, chosen.budget, chosen.seed)
        wanted = each.short if chosen.budget is None or chosen.budget < 300 else each.long
        worst = max(worst, len(array.rows) / wanted)
        stages = ", ".join(f"{stage.name} {stage.n_rows} ({stage.seconds:.1f} s)" for stage in array.stages)
        print(
            f"{each.name:>16} {each.strength:>2} {len(array.rows):>5} {f'<= {wanted}':>8} {each.best or '-':>5}"
            f" {each.pict:>5} {array.fewest:>6} {taken:>8.1f}  {stages}",
            flush=True,
        )
    print(f"largest ratio of rows to what must hold: {worst:.2f}")


if __name__ == "__main__":
    main()
