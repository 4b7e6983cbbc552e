"""Speed as ratios measured in one run: the compiled kernels against the slow, obvious forms.

`make bench` or `python benchmarks/run.py [--out results/benchmarks.md]`. Times are medians
of interleaved repetitions, so that a machine that slows down slows both sides.
"""

import argparse
import os
import sys
import time
from pathlib import Path

# as the pipeline's jobs have it: small products only wait for BLAS' other threads
os.environ.setdefault("OMP_NUM_THREADS", "1")

import numba as nb  # noqa: E402
import numpy as np  # noqa: E402
from scipy.optimize import least_squares  # noqa: E402

sys.path.insert(0, str(Path(__file__).parents[1]))

from written import publish  # noqa: E402

from imuarray.geometry import positions_of, sub_array  # noqa: E402
from imuarray.model import ArrayModel  # noqa: E402
from imuarray.model.jax64 import jax  # noqa: E402
from imuarray.motion import normal_motion, sphere_motion  # noqa: E402
from imuarray.posterior.marginal import Marginal  # noqa: E402
from imuarray.posterior.prior import GaussianPrior  # noqa: E402
from imuarray.simulation.recordings import measure  # noqa: E402
from imuarray_papers import reference
from imuarray_papers.config import model_from, read_config  # noqa: E402
from imuarray_papers.estimation.bcd import calibrate_bcd  # noqa: E402
from imuarray_papers.estimation.collapsed import (
    Collapsed,  # noqa: E402
    estimate_motion,  # noqa: E402
)
from imuarray_papers.estimation.kernels import reduced  # noqa: E402
from imuarray_papers.estimation.newton import fisher_scoring  # noqa: E402
from imuarray_papers.posterior import kernels, normals
from imuarray_papers.posterior.draws import TILE  # noqa: E402
from imuarray_papers.posterior.likelihood import CompiledTarget, Likelihood  # noqa: E402
from imuarray_papers.reference import skew  # noqa: E402
from imuarray_papers.studies.bound import descents  # noqa: E402
from tests.oracles import joint_jacobian, most_likely_motion  # noqa: E402


def interleaved(functions, repeats):
    """Median seconds of each function, the functions taking turns."""
    for function in functions:
        function()
    times = np.empty((repeats, len(functions)))
    for row in times:
        for i, function in enumerate(functions):
            start = time.perf_counter()
            function()
            row[i] = time.perf_counter() - start
    return np.median(times, axis=0)


def dataset(model, samples, rng):
    """2021 motion, measured at the nominal positions."""
    sds = np.radians(1000.0), np.radians(35000.0), 20.0
    motion = normal_motion(rng, (samples,), *sds)
    return measure(model, motion, model.array.relative, rng)[:2]


def against_direct(model, rng, samples=500, draws=100):
    """Rows: the likelihood estimate, random draws included, against the 96-dimensional form."""
    force, rate = dataset(model, samples, rng)
    likelihood = Likelihood.of(model, force, rate)
    mean = likelihood.data.mean.T
    sd = np.sqrt(model.noise.gyroscope[0, 0] / model.array.gyroscopes)
    positions = model.array.relative + 1e-4 * rng.standard_normal(model.array.positions.shape)
    positions -= positions[0]
    generator = np.random.Generator(np.random.PCG64DXSM(1))

    def direct():
        rates = mean[:, None] + sd * rng.standard_normal((samples, draws, 3))
        return reference.log_likelihood(force, positions, model.noise.accelerometer, rates)

    def fast():
        return likelihood.estimate(positions, draws, generator)

    slow, one = interleaved([direct, fast], 9)
    rates = mean[:, None] + sd * rng.standard_normal((samples, draws, 3))
    direct_value = reference.log_likelihood(force, positions, model.noise.accelerometer, rates)
    error = abs(likelihood.on(positions, rates) / direct_value - 1)
    return [
        ("direct numpy form, T = 500, N = 100", f"{1e3 * slow:.1f} ms", "1"),
        ("collapsed and compiled", f"{1e3 * one:.2f} ms", f"{slow / one:.0f}"),
        ("relative disagreement on given draws", f"{error:.1e}", ""),
    ]


def linearity(sizes, seconds) -> str:
    """How well a + b n describes the times, and the exponent between the two largest sizes."""
    fit = np.polyval(np.polyfit(sizes, seconds, 1), sizes)
    off = np.max(np.abs(fit / seconds - 1))
    last = np.log(seconds[-1] / seconds[-2]) / np.log(sizes[-1] / sizes[-2])
    return f"a + b n within {100 * off:.0f} %, last exponent {last:.2f}"


def growth(model, rng):
    """Rows: the likelihood's time against T and N."""
    generator = np.random.Generator(np.random.PCG64DXSM(1))
    positions = model.array.relative
    lengths, counts = [250, 500, 1000, 2000], [25, 50, 100, 200]
    whole = dataset(model, max(lengths), rng)
    parts = {n: Likelihood.of(model, *(y[:n] for y in whole)) for n in lengths}
    by_length = [lambda n=n: parts[n].estimate(positions, 50, generator) for n in lengths]
    by_count = [lambda n=n: parts[500].estimate(positions, n, generator) for n in counts]
    rows = [
        exponents("likelihood, growth in T", lengths, by_length),
        exponents("likelihood, growth in N", counts, by_count),
    ]
    return rows + triads(model, rng) + gradients(model, rng)


def smaller(model, count):
    """The same board and noise with ``count`` triads."""
    noise = model.noise
    sds = np.sqrt(noise.accelerometer[0, 0]), np.sqrt(noise.gyroscope[0, 0])
    return ArrayModel.isotropic(sub_array(model.array, count), *sds)


def exponents(name, sizes, jobs, repeats=15):
    """A row: times over sizes."""
    seconds = interleaved(jobs, repeats)
    listed = ", ".join(f"{n}: {1e3 * s:.2f} ms" for n, s in zip(sizes, seconds, strict=True))
    return name, listed, linearity(np.array(sizes), seconds)


def triads(model, rng):
    """Rows: growth in the number of triads, T = 500, N = 50."""
    sizes, generator, jobs = [4, 8, 16, 32], np.random.Generator(np.random.PCG64DXSM(1)), []
    for count in sizes:
        part = smaller(model, count)
        likelihood = Likelihood.of(part, *dataset(part, 500, rng))
        jobs.append(lambda m=part, x=likelihood: x.estimate(m.array.relative, 50, generator))
    return [exponents("likelihood, growth in A", sizes, jobs)]


@nb.njit
def one_by_one(generator, out, times):
    """Normal numbers from numpy's generator, a call for each."""
    for _ in range(times):
        for i in range(out.size):
            out[i] = generator.standard_normal()


@nb.njit
def by_lanes(source, out, times):
    """As the kernels draw them, a tile at a time."""
    for _ in range(times):
        normals.fill(source, out.size, out)


@nb.njit
def collapsed(positions, data, found, times):
    """What an estimate does of theta alone."""
    for _ in range(times):
        kernels.collapse(positions, data, found)


def profile(model, rng, samples=500, draws=24, steps=20):
    """Rows: what a step of the paper's chain spends on a draw of omega and on theta, one thread."""
    generator = np.random.Generator(np.random.PCG64DXSM(1))
    likelihood = Likelihood.of(model, *dataset(model, samples, rng))
    positions, count = model.array.relative, samples * draws
    start = positions[1:].ravel()
    prior = GaussianPrior(start, np.full(start.size, 3e-3))

    def chain(number):
        target = CompiledTarget(likelihood, prior, number)
        return lambda: target.transitions(start.copy(), -np.inf, 4e-7, steps, generator)

    tile = np.empty(normals.room(3 * draws * TILE))
    source = normals.source(generator, tile.size)
    memory = reduced(samples)
    jobs = chain(draws), chain(5 * draws)
    jobs += (lambda: collapsed(positions, likelihood.data, memory, steps),)
    jobs += lambda: by_lanes(source, tile, TILE), lambda: one_by_one(generator, tile, TILE)
    whole, many, theta, numbers, numpys = interleaved(jobs, 31)
    drawn, each = (many - whole) / (4 * count * steps), 3e9 / (tile.size * TILE)
    name, ratio = f"a step of the chain, T = {samples}, N = {draws}", numpys / numbers
    return [
        (name, f"{1e6 * whole / steps:.0f} us", ""),
        ("of that a draw of omega more", f"{1e9 * drawn:.1f} ns", ""),
        ("of that three normal numbers", f"{each * numbers:.1f} ns", ""),
        (
            "three of numpy's generator, one by one",
            f"{each * numpys:.1f} ns",
            f"{ratio:.1f} times those",
        ),
        ("theta's own part of the step", f"{1e6 * theta / steps:.0f} us", ""),
    ]


def gradients(model, rng):
    """Rows: the exact marginal with its gradient, growth in T and A."""

    def job(part, length):
        likelihood = Likelihood.of(part, *dataset(part, length, rng))
        marginal = Marginal.of(likelihood, part.array.relative)
        function, theta = jax.jit(jax.value_and_grad(marginal.log_density)), part.array.parameters
        return lambda: jax.block_until_ready(function(theta))

    lengths, counts = [250, 500, 1000, 2000], [4, 8, 16, 32]
    by_length = [job(model, n) for n in lengths]
    by_count = [job(smaller(model, n), 500) for n in counts]
    return [
        exponents("exact marginal and gradient, growth in T", lengths, by_length),
        exponents("exact marginal and gradient, growth in A", counts, by_count),
    ]


def descent(model, rng):
    """Rows: ML-BCD per sample and iteration, and its growth in N."""
    sizes, rows = [100, 300, 1000, 3000], []
    motion = sphere_motion(rng, (max(sizes),), np.radians(2000), np.radians(2000), 10.0)
    truth = model.array.relative + 1e-3 * rng.standard_normal(model.array.positions.shape)
    force, rate, _ = measure(model, motion, truth - truth[0], rng)

    def job(count, limit):
        return lambda: calibrate_bcd(model, force[:count], rate[:count], tolerance=0.0, limit=limit)

    short = interleaved([job(n, 20) for n in sizes], 5)
    long = interleaved([job(n, 120) for n in sizes], 5)
    seconds = (long - short) / 100
    listed = ", ".join(f"{n}: {1e6 * s:.0f} us" for n, s in zip(sizes, seconds, strict=True))
    name = "ML-BCD, one iteration, 32 triads, one core"
    rows.append((name, listed, linearity(sizes, seconds)))
    per = 1e6 * seconds[-1] / sizes[-1]
    rows.append(("ML-BCD per sample and iteration", f"{per:.2f} us", ""))
    return rows


def motions(model, rng, samples=20_000, few=10):
    """Rows: the most likely motion of a sample given the positions, against the page's form."""
    sds = [np.sqrt(part[0, 0]) for part in (model.noise.accelerometer, model.noise.gyroscope)]
    force, rate = dataset(model, samples, rng)
    rail, places = np.radians(1500.0), model.array.relative
    lost, held = np.abs(rate) >= rail, np.clip(rate, -rail, rail)
    each = np.full(len(places), sds[0]), sds[1]

    def slow():
        return [
            most_likely_motion(*y, places, *each) for y in zip(force[:few], rate[:few], strict=True)
        ]

    def fast():
        return estimate_motion(model, force, rate)

    def at_the_rail():
        return estimate_motion(model, force, held, saturated=lost)

    seconds = interleaved([slow, fast, at_the_rail], 5) / (few, samples, samples)
    apart = max(
        np.abs(np.concatenate(one) / np.hstack(fast().motion[:3])[n] - 1).max()
        for n, one in enumerate(slow())
    )
    share = 100 * lost.any(axis=(1, 2)).mean()
    names = (
        "motion by maximum likelihood, a sample of 32 triads: as on the page",
        f"`estimate_motion`, {samples} samples",
        f"`estimate_motion`, {share:.0f} % of them with gyroscopes at the rail",
    )
    rows = [
        (name, f"{1e6 * one:.3g} us", f"{seconds[0] / one:.0f}")
        for name, one in zip(names, seconds, strict=True)
    ]
    return [*rows, ("relative disagreement of the motions", f"{apart:.1e}", "")]


def to_the_bound(model, rng, samples=1000, motions=5):
    """Rows: time to 1.01 times the Cramer-Rao bound, ML-BCD against joint Gauss-Newton.

    The last is without arranging the data, which is the same for all.
    """
    found = np.array([one_to_the_bound(model, rng, samples) for _ in range(motions)])
    rows = []
    kinds = "", ", with the covariance", ", the data arranged"
    names = "ML-BCD", *(f"Gauss-Newton{kind}" for kind in kinds)
    shared = found[:, 3, 1].copy()
    found[:, 3] = found[:, 1]
    found[:, 3, 1] -= shared
    for name, (counts, seconds) in zip(names, found.transpose(1, 2, 0), strict=True):
        first = found[:, 0, 1] - (shared if name == names[-1] else 0.0)
        ratios = first / seconds
        rows.append(
            (f"to 1.01 x bound, N = {samples}, {motions} motions: {name}, median"
             f" {np.median(counts):.0f} iterations", f"{1e3 * np.median(seconds):.1f} ms",
             f"{np.median(ratios):.1f} ({ratios.min():.1f} to {ratios.max():.1f})")
        )  # fmt: skip
    return rows


def one_to_the_bound(model, rng, samples):
    """(iterations, seconds) of the three for one motion, and of arranging the data."""
    motion = sphere_motion(rng, (samples,), np.radians(2000), np.radians(2000), 10.0)
    truth = model.array.relative + 1e-3 * rng.standard_normal(model.array.positions.shape)
    force, rate, saturated = measure(model, motion, truth - truth[0], rng)
    _, bcd, newton, _ = descents(model, force, rate, saturated)

    def slow():
        calibrate_bcd(model, force, rate, tolerance=0.0, limit=int(bcd))

    def fast(covariance):
        data = Collapsed.of(model, force, rate, saturated)
        fisher_scoring(data, model.array.relative, limit=int(newton), covariance=covariance)

    def arranged():
        Collapsed.of(model, force, rate, saturated)

    seconds = interleaved([slow, lambda: fast(False), lambda: fast(True), arranged], 15)
    return list(zip((bcd, newton, newton, 0), seconds, strict=True))


def against_scipy(model, rng, samples=30):
    """Rows: all positions and motions at once by SciPy, exact Jacobian, against Gauss-Newton."""
    motion = sphere_motion(rng, (samples,), np.radians(2000), np.radians(2000), 10.0)
    truth = model.array.relative + 1e-4 * rng.standard_normal(model.array.positions.shape)
    force, rate, _ = measure(model, motion, truth - truth[0], rng)
    sds = np.sqrt(model.noise.accelerometer[0, 0]), np.sqrt(model.noise.gyroscope[0, 0])
    first, mean = model.array.parameters, np.zeros((samples, 9))
    mean[:, :3], mean[:, 6:] = rate.mean(axis=1), force.mean(axis=1)

    def parts(x):
        return positions_of(x[: first.size]), x[first.size :].reshape(samples, 9)

    def residual(x):
        positions, motions = parts(x)
        turn = skew(motions[:, :3]) @ skew(motions[:, :3]) + skew(motions[:, 3:6])
        predicted = np.einsum("tij,kj->tki", turn, positions) + motions[:, None, 6:]
        apart = (predicted - force) / sds[0], (motions[:, None, :3] - rate) / sds[1]
        return np.concatenate(apart, axis=1).ravel()

    def slope(x):
        positions, motions = parts(x)
        return joint_jacobian(motions, positions, model.array.gyroscopes, *sds)

    def peer():
        start = np.concatenate([first, mean.ravel()])
        return least_squares(residual, start, slope, x_scale="jac")

    def own():
        return fisher_scoring(Collapsed.of(model, force, rate), model.array.relative)

    slow, fast = interleaved([peer, own], 3)
    solved = peer()
    apart = np.abs(positions_of(solved.x[: first.size]) - own().positions).max()
    return [
        (
            f"scipy.optimize.least_squares, N = {samples}, {solved.njev} dense Jacobians",
            f"{slow:.2f} s",
            "1",
        ),
        ("joint Gauss-Newton, with the covariance", f"{1e3 * fast:.1f} ms", f"{slow / fast:.0f}"),
        ("largest difference of a position", f"{1e9 * apart:.2g} nm", ""),
    ]


def main():
    """Run all and print a table; write it where --out says."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("results/benchmarks.md"))
    parser.add_argument("--config", type=Path, default=Path("config.yaml"))
    arguments = parser.parse_args()
    config = read_config(arguments.config)
    model, rng = model_from(config), np.random.default_rng(config["seed"])
    rows = (
        against_direct(model, rng) + profile(model, rng) + growth(model, rng) + descent(model, rng)
    )
    rows += motions(model, rng) + to_the_bound(model, rng) + against_scipy(model, rng)
    lines = ["| what | measured | ratio to the direct form, or growth |", "|---|---|---|"]
    lines += [f"| {' | '.join(row)} |" for row in rows]
    text = "\n".join(lines) + "\n"
    publish(text, arguments.out)


if __name__ == "__main__":
    main()
