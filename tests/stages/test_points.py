"""Files of marks: masks and tables, and what is wrong with bad ones."""

from pathlib import Path

import nibabel
import numpy as np
import pytest
from PIL import Image

from mammoreg.errors import DataError
from stages.cohort.readers.points import read_discs, read_image_mask, read_mask, read_pixels, read_points, read_spheres


def picture(path: Path, pixels: np.ndarray) -> Path:
    Image.fromarray(pixels).save(path)
    return path


def blob(size: tuple[int, ...]) -> np.ndarray:
    mask = np.zeros(size, dtype=np.uint8)
    mask[2:5, 3:6] = 1
    return mask


def test_any_value_but_zero_marks(tmp_path: Path) -> None:
    found = read_image_mask(picture(tmp_path / "mask.png", blob((8, 9))))
    np.testing.assert_array_equal(found, blob((8, 9)) != 0)


def test_opacity_of_a_colour_mask_does_not_mark(tmp_path: Path) -> None:
    pixels = np.zeros((8, 9, 4), dtype=np.uint8)
    pixels[..., 3] = 255
    pixels[..., 0] = blob((8, 9)) * 200
    assert read_image_mask(picture(tmp_path / "mask.png", pixels)).sum() == 9


def test_diagonal_pixels_are_one_lesion(tmp_path: Path) -> None:
    assert read_image_mask(picture(tmp_path / "mask.png", np.eye(5, dtype=np.uint8))).sum() == 5


def test_empty_and_scattered_masks_say_so(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="empty"):
        read_image_mask(picture(tmp_path / "empty.png", np.zeros((5, 5), dtype=np.uint8)))
    scattered = blob((20, 20))
    scattered[15, 15] = 1
    with pytest.raises(DataError, match=r"2 components.*\.tsv"):
        read_image_mask(picture(tmp_path / "two.png", scattered))


def test_no_picture_at_all(tmp_path: Path) -> None:
    (tmp_path / "mask.png").write_text("not a picture")
    with pytest.raises(DataError, match="cannot be read"):
        read_image_mask(tmp_path / "mask.png")


def test_mask_of_the_mr_grid_comes_in_lps(tmp_path: Path) -> None:
    data = np.zeros((10, 11, 12), dtype=np.uint8)
    data[2, 3, 4] = 7
    affine = np.diag([2.0, 2.0, 2.0, 1.0])
    affine[:3, 3] = [-10.0, -20.0, -30.0]
    nibabel.save(nibabel.Nifti1Image(data, affine), tmp_path / "mask.nii.gz")
    found = read_mask(tmp_path / "mask.nii.gz")
    ras = affine[:3, :3] @ [2, 3, 4] + affine[:3, 3]
    np.testing.assert_allclose(found.centres(found.data), [[-ras[0], -ras[1], ras[2]]])
    nibabel.save(nibabel.Nifti1Image(0 * data, affine), tmp_path / "empty.nii.gz")
    with pytest.raises(DataError, match="empty"):
        read_mask(tmp_path / "empty.nii.gz")


def test_tables_in_every_form(tmp_path: Path) -> None:
    path = tmp_path / "marks.tsv"
    path.write_text("\ufeffname\tx\ty\tz\tcolumn\trow\tdiameter_mm\nmass 1\t1\t-2.5\t3e1\t100\t200.5\t8\n")
    np.testing.assert_allclose(read_points(path)["mass 1"], [1.0, -2.5, 30.0])
    np.testing.assert_allclose(read_pixels(path)["mass 1"], [100.0, 200.5])
    centre, diameter = read_spheres(path)["mass 1"]
    np.testing.assert_allclose([*centre, diameter], [1.0, -2.5, 30.0, 8.0])
    pixel, diameter = read_discs(path)["mass 1"]
    np.testing.assert_allclose([*pixel, diameter], [100.0, 200.5, 8.0])


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "empty"),
        ("name\tcolumn\n", "empty"),
        ("name,column,row\na,1,2\n", "no column name, column, row"),
        ("name\tcolumn\trow\na\t1\n", "None is no number"),
        ("name\tcolumn\trow\na\t1\tnan\n", "line 2, column row: 'nan' is no number"),
        ("name\tcolumn\trow\n\t1\t2\n", "is empty"),
        ("name\tcolumn\trow\na\t1\t2\nb\t1\t2\na\t3\t4\n", "line 4: name 'a' is given twice"),
    ],
)
def test_bad_tables_say_what_and_where(tmp_path: Path, text: str, says: str) -> None:
    (tmp_path / "bad.tsv").write_text(text)
    with pytest.raises(DataError, match=says):
        read_pixels(tmp_path / "bad.tsv")


def test_a_table_that_is_none(tmp_path: Path) -> None:
    (tmp_path / "bad.tsv").write_bytes(b"\xff\xfe\x00name")
    with pytest.raises(DataError, match="cannot be read"):
        read_points(tmp_path / "bad.tsv")
    with pytest.raises(DataError, match="cannot be read"):
        read_points(tmp_path / "missing.tsv")
