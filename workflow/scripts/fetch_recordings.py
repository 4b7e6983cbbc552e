"""Find or download the configured recordings -> JSON: where they are, or why they are not."""

from job import job

with job(snakemake):
    import sys

    from imuarray.errors import InputError
    from imuarray.provenance import write_json
    from imuarray.recording.sources import locate_source

    available, missing = {}, {}
    for name, entry in snakemake.params.recordings.items():
        try:
            available[name] = locate_source(entry, "results/measured/downloads")
        except InputError as error:
            # a file of the user's must be there; a published one may be out of reach
            if "file" in entry:
                raise
            missing[name] = str(error)
    if missing:
        reason = next(iter(missing.values()))
        print(f"measured part skipped for {', '.join(missing)}: {reason}", file=sys.__stderr__)
    write_json({"available": available, "missing": missing}, snakemake.output[0])
