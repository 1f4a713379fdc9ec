"""The two tables: sides, views, units, columns, separators and encodings."""

from collections.abc import Callable
from functools import partial

from numpy.random import Generator

from tests.mutants.case_folder import CaseFolder, DoesNotApplyError, Effect
from tests.mutants.mutations.registry import Mutations

TABLES = Mutations("tables", ("pictures",))


def side(case: CaseFolder, random: Generator, to: str | None = None) -> Effect:
    case.case["laterality"] = to if to is not None else "R" if case.case["laterality"] == "L" else "L"
    return Effect(note=f"laterality {case.case['laterality']}")


def views_swapped(case: CaseFolder, random: Generator) -> Effect:
    """Each row with the other's name of the view."""
    one, other = case.views["CC"], case.views["MLO"]
    one["view"], other["view"] = other["view"], one["view"]
    return Effect(note="CC and MLO")


def cell(case: CaseFolder, random: Generator, column: str, value: str, view: str | None = None) -> Effect:
    row = case.case if view is None else case.views[view]
    row[column] = value
    return Effect(note=f"{view or ''} {column} {value!r}".strip())


def without(case: CaseFolder, random: Generator, column: str) -> Effect:
    """No view has this column."""
    for row in case.views.values():
        if column not in row:
            raise DoesNotApplyError(column)
        del row[column]
    return Effect(note=f"no {column}")


def scaled(case: CaseFolder, random: Generator, column: str, factor: float, view: str | None = None) -> Effect:
    for name, row in case.views.items():
        if view in (None, name):
            if column not in row:
                raise DoesNotApplyError(column)
            row[column] = f"{float(row[column]) * factor:.5g}"
    return Effect(note=f"{view or 'both'} {column} times {factor:g}")


def as_text(
    case: CaseFolder, random: Generator, change: Callable[[str], str], table: int, encoding: str = "utf-8"
) -> Effect:
    """Change a written table; it is not written again."""
    case.write_tables()
    path = case.tables[table]
    path.write_bytes(change(path.read_text(encoding="utf-8")).encode(encoding))
    case.write_tables = lambda: None  # type: ignore[method-assign]
    return Effect(note=path.name)


def exchanged(case: CaseFolder, random: Generator) -> Effect:
    """Each table under the other's name."""
    case.write_tables()
    one, other = (path.read_bytes() for path in case.tables)
    case.tables[0].write_bytes(other)
    case.tables[1].write_bytes(one)
    case.write_tables = lambda: None  # type: ignore[method-assign]
    return Effect(note="tables exchanged")


TABLES.add("the other side", side, bases=("pictures", "nifti", "dicom", "both"))
for _side in ("left", "B", "l", ""):
    TABLES.add(f"side {_side!r}", partial(side, to=_side))
TABLES.add("names of the views swapped", views_swapped, bases=("pictures", "nifti", "both"))
for _factor in (10.0, 0.1, 2.0, 0.5, 1.18, 0.85):
    TABLES.add(f"pixel_spacing_mm times {_factor:g}", partial(scaled, column="pixel_spacing_mm", factor=_factor))
    TABLES.add(
        f"pixel_spacing_mm of CC times {_factor:g}",
        partial(scaled, column="pixel_spacing_mm", factor=_factor, view="CC"),
    )
for _factor in (10.0, 0.1, 2.0, 0.5):
    TABLES.add(f"thickness_mm times {_factor:g}", partial(scaled, column="thickness_mm", factor=_factor))
    TABLES.add(
        f"thickness_mm of MLO times {_factor:g}", partial(scaled, column="thickness_mm", factor=_factor, view="MLO")
    )
for _factor in (10.0, 0.1, 0.001):
    TABLES.add(f"source_detector_mm times {_factor:g}", partial(scaled, column="source_detector_mm", factor=_factor))
for _column in ("pixel_spacing_mm", "thickness_mm", "orientation", "angle_deg", "source_detector_mm"):
    TABLES.add(f"no {_column}", partial(without, column=_column))
for _name, _column, _value, _view in (
    ("angle in radians", "angle_deg", "0.785", "MLO"),
    ("angle of the other view", "angle_deg", "0", "MLO"),
    ("angle of 45 for CC", "angle_deg", "45", "CC"),
    ("angle reversed", "angle_deg", "-45", "MLO"),
    ("angle with a comma", "angle_deg", "45,0", "MLO"),
    ("spacing with a comma", "pixel_spacing_mm", "0,4", "CC"),
    ("two spacings", "pixel_spacing_mm", "0.4\\0.4", "CC"),
    ("spacing with its unit", "pixel_spacing_mm", "0.4 mm", "CC"),
    ("thickness nan", "thickness_mm", "nan", "CC"),
    ("thickness infinite", "thickness_mm", "inf", "CC"),
    ("thickness 0", "thickness_mm", "0", "CC"),
    ("rows reversed", "orientation", "A\\L", "CC"),
    ("columns reversed", "orientation", "P\\R", "CC"),
    ("both reversed", "orientation", "P\\L", "CC"),
    ("columns reversed", "orientation", "P\\FR", "MLO"),
    ("orientation in words", "orientation", "left", "CC"),
    ("orientation along one axis", "orientation", "A\\P", "CC"),
    ("view in words", "view", "cranio-caudal", "CC"),
    ("view in small letters", "view", "cc", "CC"),
    ("view spot", "view", "SPOT", "CC"),
    ("the same view twice", "view", "CC", "MLO"),
    ("the other's picture", "image", "mlo.png", "CC"),
    ("unknown case", "case", "other", "CC"),
    ("no such picture", "image", "cc2.png", "CC"),
    ("a table for a picture", "image", "cc_lesion.tsv", "CC"),
    ("a picture for a table", "lesion", "cc.png", "CC"),
    ("the other view's lesion", "lesion", "mlo_lesion.tsv", "CC"),
):
    TABLES.add(f"{_view}: {_name} ({_column})", partial(cell, column=_column, value=_value, view=_view))
for _column, _value in {
    "mr": "cc.png",
    "mr_lesion": "mr_landmarks.tsv",
    "mr_landmarks": "mr_lesion.tsv",
    "mr_labels": "mr.nii.gz",
    "mr_compressed": "mr.nii.gz",
    "compression": "21",
    "case": "tables",
    "exclude": "",
}.items():
    TABLES.add(f"{_column} {_value!r}", partial(cell, column=_column, value=_value), harmless=_column == "exclude")
TABLES.add(
    "the lesion's mask for the MR volume", partial(cell, column="mr", value="mr_lesion.nii.gz"), bases=("nifti",)
)
TABLES.add("the MR volume for the lesion", partial(cell, column="mr_lesion", value="mr.nii.gz"), bases=("nifti",))
for _table in (0, 1):
    for _name, _change in {
        "commas": lambda t: t.replace("\t", ","),
        "semicolons": lambda t: t.replace("\t", ";"),
        "spaces": lambda t: t.replace("\t", "    "),
        "no header": lambda t: t.partition("\n")[2],
        "header alone": lambda t: t.partition("\n")[0] + "\n",
        "a column misspelled": lambda t: t.replace("lesion", "leison", 1),
        "a column missing": lambda t: t.replace("case\t", "", 1),
        "the header twice": lambda t: t.partition("\n")[0] + "\n" + t,
        "every row twice": lambda t: t + t.partition("\n")[2],
        "a quote left open": lambda t: t.replace("case1", '"case1', 1),
        "nothing": lambda t: "",
        "zero bytes": lambda t: t.replace("case1", "ca\0se1", 1),
    }.items():
        TABLES.add(f"table {_table + 1}: {_name}", partial(as_text, change=_change, table=_table))
    TABLES.add(f"table {_table + 1}: UTF-16", partial(as_text, change=str, table=_table, encoding="utf-16"))
TABLES.add(
    "Latin-1 names", partial(as_text, change=lambda t: t.replace("mr.nii", "mré.nii"), table=0, encoding="latin-1")
)
TABLES.add("tables exchanged", exchanged)
MUTATIONS = TABLES.found
