"""Conditions for the positions and the motion: ranks, Lemma 1, invariances (paper 2017).

The Fisher information is from the model's structure tensor alone.
"""

import numpy as np
import pandas as pd

from imuarray.model import structure_tensor
from imuarray.model.structure import design, product_slopes, products
from imuarray.motion import Motion, sphere_motion
from imuarray.motion.state import directions
from imuarray.recording.units import GRAVITY
from imuarray.simulation.recordings import measure
from imuarray_papers.estimation.bcd import calibrate_bcd
from imuarray_papers.estimation.collapsed import estimate_motion

LEAST = 1e-9  # of the largest singular value: what counts for a rank


def lever_matrices(motion: Motion) -> np.ndarray:
    """A_n = Omega(omega)^2 + Omega(omega_dot) of (8) in paper 2017, (T, 3, 3)."""
    rate = np.asarray(motion.angular_rate)
    state = np.hstack([products(rate), motion.angular_acceleration, motion.specific_force])
    return np.einsum("ica,ta->tci", structure_tensor()[1:], state)


def motion_jacobian(positions, rates) -> np.ndarray:
    """Derivative of the stacked specific force in (omega, omega_dot, s), (T, 3A, 9)."""
    whole, slopes = design(positions), product_slopes(rates)
    linear = np.broadcast_to(whole[:, 6:], (len(rates), len(whole), 6))
    return np.concatenate([whole[:, :6] @ slopes, linear], axis=2)


def joint_singular_values(positions, motion: Motion) -> np.ndarray:
    """Singular values of the derivative in theta with the motion projected out, decreasing.

    Of unit noise: ranks do not depend on it, and this keeps them well conditioned.
    """
    rates = np.asarray(motion.angular_rate)
    samples, count = len(rates), len(positions)
    levers, force = lever_matrices(motion), motion_jacobian(positions, rates)
    shared = np.zeros((samples, 3 * count + 3, 3 * (count - 1)))
    moving = np.zeros((samples, 3 * count + 3, samples, 9))
    for t in range(samples):
        shared[t, 3 : 3 * count] = np.kron(np.eye(count - 1), levers[t])
        moving[t, : 3 * count, t] = force[t]
        moving[t, 3 * count :, t, :3] = np.eye(3)
    shared = shared.reshape(-1, shared.shape[-1])
    left, values, _ = np.linalg.svd(moving.reshape(len(shared), -1), full_matrices=False)
    basis = left[:, values > 1e-12 * values[0]]
    return np.linalg.svd(shared - basis @ (basis.T @ shared), compute_uv=False)


def numerical_rank(values) -> int:
    """Number of decreasing singular values that exceed `LEAST` times the largest."""
    return int(np.sum(values > LEAST * values[0]))


def lemma(rng, count: int) -> dict:
    """Lemma 1 on ``count`` random pairs: ranks, determinants, eigenvalues of A^2 + B.

    det(Omega(w)^2 + Omega(a)) = -|w x a|^2, so A_n is singular only where they are parallel.
    """
    rate = 10 * rng.standard_normal((count, 3))
    factor = 30 * rng.standard_normal((count, 1))
    free = 300 * rng.standard_normal((count, 3))
    nothing = np.zeros_like(rate)
    matrices = {
        name: lever_matrices(Motion.of(rate, second, nothing))
        for name, second in (("parallel", factor * rate), ("free", free))
    }
    ranks = {name: np.linalg.matrix_rank(m, rtol=LEAST) for name, m in matrices.items()}
    area = np.sum(np.cross(rate, free) ** 2, axis=1)
    size = np.linalg.norm(rate, axis=1)
    expected = np.stack([-(size**2) + 1j * factor[:, 0] * size, 0 * size], axis=1)
    values = np.linalg.eigvals(matrices["parallel"])
    near = np.abs(values[:, :, None] - expected[:, None]).min(axis=1) / size[:, None] ** 2
    return {
        "draws": count,
        "parallel_rank_2": int(np.sum(ranks["parallel"] == 2)),
        "free_rank_3": int(np.sum(ranks["free"] == 3)),
        "determinant_relative": float(np.max(np.abs(np.linalg.det(matrices["free"]) / area + 1))),
        "eigenvalue_relative": float(near.max()),
    }


def ranks(rng, array, triads=(3, 4, 5, 6, 8), samples=(1, 2, 3, 4)) -> pd.DataFrame:
    """Rank of the joint information, motion eliminated, over K and N (random geometry too)."""
    rows = []
    for count in (*triads, array.accelerometers):
        for number in samples:
            motion = sphere_motion(rng, (number,), 1.0, 1.0, 1.0)
            if count == array.accelerometers:
                positions = array.relative / np.abs(array.relative).max()
            else:
                positions = np.vstack([np.zeros(3), rng.standard_normal((count - 1, 3))])
            values = joint_singular_values(positions, motion)
            rows.append(
                {
                    "triads": count,
                    "samples": number,
                    "unknowns": 3 * (count - 1),
                    "rank": numerical_rank(values),
                    "smallest": values[-1] / values[0],
                    "measurements": 3 * (count + 1) * number,
                    "all_unknowns": 3 * (count - 1) + 9 * number,
                    "count_allows": number >= (count - 1) / (count - 2),
                }  # fmt: skip
            )
    return pd.DataFrame(rows)


def motion_needs(rng) -> dict:
    """Rank (of 9) of the motion given positions, for arrays at and below the minimum."""
    rate = 3 * directions(rng, (1,))
    plane = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    arrays = {
        "three spanning a plane": plane, "three on a line": np.outer([0.0, 1, 2], [1.0, 0, 0]),
        "two": plane[:2], "four in space": np.vstack([plane, [0, 0, 1]]),
    }  # fmt: skip
    found = {}
    for name, positions in arrays.items():
        force = motion_jacobian(positions, rate)[0]
        gyroscope = np.eye(3, 9)
        for label, rows in (("with gyroscope", np.vstack([force, gyroscope])), ("without", force)):
            found[f"{name}, {label}"] = int(np.linalg.matrix_rank(rows, rtol=LEAST))
    mirrored = motion_jacobian(plane, rate)[0] - motion_jacobian(plane, -rate)[0]
    found["sign_blind"] = bool(np.allclose(mirrored[:, 3:], 0) and np.allclose(
        products(rate), products(-rate)
    ))  # fmt: skip
    still = motion_jacobian(arrays["four in space"], 0 * rate)[0]
    found["rank without gyroscope at rest"] = int(np.linalg.matrix_rank(still, rtol=LEAST))
    return found


def common_axis(rng, positions, samples: int = 20) -> dict:
    """Rank for omega and omega_dot parallel in each sample: one axis, or axes that vary.

    Joint with the motion unknown (of 3 (A - 1)), and of (9) with it known (of 3).
    """
    size = rng.standard_normal((2, samples, 1))
    axes = {"one axis": directions(rng, ()), "axes vary": directions(rng, (samples,))}
    nothing = np.zeros((samples, 3))
    found = {"unknowns": 3 * (len(positions) - 1)}
    for name, axis in axes.items():
        motion = Motion.of(size[0] * axis, size[1] * axis, nothing)
        found[name] = numerical_rank(joint_singular_values(positions, motion))
        stack = lever_matrices(motion).reshape(-1, 3)  # of (9)
        found[f"{name}, motion known"] = int(np.linalg.matrix_rank(stack, rtol=LEAST))
    still = Motion.of(nothing, nothing, rng.standard_normal((samples, 3)))
    found["no rotation"] = numerical_rank(joint_singular_values(positions, still))
    return found


def invariances(rng, model, motion_sizes) -> dict:
    """Things that must not matter: origin, translation, theta for gyroscopes; (9) once."""
    positions, samples = model.array.relative, 10
    motion = sphere_motion(rng, (samples,), *motion_sizes)
    levers = lever_matrices(motion)
    shift = rng.standard_normal(3)
    moved = motion._replace(specific_force=motion.specific_force - levers @ shift)
    before = model.predict_many(motion, positions)
    after = model.predict_many(moved, positions + shift)
    scale = np.abs(before.specific_force).max()
    force, rate, _ = measure(model, motion, positions, rng)
    extra = 1000.0 * rng.standard_normal((samples, 1, 3))
    found = [calibrate_bcd(model, y, rate, limit=200).positions for y in (force, force + extra)]
    shared = np.linalg.inv(np.einsum("tci,tcj->ij", levers, levers))
    centred = force - motion.specific_force[:, None]
    once = np.einsum("ij,tcj,tkc->ki", shared, levers, centred)
    each = [np.linalg.lstsq(levers.reshape(-1, 3), centred[:, k].ravel(), rcond=None)[0]
            for k in range(centred.shape[1])]  # fmt: skip
    return {
        "origin_relative": float(
            np.abs(after.specific_force - before.specific_force).max() / scale
        ),
        "gyroscope_change": float(np.abs(after.angular_rate - before.angular_rate).max()),
        "translation_position_change_m": float(np.abs(found[1] - found[0]).max()),
        "shared_inverse_difference_m": float(np.abs(once - each).max()),
        "normal_matrix_size": list(shared.shape),
    }


def measured_acceleration(rng, model, motion_sizes, rail, count: int) -> dict:
    """Specific force in figure 4's motion, in g: the largest triad's and all triads'.

    Also seen from the middle of the array (s there), and how often a gyroscope saturates.
    """
    motion = sphere_motion(rng, (count,), *motion_sizes)
    found = {"specific_force_mps2": float(motion_sizes[2])}
    for name, positions in (
        ("reference", model.array.relative),
        ("middle", model.array.positions - model.array.positions.mean(axis=0)),
    ):
        force, _, saturated = measure(model, motion, positions, rng, gyroscope_range=rail)
        size = np.linalg.norm(force, axis=2) / GRAVITY
        for label, values in (("largest", size.max(axis=1)), ("all", size.ravel())):
            found[f"{name}_{label}_quantiles_g"] = np.quantile(values, [0.05, 0.5, 0.95]).tolist()
        medians = np.median(size.max(axis=1)[: count // 10 * 10].reshape(10, -1), axis=1)
        found[f"{name}_largest_median_se_g"] = float(medians.std(ddof=1) / np.sqrt(10))
    found["saturated_share"] = float(saturated.any(axis=(1, 2)).mean())
    return found


def inner_steps(rng, model, motion_sizes, samples) -> pd.DataFrame:
    """Gauss-Newton steps a sample in one iteration of Algorithm 1, over N: the only loop
    whose length the data decide; all others are exactly N long."""
    rows = []
    for number in samples:
        motion = sphere_motion(rng, (number,), *motion_sizes)
        force, rate, _ = measure(model, motion, model.array.relative, rng)
        steps = estimate_motion(model, force, rate).iterations
        rows.append({"samples": number, "inner_steps": int(steps.sum())})
    return pd.DataFrame(rows)
