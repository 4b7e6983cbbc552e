"""PIT values of a share of the truths drawn from the prior, for each method -> CSV."""

from job import job

with job(snakemake) as settings:
    import pandas as pd

    from imuarray.provenance import write_csv
    from imuarray.studies.batches import share
    from imuarray.studies.pit import METHODS
    from imuarray.studies.sbc import ML_MORE, pit_values
    from imuarray.studies.truths import setting_from

    chosen = snakemake.wildcards
    setting = setting_from(settings, chosen.setting, int(chosen.samples))
    count = settings["scale"]["validation_replicates"]
    place = int(chosen.part), snakemake.params.parts
    samplers = [method for method in METHODS if method != "ML"]
    tables = [
        pit_values(setting, share(range(ML_MORE * count), *place), snakemake.threads, ["ML"]),
        pit_values(setting, share(range(count), *place), snakemake.threads, samplers),
    ]
    write_csv(pd.concat(tables), snakemake.output[0])
