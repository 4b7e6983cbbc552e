"""The findings as a paper: its page with the published files that it reads -> PDF."""

from job import job

with job(snakemake):
    import shutil
    import tempfile
    from pathlib import Path

    import typst

    from imuarray.provenance import write_bytes

    with tempfile.TemporaryDirectory() as folder:
        for path in [*snakemake.input.pages, *snakemake.input.data]:
            shutil.copy(path, folder)
        page = Path(folder, "findings.typ")
        # the machine's fonts are its own: those of the wheel are the same everywhere
        made = typst.compile(page, root=folder, ignore_system_fonts=True)
    write_bytes(made, snakemake.output[0])
