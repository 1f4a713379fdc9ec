"""What a direction may not read is replaced by noise: its predictions stay the same to the last bit."""

from pathlib import Path

import nibabel
import numpy as np
import pytest
from scipy import ndimage

from mammoreg.geometry import Volume
from stages.engine.artefact import Artefact
from stages.engine.contract import Subject
from stages.engine.run import run_stage
from tests.stages.pressed_case import second_mask
from tests.stages.synthetic_case import write_case
from tests.stages.test_localize import localized, mr_marks, view_marks, write_tsv
from tests.unit.torso_phantom import torso

Direction = tuple[str, tuple[str, ...]]
INTO_MAMMOGRAM: Direction = ("mammogram_rows", ("mammogram/",))
INTO_MR: Direction = ("mr_rows", ("mr/",))
INTO_COMPRESSED: Direction = ("compressed_rows", ())


def _same(one: Artefact, other: Artefact, direction: Direction) -> bool:
    rows, prefixes = direction
    names = [name for name in one.names() if name.startswith(prefixes)] if prefixes else []
    assert one.value(rows)
    return one.value(rows) == other.value(rows) and all(
        one.array(name, units).tobytes() == other.array(name, units).tobytes()
        for name, units in ((name, "mm" if "curve" in name else "1") for name in names)
    )


@pytest.fixture(scope="module")
def true(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, list[Path]], dict[str, Path], Artefact]:
    folder = tmp_path_factory.mktemp("true")
    inputs = write_case(folder, compressed=True)
    marks = mr_marks(folder, "R") | view_marks(folder, ("CC", "MLO"), (False, False))
    return inputs, marks, localized(inputs | marks, folder / "localize.h5")


def _noise(folder: Path, name: str, seed: int) -> Path:
    """A mark of the same name somewhere else."""
    random = np.random.default_rng(seed)
    if name == "mr_landmarks":
        points = {f"p{k}": random.uniform(-25.0, 0.0, 3) for k in (1, 2)}
        return write_tsv(folder / f"{name}.tsv", "name x y z", points)
    if name == "mr_lesion":
        return write_tsv(
            folder / f"{name}.tsv", "name x y z diameter_mm", {"mass": [*random.uniform(-25.0, -5.0, 3), 12.0]}
        )
    place = {"mass": [*random.uniform(100.0, 200.0, 2), 9.0]}
    return write_tsv(folder / f"{name}.tsv", "name column row diameter_mm", place)


@pytest.mark.parametrize(
    ("names", "kept", "changed"),
    [
        (("lesion_CC", "lesion_MLO"), (INTO_MAMMOGRAM, INTO_COMPRESSED), INTO_MR),
        (("mr_lesion",), (INTO_MR, INTO_COMPRESSED), INTO_MAMMOGRAM),
        (("mr_landmarks",), (INTO_MR,), INTO_COMPRESSED),
    ],
)
def test_noise_in_the_other_sides_marks_changes_nothing(
    true: tuple[dict[str, list[Path]], dict[str, Path], Artefact],
    tmp_path: Path,
    names: tuple[str, ...],
    kept: tuple[Direction, ...],
    changed: Direction,
) -> None:
    inputs, marks, before = true
    noisy = {name: _noise(tmp_path, name, seed) for seed, name in enumerate(names)}
    after = localized(inputs | marks | noisy, tmp_path / "localize.h5")
    assert all(_same(before, after, direction) for direction in kept)
    assert not _same(before, after, changed), "the noise is read where it may be"


def _write(volume: Volume, path: Path) -> Path:
    affine = np.diag([*volume.spacing, 1.0])
    affine[:3, 3] = volume.origin
    nibabel.save(nibabel.Nifti1Image(volume.data, np.diag([-1.0, -1.0, 1.0, 1.0]) @ affine), path)
    return path


def _segmented(folder: Path, mr: Path, second: Volume) -> Artefact:
    folder.mkdir()
    files = {"mr": mr, "mr_compressed": _write(second, folder / "second.nii")}
    run_stage("segment", files, folder / "segment.h5", {"spacing_mm": 2.0}, Subject("case1"))
    return Artefact(folder / "segment.h5")


def test_segment_keeps_nothing_of_the_intensities_within_the_second_volumes_mask(tmp_path: Path) -> None:
    """Later stages know the second volume by this artefact alone (tests of the stages' records).

    Only the mask's own border moves a little, because the level between air and tissue is found in the intensities.
    """
    mr, mask = _write(torso(), tmp_path / "mr.nii"), second_mask()
    random = np.random.default_rng(3)
    plain = np.where(mask.data > 0, 400.0, 4.0).astype(np.float32)
    deep = ndimage.distance_transform_edt(mask.data, sampling=mask.spacing) > 10.0
    noisy = np.where(deep, random.uniform(100.0, 800.0, plain.shape), plain).astype(np.float32)
    one, other = (_segmented(tmp_path / n, mr, mask.with_data(d)) for n, d in (("a", plain), ("b", noisy)))
    assert one.ok, one.message
    assert (one.names(), one.volume_names()) == (other.names(), other.volume_names())
    for name in ("nipple", "chest_wall_surface"):
        assert one.array(name, "mm").tobytes() == other.array(name, "mm").tobytes()
    for name in ("mr", "labels", "breast_mask"):
        assert one.volume(name).data.tobytes() == other.volume(name).data.tobytes(), name
    masks = [a.volume("compressed_mask").data for a in (one, other)]
    assert set(np.unique(masks)) == {0, 1}
    assert (masks[0] != masks[1]).mean() < 1e-3
    assert {n: one.value(n) for n in one.value_names()} == {n: other.value(n) for n in other.value_names()}
