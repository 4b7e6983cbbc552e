"""Every quantitative or directional claim of the two papers, judged on the results of a scale.

A claim is a function of the results; its verdict follows from numbers and their Monte Carlo
errors, never from this text.
"""

from imuarray_papers.claims import (
    error2017,
    estimator2021,
    experiment2021,
    posterior2021,
    rate2017,
    sensors,
    theory2017,
)
