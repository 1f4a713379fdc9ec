"""Time and memory of one case with two views, from files to lesion, stage by stage: `make bench`.

Without arguments the embedded cohort's first two-view case; else `two_view_case.py cases.tsv views.tsv case`.
"""

import csv
import subprocess
import sys
import tempfile
import time
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[1]
EMBEDDED_VIEWS = PROJECT / "config/digital/views.tsv"


def first_two_view_case(views: Path) -> str:
    with views.open(newline="") as file:
        cases = [row["case"] for row in csv.DictReader(file, delimiter="\t")]
    return next(case for case in cases if cases.count(case) == 2)


def snakemake(*arguments: str) -> float:
    """Run the workflow on two cores; wall time in seconds."""
    command = [
        sys.executable,
        "-m",
        "snakemake",
        *arguments,
        "--quiet",
        "rules",
        "progress",
        "host",
        "reason",
        "--cores",
        "2",
    ]
    start = time.perf_counter()
    subprocess.run(command, cwd=PROJECT, check=True)
    return time.perf_counter() - start


def rows(folder: Path) -> list[tuple[str, float, float, float]]:
    """Stage, wall time in s, processor time in s and largest resident memory in MB of every job."""
    found = []
    for path in sorted(folder.glob("**/*.tsv"), key=lambda path: path.stat().st_mtime):
        with path.open(newline="") as file:
            row = next(csv.DictReader(file, delimiter="\t"))
        numbers = (float(row[key]) if row[key] not in ("-", "NA") else 0.0 for key in ("s", "cpu_time", "max_rss"))
        found.append((path.stem, *numbers))
    return found


def main(arguments: list[str]) -> None:
    keys = [f"{key}={path}" for key, path in zip(("cases", "views"), arguments, strict=False)]
    case = arguments[2] if arguments else first_two_view_case(EMBEDDED_VIEWS)
    with tempfile.TemporaryDirectory() as folder:
        keys.append(f"results={folder}")
        if not arguments:
            snakemake(f"{folder}/digital/{case}/digital.h5", "--config", *keys)  # makes the digital patient's files
        wall = snakemake(f"{folder}/{case}/localize.h5", "--config", *keys)
        found = rows(Path(folder) / "benchmarks")
    print(f"{'stage':<16}{'wall s':>8}{'cpu s':>8}{'MB':>8}")
    for name, *numbers in found:
        print(f"{name:<16}" + "".join(f"{number:>8.1f}" for number in numbers))
    print(f"{case}: {wall:.1f} s on 2 cores, at most {max(row[3] for row in found):.0f} MB a job")


if __name__ == "__main__":
    main(sys.argv[1:])
