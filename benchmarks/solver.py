"""Our solver beside every peer on the PATH, on one breast: `make bench`, results/benchmarks/solver.csv.

The breast is a half ellipsoid between two planes, its 7 x 7 x 7 hexahedra subdivided. Ours takes the road of
`close_nested` with `benchmarks.breast.OPTIONS`: no friction, one tissue, contact not stiffened at rest. The pipeline
takes another, `Closing.close`, because friction remembers the way (docs/solver_roads.md). Every run is a process of its
own on one thread; times are medians of five runs, of one above a minute. `python -m benchmarks.solver --help` names the
options.
"""

import argparse
import csv
import json
import os
import resource
import subprocess
import sys
import time
from pathlib import Path
from statistics import median

import numpy as np

from benchmarks.breast import HEIGHT_MM, POISSON, breast
from benchmarks.peers import PEERS

PROJECT = Path(__file__).resolve().parents[1]
OUTPUT = PROJECT / "results/benchmarks/solver.csv"
REFERENCE = PROJECT.parent / "shared/data/fe/febio_scaling.csv"
ELEMENTS, COMPRESSIONS = (7, 14, 21, 28, 42), (0.21, 0.5)
RUNS, LONG_S = 5, 60.0
COLUMNS = (
    "program",
    "problem",
    "elements",
    "nu",
    "compression",
    "newton_iterations",
    "load_steps",
    "solve_s",
    "total_s",
    "peak_mb",
    "force_n",
    "threads",
    "note",
)
Row = dict[str, str]


def run_ours(elements: int, compression: float) -> Row:
    """Close the plates once; total time is that of this process from its start, interpreter and imports included."""
    from mammoreg.fem.linear.direct import pypardiso
    from mammoreg.fem.plates.nested import close_nested

    body = breast(elements)
    start = time.perf_counter()
    levels = close_nested(body.closing(), HEIGHT_MM * (1.0 - compression))
    solve = time.perf_counter() - start
    coarse = [f"{round(len(c.deformed) ** (1 / 3)) - 1} a side: {c.iterations}" for c in levels[:-1]]
    solver = "MKL PARDISO" if pypardiso is not None else "SuperLU"
    note = f"close_nested, no friction; one pressure a hexahedron; {solver}" + (
        f"; before, on coarser meshes, {', '.join(coarse)}" if coarse else ""
    )
    finest = levels[-1]
    return _row("mammoreg", elements, compression, finest.iterations, finest.steps, solve, 0.0, finest.force_n[0], note)


def run_peer(name: str, elements: int, compression: float) -> Row:
    """Run another program once."""
    peer = next(peer for peer in PEERS if peer.name == name)
    done = peer.run(breast(elements), compression)
    row = _row(name, elements, compression, done.iterations, done.steps, done.solve_s, done.total_s, done.force_n, "")
    return row | {"peak_mb": f"{resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024:.0f}"}


def _row(
    program: str,
    elements: int,
    compression: float,
    iterations: int,
    steps: int,
    solve_s: float,
    total_s: float,
    force_n: float,
    note: str,
) -> Row:
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    values = (program, "subdivided breast", elements, POISSON, compression, iterations, steps, f"{solve_s:.2f}")
    rest = (f"{total_s:.2f}", f"{peak:.0f}", f"{force_n:.3f}", os.environ.get("OMP_NUM_THREADS", ""), note)
    return dict(zip(COLUMNS, map(str, (*values, *rest)), strict=True))


def measured(program: str, elements: int, compression: float, threads: int, runs: int) -> Row | None:
    """Median row of runs in processes of their own; None if the program fails."""
    count = str(threads)
    environment = {**os.environ, "OMP_NUM_THREADS": count, "MKL_NUM_THREADS": count, "OPENBLAS_NUM_THREADS": count}
    command = [sys.executable, "-m", "benchmarks.solver", "--once", program, str(elements), str(compression)]
    rows: list[Row] = []
    while len(rows) < runs:
        start = time.perf_counter()
        done = subprocess.run(command, env=environment, cwd=PROJECT, capture_output=True, text=True, check=False)
        total = time.perf_counter() - start
        if done.returncode != 0:
            print(f"{program}, {elements} a side, {compression:.0%}: {done.stderr.strip().splitlines()[-1:]}")
            return None
        row = json.loads(done.stdout)
        if program == "mammoreg":
            row["total_s"] = f"{total:.2f}"
        rows.append(row)
        if total > LONG_S:
            break
    times = {key: f"{median(float(row[key]) for row in rows):.2f}" for key in ("solve_s", "total_s")}
    note = "; ".join(part for part in (rows[0]["note"], f"median of {len(rows)}") if part)
    return rows[0] | times | {"note": note, "peak_mb": max((row["peak_mb"] for row in rows), key=float)}


def table(rows: list[Row]) -> str:
    """The rows beside FEBio's published figures, where they are at hand."""
    febio = _reference()
    head = (
        "program",
        "n",
        "closed",
        "newton",
        "steps",
        "solve s",
        "total s",
        "MB",
        "force N",
        "solve/FEBio",
        "force/FEBio",
    )
    lines = ["".join(f"{name:>12}" for name in head)]
    for row in rows:
        other = febio.get((row["elements"], float(row["compression"])))
        ratios = (
            ["", ""] if other is None else [f"{float(row[k]) / float(other[k]):.3f}" for k in ("solve_s", "force_n")]
        )
        keys = (
            "program",
            "elements",
            "compression",
            "newton_iterations",
            "load_steps",
            "solve_s",
            "total_s",
            "peak_mb",
        )
        lines.append("".join(f"{value:>12}" for value in (*(row[key] for key in keys), row["force_n"], *ratios)))
    return "\n".join([*lines, *_growth(rows)])


def _reference() -> dict[tuple[str, float], Row]:
    if not REFERENCE.exists():
        return {}
    with REFERENCE.open(newline="") as file:
        return {(row["elements"], float(row["compression"])): row for row in csv.DictReader(file)}


def _growth(rows: list[Row]) -> list[str]:
    """Exponent of the solve time over the unknowns, by least squares, of our runs."""
    lines = []
    for compression in sorted({row["compression"] for row in rows}):
        ours = [row for row in rows if row["program"] == "mammoreg" and row["compression"] == compression]
        if len(ours) > 2:
            unknowns = [3.0 * (int(row["elements"]) + 1) ** 3 for row in ours]
            exponent = np.polyfit(np.log(unknowns), np.log([float(row["solve_s"]) for row in ours]), 1)[0]
            lines.append(f"mammoreg, closed by {float(compression):.0%}: solve time grows as unknowns^{exponent:.2f}")
    return lines


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--elements", type=int, nargs="+", default=ELEMENTS, help="elements a side, multiples of 7")
    parser.add_argument("--compression", type=float, nargs="+", default=COMPRESSIONS, help="shares of the height")
    parser.add_argument("--runs", type=int, default=RUNS, help="runs of which the median is taken")
    parser.add_argument("--threads", type=int, default=1, help="OpenMP and MKL threads of our solver")
    parser.add_argument("--output", type=Path, default=OUTPUT)
    parser.add_argument("--once", nargs=3, metavar=("PROGRAM", "ELEMENTS", "COMPRESSION"), help=argparse.SUPPRESS)
    return parser.parse_args()


def main() -> None:
    options = arguments()
    if options.once:
        program, elements, compression = options.once[0], int(options.once[1]), float(options.once[2])
        row = run_ours(elements, compression) if program == "mammoreg" else run_peer(program, elements, compression)
        print(json.dumps(row))
        return
    present = [peer.name for peer in PEERS if peer.path is not None]
    for peer in PEERS:
        if peer.path is None:
            print(f"{peer.name}: skipped, {peer.command} is not on the PATH")
    rows: list[Row] = []
    options.output.parent.mkdir(parents=True, exist_ok=True)
    for program in ("mammoreg", *present):
        for elements in options.elements:
            for compression in options.compression:
                threads = options.threads if program == "mammoreg" else 1
                row = measured(program, elements, compression, threads, options.runs)
                if row is not None:
                    rows.append(row)
                    print(f"{program}, {elements} a side, {compression:.0%}: {row['solve_s']} s", flush=True)
                with options.output.open("w", newline="") as file:
                    writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
                    writer.writeheader()
                    writer.writerows(rows)
    print(table(rows))


if __name__ == "__main__":
    main()
