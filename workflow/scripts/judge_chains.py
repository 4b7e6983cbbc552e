"""Burn-in, R-hat and ESS of paired chains -> per file: verdict JSON, coordinates, burn-in CSV."""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    from imuarray.posterior.chains import read_chains
    from imuarray.posterior.diagnostics import summarise
    from imuarray.provenance import stamp, write_csv, write_json
    from imuarray.recording import has_truth, read_truth

    given, made = snakemake.input, snakemake.output
    # one recording for each chain file, or one for all of them (a single one comes as text)
    sources = [given.recordings] if isinstance(given.recordings, str) else given.recordings
    recordings = [*sources] * (len(given.chains) // len(sources))
    files = zip(
        given.chains, recordings, made.verdicts, made.coordinates, made.burn_ins, strict=True
    )
    for source, recording, *paths in files:
        chains, tree = read_chains(source)
        labels = tree["posterior"]["accelerometer"].to_numpy().tolist()
        known = has_truth(recording)
        truth = read_truth(recording)["position"].to_numpy()[1:] if known else None
        threshold = settings["paper2021"]["rhat_threshold"]
        verdict, table, burn_in = summarise(chains, labels, threshold, truth)
        for name in ("samples", "draws_per_sample"):
            verdict[name] = int(tree.attrs[name])
        for name in ("draws_from", "variance_at_most_draws", "most_draws"):
            if name in tree.attrs:
                verdict[name] = tree.attrs[name]
        write_json(verdict | {"stamp": stamp(settings, settings["seed"])}, paths[0])
        write_csv(table, paths[1])
        write_csv(burn_in, paths[2])
