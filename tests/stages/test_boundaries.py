"""The house's boundaries: who imports whom, and what the numerics load."""

import subprocess
import sys
import tomllib
from pathlib import Path

from stages.engine.registry import STAGE_MODULES

PROJECT = Path(__file__).resolve().parents[2]


def test_import_contracts_hold():
    linter = Path(sys.executable).with_name("lint-imports")
    done = subprocess.run([linter], cwd=PROJECT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


def test_the_contract_about_records_names_every_stage():
    """A stage that the list forgot could import anything of the others."""
    contracts = tomllib.loads((PROJECT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    (listed,) = [
        set(c["modules"]) for c in contracts if c["name"] == "a stage imports of another stage only its record"
    ]
    assert listed == {module.rpartition(".")[0] for module in STAGE_MODULES.values()}


def test_a_stage_without_finite_elements_does_not_load_them():
    code = (
        "import sys; from stages.engine.registry import load_stage; load_stage('segment'); "
        "print([m for m in ('skfem', 'matplotlib', 'snakemake', 'pandas') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=PROJECT / "src", capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
