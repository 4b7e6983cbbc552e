"""The JSON schema of columns.yaml, for editors: it takes what the reader takes."""

import json
from pathlib import Path

import jsonschema
import pytest
import yaml

from imuarray.recording import layout
from tests.doc_pages import ROOT, blocks

SCHEMA = json.loads(Path(layout.__file__).with_name("columns.schema.json").read_text())
FILES = [
    block
    for block in blocks(ROOT / "docs" / "convert.md")
    if (block.language, block.kind) == ("yaml", "file")
]


def own_keys(schema: dict) -> dict[str, bool]:
    """Keys of a section, and whether each has to be there."""
    return {key: key in schema.get("required", ()) for key in schema["properties"]}


def test_it_has_the_readers_keys():
    board, rig, bag = SCHEMA["anyOf"]
    for schema, whole, sensor in (
        (board, layout.BOARD, layout.BOARD_SENSOR), (rig, layout.RIG, layout.SENSOR),
        (bag, layout.BAG, layout.BAG_SENSOR),
    ):  # fmt: skip
        assert own_keys(schema) == whole
        assert all(own_keys(schema["properties"][kind]) == sensor for kind in layout.KINDS)
    imus = [s["properties"]["imus"]["additionalProperties"] for s in (rig, bag)]
    assert [own_keys(own) for own in imus] == [layout.IMU, layout.BAG_IMU]


@pytest.mark.parametrize("block", FILES, ids=lambda block: block.note)
def test_it_takes_what_the_docs_show(block):
    jsonschema.validate(yaml.safe_load(block.text), SCHEMA)


@pytest.mark.parametrize(
    "text", ["", "time: {rate: 100}", "delimiter: 3", "accelerometers: {unit: g}", "imus: {}"]
)
def test_it_refuses_what_is_not_whole(text):
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(yaml.safe_load(text), SCHEMA)
