"""PIT values of a share of the truths drawn from the prior, for each method -> CSV."""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    import pandas as pd

    from imuarray.analysis.sampling import sample
    from imuarray.provenance import write_csv
    from imuarray_papers.studies.sbc import METHODS, pit_values, pit_values_by_default
    from imuarray_papers.studies.settings import SETTINGS as STUDIES
    from imuarray_papers.studies.truths import setting_from, share

    chosen = snakemake.wildcards
    setting = setting_from(settings, chosen.setting, int(chosen.samples))
    count = settings["scale"]["validation_replicates"]
    place, threads = (int(chosen.part), snakemake.params.parts), snakemake.threads
    asked = settings["validation"]["settings"][chosen.setting]
    few = share(range(count), *place)
    if asked.get("command", False):
        table = pit_values_by_default(setting, few, sample, threads)
    else:
        samplers = [method for method in METHODS if method != "ML"]
        many = share(range(STUDIES.ml_more * count), *place)
        table = pd.concat(
            [
                pit_values(setting, many, threads, ["ML"]),
                pit_values(setting, few, threads, samplers),
            ]
        )
    write_csv(table, snakemake.output[0])
