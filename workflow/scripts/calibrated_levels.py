"""Posterior levels of truths drawn from the prior, for each method -> CSV."""

from job import job

with job(snakemake) as settings:
    from imuarray.provenance import write_csv
    from imuarray.studies.calibrated import calibrated
    from imuarray.studies.truths import setting_from

    chosen = snakemake.wildcards
    setting = setting_from(settings, chosen.setting, int(chosen.samples))
    count = settings["scale"]["validation_replicates"]
    write_csv(calibrated(setting, count, snakemake.threads), snakemake.output[0])
