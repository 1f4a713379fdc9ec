"""Study `table_1`: both routes beside the paper, with provenance and what proves nothing."""

import csv
import io
from typing import Any

import pytest

from mammoreg.errors import NotConvergedError
from stages.engine.contract import Fields, Inputs, Subject
from stages.studies.table_1 import stage as table_1

PRINTED = {"wellman", "azar", "samani", "krouskop", "bakic", "lorenzen"}


@pytest.fixture(scope="module")
def fields() -> Fields:
    return table_1.run(Inputs(), table_1.Settings(elements=(3, 2)), Subject("cohort"))


def rows(fields: Fields) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(fields.files["tables/table_1_forces.csv"].decode())))


def test_csv_has_the_columns_of_the_contract_and_every_route_of_every_entry(fields: Fields) -> None:
    found = rows(fields)
    assert list(found[0]) == ["model", "tissue", "compression", "route", "force_n", "paper_n", "independent"]
    assert len(found) == 7 * 2 * 3
    assert {row["route"] for row in found} == {"law", "fe_sliding", "fe_sticking"}
    assert {(row["tissue"], row["compression"]) for row in found} == {("fat", "0.21"), ("gland", "0.50")}
    assert {row["model"] for row in found if row["paper_n"]} == PRINTED


def test_law_rounds_to_the_paper_and_sliding_elements_meet_the_law(fields: Fields) -> None:
    found = {(row["model"], row["tissue"], row["route"]): row for row in rows(fields)}
    for (model, tissue, route), row in found.items():
        law = float(found[model, tissue, "law"]["force_n"])
        if route == "law" and row["paper_n"]:
            assert round(law) == int(row["paper_n"])
        if route == "fe_sliding":
            assert float(row["force_n"]) == pytest.approx(law, rel=0.005)
        if route == "fe_sticking":
            assert float(row["force_n"]) > law


def test_pages_first_name_what_proves_nothing_and_give_bulk_moduli_and_provenance(fields: Fields) -> None:
    page = fields.files["tables/table_1_forces.md"].decode()
    first = page.splitlines()[2]
    assert "agree by construction" in first
    assert all(name in first for name in ("samani fat", "krouskop gland", "bakic fat", "wellman gland"))
    assert "lorenzen" not in first
    assert "wellman fat" not in first
    for text in ("K / mu", "2 a side, N", "3 a side, % off", "table_1_implied", "memory", "assumption", "published"):
        assert text in page
        assert text in fields.files["tables/table_1_forces.html"].decode()
    (bulk,) = [row for row in fields.values["bulk_kpa"] if (row["model"], row["tissue"]) == ("wellman", "gland")]
    assert bulk["bulk_kpa"] > 5000.0 * 15.1 / 3.0


def test_cube_without_equilibrium_is_named_and_leaves_an_empty_force(monkeypatch: pytest.MonkeyPatch) -> None:
    def failing(*_: Any) -> Any:
        raise NotConvergedError("an element turns inside out")

    monkeypatch.setattr(table_1, "press_cube", failing)
    table_1._cube_n.cache_clear()
    fields = table_1.run(Inputs(), table_1.Settings(elements=(2,)), Subject("cohort"))
    table_1._cube_n.cache_clear()
    assert all((row["force_n"] == "") == (row["route"] != "law") for row in rows(fields))
    assert "bakic gland, fe_sticking, 2 elements a side: no equilibrium found" in (
        fields.files["tables/table_1_forces.md"].decode()
    )
