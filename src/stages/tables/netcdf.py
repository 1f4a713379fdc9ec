"""All tables as one xarray data set: case x view x method, and what is marked."""

from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr

from stages.formats.table import Row, Table
from stages.tables.layout import (
    ELONGATION,
    LANDMARKS,
    PREDICTIONS_COMPRESSED,
    PREDICTIONS_MAMMOGRAM,
    PREDICTIONS_MR,
    TABLE_5,
    TABLE_6,
    VIEWS,
)

_NAMED = (
    (PREDICTIONS_MAMMOGRAM, "predicted_mammogram"),
    (PREDICTIONS_MR, "predicted_mr"),
    (PREDICTIONS_COMPRESSED, "predicted_compressed"),
    (VIEWS, "view"),
    (TABLE_5, "lesion_mammogram"),
    (TABLE_6, "lesion_mr"),
    (ELONGATION, "elongation"),
    (LANDMARKS, "landmark"),
)
_UNITS = {"_mm": "mm", "_deg": "degree", "_n": "N", "_percent": "percent"}
_UNITS_OF_PLACES = {"column": "px", "row": "px", "x": "mm", "y": "mm", "z": "mm"}
_DIMENSION_OF = {"name": "mark", "landmark": "mark"}


def cohort_netcdf(rows_of: Mapping[str, Sequence[Row]]) -> bytes:
    """The numbers of all tables, given their rows by table name, as a netCDF file; tables without rows leave none.

    Dimensions are `case`, `view` (`views` where several are used together), `method`, `mark` (lesions and landmarks)
    and `direction`.
    """
    labels = _labels(rows_of)
    variables = {
        f"{prefix}_{column}": _variable(table, column, rows_of[table.name], labels)
        for table, prefix in _NAMED
        if rows_of[table.name]
        for column in table.numbers
    }
    used = {dimension for variable in variables.values() for dimension in variable.dims}
    coordinates = {dimension: names for dimension, names in labels.items() if dimension in used}
    title = "Cohort of registered mammograms and MR volumes"
    dataset = xr.Dataset(variables, coordinates, {"title": title})
    return bytes(dataset.to_netcdf(engine="scipy", format="NETCDF3_64BIT"))


def _labels(rows_of: Mapping[str, Sequence[Row]]) -> dict[str, list[str]]:
    """Names along each dimension, in order of first appearance."""
    found: dict[str, dict[str, None]] = {}
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
