"""Simulate hand twisting -> recording with its truth (NetCDF).

kind ``quiet`` has the sensors' declared noise and is analysed as the paper analyses its
experiment; ``simulation`` really has the large noise that the analysis assumes.
"""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    from imuarray.provenance import stamp
    from imuarray.recording import write_recording
    from imuarray_papers.studies.bayes import simulate_twisting

    noise = {
        "quiet": settings["noise"]["accelerometer_sd"],
        "simulation": settings["experiment"]["accelerometer_sd"],
    }[snakemake.wildcards.kind]
    recording, truth = simulate_twisting(settings, noise)
    write_recording(
        recording,
        snakemake.output[0],
        truth,
        stamp(settings, settings["seed"]),
    )
