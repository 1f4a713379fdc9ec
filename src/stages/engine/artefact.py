"""Artefacts: the self-describing HDF5 file that each stage leaves; the only module that imports h5py.

Arrays and volumes carry `units` and `long_name`; volumes are netCDF-4 groups with LPS coordinates in mm. The same
contents give the same bytes: no clock, no host, no absolute path.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, cast

import h5py
import numpy as np
from numpy.typing import NDArray

from mammoreg.geometry import Volume
from mammoreg.geometry.frames import Frame
from stages.engine.errors import ArtefactError
from stages.engine.failures import Failure, Status
from stages.engine.text import json_value
from stages.engine.writing import write_bytes

Value = None | bool | int | float | str | list[Any] | dict[str, Any]

AXIS_NAMES = {
    "LPS": {"x": "towards the patient's left", "y": "towards the patient's back", "z": "towards the patient's head"},
    "plate": {"x": "medial along the plate", "y": "posterior", "z": "height towards the source"},
}


@dataclass(frozen=True)
class Array:
    """A numeric array with its units ("mm", "N", "kPa", "degree", "px", "1") and what it is.

    Positions lie in LPS unless `frame` says otherwise.
    """

    data: NDArray[Any]
    units: str
    long_name: str
    frame: Frame = "LPS"


@dataclass(frozen=True)
class VolumeField:
    """A volume with the units of its samples and what it is.

    Raises:
        ValueError: it is in the breast frame, which no artefact holds.
    """

    volume: Volume
    units: str
    long_name: str

    def __post_init__(self) -> None:
        if self.volume.frame not in AXIS_NAMES:
            raise ValueError(f"artefacts hold no volume of the {self.volume.frame} frame; take it to LPS first")


@dataclass(frozen=True)
class Fields:
    """What a stage hands back.

    Attributes:
        arrays, volumes: by name; a "/" in a name makes a group.
        values: JSON values by name, their units in the name (`thickness_mm`).
        files: further files by name relative to the stage's folder (pictures, tables), with their bytes.
        failure: where it went wrong first; None if all is well.
    """

    arrays: Mapping[str, Array] = field(default_factory=dict)
    volumes: Mapping[str, VolumeField] = field(default_factory=dict)
    values: Mapping[str, Value] = field(default_factory=dict)
    files: Mapping[str, bytes] = field(default_factory=dict)
    failure: Failure | None = None

    @property
    def status(self) -> Status:
        """How the stage ended."""
        return self.failure.status if self.failure else "ok"

    @property
    def message(self) -> str:
        """What went wrong, with the stage before it; empty if all is well."""
        return str(self.failure) if self.failure else ""


class Artefact:
    """An artefact on disk, opened for reading; contents are read when asked for."""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            with h5py.File(path, "r", locking=False) as file:
                self.attrs: dict[str, str] = {name: _text(value) for name, value in file.attrs.items()}
                self._values = {name: json.loads(_text(node[()])) for name, node in file["values"].items()}
            self.stage, self.case = self.attrs["stage"], self.attrs["case"]
            self.view = self.attrs["view"] or None
            self.laterality = cast(Literal["L", "R"], self.attrs["laterality"])
            self.failure = _failure(self.attrs)
        except (OSError, KeyError, ValueError) as error:
            what = f"{path}: is {'a folder, ' * path.is_dir()}no artefact of this pipeline"
            raise ArtefactError(what if path.exists() else f"there is no file {path}") from error

    @property
    def ok(self) -> bool:
        """Whether the stage ended well."""
        return self.failure is None

    @property
    def status(self) -> Status:
        """How its stage, or the first before it that did not end well, ended."""
        return self.failure.status if self.failure else "ok"

    @property
    def message(self) -> str:
        """What went wrong, with the stage before it; empty if all is well."""
        return str(self.failure) if self.failure else ""

    @property
    def inputs(self) -> list[str]:
        """Names of what its stage was given."""
        return list(json.loads(self.attrs.get("inputs", "{}")))

    def names(self) -> list[str]:
        """Names of the arrays, in the order of writing."""
        return [name for name, _, _ in self.listing("arrays")]

    def volume_names(self) -> list[str]:
        """Names of the volumes, in the order of writing."""
        return [name.rpartition("/")[0] for name, _, _ in self.listing("volumes") if _repeats_its_group(name)]

    def value_names(self) -> list[str]:
        """Names of the values, in the order of writing."""
        return list(self._values)

    def has(self, name: str) -> bool:
        """Whether an array, a volume or a value of that name is there."""
        return name in self._values or name in self.names() or name in self.volume_names()

    def listing(self, group: Literal["arrays", "volumes"]) -> list[tuple[str, tuple[int, ...], dict[str, str]]]:
        """Name, shape and text attributes of every dataset in a group."""
        found: list[tuple[str, tuple[int, ...], dict[str, str]]] = []

        def note(name: str, node: Any) -> None:
            if isinstance(node, h5py.Dataset):
                texts = {key: _text(node.attrs[key]) for key in ("units", "long_name", "frame") if key in node.attrs}
                found.append((name, node.shape, texts))

        with h5py.File(self.path, "r", locking=False) as file:
            file[group].visititems(note)
        return found

    def value(self, name: str) -> Any:
        """A JSON value."""
        if name not in self._values:
            raise self._missing("value", name, self.value_names())
        return self._values[name]

    def array(self, name: str, units: str) -> NDArray[Any]:
        """An array, which must have been written in these units."""
        with h5py.File(self.path, "r", locking=False) as file:
            node = file["arrays"].get(name)
            if not isinstance(node, h5py.Dataset):
                raise self._missing("array", name, self.names())
            self._check_units(name, _text(node.attrs["units"]), units)
            return cast(NDArray[Any], node[()])

    def volume(self, name: str, units: str | None = None, frame: Frame = "LPS") -> Volume:
        """A volume in its frame; units are checked where given."""
        with h5py.File(self.path, "r", locking=False) as file:
            group = file["volumes"].get(name)
            if group is None:
                raise self._missing("volume", name, self.volume_names())
            node = group[name.rpartition("/")[2]]
            if units is not None:
                self._check_units(name, _text(node.attrs["units"]), units)
            if _text(node.attrs["frame"]) != frame:
                raise ArtefactError(f"{self.path}: volume {name} is not in the {frame} frame")
            return Volume(node[()], np.array(node.attrs["origin_mm"]), np.array(node.attrs["spacing_mm"]), frame)

    def _missing(self, kind: str, name: str, names: list[str]) -> ArtefactError:
        return ArtefactError(f"{self.path}: no {kind} {name!r} in this artefact; it has {', '.join(names) or 'none'}")

    def _check_units(self, name: str, found: str, asked: str) -> None:
        if found != asked:
            raise ArtefactError(f"{self.path}: {name} is in {found!r}, but {asked!r} was asked for")


def write_artefact(path: Path, attrs: Mapping[str, str], fields: Fields) -> None:
    """Write an artefact atomically: either the whole file appears under its name or nothing does.

    Args:
        path: the file; its folder is made.
        attrs: root attributes.
        fields: contents; status, message, and the stage and view that failed first become root attributes.

    Raises:
        ArtefactError: the file cannot be written (disk full, no permission).
    """
    write_bytes(path, _image({**attrs, **_outcome(fields)}, fields))


def _outcome(fields: Fields) -> dict[str, str]:
    failed = fields.failure or Failure("", "", "ok", "")
    names = ("status", "message", "failed_stage", "failed_view")
    return dict(zip(names, (failed.status, failed.message, failed.stage, failed.view), strict=True))


def _failure(attrs: Mapping[str, str]) -> Failure | None:
    if attrs["status"] == "ok":
        return None
    return Failure(attrs["failed_stage"], attrs["failed_view"], cast(Status, attrs["status"]), attrs["message"])


def _image(attrs: Mapping[str, str], fields: Fields) -> bytes:
    """The bytes of the HDF5 file, built in memory so that a full disk cannot leave half a file."""
    with h5py.File("artefact", "w", driver="core", backing_store=False, track_order=True) as file:
        for name, text in attrs.items():
            _set_text(file, name, text)
        arrays, volumes, values = (file.create_group(n, track_order=True) for n in ("arrays", "volumes", "values"))
        for name, array in fields.arrays.items():
            _write_array(arrays, name, array)
        for name, volume in fields.volumes.items():
            _write_volume(volumes, name, volume)
        for name, value in fields.values.items():
            values.create_dataset(name, data=_fixed(json.dumps(json_value(value), allow_nan=False, ensure_ascii=False)))
        file.flush()
        return cast(bytes, file.id.get_file_image())


def _write_array(parent: Any, name: str, array: Array) -> None:
    node = _subgroup(parent, name).create_dataset(name.rpartition("/")[2], data=_storable(array.data))
    _set_text(node, "units", array.units)
    _set_text(node, "long_name", array.long_name)
    if array.frame != "LPS":
        _set_text(node, "frame", array.frame)


def _write_volume(parent: Any, name: str, field_: VolumeField) -> None:
    volume, short = field_.volume, name.rpartition("/")[2]
    group = parent.require_group(name)
    data = _storable(volume.data)
    # Raw floats hardly shrink and cost seconds; labels shrink a hundredfold.
    compression = "gzip" if data.dtype.kind in "ui" else None
    node = group.create_dataset(short, data=data, compression=compression)
    texts = {"units": field_.units, "long_name": field_.long_name, "frame": volume.frame}
    for key, text in texts.items():
        _set_text(node, key, text)
    node.attrs["origin_mm"] = np.asarray(volume.origin, dtype=float)
    node.attrs["spacing_mm"] = np.asarray(volume.spacing, dtype=float)
    for axis, (letter, meaning) in enumerate(AXIS_NAMES[volume.frame].items()):
        positions = volume.origin[axis] + volume.spacing[axis] * np.arange(data.shape[axis])
        scale = group.create_dataset(letter, data=positions)
        scale.make_scale(letter)
        _set_text(scale, "units", "mm")
        _set_text(scale, "long_name", f"{volume.frame} {letter}, {meaning}")
        node.dims[axis].attach_scale(scale)


def _subgroup(parent: Any, name: str) -> Any:
    folder = name.rpartition("/")[0]
    return parent.require_group(folder) if folder else parent


def _storable(data: NDArray[Any]) -> NDArray[Any]:
    """Arrays in types that HDF5 and netCDF-4 share; booleans become bytes."""
    array = np.ascontiguousarray(data)
    if array.dtype.kind == "b":
        return array.astype(np.uint8)
    if array.dtype.kind not in "iuf":
        raise TypeError(f"an artefact's arrays are numbers, not {array.dtype}; texts belong in values")
    return array


def _fixed(text: str) -> NDArray[Any]:
    """A fixed-length string: variable-length ones lie in a heap."""
    encoded = text.encode()
    return np.array(encoded, dtype=h5py.string_dtype("utf-8", max(1, len(encoded))))


def _set_text(node: Any, name: str, text: str) -> None:
    node.attrs.create(name, _fixed(text))


def _text(value: Any) -> str:
    return value.decode() if isinstance(value, bytes) else str(value)


def _repeats_its_group(name: str) -> bool:
    parts = name.split("/")
    return len(parts) > 1 and parts[-1] == parts[-2]
