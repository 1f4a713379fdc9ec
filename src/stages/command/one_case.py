"""`mammoreg case`: one breast from file names alone; the tables are written here."""

import argparse
import csv
import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any, get_args

from stages.command.by_hand import add_command
from stages.command.running import add_run_options, run_cohort
from stages.engine.errors import UserError
from stages.engine.writing import write_bytes


def add_case(commands: Any) -> None:
    """The command that runs one breast; its options are the columns of the two tables."""
    from stages.cohort.cases import CaseRow, ViewRow

    parser = add_command(
        commands,
        "case",
        run_case,
        "run one breast from file names alone, without tables",
        "mammoreg case --mr mr.nii.gz --laterality R --cc cc.dcm --mlo mlo.dcm --mr-lesion lesion.nii.gz",
    )
    breast = parser.add_argument_group("the breast", "columns of cases.tsv, see config/README.md")
    breast.add_argument(
        "--case", default="case1", help="a name for the breast, letters, digits, _ and - (default: case1)"
    )
    for column in _columns(CaseRow):
        info = CaseRow.model_fields[column]
        breast.add_argument(_option(column), required=info.is_required(), help=_text(info.description))
    for view in get_args(ViewRow.model_fields["view"].annotation):
        group = parser.add_argument_group(f"the {view} mammogram", "columns of views.tsv")
        for column in _columns(ViewRow):
            group.add_argument(_view_option(view, column), help=_text(ViewRow.model_fields[column].description))
    add_run_options(parser.add_argument_group("the run"))


def _option(column: str) -> str:
    return f"--{column.replace('_', '-')}"


def _view_option(view: str, column: str) -> str:
    """`--cc` is the CC image, `--cc-lesion` another column of its row."""
    return f"--{view.lower()}" if column == "image" else f"--{view.lower()}-{column.replace('_', '-')}"


def _text(description: str | None) -> str:
    return (description or "").replace("%", "%%")


def run_case(given: argparse.Namespace) -> int:
    """Write both tables into the results folder and run them."""
    from stages.cohort.cases import CaseRow, ViewRow

    given.results = (given.results or Path("results")).absolute()
    values = vars(given)
    case = {"case": given.case} | _cells(CaseRow, {column: values[column] for column in _columns(CaseRow)})
    views = []
    for view in get_args(ViewRow.model_fields["view"].annotation):
        options = {column: _view_option(view, column) for column in _columns(ViewRow)}
        cells = _cells(ViewRow, {c: values[option[2:].replace("-", "_")] for c, option in options.items()})
        if cells and "image" not in cells:
            lone = options[next(iter(cells))]
            raise UserError(f"{lone} is given without {options['image']}; give the mammogram as well")
        if cells:
            views.append({"case": given.case, "view": view} | cells)
    cases_file, views_file = given.results / "cases.tsv", given.results / "views.tsv"
    _check_not_others(cases_file, given.case)
    write_bytes(cases_file, _table([case]))
    if views:
        write_bytes(views_file, _table(views))
    return run_cohort(given, cases_file, views_file if views else None, [])


def _columns(model: Any) -> list[str]:
    return [column for column in model.model_fields if column not in ("case", "view", "exclude")]


def _cells(model: Any, values: Mapping[str, str | None]) -> dict[str, str]:
    """What was given of a row; names of files as they are found from the folder that the user is in."""
    files = {column for column, info in model.model_fields.items() if info.annotation in (Path, Path | None)}
    return {
        column: str(Path(value).absolute()) if column in files else value
        for column, value in values.items()
        if value is not None
    }


def _check_not_others(cases: Path, case: str) -> None:
    """Tables of other cases, which a user may have written by hand, stay as they are."""
    if not cases.exists():
        return
    with cases.open(encoding="utf-8-sig", newline="") as file:
        others = [row.get("case") or "" for row in csv.DictReader(file, delimiter="\t")]
    if others != [case]:
        raise UserError(
            f"{cases}: is there already, with {', '.join(others) or 'no case'}; "
            "give another folder with --results, or write tables and use mammoreg run"
        )


def _table(rows: list[dict[str, str]]) -> bytes:
    columns = list(dict.fromkeys(column for row in rows for column in row))
    stream = io.StringIO()
    writer = csv.DictWriter(stream, columns, delimiter="\t", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return stream.getvalue().encode()
