"""One scenario tried: solved, checked from outside, and put into numbers."""

import time
from dataclasses import asdict, dataclass

import numpy as np

from mammoreg.errors import NotConvergedError
from mammoreg.fem.plates.closing import Closed
from mammoreg.meshing.block import BlockMesh
from mammoreg.scenes.checks import Check, deepest_mm, min_jacobian, outside_checks
from mammoreg.scenes.scenario import Scenario
from mammoreg.scenes.scene import Scene, build_scene


@dataclass(frozen=True)
class Trial:
    """What came of a scenario; all but `converged` and `message` is None where nothing converged.

    Attributes:
        converged: whether the solver says so; None where it was not asked.
        message: why not, or what else there is to say.
        newton_iterations, load_steps: of the solve.
        min_jacobian: smallest scaled Jacobian at a corner of the deformed elements.
        volume_change: relative, of the whole breast.
        force_n: mean of the plates' forces.
        width_mm, depth_mm: extent of the deformed breast along medial and posterior.
        penetration_mm: how far the deepest contact point lies inside a plate.
        wall_s: time of the solve.
        checks: name, value and limit of each check from outside.
    """

    converged: bool | None
    message: str = ""
    newton_iterations: int | None = None
    load_steps: int | None = None
    min_jacobian: float | None = None
    volume_change: float | None = None
    force_n: float | None = None
    width_mm: float | None = None
    depth_mm: float | None = None
    penetration_mm: float | None = None
    wall_s: float | None = None
    checks: tuple[Check, ...] = ()

    @property
    def checks_passed(self) -> bool | None:
        """Whether a converged answer passes every check."""
        return all(check.passed for check in self.checks) if self.converged else None

    def values(self) -> dict[str, object]:
        """All of it in JSON types; a check's value is None where it is no number."""
        checks = [
            {"name": c.name, "value": float(c.value) if np.isfinite(c.value) else None, "limit": float(c.limit)}
            for c in self.checks
        ]
        return {**asdict(self), "checks": checks, "checks_passed": self.checks_passed}


def try_scenario(scenario: Scenario, mesh: BlockMesh) -> Trial:
    """Solve a scenario on a mesh of its shape and check the answer."""
    scene = build_scene(scenario, mesh)
    start = time.perf_counter()
    try:
        closed = scene.closed()
    except NotConvergedError as error:
        return Trial(False, str(error), wall_s=time.perf_counter() - start)
    return _judged(scene, closed, time.perf_counter() - start)


def _judged(scene: Scene, closed: Closed, wall_s: float) -> Trial:
    checks = outside_checks(scene, closed)
    failed = [f"{c.name} is {c.value:.3g}, above {c.limit:.3g}" for c in checks if not c.passed]
    corner = min_jacobian(scene, closed)
    folded = ["elements are folded at a corner"] if corner <= 0.0 else []
    extent = np.ptp(closed.deformed, axis=0)
    return Trial(
        converged=True,
        message="; ".join([*failed, *folded]),
        newton_iterations=closed.iterations,
        load_steps=closed.steps,
        min_jacobian=corner,
        volume_change=closed.volume_change,
        force_n=0.5 * sum(closed.force_n),
        width_mm=float(extent[0]),
        depth_mm=float(extent[1]),
        penetration_mm=deepest_mm(scene, closed),
        wall_s=wall_s,
        checks=checks,
    )
