"""Other solvers on the same mesh, material and planes: input files, runs and what their logs say."""

import os
import re
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.breast import HEIGHT_MM, MU_KPA, POISSON, Body
from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.materials.elastic import bulk_ratio, neo_hookean

PENALTY_N_PER_MM3 = 1.0
LONGEST_S = 3600.0
HALF_HEIGHT_MM = 0.5 * HEIGHT_MM
MU_MPA = 1e-3 * MU_KPA
BULK_MPA = MU_MPA * bulk_ratio(POISSON)
PLATE_MM = 400.0


@dataclass(frozen=True)
class PeerRun:
    """What a run gave: Newton iterations, load steps, seconds in the solver and in all, and the planes' force."""

    iterations: int
    steps: int
    solve_s: float
    total_s: float
    force_n: float


@dataclass(frozen=True)
class Peer:
    """A program: its name on the PATH, its input file, arguments, and what its output says."""

    name: str
    command: str
    file: str
    arguments: tuple[str, ...]
    deck: Callable[[Body, float], str]
    force_n: Callable[[Path, Body, float], float]
    counts: Callable[[Path], tuple[int, int, float | None]]

    @property
    def path(self) -> str | None:
        """Where the program is, if it is."""
        return shutil.which(self.command)

    def run(self, body: Body, compression: float) -> PeerRun:
        """Solve in a folder of its own, on one thread.

        Raises:
            RuntimeError: the program fails, or takes more than an hour.
        """
        environment = {**os.environ, "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            (folder / self.file).write_text(self.deck(body, compression))
            start = time.perf_counter()
            try:
                subprocess.run(
                    [str(self.path), *self.arguments],
                    cwd=folder,
                    env=environment,
                    check=True,
                    capture_output=True,
                    timeout=LONGEST_S,
                )
                total = time.perf_counter() - start
                iterations, steps, solve = self.counts(folder)
                force = self.force_n(folder, body, compression)
            except (subprocess.SubprocessError, OSError, ValueError, IndexError, StopIteration) as error:
                raise RuntimeError(f"{self.command} gave no answer: {error}") from error
        return PeerRun(iterations, steps, total if solve is None else solve, total, force)


def _rows(tag: str, rows: Iterable[Iterable[float]]) -> str:
    return "\n".join(
        f'<{tag} id="{number}">{",".join(f"{value:.12g}" for value in row)}</{tag}>'
        for number, row in enumerate(rows, 1)
    )


def febio_deck(body: Body, compression: float) -> str:
    """Format 2.5, which still knows rigid walls; mm, N, MPa."""
    back, core = (
        "".join(f'<node id="{node + 1}"/>' for node in nodes) for nodes in (body.block.back_nodes(), body.core)
    )
    way = HALF_HEIGHT_MM * compression
    walls = "\n".join(
        f'<contact type="rigid_wall" surface="skin"><laugon>0</laugon><tolerance>0.2</tolerance>'
        f"<penalty>{PENALTY_N_PER_MM3}</penalty><plane>0,0,{facing},{-HALF_HEIGHT_MM}</plane>"
        f'<offset lc="1">{way:.12g}</offset></contact>'
        for facing in (1, -1)
    )
    return f"""<?xml version="1.0" encoding="ISO-8859-1"?>
<febio_spec version="2.5">
<Module type="solid"/>
<Control>
<analysis type="static"/><time_steps>10</time_steps><step_size>0.1</step_size>
<max_refs>25</max_refs><max_ups>0</max_ups><dtol>0.001</dtol><etol>0.01</etol><rtol>0</rtol>
<time_stepper><dtmin>0.001</dtmin><dtmax>0.1</dtmax><max_retries>20</max_retries><opt_iter>11</opt_iter></time_stepper>
</Control>
<Material><material id="1" name="breast" type="Mooney-Rivlin">
<c1>{0.5 * MU_MPA:.12g}</c1><c2>0</c2><k>{BULK_MPA:.12g}</k><pressure_model>2</pressure_model>
</material></Material>
<Geometry>
<Nodes name="breast">{_rows("node", body.block.points)}</Nodes>
<Elements type="hex8" mat="1" name="breast">{_rows("elem", body.block.hexes() + 1)}</Elements>
<NodeSet name="back">{back}</NodeSet>
<NodeSet name="core">{core}</NodeSet>
<Surface name="skin">{_rows("quad4", body.block.skin_quads() + 1)}</Surface>
</Geometry>
<Boundary><fix bc="y" node_set="back"/><fix bc="x,y,z" node_set="core"/></Boundary>
<Contact>{walls}</Contact>
<LoadData><loadcurve id="1" type="linear"><point>0,0</point><point>1,1</point></loadcurve></LoadData>
<Output><logfile><node_data data="ux;uy;uz" file="moved.txt" delim=","/></logfile></Output>
</febio_spec>
"""


def febio_force_n(folder: Path, body: Body, compression: float) -> float:
    """Force of the upper plane: the internal forces, of our elements, which are its own, of the nodes at it."""
    lines = [line for line in (folder / "moved.txt").read_text().splitlines() if line and not line.startswith("*")]
    moved = np.array([[float(value) for value in line.split(",")[-3:]] for line in lines[-len(body.block.points) :]])
    model = HyperelasticModel(body.block.points, body.block.hexes(), neo_hookean(MU_KPA, POISSON))
    positions = body.block.points + moved
    state = model.state(positions)
    dilatation = (model.weights * (state.det - 1.0)).sum(axis=1) / model.volume
    force = model.residual(state, model.material.bulk_kpa * dilatation).force
    nodal = np.bincount(model.dofs.ravel(), force.ravel(), positions.size).reshape(-1, 3)
    touching = positions[:, 2] > HALF_HEIGHT_MM * (1.0 - compression)
    return float(-nodal[touching, 2].sum()) * 1e-3


def febio_counts(folder: Path) -> tuple[int, int, float | None]:
    """Iterations, load steps and seconds of the solve."""
    log = (folder / "breast.log").read_text(errors="replace")
    iterations, steps = (
        int(re.findall(rf"{name} \.+ : (\d+)", log)[-1])
        for name in ("Total number of equilibrium iterations", "Number of time steps completed")
    )
    seconds = re.findall(r"Solve time[ .]+: \S+ \(([\d.eE+-]+) sec\)", log)
    return iterations, steps, float(seconds[-1]) if seconds else None


def calculix_deck(body: Body, compression: float) -> str:
    """Planes as one rigid element each that pushes on the skin; mm, N, MPa; C3D8, which locks."""
    points, hexes, way = body.block.points, body.block.hexes() + 1, HALF_HEIGHT_MM * compression
    count, elements, half = len(points), len(hexes), 0.5 * PLATE_MM
    lines = ["*NODE, NSET=BREAST", *_csv(np.arange(1, count + 1), points)]
    corners = np.array([[-half, -half], [half, -half], [half, half], [-half, half]])
    for side, bottom in enumerate((-HALF_HEIGHT_MM - 10.0, HALF_HEIGHT_MM)):
        plate = np.array([[*corner, height] for height in (bottom, bottom + 10.0) for corner in corners])
        numbers = count + 8 * side + np.arange(1, 9)
        lines += [f"*NODE, NSET=PLATE{side}", *_csv(numbers, plate), f"*ELEMENT, TYPE=C3D8, ELSET=PLATES{side}"]
        lines += _csv(np.array([elements + side + 1]), numbers[None])
        lines += [f"*SURFACE, NAME=FACE{side}", f"{elements + side + 1}, S{2 - side}"]
    lines += ["*ELEMENT, TYPE=C3D8, ELSET=TISSUE", *_csv(np.arange(1, elements + 1), hexes)]
    lines += ["*SURFACE, NAME=SKIN", *_skin_faces(body)]
    for name, nodes in (("BACK", body.block.back_nodes()), ("CORE", body.core)):
        lines += [f"*NSET, NSET={name}", *(f"{node + 1}," for node in nodes)]
    lines += ["*MATERIAL, NAME=BREAST", "*HYPERELASTIC, NEO HOOKE", f"{0.5 * MU_MPA:.12g}, {2.0 / BULK_MPA:.12g}"]
    lines += ["*MATERIAL, NAME=PLATE", "*ELASTIC", "1000., 0.3", "*SOLID SECTION, ELSET=TISSUE, MATERIAL=BREAST"]
    for side in (0, 1):
        lines += [f"*SOLID SECTION, ELSET=PLATES{side}, MATERIAL=PLATE"]
    lines += ["*SURFACE INTERACTION, NAME=SLIDE", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR"]
    lines += [f"{PENALTY_N_PER_MM3}"]
    for side in (0, 1):
        lines += ["*CONTACT PAIR, INTERACTION=SLIDE, TYPE=SURFACE TO SURFACE", f"SKIN, FACE{side}"]
    lines += ["*BOUNDARY", "BACK, 2, 2", "CORE, 1, 3", "*STEP, NLGEOM, INC=200", "*STATIC", "0.1, 1., 1e-5, 0.1"]
    lines += ["*BOUNDARY"]
    for side, towards in enumerate((way, -way)):
        lines += [f"PLATE{side}, 1, 2", f"PLATE{side}, 3, 3, {towards:.12g}"]
    lines += ["*NODE PRINT, NSET=PLATE1, TOTALS=ONLY", "RF", "*END STEP", ""]
    return "\n".join(lines)


def _csv(numbers: Iterable[int], rows: Iterable[Iterable[float]]) -> list[str]:
    return [
        ", ".join([str(number), *(f"{value:.12g}" for value in row)]) for number, row in zip(numbers, rows, strict=True)
    ]


def _skin_faces(body: Body) -> list[str]:
    """Element and face number of the skin: CalculiX counts a hexahedron's faces bottom, top, then the sides."""
    n, numbers = body.block.n, np.arange(1, body.block.n**3 + 1).reshape((body.block.n,) * 3)
    last = n - 1
    faces = {2: numbers[last], 3: numbers[:, 0], 4: numbers[:, :, last], 5: numbers[:, last], 6: numbers[:, :, 0]}
    return [f"{element}, S{face}" for face, elements in faces.items() for element in elements.ravel()]


def calculix_force_n(folder: Path, _body: Body, _compression: float) -> float:
    """Force that holds the upper plane, as printed at the end."""
    totals = (folder / "breast.dat").read_text().split("total force (fx,fy,fz) for set PLATE1")[-1].splitlines()[1:]
    return abs(float(next(line for line in totals if line.strip()).split()[2]))


def calculix_counts(folder: Path) -> tuple[int, int, float | None]:
    """Iterations and increments of the status file."""
    rows = [row.split() for row in (folder / "breast.sta").read_text().splitlines()]
    done = [row for row in rows if len(row) >= 7 and row[0].isdigit()]
    return sum(int(row[3]) for row in done), len({row[1] for row in done}), None


PEERS = (
    Peer(
        "FEBio",
        "febio4",
        "breast.feb",
        ("-i", "breast.feb", "-o", "breast.log", "-silent"),
        febio_deck,
        febio_force_n,
        febio_counts,
    ),
    Peer("CalculiX", "ccx", "breast.inp", ("breast",), calculix_deck, calculix_force_n, calculix_counts),
)
