"""Claims that only measured data can judge, on made-up results with known verdicts."""

import numpy as np
import pandas as pd
import pytest

from imuarray.geometry import mimu4444_corners
from imuarray_papers.claims.registry import CLAIMS
from imuarray_papers.claims.results import Results

BOARD = mimu4444_corners()
SETTINGS = {
    "paper2021": {"samples": [5, 50, 500], "variance_target": 0.1},
    "experiment": {"accelerometer_sd": 0.79, "recording": "mine"},
    "noise": {"accelerometer_sd": 0.04, "gyroscope_sd_dps": 0.06},
    "recordings": {"mine": {"file": "mine.nc", "group": "board"}},
}
VERDICT = {"converged": True, "burn_in_draws": 0, "most_draws": 100, "rhat_max": 1.0}


def measured(
    coverage=0.5, residual=2.0, noise=0.04, rate=0.001, variance=300.0, under=-5e-4,
    correlation=0.2, spread=2.0, exact=0.1, railed=10, gain=4.0, turning=40.0, covered=0.97,
    most="gyroscope_delay", grown=2.0, named="gyroscope_scale",
):  # fmt: skip
    """Contents by path: positions of a recording off by ``under`` on the underside, and so on."""
    rng = np.random.default_rng(0)
    nominal = BOARD.relative[1:]
    shift = np.where(nominal[:, 2:] < -1e-4, [under, under, 0.0], 0.0)
    draws = nominal + shift + 1e-5 * rng.standard_normal((2, 400, 7, 3))
    places = pd.DataFrame(
        [(label, axis) for label in BOARD.labels[1:] for axis in "xyz"],
        columns=["accelerometer", "axis"],
    ).assign(nominal_m=nominal.ravel(), method="bcd", samples=500, mean_m=nominal.ravel())
    agreement = pd.DataFrame({
        "samples": 500, "assumed": ["0.04", "0.79", "residual"],
        "accelerometer_sd": [0.04, 0.79, residual], "recordings": 5,
        "coverage_95": [exact, coverage, 0.95], "z_rms": [20.0, spread, 1.0],
        "claimed_m": 1e-5, "spread_m": 2e-5,
    })  # fmt: skip
    noises = pd.DataFrame(
        {
            "sensor": ["specific_force", "angular_rate"],
            "sd": [noise, rate],
            "ratio": [1.0, 2.0],
            "correlation": [-0.01, correlation],
        }
    )
    selection = pd.DataFrame(
        [("all", 9000), ("still pose", 6000), ("slower than 100 deg/s", 1000),
         ("accelerometer at a rail", 3), ("gyroscope at a rail", railed)],
        columns=["criterion", "samples"],
    )  # fmt: skip
    steps = pd.DataFrame({
        "step": ["robust", "clocks", "no arms", "own arms"], "nats": [np.nan, gain, 1.0, gain],
        "nats_error": 0.1, "smooth_ratio": [20.0, 2.0, 1.9, 0.9], "covered": covered, "rms_m": 7e-6,
    })  # fmt: skip
    residuals = pd.DataFrame({
        "source": ["measured", "measured", "simulated"], "quantity": "angular_rate",
        "bin_low": [0.0, 1.0, 1.0], "rms": [turning, 2 * turning, 1.0],
    })  # fmt: skip
    nats = {most: 1e4, named: 20.0, "accelerometer_nonlinearity": 10.0}
    causes = [{"effect": name, "heldout_gain_nats": value} for name, value in nats.items()]
    given = {
        "claims/statements.json": {"spread": {"slow": 0.1, "fast": 0.1 * grown}},
        "../measured/causes_board": steps, "../measured/residuals/mine": residuals,
        "../measured/diagnosis/mine/diagnosis.json": {"causes": causes},
        "../measured/subsets/mine_selection": selection,
        "../measured/positions/mine": places, "../measured/agreement/board": agreement,
        "../measured/first_order/mine_noise": noises, "chains/mine_T500": draws.reshape(2, 400, 21),
    }  # fmt: skip
    for t, sd in ((5, 4e-4), (50, 1e-4), (500, 4e-5)):
        for name, factor in (("mine", 1.0), ("simulated_mine", 0.95)):
            table = places.assign(sd_m=factor * sd, mean_m=0.0)
            judged = VERDICT | {"variance_at_most_draws": variance}
            given |= {f"posterior/{name}_T{t}": table, f"posterior/{name}_T{t}.json": judged}
    return given


def verdict(name, **changes):
    return CLAIMS[name](Results("nowhere", SETTINGS, measured(**changes)))


@pytest.mark.parametrize(
    ("name", "changes", "expected"),
    [
        ("2021-45", {}, "holds"),
        ("2021-46", {}, "holds"),
        ("2021-49", {}, "holds"),
        ("2021-49", {"under": 0.0}, "does not hold"),
        ("2021-63", {}, "holds"),
        ("2021-63", {"under": 0.0}, "does not hold"),
        ("2021-52", {"coverage": 0.5}, "holds"),
        ("2021-52", {"coverage": 0.95}, "does not hold"),
        ("2021-55", {"residual": 2.0}, "does not hold"),
        ("2021-55", {"residual": 0.5}, "holds"),
        ("2021-56", {"noise": 0.04}, "holds"),
        ("2021-56", {"noise": 0.1}, "does not hold"),
        ("2021-58", {"rate": 0.001}, "holds"),
        ("2021-58", {"rate": 0.003}, "does not hold"),
        ("2021-59", {}, "does not hold"),
        ("2021-59", {"correlation": 0.01}, "holds"),
        ("2021-60", {}, "does not hold"),
        ("2021-60", {"residual": 0.05, "exact": 0.95}, "holds"),
        ("2021-60", {"residual": 0.05}, "does not hold"),
        ("2021-61", {}, "does not hold"),
        ("2021-61", {"spread": 1.1}, "holds"),
        ("2021-62", {}, "holds"),
        ("2021-62", {"railed": 18}, "does not hold"),
        ("2017-45", {}, "does not hold"),
        ("2017-45", {"gain": 0.1}, "holds"),
        ("2021-64", {}, "does not hold"),
        ("2021-64", {"gain": 0.1}, "holds"),
        ("2021-65", {}, "does not hold"),
        ("2021-65", {"turning": 1.4}, "holds"),
        ("2021-71", {}, "holds"),
        ("2021-71", {"grown": 1.1}, "does not hold"),
        ("2021-71", {"named": "gyroscope_bias"}, "does not hold"),
        ("2021-66", {}, "holds"),
        ("2021-66", {"covered": 0.8}, "does not hold"),
        ("2021-67", {}, "does not hold"),
        ("2021-67", {"most": "gyroscope_nonlinearity"}, "holds"),
        ("2021-57", {"variance": 300.0}, "does not hold"),
        ("2021-57", {"variance": 0.1}, "holds"),
    ],
)
def test_verdicts_follow_the_numbers(name, changes, expected):
    assert verdict(name, **changes).verdict == expected


def test_three_packages_are_too_few_to_count_ellipses():
    assert verdict("2021-48").verdict == "cannot be tested here"
