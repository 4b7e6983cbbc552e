"""paper_figures/: made from the configuration at hand, or again; and the workflow elsewhere."""

import json
import re
import shutil
from pathlib import Path

import pytest
import yaml

from imuarray_papers.config import check_config, read_config
from imuarray_papers.pipeline.published import Published
from imuarray_papers.pipeline.recordings import Recordings
from tests.papers.test_pipeline import ROOT, started

MODULE = """
module papers:
    snakefile: "{}"
    config: {{}}

use rule * from papers as papers_*
"""


def published(**sections):
    config = check_config(sections)
    return Published(config, Recordings(config))


def test_what_is_committed_was_made_from_the_shipped_configuration(committed):
    names = {path.stem for path in committed.iterdir()} - {"README", "findings"}
    assert len(names) > 30
    config = read_config(ROOT / "config.yaml")
    shipped = Published(config, Recordings(config))
    for name in names:
        stated = json.loads((committed / f"{name}.json").read_text(encoding="utf-8"))
        assert stated == json.loads(json.dumps(shipped.settings(name))), name


def test_published_numbers_are_rounded(committed):
    for path in committed.glob("*.csv"):
        numbers = re.findall(r"(?<![\w.])-?\d+\.\d+(?:e-?\d+)?", path.read_text(encoding="utf-8"))
        assert all(float(f"{float(x):.7g}") == float(x) for x in numbers), path.name


def test_a_figure_rests_on_its_own_section_of_the_configuration():
    given = published()
    other = published(paper2017={"fig4_samples": [2, 3, 4]})
    for name in ("2017_fig3", "2017_fig4", "2017_fig5", "2021_fig1", "2021_fig3", "2021_table1"):
        same = given.settings(name) == other.settings(name)
        assert same == (name != "2017_fig4"), name
    noisy = published(noise={"gyroscope_sd_dps": 0.1})
    assert noisy.settings("2021_fig1") != given.settings("2021_fig1")


def test_only_a_change_makes_what_came_with_the_clone_old(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    given, target = published(), "paper_figures/2017_fig4.png"
    Path("paper_figures").mkdir()
    Path(target).touch()
    content = json.dumps(given.settings("2017_fig4"))
    Path("paper_figures/2017_fig4.json").write_text(content, encoding="utf-8")
    path = Path(given.stated("2017_fig4", [target]))
    assert path.stat().st_mtime == 0
    assert "came with the clone" in capsys.readouterr().err
    other = published(paper2017={"fig4_samples": [2, 3, 4]})
    path = Path(other.stated("2017_fig4", [target]))
    assert path.stat().st_mtime > Path(target).stat().st_mtime - 1 > 0
    assert capsys.readouterr().err == ""


@pytest.fixture
def clone(tmp_path, committed):
    """The project as committed files of paper_figures/ and the workflow of this tree."""
    shutil.copytree(ROOT / "workflow", tmp_path / "workflow")
    shutil.copytree(committed, tmp_path / "paper_figures")
    shutil.copytree(ROOT / "data", tmp_path / "data")
    shutil.copy(ROOT / "config.yaml", tmp_path)
    shutil.copy(ROOT / "CITATION.cff", tmp_path)
    return tmp_path


def dry(directory, *targets, snakefile="workflow/Snakefile"):
    """Rules of a dry run, and what it said."""
    options = f"-s {snakefile} --cores 2 --quiet host"
    done = started(directory, "-n", *targets, options=options)
    said = done.stdout + done.stderr
    assert done.returncode == 0, said[-3000:]
    return set(re.findall(r"(?m)^(\w+) +\d+$", said)) - {"total"}, said


@pytest.mark.slow
def test_a_figure_asked_for_by_name_is_that_of_the_configuration_at_hand(clone):
    target = "paper_figures/2017_fig4.png"
    rules, said = dry(clone, target)
    assert rules == set() and f"{target}: came with the clone" in said
    config = yaml.safe_load((clone / "config.yaml").read_text(encoding="utf-8"))
    config["paper2017"]["fig4_samples"] = [2, 3, 4, 5, 10]
    (clone / "config.yaml").write_text(yaml.safe_dump(config), encoding="utf-8")
    rules, _ = dry(clone, target)
    assert rules == {"position_error_part", "position_error", "figure_2017_fig4", "copy_published"}
    rules, said = dry(clone, "paper_figures/2017_fig5.png")
    assert rules == set() and "came with the clone" in said


@pytest.mark.slow
@pytest.mark.parametrize(
    "where", ["{}/workflow/Snakefile", "git+file://{}/workflow/Snakefile@HEAD"]
)
def test_the_workflow_is_a_module_of_another(tmp_path, where):
    if where.startswith("git") and not (ROOT / ".git").exists():
        pytest.skip("no repository")
    (tmp_path / "Snakefile").write_text(MODULE.format(where.format(ROOT)), encoding="utf-8")
    rules, _ = dry(tmp_path, "papers_quick", snakefile="Snakefile")
    assert {"papers_convert_recording", "papers_sample_posterior", "papers_claims"} <= rules
