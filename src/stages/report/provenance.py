"""How the results came about: a paragraph to quote, settings and versions."""

import json
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from stages.engine.artefact import Artefact
from stages.formats.pages import Section
from stages.mesh.record import MeshRecord

_LIBRARIES = ("numpy", "scipy", "scikit-fem", "scikit-image", "pypardiso", "simpleitk", "nibabel", "pydicom", "h5py")

_MECHANICS = {
    "poisson_ratio": "Poisson's ratio {}",
    "gland_contrast": "shear modulus of gland {} times that of fat",
    "fibre_ratio": "stiffness in tension along the nipple axis {} times the shear modulus",
    "friction": "friction coefficient {} between skin and plates",
}

METHODS_TEXT = (
    "Mammograms and MR volumes were registered with mammoreg {version}, a re-implementation of the model-based "
    "registration of X-ray mammograms and MR images of the female breast. The breast was segmented in the MR volume "
    "and meshed with {elements} hexahedra by transfinite interpolation. The projection angle and the imaged portion "
    "of the breast were estimated from the outline of the mammogram, with the header's angle as prior. The breast "
    "was compressed as a nearly incompressible {tissue} body ({mechanics}) between two rigid plates to the "
    "thickness given in the mammogram's header or, without it, estimated from the image (method plate). Its surface "
    "was then adapted to the outline of the mammogram, and the interior was solved anew under the displacements of "
    "that surface (method updated). Lesions and landmarks marked in the MR volume were carried through the "
    "deformation and projected through the cone beam of the mammography unit; lesions marked in the mammograms were "
    "back-projected into the deformed breast and carried into the undeformed one, where two views intersect. "
    "Methods rigid (undeformed breast, nipples aligned) and scaling (volume-preserving scaling along the beam) "
    "serve for comparison. Distances in a mammogram are detector distances divided by the magnification at the "
    "middle of the plates; overlap is the share of the true lesion that the prediction covers. Research use only."
)


def methods_paragraph(artefacts: Sequence[Artefact]) -> str:
    """The methods text for these artefacts."""
    meshes = sorted({MeshRecord(a).elements for a in artefacts if a.stage == "mesh" and a.ok})
    elements = " or ".join(f"{n} x {n} x {n}" for n in meshes) or "n x n x n"
    versions = sorted({a.attrs["package_version"] for a in artefacts if "package_version" in a.attrs})
    settings = _mechanics_settings(artefacts)
    material = settings.get("material", "homogeneous")
    own = material in ("homogeneous", "fat_and_gland")
    tissue = "neo-Hookean" if own else f"hyperelastic (fat and gland after {material.title()})"
    return METHODS_TEXT.format(
        version=", ".join(versions), elements=elements, tissue=tissue, mechanics=_mechanics(settings)
    )


def _mechanics_settings(artefacts: Sequence[Artefact]) -> dict[str, Any]:
    found = [json.loads(a.attrs["settings"]) for a in artefacts if a.stage == "compress" and "settings" in a.attrs]
    return dict(found[0].get("mechanics", {})) if found else {}


def _mechanics(settings: Mapping[str, Any]) -> str:
    """Tissue and plates of the compression in words."""
    told = settings.get("material") == "fat_and_gland"
    kept = {key: settings.get(key) for key in _MECHANICS if told or key != "gland_contrast"}
    texts = [_MECHANICS[key].format(value) for key, value in kept.items() if value]
    return ", ".join(texts) or "homogeneous"


def settings_section(artefacts: Sequence[Artefact]) -> Section:
    """Every setting of every stage; one that differs between cases is listed with all its values."""
    found: dict[tuple[str, str], list[str]] = {}
    for artefact in artefacts:
        for key, value in json.loads(artefact.attrs.get("settings", "{}")).items():
            texts = found.setdefault((artefact.stage, key), [])
            text = _plain(value)
            texts += [text] if text not in texts else []
    rows = [[stage, key, "; ".join(texts)] for (stage, key), texts in found.items()]
    return Section("Settings", ["stage", "setting", "value"], rows)


def _plain(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value)


def versions_section(artefacts: Sequence[Artefact]) -> Section:
    """Version of this package, of the code of each stage (first characters of its digest) and of the libraries."""
    own = sorted({a.attrs["package_version"] for a in artefacts if "package_version" in a.attrs})
    codes = dict.fromkeys((a.stage, a.attrs["code"][:12]) for a in artefacts if "code" in a.attrs)
    rows = [["mammoreg", ", ".join(own)], *([name, _installed(name)] for name in _LIBRARIES)]
    return Section("Versions", ["what", "version"], [*rows, *([f"code of {stage}", code] for stage, code in codes)])


def _installed(library: str) -> str:
    try:
        return version(library)
    except PackageNotFoundError:
        return "not installed"
