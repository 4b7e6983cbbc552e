"""A rule rests on what its script imports, and on nothing else; its names agree."""

import ast
import os
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

from imuarray_papers.pipeline import sources as of_package
from imuarray_papers.pipeline.sources import Sources

WORKFLOW = Path(__file__).parents[2] / "workflow"
SCRIPTS = {path.stem: path.read_text("utf-8") for path in (WORKFLOW / "scripts").glob("*.py")}
SAMPLING = {"sample_posterior", "sample_experiment"}
RULES = "".join(path.read_text(encoding="utf-8") for path in (WORKFLOW / "rules").iterdir())
# functions that make a figure or a table, by their names, which are those of the rules, too
DRAWN = {
    name.rpartition(".")[2]: f"imuarray_papers.figures.{name}"
    for name in re.findall(r'draw\(\s*"([\w.]+)"', RULES)
}


@pytest.fixture(scope="module")
def sources():
    return Sources(SCRIPTS.__getitem__)


def files(sources, name):
    """The package's files that a script rests on, or a rule that draws."""
    if name in DRAWN:
        return sources.files("publish", DRAWN[name].rpartition(".")[0])
    return sources.files(name)


def resting_on(sources, name):
    """The scripts and the rules that draw that rest on a file of the package."""
    found = {
        one
        for one in [*SCRIPTS, *DRAWN]
        if any(file.endswith(name) for file in files(sources, one))
    }
    assert found, f"no script rests on {name}"
    return found


@pytest.mark.parametrize(
    ("name", "scripts"),
    [
        ("claims/registry.py", {"claims"}),
        ("studies/checks/timing.py", {"claims_timing"}),
        ("studies/sbc.py", {"pit_values"}),
        ("blind/study.py", {"blind_diagnose"}),
        ("report/write.py", {"diagnose_recording"}),
        ("diagnosis/settings.py", {"blind_diagnose", "diagnose_recording"}),
        ("report/report.html.j2", {"diagnose_recording"}),
    ],
)
def test_what_one_stage_needs_is_that_stages_alone(sources, name, scripts):
    found = resting_on(sources, name)
    assert scripts <= found and not found & SAMPLING
    assert not any(name.startswith(("figure_2", "table_2", "simulate_")) for name in found)


@pytest.mark.parametrize("name", ["pictures/style.py", "pictures/imuarray.mplstyle"])
def test_drawings_rest_on_their_style(sources, name):
    drawn = {one for one in [*SCRIPTS, *DRAWN] if one.startswith("figure_")}
    assert len(drawn) > 15 and drawn <= resting_on(sources, name)
    assert not resting_on(sources, name) & {*SAMPLING, "blind_diagnose", "position_error_part"}


def test_everything_computed_rests_on_the_model_and_no_drawing_does(sources):
    found = resting_on(sources, "model/kinematics.py")
    assert {*SAMPLING, "simulate_samples", "position_error_part", "blind_diagnose"} <= found
    assert not found & {"figure_2017_fig3", "figure_2021_fig4", "table_2021_table2", "claims"}


@pytest.mark.parametrize("script", ["sample_posterior", "publish", "blind_diagnose"])
def test_a_script_rests_on_all_that_it_loads(sources, script):
    """Against what Python itself has loaded; `pipeline.job` only logs."""
    imports = [
        ast.unparse(node)
        for node in ast.walk(ast.parse(SCRIPTS[script]))
        if isinstance(node, ast.Import | ast.ImportFrom) and "pipeline.job" not in ast.unparse(node)
    ]
    loaded = "print(*(m.__file__ for n, m in sys.modules.items() if n.startswith('imuarray')))"
    done = subprocess.run(
        [sys.executable, "-c", "\n".join(["import sys", *imports, loaded])],
        env={**os.environ, "PYTHONPATH": ":".join(sys.path)},
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert set(done.stdout.split()) <= {str(path) for path in sources.files(script).values()}


def test_a_digest_follows_what_the_code_does(sources, monkeypatch, tmp_path):
    """Not its remarks, layout and docstrings."""
    before, other = sources.digest("claims"), sources.digest("tune")
    place, changed = (
        sources.files("claims")["imuarray_papers/claims/registry.py"],
        tmp_path / "registry.py",
    )
    text = place.read_text(encoding="utf-8")
    content = of_package._content.__wrapped__
    monkeypatch.setattr(of_package, "_content", lambda path: (
        content(changed if path == place else path)
    ))  # fmt: skip
    for altered, same in (
        (text + "\n# a remark\n", True),
        (text.replace('"""', '"""Otherwise: ', 1), True),
        (text + "\nADDED = 1\n", False),
    ):
        changed.write_text(altered, encoding="utf-8")
        assert (sources.digest("claims") == before) is same
        assert sources.digest("tune") == other


def test_rules_take_the_digest_of_the_script_they_run():
    for rule in re.split(r"(?m)^ *(?:rule|checkpoint)\b", RULES)[1:]:
        script = re.search(r"scripts/(\w+)\.py", rule)
        if script and script[1] != "publish":  # that of `draw`
            assert f'code("{script[1]}"' in rule, rule


def test_what_is_drawn_is_a_function_of_the_package():
    assert len(DRAWN) > 30
    for name in DRAWN.values():
        source, _, function = name.rpartition(".")
        assert callable(getattr(import_module(source), function))
