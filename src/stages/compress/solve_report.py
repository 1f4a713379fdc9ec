"""The report of a solve in artefacts and logs."""

from mammoreg.fem.report import SolveReport
from stages.engine.contract import Value


def report_values(report: SolveReport | None) -> dict[str, Value]:
    """What an artefact keeps of a report: all but wall times, which differ from run to run."""
    if report is None:
        return {}
    return {
        "iterations": report.iterations,
        "load_steps": report.steps,
        "cut_steps": report.cuts,
        "unbalance": report.unbalance,
        "energy_mj": report.isochoric_mj,
        "volumetric_energy_mj": report.volumetric_mj,
        "part_energies_mj": dict(report.parts_mj),
        "min_det_f": report.min_det_f,
        "volume_change": report.volume_change,
    }


def seconds_text(report: SolveReport | None) -> str:
    """Where the time of a solve went, for the log."""
    if report is None:
        return "no report of the solve"
    parts = ", ".join(f"{name} {seconds:.2f}" for name, seconds in report.seconds.items())
    return f"{report.iterations} Newton iterations in {report.steps} load steps; seconds: {parts}"
