"""Files of marks: masks and tables, and what is wrong with bad ones."""

from pathlib import Path

import nibabel
import numpy as np
import pytest
from PIL import Image

from mammoreg.errors import DataError
from stages.cohort.readers.marks.masks import read_image_mask, read_masks
from stages.cohort.readers.marks.points import read_discs, read_pixels, read_points, read_spheres


def picture(path: Path, pixels: np.ndarray) -> Path:
    Image.fromarray(pixels).save(path)
    return path


def blob(size: tuple[int, ...]) -> np.ndarray:
    mask = np.zeros(size, dtype=np.uint8)
    mask[2:5, 3:6] = 1
    return mask


@pytest.mark.parametrize("value", [1, 7, 255])
def test_any_value_marks(tmp_path: Path, value: int) -> None:
    found = read_image_mask(picture(tmp_path / "mask.png", value * blob((8, 9))))
    np.testing.assert_array_equal(found, blob((8, 9)) != 0)


def test_the_lesion_lies_above_half_of_the_maximum(tmp_path: Path) -> None:
    """Smoothed borders and a background of compression noise do not make it larger."""
    pixels = 250 * blob((20, 20))
    pixels[1, 3:6], pixels[5, 3:6], pixels[10:, 10:] = 120, 130, 2
    assert read_image_mask(picture(tmp_path / "mask.png", pixels)).sum() == 12


def test_an_inverted_mask_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"covers 98% of the picture; it is inverted, or not a lesion's"):
        read_image_mask(picture(tmp_path / "mask.png", 255 - 255 * blob((20, 20))))


def test_several_labels_are_no_mask(tmp_path: Path) -> None:
    pixels = blob((20, 20))
    pixels[10:15, 10:15] = 2
    with pytest.raises(DataError, match="holds the labels 1, 2; keep the lesion's alone"):
        read_image_mask(picture(tmp_path / "mask.png", pixels))


def test_transparent_pixels_do_not_mark(tmp_path: Path) -> None:
    pixels = np.full((8, 9, 4), 255, dtype=np.uint8)
    pixels[..., 3] = 255 * blob((8, 9))
    assert read_image_mask(picture(tmp_path / "mask.png", pixels)).sum() == 9
    pixels[..., 3] = 255
    pixels[..., :3] = 0
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
    found = read_masks(tmp_path / "mask.nii.gz")["lesion"]
    ras = affine[:3, :3] @ [2, 3, 4] + affine[:3, 3]
    np.testing.assert_allclose(found.centres(found.data), [[-ras[0], -ras[1], ras[2]]])
    nibabel.save(nibabel.Nifti1Image(0 * data, affine), tmp_path / "empty.nii.gz")
    with pytest.raises(DataError, match="empty"):
        read_masks(tmp_path / "empty.nii.gz")


def _nifti(path: Path, data: np.ndarray) -> Path:
    nibabel.save(nibabel.Nifti1Image(data.astype(np.float32), np.diag([2.0, 2.0, 2.0, 1.0])), path)
    return path


@pytest.mark.parametrize("background", [0.0, 4e-11, -0.02])
def test_a_probability_map_marks_what_is_likely(tmp_path: Path, background: float) -> None:
    data = np.full((20, 20, 20), background)
    data[8:12, 8:12, 8:12] = 0.4
    data[9:11, 9:11, 9:11] = 0.999
    found = read_masks(_nifti(tmp_path / "map.nii.gz", data))["lesion"]
    assert found.data.dtype == bool
    assert found.data.sum() == 8


def test_masks_larger_than_any_lesion(tmp_path: Path) -> None:
    data = np.ones((20, 20, 20))
    data[8:12, 8:12, 8:12] = 0
    with pytest.raises(DataError, match="covers 99% of the volume; it is inverted"):
        read_masks(_nifti(tmp_path / "inverted.nii.gz", data))
    data = np.zeros((120, 120, 120))
    data[10:60, 10:60, 10:60] = 1
    with pytest.raises(DataError, match="holds 1000 ml, more than any lesion"):
        read_masks(_nifti(tmp_path / "breast.nii.gz", data))


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
    "content",
    [
        b"name\tx\ty\tz\t\r\na\t1\t2\t3\t\r\n\r\n",
        '\ufeff"name";"x";"y";"z"\r\n"a";"1";"2";"3"\r\n;;;\r\n'.encode(),
        b"name,x,y,z\na,1,2,3\n",
        "name\tx\ty\tz\r\na\t1\t2\t3\r\n".encode("utf-16"),
        b"label,l,p,s,defined,selected,visible,locked,description\na,1,2,3,1,1,1,0,\n",
    ],
)
def test_tables_as_other_programs_write_them(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "marks.tsv").write_bytes(content)
    found = read_points(tmp_path / "marks.tsv")
    assert list(found) == ["a"]
    np.testing.assert_allclose(found["a"], [1.0, 2.0, 3.0])


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "empty"),
        ("name\tcolumn\n", "empty"),
        ("name column row\na 1 2\n", "no column name, column, row"),
        ("name\tcolumn\trow\na\t1\n", "None is no number"),
        ("name;column;row\na;1,5;2\n", "'1,5' is no number; write a decimal point"),
        ("name\tcolumn\trow\na\t1\tnan\n", "line 2, column row: 'nan' is no number"),
        ("name\tcolumn\trow\n\t1\t2\n", "is empty"),
        ("column\trow\tname\n1\t2\n", "is empty"),
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
