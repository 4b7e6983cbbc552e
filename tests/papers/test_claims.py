"""The claims: a world in which the papers are right, and verdicts that flip when it is not."""

import re

import numpy as np
import pandas as pd
import pytest

from imuarray.errors import InputError
from imuarray.geometry import mimu4444_corners
from imuarray.motion import normal_motion
from imuarray.recording import Recording
from imuarray.simulation.recordings import measure
from imuarray_papers.claims.registry import (
    CLAIMS,
    FAILS,
    HOLDS,
    REGISTER,
    UNTESTED,
    VERDICTS,
    claim,
    evaluate,
    markdown,
)
from imuarray_papers.claims.results import Results
from imuarray_papers.config import model_from, read_config
from imuarray_papers.studies.bound import bound_table
from imuarray_papers.studies.checks import identifiability, marginalisation, statements
from imuarray_papers.studies.position_error import magnitudes
from imuarray_papers.studies.rate_error import accelerometers_only
from tests.papers.test_claims_measured import SETTINGS as MEASURED
from tests.papers.test_claims_measured import measured

SAMPLES = (5, 50, 500)
SDS = {
    "": 1.0,
    "simulation_": 100.0,
    "quiet_": 100.0,
    "mine_": 100.0,
    "simulation_small_noise_": 3.0,
}


@pytest.fixture(scope="module")
def settings():
    config = read_config("config.yaml") | {"recordings": MEASURED["recordings"]}
    config["experiment"]["recording"] = "mine"
    return config | {"scale": {"name": "made up", **config["scales"]["quick"]}}


def calibration(paper):
    """Figures 3 to 5 as the paper describes them, with errors of 1 %."""
    samples = [
        {"samples": n, "iterations": i, "converged_share": 1.0,
         "rmse_m": 1e-3 if n == 2 else np.hypot(1e-3 * np.exp(-i / 20), 1e-6 * (1000 / n) ** 0.5)}
        for n in paper["fig4_samples"] for i in paper["fig4_iterations"]
    ]  # fmt: skip
    motion = [
        {"angular_rate_dps": w, "angular_acceleration_dps2": a, "rmse_m": 1 / (w * w + a),
         "converged_share": 1.0}
        for a in paper["fig5_accelerations_dps2"] for w in paper["fig5_rates_dps"]
    ]  # fmt: skip
    force = [{"specific_force_mps2": f, "rmse_m": 2e-5} for f in (0.0, 1.0, 10.0, 100.0)]
    rate = [
        {"angular_rate_dps": w, "position_sd_m": sd, "array_rmse_dps": 0.0106,
         "array_rmse_se_dps": 1e-4, "gyroscopes_rmse_dps": 0.0106 if w < 2000 else 1000.0,
         "gyroscopes_rmse_se_dps": 1e-4}
        for sd in paper["fig3_position_sds"] for w in (100.0, 1000.0, 5000.0)
    ]  # fmt: skip
    tables = {"samples": samples, "motion": motion, "force": force}
    found = {f"calibration/position_error_{k}": pd.DataFrame(v) for k, v in tables.items()}
    found = {k: v.assign(rmse_se_m=0.01 * v.rmse_m) for k, v in found.items()}
    return found | {"calibration/rate_error": pd.DataFrame(rate)}


def posterior(name, samples, scale):
    """A converged posterior of 93 coordinates whose sds fall with the root of T."""
    rng = np.random.default_rng(samples)
    labels = [(str(k), axis) for k in range(2, 33) for axis in "xyz"]
    table = pd.DataFrame(labels, columns=["accelerometer", "axis"])
    table["sd_m"] = scale * 1e-5 / np.sqrt(samples)
    table["truth_m"] = 0.0
    table["mean_m"] = table.sd_m * rng.standard_normal(93)
    return table.assign(name=name)


def verdict(samples):
    return {
        "converged": True, "rhat_max": 1.01, "ess_min": 500.0, "split_z_max": 2.5, "chains": 2,
        "acceptance": [0.15, 0.16], "burn_in_steps": 1000, "burn_in_draws": 0, "steps": 10**6,
    }  # fmt: skip


# Measured data of such a world; the covered share is too small at the paper's noise alone.
RIGHT = {
    "residual": 0.05, "variance": 0.1, "correlation": 0.01, "spread": 1.4, "exact": 0.95,
    "gain": 0.01, "turning": 1.0, "most": "gyroscope_nonlinearity",
}  # fmt: skip


def bayes():
    """Tuning, chains and posteriors of a world in which the paper is right."""
    found, linear = {}, []
    for t in SAMPLES:
        sweep = pd.DataFrame({"draws": [1, 2, 5, 10, 20, 50, 100], "realisations": 1000})
        sweep["variance"] = 0.003 * t / sweep.draws
        sweep["variance_se"] = 0.045 * sweep.variance
        found[f"tuning/variance_T{t}"] = sweep
        step = np.geomspace(1e-8, 1e-4, 9)
        moves = pd.DataFrame({"step_length_m": step, "acceptance": 1 / (1 + (step / 1e-6) ** 2)})
        found[f"tuning/acceptance_T{t}"] = moves.assign(acceptance_se=0.01, transitions=1000)
        draws = int(np.ceil(0.03 * t))
        found[f"tuning/T{t}.json"] = {"draws": draws, "variance": 0.003 * t / draws}
        found[f"benchmarks/chains/T{t}"] = pd.DataFrame({"s": [60.0 * t]})
        candidates = {"burn_in": [0, 5], "rhat_max": [1.2, 1.01]}
        found[f"posterior/burn_in_T{t}"] = pd.DataFrame(candidates)
        for prefix, scale in SDS.items():
            name = f"{prefix}T{t}"
            table = posterior(name, t, scale)
            linear.append(table)
            found[f"posterior/{name}"], found[f"posterior/{name}.json"] = table, verdict(t)
            normals = np.random.default_rng(t).standard_normal((2, 400, 93))
            found[f"chains/{name}"] = table.mean_m.to_numpy() + table.sd_m.to_numpy() * normals
    return found | {"claims/linearised": pd.concat(linear)}


def studies(settings):
    """The check studies themselves, at their smallest."""
    rng, model = np.random.default_rng(1), model_from(settings)
    paper = settings["paper2017"]
    sizes, sds = magnitudes(paper), (np.radians(1000.0), np.radians(35000.0), 20.0)
    checks = {
        "lemma": identifiability.lemma(rng, 50),
        "motion_needs": identifiability.motion_needs(rng),
        "common_axis": identifiability.common_axis(rng, model.array.relative, 8),
        "invariances": identifiability.invariances(rng, model, sizes),
        "accelerations": [
            identifiability.measured_acceleration(rng, model, (*sizes[:2], f), 35.0, 100)
            for f in (0.0, 10.0)
        ],
    }
    there = model.array.relative
    estimator = {
        "limits": marginalisation.limits(rng, model, sds),
        "determinant": marginalisation.determinant_power(rng, model, sds, pairs=20),
        "six_dimensions": marginalisation.six_dimensions(rng, model, sds),
        "log_sum_exp": marginalisation.log_sum_exp(rng, 20),
        "underflow": marginalisation.underflow(
            rng, model, *measure(model, normal_motion(rng, (5,), *sds), there, rng)[:2],
            {"truth": there, "start": there + 1e-3 * rng.standard_normal(there.shape)}),
        "unbiased": marginalisation.unbiased(rng, 1000),
        "effective_draws": marginalisation.effective_draws(rng, model, sds, 500, 3),
        "theory": marginalisation.theory(), "random_walk": marginalisation.best_acceptance(rng, 20),
    }  # fmt: skip
    cases = [(n, *sizes) for n in (2, 1000)] + [(10, *sizes)]
    effect = {"method": "linearised", "shift_max_sd": 0.01, "shift_along_sd": 0.02}
    effect |= {"width_ratio_min": 1.0}
    effects = [{"name": f"{p}T{t}", "samples": t} | effect for p in SDS for t in SAMPLES]
    motion = normal_motion(rng, (2000,), *sds)
    said = {
        "bound_m": statements.any_motion(model, 1, 1000, sizes, sds, (5.0, 62.5), motion),
        "motion": statements.motion_efficiency(model, 1, 1000, sizes),
        "differentiation": statements.differentiation(model, 1, 200, sds, 5.0, 62.5),
        "sds": [field.std() for field in motion[:3]],
        "averaging": {"specific_force": 1.0, "angular_rate": 1.0},
        "spread": {"slow": 0.1, "fast": 0.2},
    }
    return {
        "claims/dependence": statements.dependence(model, 1, 20, sizes),
        "claims/statements.json": said, "claims/identifiability.json": checks,
        "claims/marginalisation.json": estimator,
        "claims/ranks": identifiability.ranks(rng, model.array, (3, 5), (1, 2, 3)),
        "claims/inner_steps": identifiability.inner_steps(rng, model, sizes, (2, 50)),
        "claims/position_bound": bound_table(model, 1, cases),
        "claims/accelerometers_only": accelerometers_only(
            model, 1, np.radians([1e3, 1e4]), 35.0, 10.0, paper["fig3_position_sds"], 80),
        "claims/determinant": pd.DataFrame(effects),
        "claims/timing": pd.DataFrame({
            "what": "transition", "samples": SAMPLES, "seconds": [1e-5, 2e-5, 3e-4],
            "spread_s": 1e-6}),
        "claims/acceptance_variance": pd.DataFrame({
            "log_variance": [0.1, 3.0], "acceptance": [0.2, 0.05], "acceptance_se": 0.01}),
    }  # fmt: skip


@pytest.fixture(scope="module")
def results(settings):
    given = calibration(settings["paper2017"]) | bayes() | measured(**RIGHT)
    return Results("/nowhere", settings, given | studies(settings))


@pytest.fixture(scope="module")
def table(results):
    return evaluate(results)


def test_ids():
    assert all(re.fullmatch(r"20(17|21)-\d\d", item) for item in CLAIMS)
    assert set(CLAIMS) == set(REGISTER)
    for paper, last in (("2017", 49), ("2021", 71)):
        withdrawn = {"2017-24", "2021-51"}
        every = {f"{paper}-{number:02d}" for number in range(1, last + 1)} - withdrawn
        assert {item for item in CLAIMS if item.startswith(paper)} == every
    with pytest.raises(ValueError, match="there already"):
        claim("2017-01")(print)


@pytest.mark.parametrize("paper", ["2017", "2021"])
def test_enough_testable(table, paper):
    assert np.sum((table.paper == paper) & (table.verdict != UNTESTED)) >= 12


def test_every_claim_has_a_verdict(table):
    assert list(table.id) == sorted(CLAIMS)
    assert set(table.verdict) <= set(VERDICTS)
    tested = table[table.verdict != UNTESTED]
    assert np.all(tested.our_value.str.len() > 0) and np.all(tested.criterion.str.len() > 0)
    assert np.all(table[table.verdict == UNTESTED].remark.str.len() > 0)
    assert not table.map(lambda cell: bool(re.search(r"\bnan\b", str(cell)))).to_numpy().any()


# What no choice of the made-up results can make hold: they rest on the studies themselves.
REAL = {"2017-02", "2017-06", "2017-19", "2017-20", "2017-44", "2017-46", "2021-11"}


def test_verdicts_in_a_world_where_the_papers_are_right(table):
    """(False alarms: 4 errors in 2021-05 and 3 in 2021-06, below 0.005; seeds are fixed.)"""
    assert set(table.id[table.verdict == FAILS]) == REAL


def scaled(path, column, query, factor):
    """A change of ``column`` where ``query`` holds, by ``factor`` (a number or a function)."""

    def change(results):
        frame = results.table(path).copy()
        rows = frame.query(query).index
        function = factor if callable(factor) else lambda old: old * factor
        frame[column] = frame[column].astype(float)
        frame.loc[rows, column] = function(frame.loc[rows, column])
        return {path: frame}

    return change


def replaced(path, **values):
    return lambda results: {f"{path}.json": results.json(path) | values}


SAMPLE_TABLE, MOTION = "calibration/position_error_samples", "calibration/position_error_motion"
FORCE, RATE = "calibration/position_error_force", "calibration/rate_error"
FLIPS = [
    ("2017-01", scaled(SAMPLE_TABLE, "rmse_m", "samples > 100", 0.3)),
    ("2017-04", scaled(SAMPLE_TABLE, "rmse_m", "samples == 1000", 10.0)),
    ("2017-05", scaled(SAMPLE_TABLE, "rmse_m", "samples == 2 and iterations == 1000", 0.5)),
    ("2017-07", scaled(SAMPLE_TABLE, "rmse_m", "samples == 10 and iterations == 20", 3.0)),
    ("2017-08", scaled(SAMPLE_TABLE, "rmse_m", "samples == 300 and iterations == 1000", 3.0)),
    ("2017-09", scaled(MOTION, "rmse_m", "angular_rate_dps == 2000", 100.0)),
    ("2017-10", scaled(MOTION, "rmse_m", "angular_acceleration_dps2 == 20000", 1e3)),
    ("2017-11", scaled(FORCE, "rmse_m", "specific_force_mps2 == 100", 1.1)),
    ("2017-12", scaled(SAMPLE_TABLE, "rmse_m", "iterations == 1000", 3.0)),
    ("2017-15", scaled(RATE, "array_rmse_dps", "position_sd_m == 1e-5", 3.0)),
    ("2017-16", scaled(RATE, "array_rmse_dps", "angular_rate_dps > 2000", 30.0)),
    ("2017-18", scaled(RATE, "array_rmse_dps", "position_sd_m == 1e-6", 2.0)),
    ("2017-22", scaled("claims/accelerometers_only", "rmse_se_dps", "position_sd_m == 0", 1e3)),
    ("2017-23", scaled(RATE, "gyroscopes_rmse_dps", "angular_rate_dps > 2000", 1e-6)),
    ("2017-25", scaled("claims/inner_steps", "inner_steps", "samples == 50", 3.0)),
    ("2017-33", scaled("claims/ranks", "rank", "samples == 1", lambda old: old + 3)),
    ("2017-47", scaled("claims/dependence", "factor", "change == 'one gyroscope'", 1.1)),
    ("2017-48", replaced("claims/statements", bound_m={"normal": 2e-5})),
    ("2017-49", replaced("claims/statements", motion={"ratio": 1.2, "se": 0.01})),
    ("2021-68", replaced("claims/statements", sds=[10.0, 600.0, 20.0])),
    (
        "2021-69",
        replaced("claims/statements", averaging={"specific_force": 3.0, "angular_rate": 1.0}),
    ),
    (
        "2021-70",
        replaced(
            "claims/statements",
            differentiation={"one sample": 9.0, "difference": 8.0, "noise": 0.1},
        ),
    ),
    ("2021-13", scaled("claims/determinant", "shift_max_sd", "samples == 500", 50.0)),
    ("2021-18", scaled("tuning/variance_T50", "variance", "draws > 5", 3.0)),
    ("2021-19", scaled("tuning/variance_T500", "variance", "draws > 0", 0.01)),
    ("2021-21", replaced("tuning/T50", variance=0.5)),
    ("2021-22", replaced("posterior/T500", acceptance=[0.5, 0.16])),
    ("2021-25", scaled("tuning/acceptance_T5", "acceptance", "step_length_m > 1e-5", 500.0)),
    ("2021-26", scaled("claims/acceptance_variance", "acceptance", "log_variance > 1", 4.0)),
    ("2021-27", replaced("posterior/T5", rhat_max=1.2)),
    ("2021-28", replaced("posterior/T5", split_z_max=8.0)),
    ("2021-29", scaled("posterior/burn_in_T5", "rhat_max", "burn_in > 0", 1.1)),
    ("2021-30", scaled("posterior/T5", "sd_m", "axis == 'z'", 1e4)),
    ("2021-31", scaled("posterior/T500", "sd_m", "accelerometer == '7'", 100.0)),
    ("2021-32", scaled("posterior/T500", "mean_m", "axis == 'x'", 100.0)),
    ("2021-33", scaled("posterior/T50", "mean_m", "sd_m > 0", 5.0)),
    ("2021-37", scaled("posterior/T500", "truth_m", "sd_m > 0", lambda old: old + 1e-4)),
    ("2021-43", scaled("posterior/simulation_T5", "sd_m", "sd_m > 0", 0.2)),
    ("2021-54", scaled("posterior/quiet_T500", "truth_m", "axis == 'x'", lambda old: old - 1e-2)),
    ("2021-47", scaled("posterior/simulation_T500", "sd_m", "sd_m > 0", 20.0)),
]


@pytest.mark.parametrize(("name", "change"), FLIPS, ids=[name for name, _ in FLIPS])
def test_verdict_flips(results, name, change):
    assert CLAIMS[name](results).verdict == HOLDS
    changed = results.replace(change(results))
    assert CLAIMS[name](changed).verdict == FAILS


def test_accuracy_rests_on_what_it_is_said_to(results):
    changes = ["noise of the gyroscopes", "size", "angular rate"]
    table = pd.DataFrame({"change": [*changes, "one gyroscope"], "factor": 1.5}).assign(factor_se=0)
    extra = pd.DataFrame({"change": ["angular acceleration", "specific force"], "factor": 1.0})
    whole = pd.concat([table, extra], ignore_index=True)
    assert CLAIMS["2017-46"](results.replace({"claims/dependence": whole})).verdict == HOLDS


def test_the_mean_of_triads_with_noise_of_their_own():
    rng = np.random.default_rng(0)
    common = rng.standard_normal((4000, 1, 3))
    shapes = {"specific_force": rng.standard_normal((4000, 4, 3)), "angular_rate": 0 * common}
    shapes["angular_rate"] = common + np.zeros((1, 4, 1))
    labels = tuple("1234")
    made = Recording(
        time=np.arange(4000.0), stationary=np.ones(4000, bool), **shapes,
        accelerometer_labels=labels, gyroscope_labels=labels,
        accelerometer_position=mimu4444_corners().positions[:4], accelerometer_noise_sd=1.0,
        gyroscope_noise_sd=1.0, accelerometer_range=99.0, gyroscope_range=99.0,
        position_prior_sd=1e-3,
    )  # fmt: skip
    found = statements.averaging(made)
    assert found["specific_force"] == pytest.approx(1.0, abs=0.05)
    assert found["angular_rate"] == pytest.approx(2.0, abs=0.05)


def test_a_complete_calibration_takes_more_iterations_for_more_samples(results):
    """What is left falls by exp(-1/20) an iteration, to 0.46 of a last RMSE that falls with N."""
    outcome = CLAIMS["2017-44"](results)
    assert outcome.verdict == FAILS and outcome.value.startswith("108, 154 ")
    table = results.table(SAMPLE_TABLE)
    last = 1e-6 + 0 * table.samples
    same = table.assign(rmse_m=np.hypot(1e-3 * np.exp(-table.iterations / 20), last))
    assert CLAIMS["2017-44"](results.replace({SAMPLE_TABLE: same})).verdict == HOLDS


def test_unconverged_chains_are_not_believed(results):
    """The claims then rest on the linearised posterior and say so."""
    change = replaced("posterior/T5", converged=False, rhat_max=2.0)(results)
    change |= scaled("posterior/T5", "sd_m", "sd_m > 0", 1e6)(results)
    outcome = CLAIMS["2021-30"](results.replace(change))
    assert outcome.verdict == HOLDS and "T5: R-hat 2" in outcome.remark


@pytest.mark.parametrize("name", [f"2021-{n}" for n in (30, 31, 32, 33, 43, 45, 46, 47)])
def test_fallback_is_named(results, name):
    prefix = {"2021-45": "mine_", "2021-46": "mine_", "2021-47": "simulation_"}.get(name, "")
    assert "linearised" not in CLAIMS[name](results).remark
    change = replaced(f"posterior/{prefix}T50", converged=False, rhat_max=2.0)(results)
    remark = CLAIMS[name](results.replace(change)).remark
    assert f"{prefix}T50: R-hat 2" in remark and "linearised posterior there" in remark


def test_own_extension_of_figure_5_is_reported_not_judged(results):
    change = scaled(MOTION, "rmse_m", "angular_acceleration_dps2 == 200000", 100.0)(results)
    outcome = CLAIMS["2017-10"](results.replace(change))
    assert outcome.verdict == HOLDS
    assert re.search(r"our extension to 200000 deg/s\^2.*times larger at", outcome.remark)


@pytest.mark.parametrize("name", ["2017-12", "2017-15", "2017-16"])
def test_noise_makes_no_claim_hold(results, name):
    path, column = (SAMPLE_TABLE, "rmse_se_m") if name == "2017-12" else (RATE, "array_rmse_se_dps")
    change = scaled(path, column, f"{column} > 0", 1000.0)(results)
    assert CLAIMS[name](results.replace(change)).verdict == FAILS


def test_page(table, settings):
    page = markdown(table, settings)
    rows = [line for line in page.splitlines() if re.match(r"\| 20\d\d-", line)]
    assert len(rows) == len(CLAIMS)
    assert all(len(re.findall(r"(?<!\\)\|", row)) == 10 for row in rows)
    assert "`made up`" in page and f"seed {settings['seed']}" in page
    counts = " ".join(re.findall(r"^\| 20\d\d \|.*$", page, re.M))
    assert sum(map(int, re.findall(r"\d+", counts))) == len(CLAIMS) + 2017 + 2021


def test_missing_result(settings, tmp_path):
    with pytest.raises(InputError, match="rate_error.csv: expected a result"):
        Results(tmp_path, settings).table("calibration/rate_error")
