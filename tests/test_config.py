"""The configuration: the shipped one is valid, its schema documented, mistakes one clear line."""

import copy
from pathlib import Path

import pytest
import yaml

from imuarray.config import check_config, describe_schema, model_from, read_config
from imuarray.errors import InputError

ROOT = Path(__file__).parents[1]


@pytest.fixture
def config():
    return read_config(ROOT / "config.yaml")


def test_every_leaf_of_the_shipped_config_is_described(config):
    text = describe_schema()
    for section, content in config.items():
        assert f"| `{section}`" in text
        if isinstance(content, dict) and section not in ("scales", "recordings"):
            for key in content:
                assert f"| `{section}.{key}`" in text


def test_documentation_agrees_with_the_schema():
    assert (ROOT / "config" / "README.md").read_text() == describe_schema()


def test_schema_gives_each_key_a_description():
    for line in describe_schema().splitlines():
        assert not line.endswith("| section |") or line.count(".") == 0


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (("scale",), "huge", "expected one of quick, default, paper, found huge"),
        (("noise", "accelerometer_sd"), -1, "noise.accelerometer_sd"),
        (("paper2021", "prior_sd"), "3 mm", "paper2021.prior_sd"),
        (("papers",), {}, "papers"),
        (("paper2021", "samples"), [5, 7], "expected an entry T7"),
        (("scales", "quick", "draws"), 10**9, "transitions"),
    ],
)
def test_mistakes_are_named(config, path, value, message):
    wrong = copy.deepcopy(config)
    place = wrong
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    with pytest.raises(InputError, match=message) as error:
        check_config(wrong)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("text", ["", "[1, 2", "a: [", "- 1", "\x00"])
def test_files_that_are_no_configuration(tmp_path, text):
    path = tmp_path / "c.yaml"
    path.write_text(text)
    with pytest.raises(InputError):
        read_config(path)


def test_yaml_runs_no_code(tmp_path):
    path = tmp_path / "c.yaml"
    path.write_text("!!python/object/apply:os.system ['echo unsafe']")
    with pytest.raises(InputError):
        read_config(path)


def test_model_from_a_position_list(config):
    config["array"] = {"positions": [[0, 0, 0], [0.02, 0, 0], [0, 0.02, 0]], "gyroscopes": 1}
    model = model_from(check_config(yaml.safe_load(yaml.safe_dump(config))))
    assert model.array.accelerometers == 3 and model.array.gyroscopes == 1
