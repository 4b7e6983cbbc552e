"""The marginal likelihood p(y | theta) without Monte Carlo noise, and with a gradient.

Given omega_t the rest of the motion is integrated analytically, as in (26a); what is left, an
integral over omega_t in three dimensions, has an exponent that is a quartic polynomial, almost
quadratic. Gauss-Hermite nodes are laid around its mode at every theta, scaled by its curvature.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np

from imuarray.model import structure_tensor
from imuarray.model.jax64 import cholesky, jax, jnp, log_determinant, solve_lower, solve_upper
from imuarray.model.structure import CURVATURES, PAIRS
from imuarray.posterior.settings import SETTINGS

NODE_COUNTS = (1, 3, 5, 7, 9, 11)  # nodes on each axis of omega


class MarginalData(NamedTuple):
    """Measurements as the marginal needs them (T samples, D = 3 A)."""

    weighted: jnp.ndarray  # (T, D) Lambda y
    energy: jnp.ndarray  # (T,) y' Lambda y
    precision: jnp.ndarray  # (D, D) Lambda
    mean: jnp.ndarray  # (T, 3) rad/s, of p(omega | y_g)
    information: jnp.ndarray  # (T, 3, 3), its inverse covariance
    observed: jnp.ndarray  # (T, 3) rad/s, the gyroscopes' own mean
    prior: jnp.ndarray  # s^2/rad^2, what of ``information`` is omega's prior: zero where flat
    ridge: jnp.ndarray  # (6,) the prior's part of H' Lambda H's diagonal, zero where flat
    start: jnp.ndarray  # (T, 3) rad/s, where the search for each mode begins
    volume: jnp.ndarray  # half the log determinants of ``information``, summed over samples
    spread: jnp.ndarray  # chi-square of the gyroscopes about their mean, and their readings


def grid(nodes: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (n^3, 3) and log weights (n^3,) of the standard normal in three dimensions."""
    points, weights = np.polynomial.hermite_e.hermegauss(nodes)
    weights = np.log(weights / np.sqrt(2 * np.pi))
    three = np.meshgrid(points, points, points, indexing="ij")
    logs = weights[:, None, None] + weights[:, None] + weights
    return np.stack([axis.ravel() for axis in three], axis=1), logs.ravel()


def _products(rate):
    """w (..., 6) of omega (..., 3)."""
    return jnp.stack([rate[..., i] * rate[..., j] for i, j in PAIRS], axis=-1)


def collapse(positions, data: MarginalData):
    """(C (6, 6), b (T, 6), constant (T,), log |H' Lambda H|) at positions (A, 3) m.

    Minus twice the exponent of (26a) is constant - 2 b . w + w' C w.
    """
    affine = jnp.concatenate([jnp.ones((len(positions), 1)), positions], axis=1)
    design = jnp.einsum("km,mij->kij", affine, structure_tensor()).reshape(-1, 12)
    known = design.T @ data.precision @ design
    factor = cholesky(known[6:, 6:] + jnp.diag(data.ridge))
    half = solve_lower(factor, known[6:, :6])
    observed = data.weighted @ design
    inner = solve_lower(factor, observed[:, 6:].T)
    b = observed[:, :6] - inner.T @ half
    constant = data.energy - jnp.sum(inner**2, axis=0)
    return known[:6, :6] - half.T @ half, b, constant, log_determinant(factor)


def scaled(data: MarginalData, logs):
    """(data, log evidence) with noise and motion's prior so many times as wide.

    ``logs`` (4,) of the factors on the sds of accelerometers, gyroscopes, omega and omega_dot.
    The evidence is what `log_marginal` leaves out because it does not hang on positions:
    log p(y_g) and the normalisers, up to a constant.
    """
    force, gyroscopes, rate, acceleration = jnp.exp(-2 * logs)
    own = gyroscopes * (data.information - data.prior * jnp.eye(3))
    prior = rate * data.prior
    factor = jax.vmap(cholesky)(own + prior * jnp.eye(3))
    pulled = jnp.einsum("tij,tj->ti", own, data.observed)
    mean = jax.vmap(lambda f, h: solve_upper(f, solve_lower(f, h[:, None]))[:, 0])(factor, pulled)
    volume = jnp.sum(jnp.log(jnp.diagonal(factor, axis1=1, axis2=2)))
    apart = gyroscopes * data.spread[0] + prior * jnp.sum(mean * data.observed)
    evidence = -0.5 * apart - volume - 3 * len(mean) * jnp.sum(logs[2:])
    evidence -= data.weighted.size * logs[0] + data.spread[1] * logs[1]
    return data._replace(
        weighted=force * data.weighted, energy=force * data.energy,
        precision=force * data.precision, mean=mean, information=own + prior * jnp.eye(3),
        volume=volume, ridge=acceleration * data.ridge,
    ), evidence  # fmt: skip


def _curvature(rate, C, b, information):
    """(gradient (3,), second derivatives (3, 3) or their first-order part) of one exponent."""
    slope = jnp.einsum("aij,j->ai", CURVATURES, rate)
    misfit = C @ _products(rate) - b
    first = information + slope.T @ C @ slope
    full = first + jnp.einsum("a,aij->ij", misfit, CURVATURES)
    minors = full[0, 0], full[0, 0] * full[1, 1] - full[0, 1] ** 2, jnp.linalg.det(full)
    sound = (minors[0] > 0) & (minors[1] > 0) & (minors[2] > 1e-3 * jnp.linalg.det(first))
    return slope.T @ misfit, jnp.where(sound, full, first)


def _step(rate, C, b, mean, information):
    """(omega (3,) after a step of Newton's method, its squared length in sds) of one sample.

    Its derivative takes the curvature as given: at a mode, that is the mode's derivative.
    """
    slope, second = _curvature(rate, C, b, information)
    factor = cholesky(jax.lax.stop_gradient(second))
    half = solve_lower(factor, (slope + information @ (rate - mean))[:, None])
    return rate - solve_upper(factor, half)[:, 0], jnp.sum(half**2)


def _modes_at(C, b, data):
    """(modes (T, 3), lower factors (T, 3, 3) of the curvatures there) of the exponents."""
    steps = jax.vmap(_step, (0, None, 0, 0, 0))

    def further(state):
        return (state[2] < SETTINGS.newton) & (state[1] > SETTINGS.near**2)

    def again(state):
        rate, length = steps(state[0], C, b, data.mean, data.information)
        return rate, jnp.max(length), state[2] + 1

    rate, _, _ = jax.lax.while_loop(further, again, (data.start, jnp.inf, 0))
    second = jax.vmap(_curvature, (0, None, 0, 0))(rate, C, b, data.information)[1]
    return rate, jax.vmap(cholesky)(second)


def log_marginal(positions, data: MarginalData, nodes, log_weights):
    """log p(y_a | theta, y_g) at positions (A, 3) m, up to the constant that (26a) leaves out.

    One node is Laplace's method.
    """
    C, b, constant, logdet = collapse(positions, data)
    rate, factor = _modes_at(*jax.lax.stop_gradient((C, b, data)))
    if len(nodes) == 1:
        inside, volume = _laplace(rate, C, b, constant, data)
    else:
        inside, volume = _quadrature(rate, factor, C, b, constant, data, nodes, log_weights)
    return inside - volume + data.volume - 0.5 * len(rate) * logdet


def log_posterior(theta, data: MarginalData, nodes, log_weights, spread, mean, sd):
    """Log density of theta (P,) = (r_2 ... r_A, logs of `scaled` by ``spread``), up to a constant.

    Normal prior of ``mean`` and ``sd`` (P,); to be traced by JAX.
    """
    count = data.weighted.shape[1] - 3
    evidence = -0.5 * jnp.sum(((theta - mean) / sd) ** 2)
    if theta.size > count:
        data, more = scaled(data, (spread @ theta[count:])[:4])
        evidence += more
    return log_marginal(_positions(theta[:count]), data, nodes, log_weights) + evidence


def _positions(theta):
    """`geometry.positions_of` as JAX traces it."""
    return jnp.concatenate([jnp.zeros((1, 3)), theta.reshape(-1, 3)])


def _exponent(rate, C, b, constant, data):
    """Exponent of (26a) at omega (T, N, 3) of each sample, (T, N)."""
    w = _products(rate)
    away = rate - data.mean[:, None]
    prior = jnp.einsum("tni,tij,tnj->tn", away, data.information, away)
    form = jnp.einsum("tna,ab,tnb->tn", w, C, w) - 2 * jnp.einsum("tna,ta->tn", w, b)
    return -0.5 * (prior + form + constant[:, None])


def _quadrature(rate, factor, C, b, constant, data, nodes, log_weights):
    """(log integrals, log volume), each summed over samples.

    The nodes are fixed where the derivative is taken: the derivative under the integral.
    """
    # omega = mode + F^-T z for a curvature F F'
    spread = jax.vmap(lambda f: solve_upper(f, nodes.T).T)(factor)
    exponent = _exponent(rate[:, None] + spread, C, b, constant, data)
    inside = jax.scipy.special.logsumexp(
        exponent + log_weights + 0.5 * jnp.sum(nodes**2, axis=1), axis=1
    )
    return jnp.sum(inside), jnp.sum(jnp.log(jnp.diagonal(factor, axis1=1, axis2=2)))


def _laplace(rate, C, b, constant, data):
    """Integral by the mode alone; the volume's derivative follows the mode as theta moves."""

    def volume(rate, b, mean, information):
        # one step more is nothing at the mode, but its derivative is the mode's
        moved = _step(rate, C, b, mean, information)[0]
        return 0.5 * log_determinant(cholesky(_curvature(moved, C, b, information)[1]))

    volumes = jax.vmap(volume)(rate, b, data.mean, data.information)
    return jnp.sum(_exponent(rate[:, None], C, b, constant, data)), jnp.sum(volumes)


_value = jax.jit(log_marginal)


@dataclass(frozen=True)
class Marginal:
    """The papers' marginal likelihood of a recording, exact to its quadrature.

    Build it with `Marginal.of`; ``nodes`` (n^3, 3) and ``log_weights`` (n^3,) as `grid` has them.
    """

    data: MarginalData
    nodes: np.ndarray
    log_weights: np.ndarray
    gap: float = np.nan  # nats in total to the next finer quadrature, where that was looked at

    @classmethod
    def of(
        cls, weighted, energy, precision, rates, start, positions, motion_sd=(np.inf, np.inf),
        nodes: int | None = None, observed=None, spread=(0.0, 0),
        enough: float = SETTINGS.node_error,
    ) -> Self:  # fmt: skip
        """Marginal of a recording of T samples, D = 3 A readings of accelerometers each.

        ``weighted`` (T, D) Lambda y, ``energy`` (T,) y' Lambda y, ``precision`` (D, D) Lambda;
        ``rates``: p(omega | y_g), mean (T, 3) rad/s and covariance (T, 3, 3); ``start`` (T, 3)
        rad/s, where the search for the modes begins; ``motion_sd``: prior sds of omega (rad/s),
        which ``rates`` have, and of omega_dot (rad/s^2). ``nodes`` on each axis of omega, by
        default the fewest of `NODE_COUNTS` that at ``positions`` (A, 3) m differ by less than
        ``enough`` nats in total from the next, or the most: ``gap`` says. Two poor gyroscopes
        already need more than three (tests). For `scaled` alone: ``observed`` (T, 3) the
        gyroscopes' own mean, ``spread`` chi-square about it and the number of readings.
        """
        mean, covariance = rates
        information = np.linalg.inv(covariance)
        parts = (
            weighted, energy, precision, mean, information, mean if observed is None else observed,
            float(motion_sd[0]) ** -2.0, np.repeat([float(motion_sd[1]) ** -2.0, 0.0], 3), start,
            0.5 * np.sum(np.linalg.slogdet(information)[1]), np.array(spread, float),
        )  # fmt: skip
        data = MarginalData(*map(jnp.asarray, parts))
        if nodes is not None:
            return cls(data, *grid(nodes))
        coarser = cls(data, *grid(NODE_COUNTS[0]))
        value = coarser(positions)
        for count in NODE_COUNTS[1:]:
            finer = cls(data, *grid(count))
            before, value = value, finer(positions)
            gap = abs(before - value)
            if gap < enough:
                return replace(coarser, gap=gap)
            coarser = finer
        return replace(coarser, gap=gap)

    def __call__(self, positions) -> float:
        """log p(y_a | theta, y_g) at positions (A, 3) m, (26a) in the limit of many draws."""
        positions = np.asarray(positions, float)
        return float(_value(positions - positions[0], self.data, self.nodes, self.log_weights))

    def log_density(self, theta):
        """Log density of theta (3 (A - 1),), to be traced and differentiated by JAX."""
        return log_marginal(_positions(theta), self.data, self.nodes, self.log_weights)
