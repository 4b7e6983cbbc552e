"""A rule rests on what its script imports, and on nothing else; its names agree."""

import ast
import os
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

WORKFLOW = Path(__file__).parents[1] / "workflow"
SCRIPTS = [path.stem for path in (WORKFLOW / "scripts").glob("*.py")]
SAMPLING = {"sample_posterior", "sample_experiment", "sample_measured"}
RULES = "".join(path.read_text(encoding="utf-8") for path in (WORKFLOW / "rules").iterdir())


@pytest.fixture(scope="module")
def sources():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(WORKFLOW))
        from support import Sources

        return Sources()


def resting_on(sources, name):
    """The scripts that rest on a file of the package."""
    found = {script for script in SCRIPTS if f"imuarray/{name}" in sources.files(script)}
    assert found, f"no script rests on {name}"
    return found


@pytest.mark.parametrize(
    ("name", "scripts"),
    [
        ("claims/registry.py", {"claims"}),
        ("studies/checks/timing.py", {"claims_timing"}),
        ("studies/joint.py", {"joint_test"}),
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


@pytest.mark.parametrize("name", ["figures/style.py", "figures/imuarray.mplstyle"])
def test_drawings_rest_on_their_style(sources, name):
    drawn = {script for script in SCRIPTS if script.startswith("figure_")}
    assert drawn <= resting_on(sources, name)
    assert not resting_on(sources, name) & {*SAMPLING, "blind_diagnose", "position_error_part"}


def test_everything_computed_rests_on_the_model_and_no_drawing_does(sources):
    found = resting_on(sources, "model/kinematics.py")
    assert {*SAMPLING, "simulate_samples", "position_error_part", "blind_diagnose"} <= found
    assert not found & {"figure_2017_fig3", "figure_2021_fig4", "table_2021_table2", "claims"}


@pytest.mark.parametrize("script", ["sample_posterior", "figure_2021_fig4", "blind_diagnose"])
def test_a_script_rests_on_all_that_it_loads(sources, script):
    """Against what Python itself has loaded."""
    tree = ast.parse((WORKFLOW / "scripts" / f"{script}.py").read_text(encoding="utf-8"))
    imports = [
        ast.unparse(node)
        for node in ast.walk(tree)
        if isinstance(node, ast.Import | ast.ImportFrom)
    ]
    loaded = "print(*(m.__file__ for n, m in sys.modules.items() if n.startswith('imuarray')))"
    done = subprocess.run(
        [sys.executable, "-c", "\n".join(["import sys", *imports, loaded])],
        env={**os.environ, "PYTHONPATH": f"{WORKFLOW / 'scripts'}:{':'.join(sys.path)}"},
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert set(done.stdout.split()) <= {str(path) for path in sources.files(script).values()}


def test_a_script_rests_on_its_siblings(sources):
    for name in SAMPLING:
        assert {"scripts/chains.py", f"scripts/{name}.py"} <= set(sources.files(name))


def test_a_digest_follows_what_the_code_does(sources, monkeypatch, tmp_path):
    """Not its remarks, layout and docstrings."""
    before, other = sources.digest("claims"), sources.digest("tune")
    place, changed = (
        sources.files("claims")["imuarray/claims/registry.py"],
        tmp_path / "registry.py",
    )
    scope, text = type(sources).digest.__globals__, place.read_text(encoding="utf-8")
    content = scope["_content"].__wrapped__
    monkeypatch.setitem(scope, "_content", lambda path: (
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
    for rule in re.split(r"(?m)^(?:rule|checkpoint) ", RULES)[1:]:
        name, script = rule.partition(":")[0], re.search(r"scripts/(\w+)\.py", rule)
        if script and name != "fetch_recordings":  # what has been fetched stays
            assert f'CODE.digest("{script[1]}"' in rule, name


def test_a_figures_rule_script_and_function_have_its_name():
    drawing = set(re.findall(r"(?m)^rule ((?:figure|table)_\w+):", RULES))
    assert drawing == {script for script in SCRIPTS if script.startswith(("figure_", "table_"))}
    for name in drawing:
        assert f'script:\n        "../scripts/{name}.py"' in RULES
        script = ast.parse((WORKFLOW / "scripts" / f"{name}.py").read_text(encoding="utf-8"))
        imports = [node for node in ast.walk(script) if isinstance(node, ast.ImportFrom)]
        [module] = [node.module for node in imports if node.names[0].name == name]
        assert callable(getattr(import_module(module), name))
