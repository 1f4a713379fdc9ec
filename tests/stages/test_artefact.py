"""Artefacts: round trips, units, determinism, xarray, atomic writing."""

import os
import resource
import subprocess
import sys

import numpy as np
import pytest
import xarray
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from mammoreg.geometry import Volume
from stages.engine.artefact import Array, Artefact, Fields, VolumeField, write_artefact
from stages.engine.errors import ArtefactError
from stages.engine.writing import write_bytes

ATTRS = {"stage": "segment", "case": "c", "view": "", "laterality": "L", "artefact_id": "x"}


def _volume(dtype=np.float32, frame="LPS"):
    data = np.arange(24).reshape(2, 3, 4).astype(dtype)
    return Volume(data, np.array([1.1, -2.0, 30.3]), np.array([1.4, 1.0, 0.7]), frame)


def _write(path, **contents):
    write_artefact(path, ATTRS, Fields(**contents))
    return Artefact(path)


@settings(max_examples=30, deadline=None)
@given(
    data=hnp.arrays(
        st.sampled_from([np.float64, np.float32, np.int64, np.uint8, np.bool_]), hnp.array_shapes(max_dims=3)
    )
)
def test_arrays_come_back_as_they_were(tmp_path_factory, data):
    path = tmp_path_factory.mktemp("a") / "x.h5"
    found = _write(path, arrays={"group/data": Array(data, "mm", "anything")}).array("group/data", "mm")
    np.testing.assert_array_equal(found, data)
    assert found.dtype == (np.uint8 if data.dtype == np.bool_ else data.dtype)


@pytest.mark.parametrize("dtype", [np.float32, np.uint8, np.int16])
def test_volume_comes_back_on_the_same_grid(tmp_path, dtype):
    volume = _volume(dtype, "plate")
    found = _write(tmp_path / "x.h5", volumes={"updated/mr": VolumeField(volume, "1", "MR")})
    assert found.volume_names() == ["updated/mr"]
    back = found.volume("updated/mr", "1", frame="plate")
    np.testing.assert_array_equal(back.data, volume.data)
    np.testing.assert_array_equal(back.origin, volume.origin)
    np.testing.assert_array_equal(back.spacing, volume.spacing)


def test_xarray_opens_a_volume_with_coordinates_in_mm(tmp_path):
    volume = _volume()
    _write(tmp_path / "x.h5", volumes={"mr": VolumeField(volume, "1", "MR signal")})
    with xarray.open_dataset(tmp_path / "x.h5", group="volumes/mr", engine="netcdf4") as dataset:
        assert dataset.mr.dims == ("x", "y", "z")
        assert dataset.x.attrs["units"] == "mm"
        assert dataset.mr.attrs["long_name"] == "MR signal"
        point = dataset.mr.sel(x=2.5, y=-1.0, z=31.0, method="nearest")
        assert float(point) == volume.data[1, 1, 1]


VALUES = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**53), 2**53)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=10,
)


@settings(max_examples=50, deadline=None)
@given(value=VALUES)
def test_values_come_back_as_they_were(tmp_path_factory, value):
    found = _write(tmp_path_factory.mktemp("a") / "x.h5", values={"v": value})
    assert found.value("v") == value


def test_long_value_is_no_problem(tmp_path):
    rows = [{"name": f"P{i}", "distance_mm": i / 7} for i in range(5000)]
    assert _write(tmp_path / "x.h5", values={"rows": rows}).value("rows") == rows


def test_numbers_that_are_not_finite_become_null(tmp_path):
    found = _write(tmp_path / "x.h5", values={"a": float("nan"), "b": [np.float64("inf"), np.int64(3)]})
    assert found.value("a") is None
    assert found.value("b") == [None, 3]


def test_other_units_are_refused(tmp_path):
    found = _write(tmp_path / "x.h5", arrays={"force": Array(np.ones(2), "N", "force")})
    with pytest.raises(ArtefactError, match="force is in 'N', but 'kPa' was asked for"):
        found.array("force", "kPa")


def test_other_frame_is_refused(tmp_path):
    found = _write(tmp_path / "x.h5", volumes={"mr": VolumeField(_volume(frame="plate"), "1", "MR")})
    with pytest.raises(ArtefactError, match="volume mr is not in the LPS frame"):
        found.volume("mr")


@pytest.mark.parametrize("kind", ["array", "volume", "value"])
def test_missing_name_lists_what_is_there(tmp_path, kind):
    found = _write(
        tmp_path / "x.h5",
        arrays={"points": Array(np.ones(3), "mm", "points")},
        volumes={"mr": VolumeField(_volume(), "1", "MR")},
        values={"n": 7},
    )
    name = {"array": "points", "volume": "mr", "value": "n"}[kind]
    ask = {
        "array": lambda: found.array("q", "mm"),
        "volume": lambda: found.volume("q"),
        "value": lambda: found.value("q"),
    }
    with pytest.raises(ArtefactError, match=f"no {kind} 'q' in this artefact; it has {name}"):
        ask[kind]()
    assert found.has(name)
    assert not found.has("q")


def test_same_contents_give_the_same_bytes(tmp_path):
    contents = {
        "arrays": {"b": Array(np.arange(5.0), "mm", "b"), "a": Array(np.arange(3), "1", "a")},
        "volumes": {"labels": VolumeField(_volume(np.uint8), "1", "labels")},
        "values": {"z": 1, "a": "text"},
    }
    _write(tmp_path / "one.h5", **contents)
    _write(tmp_path / "deep" / "er" / "two.h5", **contents)
    assert (tmp_path / "one.h5").read_bytes() == (tmp_path / "deep/er/two.h5").read_bytes()


def test_text_array_is_a_mistake_of_the_programmer(tmp_path):
    with pytest.raises(TypeError, match="texts belong in values"):
        _write(tmp_path / "x.h5", arrays={"names": Array(np.array(["a"]), "1", "names")})
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("content", [b"", b"no HDF5 at all"])
def test_file_that_is_no_artefact(tmp_path, content):
    path = tmp_path / "x.h5"
    path.write_bytes(content)
    with pytest.raises(ArtefactError, match="is no artefact of this pipeline"):
        Artefact(path)


def test_other_hdf5_file_is_no_artefact(tmp_path):
    volume = xarray.Dataset({"mr": (("x",), np.ones(3))})
    volume.to_netcdf(tmp_path / "x.h5", engine="netcdf4", group="values")
    with pytest.raises(ArtefactError, match="is no artefact of this pipeline"):
        Artefact(tmp_path / "x.h5")


def test_permissions_follow_the_umask(tmp_path):
    before = os.umask(0o027)
    try:
        write_bytes(tmp_path / "x", b"content")
    finally:
        os.umask(before)
    assert (tmp_path / "x").stat().st_mode & 0o777 == 0o640


def test_disk_full_leaves_the_old_file_and_nothing_else(tmp_path):
    """A limit on the file size makes the kernel refuse in the middle of writing, as a full disk does."""
    write_bytes(tmp_path / "x.h5", b"old")
    script = (
        "import resource, sys, pathlib, numpy as np\n"
        "from stages.engine.artefact import *\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))\n"
        f"attrs = {ATTRS!r}\n"
        "fields = Fields(arrays={'big': Array(np.ones(10000), 'mm', 'big')})\n"
        "try:\n    write_artefact(pathlib.Path(sys.argv[1]), attrs, fields)\n"
        "except ArtefactError as error:\n    print(error)\n"
    )
    path = str(tmp_path / "x.h5")
    done = subprocess.run([sys.executable, "-c", script, path], capture_output=True, text=True, check=True)
    assert "cannot be written (File too large); nothing is left behind: make room" in done.stdout
    assert [p.name for p in tmp_path.iterdir()] == ["x.h5"]
    assert (tmp_path / "x.h5").read_bytes() == b"old"
    assert resource.getrlimit(resource.RLIMIT_FSIZE)[0] != 4096
