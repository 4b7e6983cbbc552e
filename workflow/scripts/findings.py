"""The findings as a paper: its page with the published files that it reads -> PDF."""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    import shutil
    import tempfile
    from pathlib import Path

    import typst
    import yaml

    from imuarray.provenance import write_bytes

    with tempfile.TemporaryDirectory() as folder:
        given = snakemake.input
        for path in [*given.pages, *given.data, given.papers]:
            shutil.copy(path, folder)
        Path(folder, "config.yaml").write_text(yaml.safe_dump(settings), encoding="utf-8")
        page = Path(folder, "findings.typ")
        # the machine's fonts are its own: those of the wheel are the same everywhere
        made = typst.compile(page, root=folder, ignore_system_fonts=True)
    write_bytes(made, snakemake.output[0])
