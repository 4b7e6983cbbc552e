"""The findings as a paper: it compiles with the published files, no number in it is typed in."""

import re
import runpy
from pathlib import Path
from types import SimpleNamespace

import pytest

from imuarray_papers.config import read_config
from imuarray_papers.pipeline.rules import read_by

ROOT = Path(__file__).parents[2]
SCRIPTS = ROOT / "workflow" / "scripts"
PAGES = [SCRIPTS / "findings.typ", SCRIPTS / "findings_results.typ"]
# years, equations, figures and tables of the papers, formulas, and arguments of functions
REFERENCES = (
    r"\b20(17|21)\b|\(\d+[ab]?\)|(figure|table) [\dIVX]+|\$[^$]*\$|(?<=[(: ])\"[^\"]*\"(?=[,)])"
)


def typed_in(text):
    """The digits of a page that are no references."""
    return re.findall(r"\d+", re.sub(REFERENCES, "", text, flags=re.IGNORECASE))


def test_no_number_of_the_paper_is_typed_in():
    text = PAGES[0].read_text(encoding="utf-8").partition("\n")[2]
    assert typed_in(text) == []
    assert typed_in(text + "The error is 8 µm.") == ["8"]


@pytest.fixture
def typeset(tmp_path, committed):
    """Run the rule's script with the published files, one of them altered."""
    pytest.importorskip("typst")
    settings = read_config(ROOT / "config.yaml")

    def run(altered="", change=str):
        data = [committed / name for name in read_by(PAGES[1].read_text(encoding="utf-8"))]
        if altered:
            text = (committed / altered).read_text(encoding="utf-8")
            (tmp_path / altered).write_text(change(text), encoding="utf-8")
            data[data.index(committed / altered)] = tmp_path / altered
        given = SimpleNamespace(pages=PAGES, data=data, papers=ROOT / "CITATION.cff")
        snakemake = SimpleNamespace(
            input=given, output=[tmp_path / "findings.pdf"], log=[tmp_path / "log"],
            params={"settings": settings}, rule="findings",
        )  # fmt: skip
        runpy.run_path(str(SCRIPTS / "findings.py"), {"snakemake": snakemake})
        return (tmp_path / "findings.pdf").read_bytes()

    return run


def test_the_paper_has_four_pages_the_same_every_time(typeset):
    made = typeset()
    assert len(re.findall(rb"/Type\s*/Page\b", made)) == 4
    assert b"CreationDate" not in made and typeset() == made


def test_a_verdict_that_the_text_contradicts_stops_it(typeset, capsys):
    """What the text says of a claim is compared with the claim's verdict."""
    with pytest.raises(SystemExit):
        typeset("claims.csv", lambda text: text.replace(",does not hold,", ",holds,"))
    assert "expected does not hold, found holds" in capsys.readouterr().err
