"""Do recordings of one board agree within their claimed widths? -> summary and all pairs, CSV."""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    import pandas as pd

    from imuarray.provenance import write_csv
    from imuarray_papers.measured.positions import agreement, pairwise

    table = pd.concat([pd.read_csv(path, dtype={"accelerometer": str, "assumed": str})
                       for path in snakemake.input.positions])  # fmt: skip
    table = table[table.method == "map"]
    summaries, pairs = [], []
    for (samples, assumed), part in table.groupby(["samples", "assumed"], sort=False):
        between = pairwise(part)
        keys = {"samples": samples, "assumed": assumed}
        pairs.append(between.assign(**keys))
        sd = part.accelerometer_sd.mean()
        summaries.append(keys | {"accelerometer_sd": sd} | agreement(between, part))
    write_csv(pd.DataFrame(summaries), snakemake.output.summary)
    write_csv(pd.concat(pairs, ignore_index=True), snakemake.output.pairs)
