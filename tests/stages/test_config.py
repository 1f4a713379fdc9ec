"""The configuration: defaults, errors with the nearest key, and the texts that are written from the models."""

from pathlib import Path

import pytest
import yaml

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
