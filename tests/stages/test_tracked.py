"""Names under which the workflow follows a user's files."""

from pathlib import Path

import pytest

from stages.cohort.tracked import is_indirect, tracked_files


@pytest.fixture
def folder(tmp_path):
    folder = tmp_path / "MR {1.2.840}"
    (folder / "S1").mkdir(parents=True)
    (folder / "S1" / "IM1").write_text("one")
    (folder / "a{b}.nii.gz").write_text("two")
    (folder / ".DS_Store").write_text("left by a system")
    return folder


def test_files_of_a_folder_with_braces_have_links_without(folder, tmp_path):
    names = tracked_files(folder, tmp_path / "links")
    assert sorted(Path(name).read_text() for name in names) == ["one", "two"]
    assert not set("{}") & set("".join(Path(name).name for name in names))
    assert all(Path(name).is_symlink() for name in names)
    assert tracked_files(folder, tmp_path / "links") == names


def test_a_link_keeps_what_the_name_says_of_the_kind(folder, tmp_path):
    path = folder / "a{b}.nii.gz"
    assert is_indirect(path)
    assert str(tracked_files(path, tmp_path / "links")).endswith(".nii.gz")


def test_other_names_stay(tmp_path):
    path = tmp_path / "mr.nii.gz"
    path.write_text("volume")
    assert not is_indirect(path)
    assert tracked_files(path, tmp_path / "links") == str(path)
    assert not (tmp_path / "links").exists()
    assert is_indirect(tmp_path)
    assert tracked_files(tmp_path, tmp_path / "links") == [str(path)]
