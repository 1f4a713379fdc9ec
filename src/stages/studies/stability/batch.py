"""Some scenarios of the stability study, each in a process of its own."""

from collections.abc import Mapping
from functools import partial
from typing import Any

from pydantic import Field

from mammoreg.errors import DataError, NotConvergedError
from mammoreg.meshing.block import BlockMesh
from mammoreg.scenes.bodies import body_mesh
from mammoreg.scenes.design import stability_design
from mammoreg.scenes.scenario import SCAN, STICKING, Scenario
from mammoreg.scenes.trial import Trial, try_scenario
from stages.engine.artefact import Artefact
from stages.engine.contract import Fields, Inputs, SettingsModel, Stage, Subject
from stages.studies.stability.isolated import in_own_process
from stages.studies.stability.record import ScanMeshRecord

NO_SCAN = "not run: stability_scan is not set"
NOT_CHOSEN = "not run: left out by stability_batch.only"


class Settings(SettingsModel):
    """How the study's scenarios are run."""

    batches: int = Field(12, ge=1, le=240, description="jobs that share the scenarios")
    time_limit_s: float = Field(900.0, gt=0.0, description="a scenario that takes longer has not converged, s")
    only: tuple[str, ...] = Field((), description="names of scenarios to run; empty: all")


def run(inputs: Inputs, settings: Settings, subject: Subject) -> Fields:
    """Try every scenario of the batch; the others of the study are left to other jobs."""
    if unknown := set(settings.only) - {scenario.name for scenario in stability_design()}:
        raise DataError(
            f"key stability_batch.only: no scenarios {', '.join(sorted(unknown))}; stability.csv lists them"
        )
    scan = inputs.artefact("stability_scan_mesh") if inputs.has("stability_scan_mesh") else None
    rows = []
    for scenario in batch_of(int(subject.row["batch"]), settings.batches):
        chosen = not settings.only or scenario.name in settings.only
        trial = _tried(scenario, scan, settings.time_limit_s) if chosen else Trial(None, NOT_CHOSEN)
        print(f"{scenario.name}: converged {trial.converged}, {trial.wall_s or 0.0:.1f} s {trial.message}", flush=True)
        rows.append(_row(scenario, trial))
    return Fields(values={"rows": rows})


def batch_of(batch: int, batches: int) -> list[Scenario]:
    """Scenarios of a batch, 0 to `batches` - 1: finest meshes are dealt out first, so that jobs take alike."""
    order = sorted(stability_design(), key=lambda scenario: -scenario.elements)
    return order[batch::batches]


def _tried(scenario: Scenario, scan: Artefact | None, limit_s: float) -> Trial:
    if scenario.shape == SCAN and scan is None:
        return Trial(None, NO_SCAN)
    if scenario.shape == SCAN and scan is not None and scan.failure:
        return Trial(None, f"not run: {scan.failure.message}")
    mesh = _mesh(scenario, scan)
    try:
        return in_own_process(partial(try_scenario, scenario, mesh), limit_s)
    except NotConvergedError as error:
        return Trial(False, str(error))


def _mesh(scenario: Scenario, scan: Artefact | None) -> BlockMesh:
    if scenario.shape != SCAN or scan is None:
        return body_mesh(scenario.shape, scenario.elements)
    return ScanMeshRecord(scan).block(scenario.elements)


def _row(scenario: Scenario, trial: Trial) -> Mapping[str, Any]:
    """A row of the table, and what the page needs besides."""
    return {
        "scenario": scenario.name,
        "material": scenario.material,
        "nu": scenario.poisson,
        "compression": scenario.compression,
        "elements": scenario.elements,
        "contrast": scenario.contrast,
        "shape": scenario.shape,
        "friction": "sticking" if scenario.friction == STICKING else f"{scenario.friction:g}",
        **trial.values(),
    }


STAGE = Stage(
    name="stability_batch",
    schema=1,
    inputs=(),
    optional=("stability_scan_mesh",),
    settings=Settings,
    run=run,
    takes_failed=True,
)
