"""What the Cramer-Rao bound says, a table of four: see the functions below -> CSV."""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    from itertools import product

    import numpy as np
    import pandas as pd

    from imuarray.provenance import write_csv
    from imuarray_papers.config import model_from, motion_sds
    from imuarray_papers.studies import bound
    from imuarray_papers.studies.position_error import magnitudes
    from imuarray_papers.studies.settings import SETTINGS

    paper, theory, scale = settings["paper2017"], settings["theory"], settings["scale"]
    model, seed, sizes = model_from(settings), settings["seed"], magnitudes(paper)
    threads, repeats = snakemake.threads, scale["theory_repeats"]
    options = {
        "position_sd": paper["position_sd"], "rail": np.radians(paper["gyroscope_range_dps"]),
        "realisations": scale["theory_realisations"], "limit": SETTINGS.bcd_limit,
    }  # fmt: skip

    def efficiency():
        """RMSE of the most likely positions beside the bound."""
        cases = [(theory["samples"], 1.0)]
        cases += [([theory["noise_samples"]], factor) for factor in theory["noise_factors"]]
        return pd.concat(
            bound.efficiency(model, seed, samples, sizes, options, threads, False, factor)
            for samples, factor in cases
        )

    def convergence():
        """Iterations to 1.01 times the bound, ML-BCD and Gauss-Newton, by motion and geometry."""
        motions = [
            (*np.radians(pair), paper["specific_force"])
            for pair in product(paper["fig5_rates_dps"], paper["fig5_accelerations_dps2"])
        ]
        cases = [(model, motions)]
        cases += [(other, [sizes]) for other in bound.geometries(model).values()]
        samples = theory["convergence_samples"]
        return pd.concat(
            bound.convergence(array, seed, samples, moves, options, repeats, threads)
            for array, moves in cases
        )

    def size():
        """The bound against the size of the array."""
        samples, factors = theory["convergence_samples"], theory["size_factors"]
        return bound.against_size(model, seed, samples, sizes, factors, repeats)

    def ranks():
        """Rank and conditioning of the information over N, motion and geometry."""
        return bound.ranks(bound.rank_cases(model, seed, sizes, motion_sds(settings)))

    tables = {"efficiency": efficiency, "convergence": convergence, "size": size, "ranks": ranks}
    write_csv(tables[snakemake.params.table](), snakemake.output[0])
