"""Stage `figures`: pictures of one case, and the files that other programs open."""

from typing import TYPE_CHECKING

from stages.engine.artefact import Fields
from stages.engine.completion import first_failure
from stages.engine.contract import Inputs, NoSettings, Stage, Subject
from stages.figures.record import Picture, figures_fields
from stages.views import IMAGED

if TYPE_CHECKING:
    from stages.figures.case import PicturedCase

_ARTEFACTS = ("segment", "mesh", "pose", "compress", "shape", "solve", "project", "localize", "evaluate")


def run(inputs: Inputs, settings: NoSettings, subject: Subject) -> Fields:
    """Draw and export what the case's stages came to; what failed first is passed on."""
    # Only this function pays for matplotlib.
    from stages.figures.case import PicturedCase
    from stages.figures.exports import case_exports

    case = PicturedCase(inputs, subject.laterality, subject.case, subject.row.get("mr_series", ""))
    failure = first_failure(artefact for name in _ARTEFACTS for artefact in inputs.artefacts(name))
    return figures_fields(_pictures(case), case_exports(case), failure)


def _pictures(case: "PicturedCase") -> list[tuple[Picture, bytes]]:
    from stages.figures import landmarks, lesions, shapes
    from stages.figures.captions import CAPTIONS

    makers = {
        "overview": lesions.overview,
        "landmarks": landmarks.in_mammograms,
        "landmarks_3d": landmarks.in_second_volume,
        "outlines": shapes.outlines,
        "mesh": shapes.meshes,
        "segmentation": shapes.tissues,
    }
    made = {name: make(case) for name, make in makers.items()}
    return [(Picture(name, *CAPTIONS[name]), png.tobytes()) for name, png in made.items() if png is not None]


STAGE = Stage(
    name="figures",
    schema=2,
    inputs=("segment",),
    optional=(
        *_ARTEFACTS[1:],
        "mr",
        "mr_lesion",
        "mr_landmarks",
        "mr_compressed_landmarks",
        *(f"{kind}_{view}" for kind in ("lesion", "landmarks") for view in IMAGED),
    ),
    settings=NoSettings,
    run=run,
    takes_failed=True,
    folder=".",
)
