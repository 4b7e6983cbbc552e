"""Variance of log p-hat at the prior mean -> CSV per T: samples, draws, variance, variance_se."""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    import numpy as np
    import pandas as pd

    from imuarray.provenance import write_csv
    from imuarray.recording import read_recording
    from imuarray.streams import stream
    from imuarray_papers.posterior.tuning import variance_sweep
    from imuarray_papers.studies.bayes import target_for

    paper, count = settings["paper2021"], settings["scale"]["variance_realisations"]
    files = zip(paper["samples"], snakemake.input.recordings, snakemake.output, strict=True)
    for samples, source, path in files:
        recording = read_recording(source)
        variances = variance_sweep(
            target_for(settings, recording, 1).likelihood,
            recording.relative_positions(),
            paper["sweep_draws"],
            count,
            stream(settings["seed"], "variance sweep", samples),
            snakemake.threads,
        )
        table = pd.DataFrame(
            {"samples": samples, "draws": paper["sweep_draws"], "variance": variances}
        )
        table["variance_se"] = variances * np.sqrt(2 / (count - 1))
        write_csv(table.assign(realisations=count), path)
