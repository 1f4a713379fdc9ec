"""The house's boundaries: who imports whom, and what the numerics load."""

import subprocess
import sys
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[2]


def test_import_contracts_hold():
    linter = Path(sys.executable).with_name("lint-imports")
    done = subprocess.run([linter], cwd=PROJECT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


def test_a_stage_without_finite_elements_does_not_load_them():
    code = (
        "import sys; from stages.engine.registry import load_stage; load_stage('segment'); "
        "print([m for m in ('skfem', 'matplotlib', 'snakemake', 'pandas') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=PROJECT / "src", capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
