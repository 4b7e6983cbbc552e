"""Dynamic samples of a recording -> disjoint subsets, their simulations, counts removed."""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    import pandas as pd

    from imuarray.analysis.selection import disjoint, select_dynamic
    from imuarray.provenance import stamp, write_csv
    from imuarray.recording import read_recording, write_recording
    from imuarray.streams import stream
    from imuarray_papers.measured.positions import simulate_subset

    name, seed, made = snakemake.wildcards.name, settings["seed"], snakemake.output
    whole = read_recording(snakemake.input.recording)
    found = select_dynamic(whole)
    counts = settings["paper2021"]["samples"]
    subsets = disjoint(found.informative, counts)
    for samples, measured, simulated in zip(counts, made.measured, made.simulated, strict=True):
        subset = whole.select(subsets[samples])
        attrs = stamp(settings, seed) | {"samples": samples}
        write_recording(subset, measured, attrs=attrs)
        rng = stream(seed, "measured", name, samples)
        force_sd = settings["experiment"]["accelerometer_sd"]
        recording, truth = simulate_subset(subset, force_sd, rng)
        write_recording(recording, simulated, truth, attrs)
    rows = [("all", len(whole.time)), *found.removed.items()]
    rows.append(("left: informative", len(found.informative)))
    write_csv(pd.DataFrame(rows, columns=["criterion", "samples"]), made.selection)
