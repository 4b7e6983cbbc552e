"""Effects drawn at random when the test runs are hidden by one process and found by another."""

import json
import os
import secrets
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest

from imuarray.model import DATA_EFFECTS
from imuarray.recording import write_recording
from imuarray_papers.blind.cases import Case, make
from imuarray_papers.blind.inject import CATALOGUE, EFFECTS

pytestmark = pytest.mark.slow

# Settable, to see a failure again.
SEED = int(os.environ.get("IMUARRAY_HIDDEN_SEED") or secrets.randbits(32))
COUNT = 3
DIAGNOSE = """
import sys
from imuarray.cli import main
for path in sys.argv[1:]:
    assert main(["diagnose", path, "--out", path.removesuffix(".nc")]) in (0, 3)
"""


def drawn(rng, number: int) -> Case:
    """Any effect of the catalogue in one IMU, of 14 to 30 sigma."""
    names = [name for name in CATALOGUE if EFFECTS[name].scalable]
    effect = str(rng.choice(names)), (int(rng.integers(8)),)
    return Case(f"drawn-{number}", (effect,), float(rng.uniform(14, 30)), kind="one", duration=5.0)


def diagnosed(cases, folder):
    """[(truth, diagnosis.json)] of cases, all by one process of its own."""
    truths, paths = [], []
    for case in cases:
        recording, truth = make(case, SEED)
        truths.append(truth)
        paths.append(folder / f"{case.id}.nc")
        write_recording(recording, paths[-1])
    done = subprocess.run([sys.executable, "-c", DIAGNOSE, *map(str, paths)], capture_output=True)
    assert done.returncode == 0, done.stderr.decode()
    read = [json.loads((path.with_suffix("") / "diagnosis.json").read_text()) for path in paths]
    return list(zip(truths, read, strict=True))


@pytest.fixture(scope="module")
def answers(tmp_path_factory):
    """(answers of the drawn recordings, the names that clean ones were given).

    Of clean recordings up to 2 % may be given a name; so a second one is drawn if the first is.
    """
    rng, folder = np.random.default_rng(SEED), tmp_path_factory.mktemp("recordings")
    clean = [Case(name, duration=5.0) for name in ("none", "again")]
    *drawn_ones, first = diagnosed([drawn(rng, n) for n in range(COUNT)] + clean[:1], folder)
    named = [_names(first)]
    if named[0]:
        named += map(_names, diagnosed(clean[1:], folder))
    return drawn_ones, named


def _names(answer) -> list[str]:
    return [cause["effect"] for cause in answer[1]["causes"]]


def wrong(truth, document) -> str:
    """What is wrong with an answer; nothing of a right one."""
    [hidden], causes = truth["effects"], document["causes"]
    if [hidden["effect"]] != [
        name for c in causes for name in (c["effect"], *c["indistinguishable_from"])
        if name == hidden["effect"]
    ] or len(causes) != 1:  # fmt: skip
        return f"{hidden['effect']}: named {[cause['effect'] for cause in causes]}"
    [cause] = causes
    if cause["sensors"] != hidden["sensors"]:
        return f"{hidden['effect']} of {hidden['sensors']}: named of {cause['sensors']}"
    # from which it is adopted; readings that are left out are in little of the held-out time
    rare = hidden["effect"] in DATA_EFFECTS and DATA_EFFECTS[hidden["effect"]].left_out
    if cause["heldout_gain_nats"] < (1e-9 if rare else 1.5 * cause["heldout_gain_se"]):
        return f"{hidden['effect']}: gains no more than its error on held-out time"
    # a scan fixes others; a time follows from its correlation
    items = [item for name, item in cause["parameters"].items()
             if item["sd"] and not name.startswith("correlation_time")]  # fmt: skip
    true = next((np.ravel(p["value"]) for p in hidden["parameters"].values()
                 if np.size(p["value"]) == len(items)), None)  # fmt: skip
    if hidden["effect"] == "coloured_noise":  # the same of both kinds
        true = np.full(len(items), hidden["parameters"]["coefficient"]["value"])
    if cause["effect"] != hidden["effect"] or true is None:
        return ""
    z = [(item["value"] - value) / item["sd"] for item, value in zip(items, true, strict=True)]
    return "" if np.abs(z).max() < 4.5 else f"{hidden['effect']}: off by {np.abs(z).max():.1f} sds"


def test_what_is_hidden_is_found(answers):
    """The published rate is 97 %: of three, one may be missed."""
    said = [wrong(*each) for each in answers[0]]
    assert sum(map(bool, said)) <= 1, f"IMUARRAY_HIDDEN_SEED={SEED}: {said}"


def test_nothing_is_found_where_nothing_is_hidden(answers):
    named = answers[1]
    assert not all(named), f"IMUARRAY_HIDDEN_SEED={SEED}: {named}"


def test_published_rates_hold_their_bars(committed):
    """A worse publication fails."""
    share = pd.read_csv(committed / "blind_bars.csv").set_index("id").share
    assert share.false_alarms <= 0.02
    assert share.one_found >= 0.97
