"""p(omega_t | y_g) from the spread among gyroscopes, (30a) and (30b) of paper 2021."""

import numpy as np

from imuarray.errors import InputError
from imuarray.recording import Recording

FEWEST = 4  # gyroscopes for a covariance (3, 3) of full rank


def sample_covariance(angular_rate):
    """Mean (T, 3) rad/s, (30a), and covariance (T, 3, 3), (30b), of rates (T, G, 3).

    The covariance is that of one gyroscope, as the paper writes it. InputError where G < 4.
    """
    if angular_rate.shape[1] < FEWEST:
        raise InputError(
            f"gyroscopes: expected at least {FEWEST} for the spread among them (30b), found"
            f" {angular_rate.shape[1]}"
        )
    mean = angular_rate.mean(axis=1)
    off = angular_rate - mean[:, None]
    return mean, np.einsum("tgi,tgj->tij", off, off) / (angular_rate.shape[1] - 1)


def rate_distribution(recording: Recording):
    """`sample_covariance`, or the declared noise where there are fewer than 4 gyroscopes."""
    rate = recording.angular_rate
    if rate.shape[1] >= FEWEST:
        return sample_covariance(rate)
    covariance = np.eye(3) * recording.gyroscope_noise_sd**2 / rate.shape[1]
    return rate.mean(axis=1), np.broadcast_to(covariance, (len(rate), 3, 3))
