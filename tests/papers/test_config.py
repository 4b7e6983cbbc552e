"""The configuration: the shipped one is valid, its schema documented, mistakes one clear line."""

import copy
import re
from pathlib import Path

import pytest
import yaml

from imuarray.errors import InputError
from imuarray.geometry.boards import BOARDS
from imuarray_papers.config import check_config, describe_schema, model_from, read_config
from imuarray_papers.studies.bayes import simulate_twisting

ROOT = Path(__file__).parents[2]


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


def test_schema_knows_every_board():
    schema = yaml.safe_load((ROOT / "src/imuarray_papers/schemas/config.schema.yaml").read_text())
    assert schema["properties"]["array"]["properties"]["board"]["enum"] == list(BOARDS)


def test_cluster_groups_are_of_rules():
    rules = "".join(path.read_text() for path in (ROOT / "workflow/rules").glob("*.smk"))
    known = set(re.findall(r"(?m)^(?:rule|checkpoint|use rule \w+ as) (\w+)", rules))
    known |= set(re.findall(r'(?:draw\(\n +"\w+\.|^ +\(")(\w+)"', rules, re.MULTILINE))
    profile = yaml.safe_load((ROOT / "profiles/slurm/config.yaml").read_text())
    assert {group.partition("=")[0] for group in profile["groups"]} <= known


def test_schema_gives_each_key_a_description():
    for line in describe_schema().splitlines():
        assert not line.endswith("| section |") or line.count(".") == 0


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (("scale",), "huge", "expected any of quick, default, paper, found 'huge'"),
        (("noise", "accelerometer_sd"), -1, "noise.accelerometer_sd"),
        (("paper2021", "prior_sd"), "3 mm", "paper2021.prior_sd"),
        (("papers",), {}, "papers"),
        (("paper2021", "samples"), [5, 7], "expected an entry T7"),
        (("scales", "quick", "draws"), 10**9, "transitions"),
        (("noise", "accelerometer_sd"), float("nan"), "noise.accelerometer_sd: .* found nan"),
        (("noise", "accelerometer_sd"), float("inf"), "found inf"),
        (("noise", "gyroscope_sd_dps"), 1e200, "between 1e-15 and 1e.11, or 0, found 1e.200"),
        (("noise", "accelerometer_sd"), 1e-200, "found 1e-200"),
        (("experiment", "sampling_rate"), 10**400, "found an integer of 1329 bits"),
        (("experiment", "sigmas"), [0.1, float("nan")], "experiment.sigmas.1: .* found nan"),
        (("array",), {"board": "mimu4444", "gyroscopes": 300000}, "maximum of 256"),
        (("paper2021", "samples"), [10**9], "maximum of 10000000"),
        (("scales", "quick", "parts"), 10**9, "maximum of 10000"),
        (("recordings",), {"a\n": {"file": "x.nc"}}, "recordings: 'a.n' does not match"),
        (("recordings",), {"a": {"file": "x.nc", "group": "my board"}}, "a.group: .* not match"),
        (("recordings",), {"a": {"file": "x.nc", "group": "../.."}}, "a.group: .* not match"),
        (("recordings",), {"a": {"file": "x.nc", "group": "b\n"}}, "a.group: .* not match"),
        (("recordings",), {1: {"file": "x.nc"}}, "recordings: 1 is not of type 'string'"),
        (("validation", "settings"), {"a b": {"triads": 3, "samples": [5]}}, "does not match"),
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


def test_a_configuration_that_holds_itself(tmp_path):
    path = tmp_path / "c.yaml"
    path.write_text((ROOT / "config.yaml").read_text() + "\nextra: &a [*a]\n")
    with pytest.raises(InputError, match="expected at most 8 levels"):
        read_config(path)


@pytest.mark.parametrize(
    ("duration", "rate", "message"),
    [(1e10, 100.0, "expected 1 to 8333333 samples of 8 triads, found"), (1e-9, 1.0, "expected 1")],
)
def test_a_simulation_of_any_length(config, duration, rate, message):
    config["array"] = {"board": "mimu4444_corners"}
    config["experiment"] |= {"duration": duration, "sampling_rate": rate}
    with pytest.raises(InputError, match=message):
        simulate_twisting(check_config(config), 0.04)


def test_model_from_a_position_list(config):
    config["array"] = {"positions": [[0, 0, 0], [0.02, 0, 0], [0, 0.02, 0]], "gyroscopes": 1}
    model = model_from(check_config(yaml.safe_load(yaml.safe_dump(config))))
    assert model.array.accelerometers == 3 and model.array.gyroscopes == 1


def test_defaults_are_the_shipped_configuration(config):
    """A module with `config: {}` gets what a clone has."""
    assert check_config({}) == config
    other = check_config({"noise": {"gyroscope_sd_dps": 0.1}, "scales": {"mine": {"threads": 1}}})
    assert other["noise"] == config["noise"] | {"gyroscope_sd_dps": 0.1}
    assert other["scales"]["mine"] == config["scales"]["default"] | {"threads": 1}
    assert other["scales"]["quick"] == config["scales"]["quick"]
