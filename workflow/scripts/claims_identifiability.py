"""Ranks, Lemma 1, invariances, accelerations -> JSON; ranks over K and N, inner steps -> CSV."""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    import numpy as np

    from imuarray.provenance import stamp, write_csv, write_json
    from imuarray.streams import stream
    from imuarray_papers.config import model_from
    from imuarray_papers.studies.checks import identifiability as checks
    from imuarray_papers.studies.position_error import magnitudes

    model, paper, seed = model_from(settings), settings["paper2017"], settings["seed"]
    sizes, count = magnitudes(paper), settings["scale"]["realisations"]
    rail = np.radians(paper["gyroscope_range_dps"])

    def rng(name):
        return stream(seed, "identifiability", name)

    write_json(
        {
            "lemma": checks.lemma(rng("lemma"), 10 * count),
            "motion_needs": checks.motion_needs(rng("needs")),
            "common_axis": checks.common_axis(rng("axis"), model.array.relative),
            "invariances": checks.invariances(rng("invariances"), model, sizes),
            "accelerations": [
                checks.measured_acceleration(
                    rng("range"), model, (*sizes[:2], force), rail, 10 * count
                )
                for force in (0.0, sizes[2])
            ],
            "stamp": stamp(settings, seed),
        },
        snakemake.output.checks,
    )
    write_csv(checks.ranks(rng("ranks"), model.array), snakemake.output.ranks)
    samples = paper["fig4_samples"]
    write_csv(checks.inner_steps(rng("steps"), model, sizes, samples), snakemake.output.work)
