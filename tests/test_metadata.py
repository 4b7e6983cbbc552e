"""What archives and catalogues read of the project says the same everywhere."""

import json
import tomllib
from pathlib import Path

import yaml

import imuarray

ROOT = Path(__file__).parents[1]


def test_citation_codemeta_and_zenodo_agree():
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    meta = json.loads((ROOT / "codemeta.json").read_text("utf-8"))
    zenodo = json.loads((ROOT / ".zenodo.json").read_text("utf-8"))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    assert {cited["version"], meta["version"], zenodo["version"]} == {imuarray.__version__}
    assert cited["title"] == meta["name"] == zenodo["title"]
    assert cited["abstract"] == meta["description"] == zenodo["description"]
    assert cited["keywords"] == meta["keywords"] == zenodo["keywords"]
    assert project["keywords"] == cited["keywords"]
    names = [author["name"] for author in cited["authors"]]
    for authors in (meta["author"], zenodo["creators"], project["authors"]):
        assert [author["name"] for author in authors] == names
    date = str(cited["date-released"])
    assert date == meta["datePublished"] == zenodo["publication_date"]
    assert cited["license"] == project["license"] == zenodo["license"]
    assert meta["license"].endswith(f"/{cited['license']}")


def test_the_container_is_of_this_version():
    snakefile = (ROOT / "workflow" / "Snakefile").read_text("utf-8")
    assert f'container: "docker-daemon://imuarray:{imuarray.__version__}"' in snakefile.replace(
        "\n", ""
    )
