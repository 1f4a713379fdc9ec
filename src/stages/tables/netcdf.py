"""All tables as one xarray data set: case x view x approach, and what is marked."""

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from stages.formats.table import Row, Table
from stages.tables.record import (
    ELONGATION,
    LANDMARKS,
    PREDICTIONS_COMPRESSED,
    PREDICTIONS_MAMMOGRAM,
    PREDICTIONS_MR,
    SEGMENTATION,
    TABLE_5,
    TABLE_6,
    VIEWS,
)

_NAMED = (
    (PREDICTIONS_MAMMOGRAM, "predicted_mammogram"),
    (PREDICTIONS_MR, "predicted_mr"),
    (PREDICTIONS_COMPRESSED, "predicted_compressed"),
    (VIEWS, "view"),
    (SEGMENTATION, "segmentation"),
    (TABLE_5, "lesion_mammogram"),
    (TABLE_6, "lesion_mr"),
    (ELONGATION, "elongation"),
    (LANDMARKS, "landmark"),
)
_UNITS = {"_mm": "mm", "_deg": "degree", "_n": "N", "_percent": "percent"}
_UNITS_OF_PLACES = {"column": "px", "row": "px", "x": "mm", "y": "mm", "z": "mm"}
# `method` is a keyword of `xarray.Dataset.sel`, which would be taken for it.
_DIMENSION_OF = {"method": "approach", "views": "view", "name": "mark", "landmark": "mark"}
_SEEN = "predicted_mammogram_seen"


def cohort_netcdf(rows_of: Mapping[str, Sequence[Row]], outcomes: Mapping[str, tuple[str, str]]) -> bytes:
    """The numbers of all tables as a netCDF-4 file; tables without rows leave none.

    Dimensions are `case`, `view` (CC, MLO, ..., 3D, and CC+MLO where both are used together), `approach` (the tables'
    `method`), `mark` (lesions and landmarks), `direction` and `check`. Texts stand in the tables.

    Args:
        rows_of: rows by table name.
        outcomes: status and message of every case, of those too that have no row.
    """
    labels = _labels(rows_of, list(outcomes))
    variables = {
        f"{prefix}_{column}": _variable(table, column, rows_of[table.name], labels)
        for table, prefix in _NAMED
        if rows_of[table.name]
        for column in table.numbers
    }
    if rows := rows_of[PREDICTIONS_MAMMOGRAM.name]:
        variables[_SEEN] = _variable(PREDICTIONS_MAMMOGRAM, "seen", rows, labels)
    for number, name in enumerate(("status", "message")):
        texts = np.array([outcome[number] for outcome in outcomes.values()], dtype=object)
        variables[name] = xr.Variable(["case"], texts, {"long_name": f"{name} of the case"})
    used = {dimension for variable in variables.values() for dimension in variable.dims}
    coordinates = {dimension: names for dimension, names in labels.items() if dimension in used}
    title = "Cohort of registered mammograms and MR volumes"
    return _file(xr.Dataset(variables, coordinates, {"title": title}))


def _file(dataset: xr.Dataset) -> bytes:
    """The bytes of a netCDF-4 file; made on disk, for an image in memory holds what lay there before."""
    encoding: dict[Any, dict[str, Any]] = {
        # Texts of fixed length, for those of variable length lie in a heap.
        name: {"dtype": "S1"} if variable.dtype.kind in "OUT" else {"zlib": True}
        for name, variable in dataset.variables.items()
    }
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cohort.nc"
        dataset.to_netcdf(path, engine="netcdf4", format="NETCDF4", encoding=encoding)
        return path.read_bytes()


def _labels(rows_of: Mapping[str, Sequence[Row]], cases: Sequence[str]) -> dict[str, list[str]]:
    """Names along each dimension, in order of first appearance."""
    found: dict[str, dict[str, None]] = {"case": dict.fromkeys(cases)}
    for table, _ in _NAMED:
        for key, dimension in _dimensions(table).items():
            found.setdefault(dimension, {}).update(dict.fromkeys(str(row[key]) for row in rows_of[table.name]))
    return {dimension: list(names) for dimension, names in found.items()}


def _dimensions(table: Table) -> dict[str, str]:
    return {key: _DIMENSION_OF.get(key, key) for key in ("case", *table.keys)}


def _variable(table: Table, column: str, rows: Sequence[Row], labels: Mapping[str, list[str]]) -> xr.Variable:
    dimensions = _dimensions(table)
    places = {dimension: {name: i for i, name in enumerate(labels[dimension])} for dimension in dimensions.values()}
    values = np.full([len(places[dimension]) for dimension in dimensions.values()], np.nan)
    for row in rows:
        if row.get(column) is not None:
            values[tuple(places[dimension][str(row[key])] for key, dimension in dimensions.items())] = row[column]
    units = next(
        (unit for ending, unit in _UNITS.items() if column.endswith(ending)), _UNITS_OF_PLACES.get(column, "1")
    )
    return xr.Variable(list(dimensions.values()), values, {"units": units, "long_name": f"{table.title}: {column}"})
