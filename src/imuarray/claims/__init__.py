"""Every quantitative or directional claim of the two papers, judged on the results of a scale.

A claim is a function of the results; its verdict follows from numbers and their Monte Carlo
errors, never from this text.
"""

from imuarray.claims import (
    error2017,
    estimator2021,
    experiment2021,
    measured2021,
    physics2017,
    posterior2021,
    rate2017,
    size2021,
    theory2017,
    tuning2021,
)
from imuarray.claims.page import markdown, write_markdown
from imuarray.claims.registry import CLAIMS, VERDICTS, Claim, Outcome, evaluate
from imuarray.claims.results import Results

MODULES = (
    error2017, rate2017, theory2017, physics2017,
    estimator2021, tuning2021, posterior2021, experiment2021,
    measured2021, size2021,
)  # fmt: skip

__all__ = [
    "CLAIMS",
    "VERDICTS",
    "Claim",
    "Outcome",
    "Results",
    "evaluate",
    "markdown",
    "write_markdown",
]
