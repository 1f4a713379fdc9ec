"""The folder that an import leaves: tables, account, and files under neutral names; whole or not at all."""

import csv
import io
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mammoreg.errors import DataError
from stages.cohort.readers.dicom_headers import read_dicom
from stages.cohort.readers.mr.stacks import MrStack
from stages.cohort.readers.mr.voxels import stack_voxels
from stages.engine.errors import UserError
from stages.formats.nifti import nifti_bytes
from stages.importing.deidentified import deidentified
from stages.importing.mammograms import FoundImage
from stages.importing.plan import Breast, Entry, Plan

CASES, VIEWS, ACCOUNT = "cases.tsv", "views.tsv", "import.tsv"
Watched = Callable[[Sequence[Breast]], Iterable[Breast]]


def write_import(
    plan: Plan, out: Path, watched: Watched, *, link: bool = False, with_paths: bool = False
) -> list[Breast]:
    """Write what was planned; a breast whose pixels cannot be read is left, and the account says why.

    Args:
        plan: the rows and the account.
        out: a folder that is not there yet, or empty.
        watched: passes the breasts on, and shows how far it is.
        link: links to the files as they are in place of copies without identity.
        with_paths: the account names the files.

    Returns:
        The breasts that are written.

    Raises:
        UserError: the folder is there, cannot be written, or would hold no breast.
    """
    written: list[Breast] = []
    entries = list(plan.entries)
    cases: list[dict[str, str]] = []
    views: list[dict[str, str]] = []
    with _made(out) as folder:
        volumes: dict[int, str] = {}
        for breast in watched(plan.breasts):
            shared = sum(other.stack is breast.stack for other in plan.breasts) > 1
            name = f"{breast.patient}{breast.exam}" if shared else breast.case
            try:
                if id(breast.stack) not in volumes:
                    volumes[id(breast.stack)] = _write_mr(folder, breast, name, link)
                images = {
                    view: _write_image(folder, breast, view, image, link) for view, image in breast.images.items()
                }
            except DataError as error:
                entries.append(
                    Entry(breast.patient, breast.case, "", f"left after all: {_without_paths(error, breast)}")
                )
                continue
            exam = {"exam": breast.exam} if breast.exam else {}
            row = {"case": breast.case, "laterality": breast.side, "mr": volumes[id(breast.stack)]}
            cases.append(row | {"patient": breast.patient} | exam)
            views += [{"case": breast.case, "view": view, "image": image} for view, image in images.items()]
            written.append(breast)
        if not written:
            raise UserError(f"nothing can be written: {'; '.join(entry.why for entry in entries[len(plan.entries) :])}")
        (folder / CASES).write_text(_table(cases), encoding="utf-8")
        (folder / VIEWS).write_text(_table(views), encoding="utf-8")
        (folder / ACCOUNT).write_text(_account(entries, with_paths), encoding="utf-8")
    return written


def _without_paths(error: DataError, breast: Breast) -> str:
    """A message without the names of files, which may be names of patients."""
    files = [*(frame.file for frame in breast.stack.frames), *(image.path for image in breast.images.values())]
    text = str(error)
    for path in files:
        text = text.removeprefix(f"{path}: ")
    return text


@contextmanager
def _made(out: Path) -> Iterator[Path]:
    """A folder beside the one to be, which takes its place once all is written."""
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise UserError(f"{out}: is there already; name a folder that is not")
    folder = None
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        folder = Path(tempfile.mkdtemp(dir=out.parent, prefix=f".{out.name}."))
        yield folder
        folder.chmod(0o755)
        folder.replace(out)
    except OSError as error:
        raise UserError(f"{out}: cannot be written ({error.strerror or error}); nothing is left behind") from error
    finally:
        if folder is not None and folder.exists():
            shutil.rmtree(folder, ignore_errors=True)


def _write_mr(folder: Path, breast: Breast, name: str, link: bool) -> str:
    """One volume, as NIfTI or as a folder of links to its slices."""
    if link:
        target = folder / "mr" / name
        target.mkdir(parents=True)
        for number, path in enumerate(dict.fromkeys(frame.file for frame in breast.stack.frames), 1):
            (target / f"{number:04d}.dcm").symlink_to(path.absolute())
        return f"mr/{name}"
    (folder / "mr").mkdir(exist_ok=True)
    (folder / "mr" / f"{name}.nii.gz").write_bytes(nifti_bytes(_voxels(breast.stack), breast.stack.affine))
    return f"mr/{name}.nii.gz"


def _voxels(stack: MrStack) -> NDArray[np.float32] | NDArray[np.int16]:
    """Intensities, as whole numbers where they are such."""
    voxels = stack_voxels(stack)
    low, high = float(voxels.min()), float(voxels.max())
    whole = np.iinfo(np.int16).min <= low and high <= np.iinfo(np.int16).max and bool((voxels == np.rint(voxels)).all())
    return voxels.astype(np.int16) if whole else voxels


def _write_image(folder: Path, breast: Breast, view: str, image: FoundImage, link: bool) -> str:
    name = f"mammograms/{breast.case}_{view}.dcm"
    (folder / "mammograms").mkdir(exist_ok=True)
    if link:
        (folder / name).symlink_to(image.path.absolute())
        return name
    whole = read_dicom(image.path, pixels=True)
    if whole is None:
        raise DataError(f"{image.path}: is no DICOM file any more; import again")
    (folder / name).write_bytes(deidentified(whole, breast.patient, f"{breast.case} {view}"))
    return name


def _table(rows: Sequence[dict[str, str]]) -> str:
    stream = io.StringIO()
    columns = list(dict.fromkeys(column for row in rows for column in row))
    writer = csv.DictWriter(stream, columns, delimiter="\t", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return stream.getvalue()


def _account(entries: Sequence[Entry], with_paths: bool) -> str:
    rows = []
    for entry in entries:
        row = {"patient": entry.patient, "what": entry.what, "used_for": entry.used_for, "why": entry.why}
        rows.append(row | ({"files": " | ".join(entry.files)} if with_paths else {}))
    return _table(rows)
