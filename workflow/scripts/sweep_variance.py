"""Variance of log p-hat at the prior mean -> CSV: samples, draws, variance, variance_se."""

from job import job

with job(snakemake) as settings:
    import numpy as np
    import pandas as pd

    from imuarray.posterior.tuning import variance_sweep
    from imuarray.provenance import write_csv
    from imuarray.recording import read_recording
    from imuarray.streams import stream
    from imuarray.studies.bayes import target_for

    samples, scale = int(snakemake.wildcards.samples), settings["scale"]
    recording = read_recording(snakemake.input.recording)
    draws, count = settings["paper2021"]["sweep_draws"], scale["variance_realisations"]
    likelihood = target_for(settings, recording, 1).likelihood
    variances = variance_sweep(
        likelihood, recording.relative_positions(), draws, count,
        stream(settings["seed"], "variance sweep", samples),
    )  # fmt: skip
    table = pd.DataFrame(
        {
            "samples": samples,
            "draws": draws,
            "variance": variances,
            "variance_se": variances * np.sqrt(2 / (count - 1)),
            "realisations": count,
        }  # fmt: skip
    )
    write_csv(table, snakemake.output[0])
