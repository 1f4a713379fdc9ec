"""The configuration: defaults, errors with the nearest key, and the texts that are written from the models."""

import importlib
import re
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from stages.code_numbers import NUMBERS
from stages.engine.config import config_model, read_config, stage_settings
from stages.engine.errors import FaultsError
from stages.engine.registry import STAGE_MODULES, load_stage
from stages.reference import reference_files

PROJECT = Path(__file__).resolve().parents[2]


def test_empty_configuration_is_the_embedded_cohort():
    config = read_config({})
    assert config.table_files(Path("here")) == (
        Path("here/config/digital/cases.tsv"),
        Path("here/config/digital/views.tsv"),
    )
    assert config.results == "results"


def test_cases_alone_are_a_cohort_without_mammograms():
    assert read_config({"cases": "my/cases.tsv"}).table_files(Path("here")) == (Path("my/cases.tsv"), None)


def test_number_as_a_folder_name_and_exponent_as_yaml_reads_it():
    values = yaml.safe_load("results: 2026\nsolve: {residual: 1e-3}")
    assert isinstance(values["solve"]["residual"], str), "YAML 1.1 takes 1e-3 for a text"
    config = read_config(values)
    assert config.results == "2026"
    assert stage_settings(config, "solve")["residual"] == 1e-3


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"compres": {}}, "config, key compres: is unknown; the nearest known one is 'compress'"),
        ({"mesh": {"element": 7}}, "config, key mesh.element: is unknown; the nearest known one is 'elements'"),
        ({"mesh": {"elements": 1}}, "config, key mesh.elements: 1 is not permitted; input should be greater than"),
        ({"views": "v.tsv"}, "config, key views: is given without cases; give cases=<cases.tsv> as well"),
    ],
)
def test_fault_names_the_key_and_the_remedy(values, message):
    with pytest.raises(FaultsError) as caught:
        read_config(values)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("values", "messages"),
    [
        (
            {"pose": {"mechanics": {"friction": 0.1, "gland_contrast": 2}}},
            [
                "config, key pose.mechanics.friction: is unknown; write mechanics.friction, which counts",
                "config, key pose.mechanics.gland_contrast: is unknown; write mechanics.gland_contrast, which counts",
            ],
        ),
        ({"compress": {"mechanics": {"skn": "none"}}}, ["compress.mechanics.skn: is unknown; write mechanics.skin, "]),
        ({"compress": {"mechanics": {}}}, ["the section mechanics stands beside compress, not in it"]),
    ],
)
def test_shared_key_in_a_stage_s_section_is_told_its_place(values, messages):
    with pytest.raises(FaultsError) as caught:
        read_config(values)
    assert len(caught.value.faults) == len(messages)
    for message in messages:
        assert message in str(caught.value)


def test_value_that_is_not_permitted_is_answered_in_the_user_s_words():
    with pytest.raises(FaultsError) as caught:
        read_config({"mechanics": {"material": "jelly"}})
    (fault,) = caught.value.faults
    assert str(fault).startswith("config, key mechanics.material: 'jelly' is not permitted; input should be 'wellman'")
    assert "'fat_and_gland'" in str(fault)
    assert "iteral" not in str(fault)


@pytest.mark.parametrize(
    ("key", "value", "readers"),
    [
        ("friction", 0.1, {"pose", "compress"}),
        ("back_layer_mm", 20.0, {"pose", "compress"}),
        ("back_layer", "measured", {"pose", "compress"}),
        ("material", "homogeneous", {"compress"}),
        ("gland_contrast", 2.0, {"compress"}),
        ("skin", "attached", {"compress"}),
        ("skin_thickness_mm", 2.0, {"compress"}),
        ("skin_modulus_kpa", 20.0, {"compress"}),
    ],
)
def test_shared_key_changes_the_stages_for_which_it_counts(key, value, readers):
    plain, changed = read_config({}), read_config({"mechanics": {key: value}})
    found = {name for name in STAGE_MODULES if stage_settings(plain, name) != stage_settings(changed, name)}
    assert found == readers


def test_pose_and_compress_press_between_the_same_plates():
    """What pose leaves out is the tissue's difference and the skin, and nothing else."""
    config = read_config({"mechanics": {"friction": 0.2, "lip_radius_mm": 12.0, "back": "springs", "skin": "attached"}})
    coarse, fine = (
        load_stage(name).settings.model_validate(stage_settings(config, name)).mechanics.numerics()
        for name in ("pose", "compress")
    )
    assert (coarse.friction, coarse.lip_radius_mm, coarse.back) == (0.2, 12.0, "springs")
    assert replace(fine, material="homogeneous", gland_contrast=1.0, skin="none") == coarse
    assert fine.skin == "attached"


def test_every_stage_takes_the_settings_that_the_configuration_gives_it():
    for name in STAGE_MODULES:
        settings = load_stage(name).settings
        given = stage_settings(config_model()(), name)
        assert settings.model_validate(given) == settings()
        assert given.keys() == settings.model_fields.keys()


def test_keys_stand_in_the_order_in_which_a_run_needs_them():
    order = [name for name in config_model().model_fields if name in STAGE_MODULES]
    assert len(order) > 10
    for place, name in enumerate(order):
        record = load_stage(name)
        later = set(order[place:]) & {*record.inputs, *record.optional}
        assert not later, f"{name} reads {later}, which come after it"


def test_permitted_values_are_listed_plainly():
    for path, text in reference_files(PROJECT).items():
        assert "Literal" not in text, path
    text = (PROJECT / "config" / "config.yaml").read_text().replace("\n  #", "")
    materials = ("wellman", "azar", "samani", "homogeneous", "krouskop", "bakic", "lorenzen", "fat_and_gland")
    assert f"({' | '.join(materials)})" in text


def test_every_default_of_the_mechanics_says_where_it_comes_from():
    """In config.yaml and in the table of config/README.md: a reference, the paper, or the word chosen."""
    table = _table_of_sources()
    keys = type(config_model()().mechanics).model_fields
    assert len(keys) == 16
    for key in keys:
        value, origin = table[f"mechanics.{key}"]
        assert yaml.safe_load(value) == stage_settings(config_model()(), "compress")["mechanics"][key]
        assert re.match(r"chosen\b|.*\bpaper\b|.*(19|20)\d\d|.*doi ", origin), f"{key}: {origin}"
        folded = re.sub(r"\n +# ", " ", (PROJECT / "config" / "config.yaml").read_text())
        assert re.search(rf"; {re.escape(origin)}[^\n]*\n  {key}:", folded), key


def test_numbers_in_the_code_stand_in_the_table_with_their_value():
    table = _table_of_sources()
    for module, names in NUMBERS.items():
        for name in names:
            held = importlib.import_module(module)
            settings = {"mr_chest_wall": "BackSettings", "options": "ClosingOptions"}.get(module.rsplit(".", 1)[1])
            value = getattr(getattr(held, settings)() if settings else held, name)
            text, origin = table[f"{module}.{name}"]
            assert float(text) == value, name
            assert "chosen" in origin or "paper" in origin, name


def _table_of_sources() -> dict[str, tuple[str, str]]:
    """Value and origin by number, as config/README.md has them."""
    text = (PROJECT / "config" / "README.md").read_text().split("<!-- sources -->")[1]
    rows = [line.strip("| ").split(" | ", 2) for line in text.splitlines() if line.startswith("| `")]
    return {number.strip("`"): (value.strip("`"), origin) for number, value, origin in rows}


def test_all_faults_come_at_once():
    with pytest.raises(FaultsError) as caught:
        read_config({"mesh": {"elements": 1, "x": 2}, "nonsense": 1, "results": ""})
    assert len(caught.value.faults) == 4


def test_settings_of_every_stage_say_what_they_mean():
    for name in STAGE_MODULES:
        for key, info in load_stage(name).settings.model_fields.items():
            assert info.description, f"{name}.{key}"


def test_stage_records_agree_with_the_registry():
    for name in STAGE_MODULES:
        assert load_stage(name).name == name


def test_written_texts_equal_the_models():
    for path, text in reference_files(PROJECT).items():
        assert path.read_text(encoding="utf-8") == text, f"{path.name} is out of date: make generated"


def test_default_file_holds_the_defaults():
    values = yaml.safe_load((PROJECT / "config" / "config.yaml").read_text())
    assert read_config(values) == config_model()()
