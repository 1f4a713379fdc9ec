"""All stages of one case in this process, as the workflow's rules chain them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from stages.engine.artefact import Artefact
from stages.engine.contract import Laterality, Subject
from stages.engine.run import run_stage

Settings = Mapping[str, Mapping[str, Any]]


@dataclass(frozen=True)
class Given:
    """A case as its rows of the tables give it: files by the names that stages use, and values of each view."""

    laterality: Laterality
    mr: Path
    images: Mapping[str, Path]
    marks: Mapping[str, Path] = field(default_factory=dict)
    more: Mapping[str, Path] = field(default_factory=dict)
    rows: Mapping[str, Mapping[str, str]] = field(default_factory=dict)


def run_case(given: Given, folder: Path, settings: Settings) -> dict[str, Artefact]:
    """Artefacts by file name without its ending; `localize` is the last."""

    def run(stage: str, inputs: Mapping[str, Path | Sequence[Path]], view: str | None = None) -> Path:
        output = folder / (f"{stage}.{view}.h5" if view else f"{stage}.h5")
        row = given.rows.get(view, {}) if view else {}
        run_stage(stage, inputs, output, settings.get(stage, {}), Subject("case1", given.laterality, view, row))
        return output

    calibrate = run("calibrate", {})
    segment = run("segment", {"mr": given.mr, **given.more})
    mesh = run("mesh", {"segment": segment})
    base = {"segment": segment, "mesh": mesh}
    of_views: dict[str, list[Path]] = {"pose": [], "compress": [], "solve": []}
    views = sorted(given.images) or ["3D"]
    for view in views:
        image = {"image": given.images[view]} if view in given.images else {}
        pose = run("pose", {**base, "calibrate": calibrate, **image}, view)
        compress = run("compress", {**base, "pose": pose, "calibrate": calibrate}, view)
        shape = run("shape", {"mesh": mesh, "pose": pose, "compress": compress}, view)
        solve = run("solve", {"mesh": mesh, "compress": compress, "shape": shape}, view)
        for name, path in (("pose", pose), ("compress", compress), ("solve", solve)):
            of_views[name].append(path)
    run("localize", {**base, **of_views, **given.marks})
    return {path.stem: Artefact(path) for path in sorted(folder.glob("*.h5"))}
