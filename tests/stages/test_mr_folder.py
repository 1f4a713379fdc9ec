"""A patient's folder as a PACS writes it: the fitting MR stack is found, the others are listed, or it is refused."""

import re
from pathlib import Path

import numpy as np
import pytest
from pydicom.encaps import encapsulate
from pydicom.uid import JPEG2000, JPEGLSLossless, RLELossless

from mammoreg.errors import DataError
from stages.cohort.readers.mr.header import read_mr_grid
from stages.cohort.readers.mr.volume import mr_choice, read_mr
from stages.cohort.readers.whole import check_whole_mr
from tests.shared_data import DATA, requires_shared
from tests.stages.mr_series import (
    ROWS,
    SAGITTAL,
    again,
    linear_field,
    multi_frame,
    report,
    series,
    write,
    write_directory,
)


def assert_is_the_field(volume, factor: float = 1.0) -> None:
    """Each voxel holds the field at its place, to the rounding of the stored values."""
    places = volume.to_world(np.moveaxis(np.indices(volume.shape), 0, -1))
    assert np.abs(volume.data - factor * linear_field(places)).max() < 0.51


def taken(folder: Path, *, side="R", wanted: str = "") -> str:
    choice = mr_choice(folder, side, wanted)
    assert choice is not None
    return choice.taken


def reasons(folder: Path, side="R") -> dict[str, str]:
    """Why each series was left, by its number."""
    choice = mr_choice(folder, side)
    assert choice is not None
    return {re.search(r"series (\w+)", what)[1]: why for what, why in choice.left}


def test_rescale_differs_by_slice(tmp_path):
    volume = read_mr(write(tmp_path, series("t1")))
    assert volume.shape == (10, 12, 9)
    assert_is_the_field(volume)


def test_a_patients_folder(tmp_path):
    """Reports, a directory, other modalities and series that show something else do not hide the one that fits."""
    fit = series("t1_fl3d_tra_fs_pre", SeriesNumber=5)
    write(tmp_path / "A" / "S5", fit)
    write(
        tmp_path / "A" / "S1",
        [
            s
            for axes in (((1, 0, 0), (0, 1, 0)), SAGITTAL)
            for s in series("localizer", count=3, step_mm=9.0, axes=axes, SeriesNumber=1)
        ],
        "LOC",
    )
    write(tmp_path / "A" / "S2", series("t2_tse_tra", SeriesNumber=2, EchoTime=95.0, RepetitionTime=4000.0), "T2")
    write(tmp_path / "A" / "S3", series("ep2d_diff", SeriesNumber=3, DiffusionBValue=800.0), "DW")
    post = again(series("t1_fl3d_tra_fs", SeriesNumber=6), ContrastBolusAgent="Gd", AcquisitionTime="102000")
    write(tmp_path / "A" / "S6", post)
    write(tmp_path / "B" / "S7", series("t1_fl3d_tra_fs_SUB", SeriesNumber=7))
    write(tmp_path / "B" / "S8", series("t1_MIP", SeriesNumber=8, ImageType=["DERIVED", "SECONDARY", "M", "MIP"]))
    write(tmp_path / "B" / "S9", series("t1_fl3d_tra_late", SeriesNumber=9)[::2], "HALF")
    write(tmp_path, [report(fit[0])], "SR")
    (tmp_path / "README.txt").write_text("viewer")
    write_directory(tmp_path / "disc", sorted((tmp_path / "A" / "S5").iterdir())[:3])
    choice = mr_choice(tmp_path, "R")
    assert choice.taken.startswith(
        "series 5, T1, 3D, before contrast, echo 1.7 ms, axial 10 x 12 x 9 voxels of 1.5 x 1.5 x 2 mm"
    )
    left = reasons(tmp_path)
    assert left["1"] == "no volume"
    assert left["2"] == "is T2-weighted, not T1"
    assert left["3"] == "diffusion"
    assert left["6"] == "with contrast agent"
    assert left["7"] == "subtraction"
    assert left["8"] == "projection (MIP)"
    assert left["9"] == "no volume"
    assert_is_the_field(read_mr(tmp_path, "R"))
    grid = read_mr_grid(tmp_path, "R")
    assert grid.shape == (10, 12, 9)
    told = f"{choice.taken}{choice.left}{choice.notes}"
    assert not re.search(r"Doe|Jane|2018|1970|1\.2\.|A77|fl3d|101500", told)


def test_the_column_names_another_series_by_number_or_uid(tmp_path):
    write(tmp_path / "a", series("t1 pre", SeriesNumber=5))
    other = series("t1 post", SeriesNumber=6, field=lambda p: 2.0 * linear_field(p))
    write(tmp_path / "b", other)
    assert taken(tmp_path).startswith("series 5")
    for wanted in ("6", other[0].SeriesInstanceUID):
        assert taken(tmp_path, wanted=wanted).startswith("series 6")
        assert_is_the_field(read_mr(tmp_path, "R", wanted), 2.0)
    assert "contrast agent" in mr_choice(tmp_path, "R", "6").notes[0]
    with pytest.raises(DataError, match=r"holds no MR series 77; it holds \(1\) series 5.*\(2\) series 6"):
        read_mr(tmp_path, "R", "77")


def test_no_series_that_fits_is_a_fault_that_lists_them(tmp_path):
    write(tmp_path / "a", series("sub1", SeriesNumber=5))
    write(tmp_path / "b", series("t1 adc", SeriesNumber=6))
    with pytest.raises(
        DataError, match=r"no MR volume that fits: .*5.*subtraction; .*6.*diffusion; name one .*mr_series"
    ):
        read_mr(tmp_path, "R")


def test_two_examinations_that_would_do_are_a_fault(tmp_path):
    write(tmp_path / "a", series("t1", SeriesNumber=5))
    write(tmp_path / "b", series("t1", SeriesNumber=5, study="a year later"))
    with pytest.raises(DataError, match="several examinations.*examination 1 of 2.*examination 2 of 2.*mr_series"):
        read_mr(tmp_path, "R")


def test_two_patients_are_a_fault(tmp_path):
    write(tmp_path / "a", series("t1"))
    write(tmp_path / "b", series("t1", patient="Roe^Ann"))
    with pytest.raises(DataError, match="several patients"):
        read_mr(tmp_path, "R")


def test_a_lone_t2_series_is_read_and_said(tmp_path):
    write(tmp_path, series("t2", EchoTime=95.0))
    assert "T2-weighted" in mr_choice(tmp_path, "R").notes[0]
    assert_is_the_field(read_mr(tmp_path))


@pytest.mark.parametrize("key", ["TemporalPositionIdentifier", "AcquisitionNumber", "AcquisitionTime", None])
def test_phases_of_one_series(tmp_path, key):
    """Of several phases the first is taken, by whatever tells them apart; copies have the same UID in each file."""
    first = series("dyn", ContrastBolusAgent="Gd", AcquisitionTime=None)
    later = [
        again(series("dyn", field=lambda p, k=k: k * linear_field(p), ContrastBolusAgent="Gd", AcquisitionTime=None))
        for k in (2, 3)
    ]
    for number, phase in enumerate([first, *later]):
        for place, header in enumerate(phase):
            header.InstanceNumber = number + 3 * place
            if key:
                setattr(header, key, f"10{20 + number}00" if key == "AcquisitionTime" else number + 1)
        write(tmp_path, phase, f"P{number}")
    assert "phase 1 of 3" in taken(tmp_path)
    assert_is_the_field(read_mr(tmp_path))


def test_two_echoes_half_a_slice_apart_are_two_volumes(tmp_path):
    write(tmp_path, series("tse", EchoTime=10.0, RepetitionTime=780.0, ScanningSequence="SE"), "A")
    late = again(series("tse", start=(-10.0, -8.0, 6.0), ScanningSequence="SE", RepetitionTime=780.0), EchoTime=60.0)
    write(tmp_path, late, "B")
    assert "T1" in taken(tmp_path)
    assert "echo 10 ms" in taken(tmp_path)
    volume = read_mr(tmp_path)
    assert volume.shape[2] == 9
    assert_is_the_field(volume)


def test_files_that_are_there_twice(tmp_path):
    slices = series("t1")
    write(tmp_path, slices)
    write(tmp_path / "again", slices[:5])
    assert_is_the_field(read_mr(tmp_path))
    assert "5 slices of the MR series are there twice" in mr_choice(tmp_path, "R").notes[0]


def test_equal_pictures_under_other_identifiers(tmp_path):
    slices = series("t1")
    write(tmp_path, slices)
    write(tmp_path / "again", again(slices[:5], InstanceNumber=99))
    assert_is_the_field(read_mr(tmp_path))


def test_a_picture_in_another_direction_among_slices(tmp_path):
    write(tmp_path, series("t1"))
    write(tmp_path, series("t1", count=1, axes=SAGITTAL), "SAG")
    assert_is_the_field(read_mr(tmp_path))
    assert list(reasons(tmp_path).values()) == ["no volume"]


def test_both_breasts_as_two_sagittal_slabs(tmp_path):
    """Of a series that leaves out what lies between the breasts each side takes its own slab."""
    for x in (-90.0, 70.0):
        slab = series("vibrant", start=(x, -8.0, 5.0), axes=SAGITTAL, count=10, field=lambda p: linear_field(p) + 400.0)
        write(tmp_path, again(slab, SeriesDescription=f"slab {x}"), f"{x:.0f}_")
    right, left = (read_mr(tmp_path, side).origin[0] for side in ("R", "L"))
    assert right < -100.0 < 50.0 < left


BROKEN = {
    "missing": (lambda s: s[:4] + s[5:], "slices lie 2.00 to 4.00 mm apart; one is missing"),
    "every second": (lambda s: s[::2], "SpacingBetweenSlices is 2 mm: 1 of 2 slices are missing"),
    "spacing": (
        lambda s: s[:12] + again(s[12:], PixelSpacing=[1.2, 1.2]),
        "PixelSpacing changes within it, 1.2 to 1.5 mm",
    ),
    "size": (lambda s: s[:12] + again(s[12:], Rows=ROWS - 1), "the slices differ in size"),
    "colour": (lambda s: again(s, SamplesPerPixel=3), "colour pictures"),
    "few": (lambda s: s[:5], "series 1, 5 single pictures: no volume; export one complete series"),
    "crooked": (
        lambda s: [*s[:8], *again(s[8:9], ImagePositionPatient=[-4.0, -8.0, 21.0]), *s[9:]],
        "slices|straight line",
    ),
}


@pytest.mark.parametrize(("spoil", "message"), BROKEN.values(), ids=BROKEN.keys())
def test_incomplete_stacks_are_refused_by_their_headers(tmp_path, spoil, message):
    write(tmp_path, spoil(series("t1", count=20)))
    with pytest.raises(DataError, match=message):
        read_mr_grid(tmp_path, "R")


def test_a_whole_series_is_taken_before_a_better_one_that_is_not(tmp_path):
    write(tmp_path / "a", [s for n, s in enumerate(series("t1 pre", count=20, step_mm=1.0, SeriesNumber=2)) if n != 9])
    write(tmp_path / "b", series("t1", SeriesNumber=3))
    assert taken(tmp_path).startswith("series 3")
    assert "missing" in reasons(tmp_path)["2"]


def test_slices_closer_than_they_are_thick_and_gaps_written_for_distances(tmp_path):
    write(tmp_path / "a", series("t1", SliceThickness=4.0))
    write(tmp_path / "b", series("t1", SliceThickness=1.8, SpacingBetweenSlices=0.2))
    for folder in ("a", "b"):
        assert_is_the_field(read_mr(tmp_path / folder))


@pytest.mark.parametrize("whole_file", [True, False])
def test_multi_frame(tmp_path, whole_file):
    """One file a volume with several phases, named by its folder or itself; each frame has its own rescaling."""
    phases = [series("t1", field=lambda p, k=k: k * linear_field(p)) for k in (1, 2)]
    write(tmp_path, [multi_frame(*phases)])
    path = next(tmp_path.iterdir()) if whole_file else tmp_path
    assert "phase 1 of 2" in taken(path)
    assert_is_the_field(read_mr(path))


def test_multi_frame_with_a_stack_for_each_breast(tmp_path):
    """Two stacks in one object, told by StackID: each side takes its own."""
    slabs = [
        series("t1", start=(x, -8.0, 5.0), axes=SAGITTAL, field=lambda p: linear_field(p) + 400.0) for x in (-60, 70)
    ]
    found = multi_frame([*slabs[0], *slabs[1]])
    for number, group in enumerate(found.PerFrameFunctionalGroupsSequence):
        group.FrameContentSequence[0].StackID = str(1 + number // 9)
    write(tmp_path, [found])
    right, left = (read_mr(tmp_path, side).origin[0] for side in ("R", "L"))
    assert right < -60.0
    assert left > 50.0
    (why,) = reasons(tmp_path, "R").values()
    assert "other breast" in why


def test_the_side_that_a_header_names(tmp_path):
    """A small volume is of the breast that its header names, unless the table names the series; a wide one of both."""
    write(tmp_path / "one", series("t1 left", SeriesNumber=3))
    assert "series 3" in taken(tmp_path / "one", side="L")
    with pytest.raises(DataError, match="shows the other breast, its header says; name one"):
        read_mr(tmp_path / "one", "R")
    assert "series 3" in taken(tmp_path / "one", side="R", wanted="3")
    write(
        tmp_path / "wide",
        again(
            series(
                "t1",
                axes=SAGITTAL,
                count=22,
                step_mm=14.0,
                start=(160.0, 0.0, 0.0),
                field=lambda p: linear_field(p) + 900.0,
            ),
            Laterality="L",
        ),
    )
    assert "T1" in taken(tmp_path / "wide", side="R")


def test_a_series_for_a_biopsy_comes_last(tmp_path):
    write(tmp_path / "a", series("t1 biopsy grid", SeriesNumber=2, step_mm=1.0, count=18))
    write(tmp_path / "b", series("t1", SeriesNumber=3))
    assert taken(tmp_path).startswith("series 3")
    assert "biopsy" in reasons(tmp_path)["2"]
    assert "between plates" in mr_choice(tmp_path, "R", "2").notes[0]


def test_a_blank_slice_between_others_is_refused(tmp_path):
    slices = series("t1")
    slices[4].PixelData = bytes(len(slices[4].PixelData))
    write(tmp_path, slices)
    with pytest.raises(DataError, match="slice 5 along axis 3 is blank"):
        read_mr(tmp_path)
    ends = series("t1", study="padded")
    for header in (ends[0], ends[-1]):
        header.PixelData = bytes(len(header.PixelData))
    assert read_mr(write(tmp_path / "padded", ends)).shape == (10, 12, 9)


def test_multi_frame_files_of_one_frame_each(tmp_path):
    write(tmp_path, [multi_frame([header]) for header in series("t1")])
    assert_is_the_field(read_mr(tmp_path))


@pytest.mark.parametrize("syntax", [RLELossless, JPEG2000, JPEGLSLossless])
def test_compressed_slices(tmp_path, syntax):
    """RLE is pydicom's; another is decoded, or refused by its name in words that help."""
    slices = series("t1")
    for header in slices:
        if syntax == RLELossless:
            header.compress(RLELossless)
        else:
            header.PixelData = encapsulate([b"\x00" * 20])
            header["PixelData"].is_undefined_length = True
            header.file_meta.TransferSyntaxUID = syntax
    write(tmp_path, slices)
    if syntax == RLELossless:
        assert_is_the_field(read_mr(tmp_path))
    else:
        with pytest.raises(DataError, match="cannot be decoded.*export the series"):
            read_mr(tmp_path)


def test_jpeg_lossless_that_pydicom_leaves_to_gdcm(tmp_path):
    """A lossless JPEG written by GDCM comes back sample by sample, each slice with its own rescaling."""
    import SimpleITK

    slices = series("t1")
    write(tmp_path / "plain", slices)
    (tmp_path / "packed").mkdir()
    for number, header in enumerate(slices):
        plain = SimpleITK.GetImageFromArray(header.pixel_array)
        writer = SimpleITK.ImageFileWriter()
        writer.SetFileName(str(tmp_path / "jpeg.dcm"))
        writer.UseCompressionOn()
        writer.SetCompressor("JPEG")
        writer.Execute(plain)
        from pydicom import dcmread

        coded = dcmread(tmp_path / "jpeg.dcm")
        header.PixelData, header.file_meta.TransferSyntaxUID = coded.PixelData, coded.file_meta.TransferSyntaxUID
        header["PixelData"].is_undefined_length = True
        header["PixelData"].VR = "OB"
        header.save_as(tmp_path / "packed" / f"{number}", enforce_file_format=True)
    assert header.file_meta.TransferSyntaxUID.is_compressed
    assert np.array_equal(read_mr(tmp_path / "packed").data, read_mr(tmp_path / "plain").data)


@pytest.mark.parametrize("end", [0, -1])
def test_an_end_slice_with_another_header_is_remarked(tmp_path, end):
    slices = series("t1")
    slices[end].EchoTime = 99.0
    write(tmp_path, slices)
    assert read_mr(tmp_path).shape == (10, 12, 8)
    assert "1 single pictures would continue the MR series" in mr_choice(tmp_path, "R").notes[0]


def test_headers_of_random_bytes_end_in_words(tmp_path):
    """Whatever a damaged header makes of itself is a volume or a fault that says so, never another exception."""
    rng = np.random.default_rng(5)
    write(tmp_path, series("t1"))
    path = sorted(tmp_path.iterdir())[4]
    whole = path.read_bytes()
    said = []
    for _ in range(120):
        spoilt = bytearray(whole)
        for place in rng.integers(128, 1400, size=4):
            spoilt[place] = rng.integers(0, 256)
        path.write_bytes(bytes(spoilt))
        try:
            check_whole_mr(tmp_path, "R")
            read_mr(tmp_path, "R")
        except DataError as error:
            said.append(str(error))
    assert len(said) > 40
    assert all(text.startswith(str(tmp_path)) for text in said)


def test_a_link_without_a_file_is_named(tmp_path):
    write(tmp_path, series("t1"))
    (tmp_path / "IM9999").symlink_to("/nowhere/annex")
    with pytest.raises(DataError, match="IM9999: a link without a file behind it"):
        read_mr_grid(tmp_path)


def test_a_damaged_slice_is_named(tmp_path):
    write(tmp_path, series("t1"))
    path = sorted(tmp_path.iterdir())[0]
    path.write_bytes(path.read_bytes()[:134] + b"\xff" * 40)
    with pytest.raises(DataError, match=path.name):
        read_mr(tmp_path)


@pytest.mark.parametrize("text", ["Anonymized", "nan", ""])
def test_places_that_are_no_numbers(tmp_path, text):
    from pydicom.dataelem import RawDataElement
    from pydicom.tag import Tag

    slices = series("t1")
    raw = f"{text}\\1\\2".encode()
    for header in slices:
        tag = Tag("ImagePositionPatient")
        header._dict[tag] = RawDataElement(tag, "DS", len(raw), raw + b" " * (len(raw) % 2), 0, False, True)
        header._dict[tag] = header._dict[tag]._replace(length=len(header._dict[tag].value))
    write(tmp_path, slices)
    with pytest.raises(DataError, match="lack the slices' place"):
        read_mr_grid(tmp_path)


def test_files_without_preamble(tmp_path):
    for number, header in enumerate(series("t1")):
        bare = tmp_path / f"IM{number}"
        header.save_as(bare, enforce_file_format=True)
        bare.write_bytes(bare.read_bytes()[132:])
    assert_is_the_field(read_mr(tmp_path))


@requires_shared("mri")
def test_a_real_series():
    assert taken(DATA / "mri/69b91dc2_t1_tse_dicom") == (
        "series 4, T1, echo 10 ms, axial 512 x 268 x 58 voxels of 0.645 x 0.645 x 3.3 mm"
    )
