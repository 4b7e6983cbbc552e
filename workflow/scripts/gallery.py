"""paper_figures/README.md from the captions, the tables and the chains' verdicts."""

from job import job

with job(snakemake) as settings:  # noqa: F821
    import json
    from pathlib import Path

    from imuarray.figures.gallery import caption, gallery
    from imuarray.figures.notes import chain_lines
    from imuarray.provenance import write_bytes

    output, source = Path(snakemake.output[0]), snakemake.params.source  # noqa: F821
    captions = {
        Path(path).stem: caption(Path(path).read_text(encoding="utf-8"), settings, source=source)
        for path in snakemake.input.captions  # noqa: F821
    }
    lines = {}
    for data, group in (("Section IV-A", "verdicts"), (f"Experiment ({source})", "experiment")):
        paths = map(Path, snakemake.input[group])  # noqa: F821
        read = [json.loads(path.read_text(encoding="utf-8")) for path in paths]
        lines[data] = chain_lines({verdict["samples"]: verdict for verdict in read})
    shown = [*snakemake.params.figures, *snakemake.params.measured]  # noqa: F821
    figures = {name: captions[name] for name in shown}
    tables = {
        name: (captions[name], output.with_name(f"{name}.md").read_text(encoding="utf-8"))
        for name in [*snakemake.params.tables, *snakemake.params.measured_tables]  # noqa: F821
    }
    write_bytes(gallery(figures, tables, settings, lines).encode(), output)
