"""Do diagnoses of one board's recordings agree? -> tables of positions and parameters."""

from imuarray_papers.pipeline.job import job

with job(snakemake):
    import json
    from pathlib import Path

    from imuarray.provenance import write_csv
    from imuarray_papers.figures.board import (
        parameters_agreement,
        positions_agreement,
        recordings_table,
    )
    from imuarray_papers.figures.style import rounded

    documents = {
        Path(path).parent.name: json.loads(Path(path).read_text(encoding="utf-8"))
        for path in snakemake.input.diagnoses
    }
    positions, parameters = positions_agreement(documents), parameters_agreement(documents)
    made = snakemake.output
    write_csv(rounded(positions), made.positions)
    write_csv(rounded(parameters), made.parameters)
    write_csv(rounded(recordings_table(documents)), made.recordings)
