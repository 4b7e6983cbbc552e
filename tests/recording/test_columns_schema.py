"""The JSON schema of columns.yaml, for editors: its keys are the reader's."""

import json

import jsonschema
import pytest
import yaml

from imuarray.recording import layout
from tests.doc_pages import ROOT, blocks

SCHEMA = json.loads(layout.SCHEMA.read_text())
FILES = [
    block
    for block in blocks(ROOT / "docs" / "convert.md")
    if (block.language, block.kind) == ("yaml", "file")
]


@pytest.mark.parametrize("block", FILES, ids=lambda block: block.note)
def test_it_takes_what_the_docs_show(block):
    jsonschema.validate(yaml.safe_load(block.text), SCHEMA)


@pytest.mark.parametrize(
    "text", ["", "time: {rate: 100}", "delimiter: 3", "accelerometers: {unit: g}", "imus: {}"]
)
def test_it_refuses_what_is_not_whole(text):
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(yaml.safe_load(text), SCHEMA)
