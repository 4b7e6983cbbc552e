"""paper_figures/README.md from the captions, the tables and the chains' verdicts."""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    import json
    from pathlib import Path

    from imuarray.provenance import write_bytes
    from imuarray_papers.figures.gallery import caption, gallery
    from imuarray_papers.figures.style import chain_lines

    output, given = Path(snakemake.output[0]), snakemake.params
    captions = {
        Path(path).stem: caption(Path(path).read_text(encoding="utf-8"), settings)
        for path in snakemake.input.captions
    }
    shown = f"Experiment (recording {settings['experiment']['recording']})"
    lines = {}
    for data, group in (("Section IV-A", "verdicts"), (shown, "experiment")):
        read = [json.loads(Path(path).read_text("utf-8")) for path in snakemake.input[group]]
        lines[data] = chain_lines({verdict["samples"]: verdict for verdict in read})
    figures = {name: captions[name] for name in given.figures}
    tables = {
        name: (captions[name], output.with_name(f"{name}.md").read_text(encoding="utf-8"))
        for name in given.tables
    }
    write_bytes(gallery(figures, tables, settings, lines).encode(), output)
