"""Posterior levels of a share of the truths drawn from the prior, for each method -> CSV."""

from job import job

with job(snakemake) as settings:
    from imuarray.provenance import write_csv
    from imuarray.studies.batches import share
    from imuarray.studies.calibrated import calibrated
    from imuarray.studies.truths import setting_from

    chosen = snakemake.wildcards
    setting = setting_from(settings, chosen.setting, int(chosen.samples))
    whole = range(settings["scale"]["validation_replicates"])
    mine = share(whole, int(chosen.part), snakemake.params.parts)
    write_csv(calibrated(setting, mine, snakemake.threads), snakemake.output[0])
