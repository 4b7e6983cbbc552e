"""Burn-in, R-hat, ESS -> verdict JSON, per-coordinate CSV, burn-in CSV."""

from job import job

with job(snakemake) as settings:
    import numpy as np

    from imuarray.posterior.store import read_chains
    from imuarray.posterior.summary import summarise
    from imuarray.provenance import stamp, write_csv, write_json
    from imuarray.recording import read_truth

    chains, tree = read_chains(snakemake.input.chains)
    labels = tree["posterior"]["accelerometer"].to_numpy().tolist()
    truth = read_truth(snakemake.input.recording)["position"].to_numpy()[1:]
    threshold = settings["paper2021"]["rhat_threshold"]
    verdict, table, burn_in = summarise(chains, labels, threshold, np.asarray(truth))
    for name in ("samples", "draws_per_sample"):
        verdict[name] = int(tree.attrs[name])
    write_json(verdict | {"stamp": stamp(settings, settings["seed"])}, snakemake.output.verdict)
    write_csv(table, snakemake.output.coordinates)
    write_csv(burn_in, snakemake.output.burn_in)
