"""Do diagnoses of one board's recordings agree? -> tables of positions and parameters, figure."""

from job import job

with job(snakemake):
    import json
    from pathlib import Path

    from imuarray.diagnosis.repeatability import (
        parameters_agreement,
        positions_agreement,
        recordings_table,
    )
    from imuarray.figures.style import write_figure
    from imuarray.provenance import write_csv
    from imuarray.report.repeatability import repeatability_figure

    documents = {
        Path(path).parent.name: json.loads(Path(path).read_text(encoding="utf-8"))
        for path in snakemake.input.diagnoses
    }
    positions, parameters = positions_agreement(documents), parameters_agreement(documents)
    made = snakemake.output
    write_csv(positions, made.positions)
    write_csv(parameters, made.parameters)
    write_csv(recordings_table(documents), made.recordings)
    footer = [
        f"{len(documents)} recordings of board {snakemake.wildcards.group}; differences of all"
        " pairs in all coordinates. Pairs share recordings."
    ]
    figure = repeatability_figure(documents, positions, footer)
    write_figure(figure, positions, pdf=made.pdf, png=made.png, csv=made.csv)
