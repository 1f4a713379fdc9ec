"""Stage `figures`: pictures of one case, and the files that other programs open."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from stages.engine.artefact import Fields, first_failure
from stages.engine.contract import Inputs, SettingsModel, Stage, Subject
from stages.views import IMAGED

if TYPE_CHECKING:
    from mammoreg.plots.style import Png
    from stages.figures.case import PicturedCase

_ARTEFACTS = ("segment", "mesh", "pose", "compress", "shape", "solve", "project", "localize", "evaluate")


class Settings(SettingsModel):
    """`figures` has no settings."""


@dataclass(frozen=True)
class Picture:
    """A picture of a case with what stands beside it in the report."""

    name: str
    title: str
    caption: str
    png: "Png"


def run(inputs: Inputs, settings: Settings, subject: Subject) -> Fields:
    """Draw and export what the case's stages came to; what failed first is passed on."""
    # Only this function pays for matplotlib.
    from stages.figures.case import PicturedCase
    from stages.figures.exports import case_exports

    case = PicturedCase(inputs, subject.laterality)
    pictures = _pictures(case)
    files = {f"figures/{picture.name}.png": picture.png.tobytes() for picture in pictures}
    files |= {f"export/{name}": content for name, content in case_exports(case).items()}
    listed = [{"name": p.name, "title": p.title, "caption": p.caption} for p in pictures]
    failure = first_failure(artefact for name in _ARTEFACTS for artefact in inputs.artefacts(name))
    return Fields(values={"pictures": listed, "files": sorted(files)}, files=files, failure=failure)


def _pictures(case: "PicturedCase") -> list[Picture]:
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
    return [Picture(name, *CAPTIONS[name], png) for name, png in made.items() if png is not None]


STAGE = Stage(
    name="figures",
    schema=1,
    inputs=("segment",),
    optional=(
        *_ARTEFACTS[1:],
        "mr",
        "mr_lesion",
        "mr_landmarks",
        "mr_compressed_landmarks",
        *(f"{kind}_{view}" for kind in ("lesion", "landmarks") for view in IMAGED),
    ),
    settings=Settings,
    run=run,
    takes_failed=True,
    folder=".",
)
