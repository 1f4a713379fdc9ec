"""Stage `calibrate`: scale of the homogeneous tissue and forces of the material models (paper, II-B, Table I)."""

from pydantic import Field

from mammoreg.materials.catalogue import CATALOGUE, CatalogueTissue
from mammoreg.materials.cube import HIGH_COMPRESSION, LOW_COMPRESSION, SULLIVAN, cube_force_n, mu_for_force_kpa
from mammoreg.materials.laws import NeoHookean
from stages.engine.contract import Fields, Inputs, SettingsModel, Stage, Subject, Value, source


class Settings(SettingsModel):
    """Which force sets the scale of the homogeneous tissue."""

    force_n: float = Field(
        SULLIVAN.median_n,
        gt=0.0,
        le=1000.0,
        description="force at which the tissue is scaled, N",
        json_schema_extra=source(
            "the paper's median of Sullivan et al., Radiology 1991;181:355 (the abstract has 122.5)"
        ),
    )
    compression: float = Field(
        HIGH_COMPRESSION,
        gt=0.0,
        lt=0.9,
        description="compression of the 240 cm3 cube at that force, share",
        json_schema_extra=source("the paper's larger compression"),
    )


def run(inputs: Inputs, settings: Settings, subject: Subject) -> Fields:
    """Scale the homogeneous neo-Hookean tissue; judge all models by the measured forces."""
    mu_kpa = mu_for_force_kpa(settings.force_n, settings.compression)
    tissue = NeoHookean(mu_kpa)
    low, high = cube_force_n(tissue, LOW_COMPRESSION), cube_force_n(tissue, HIGH_COMPRESSION)
    table = [row for name in CATALOGUE for row in _rows(name)]
    return Fields(
        values={
            "mu_kpa": mu_kpa,
            "scaled_to_force_n": settings.force_n,
            "scaled_at_compression": settings.compression,
            "force_fat_21_n": low,
            "force_gland_50_n": high,
            "fat_21_in_range": SULLIVAN.holds(low),
            "gland_50_in_range": SULLIVAN.holds(high),
            "force_ratio": high / low,
            "range_ratio": SULLIVAN.ratio,
            "any_scale_holds_both": high / low <= SULLIVAN.ratio,
            "range_lowest_n": SULLIVAN.lowest_n,
            "range_highest_n": SULLIVAN.highest_n,
            "table_1": list[Value](table),
        }
    )


def _rows(model: str) -> list[dict[str, Value]]:
    """Table I for one model by its one-dimensional laws: fat at 21 %, gland at 50 %."""
    entry = CATALOGUE[model]
    return [
        _row(model, "fat", entry.fat, LOW_COMPRESSION, entry.table_1.get("fat")),
        _row(model, "gland", entry.gland, HIGH_COMPRESSION, entry.table_1.get("gland")),
    ]


def _row(model: str, name: str, tissue: CatalogueTissue, compression: float, paper_n: float | None) -> dict[str, Value]:
    force = cube_force_n(tissue.law, compression)
    return {
        "model": model,
        "tissue": name,
        "compression": compression,
        "route": "law",
        "force_n": force,
        "paper_n": paper_n,
        "independent": tissue.independent,
        "in_range": SULLIVAN.holds(force),
    }


STAGE = Stage(name="calibrate", schema=1, inputs=(), settings=Settings, run=run)
