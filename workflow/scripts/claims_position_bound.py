"""Cramer-Rao bound of the positions in the settings of figures 4 and 5 of 2017 -> CSV."""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    import numpy as np

    from imuarray.provenance import write_csv
    from imuarray_papers.config import model_from
    from imuarray_papers.studies.bound import bound_table
    from imuarray_papers.studies.position_error import magnitudes

    paper = settings["paper2017"]
    cases = [(samples, *magnitudes(paper)) for samples in paper["fig4_samples"]]
    cases += [
        (paper["fig5_samples"], np.radians(rate), np.radians(acceleration), paper["specific_force"])
        for acceleration in paper["fig5_accelerations_dps2"]
        for rate in paper["fig5_rates_dps"]
    ]
    write_csv(bound_table(model_from(settings), settings["seed"], cases), snakemake.output[0])
