"""`make crate`: results/ro-crate-metadata.json, what the results are, for an archive."""

import sys
from pathlib import Path

import yaml

from imuarray.errors import InputError
from imuarray.provenance import write_json

RESULTS = ("figures", "tables", "claims")  # folders of a scale that are described file by file


def crate(root: Path) -> dict:
    """RO-Crate 1.1 of ``root``/results: its figures, tables and claims, and how they were made.

    Raises InputError where there are no results.
    """
    from rocrate.model.softwareapplication import SoftwareApplication
    from rocrate.rocrate import ROCrate

    made = [path for name in RESULTS for path in root.glob(f"results/*/{name}/*.*")]
    if not made:
        raise InputError(f"{root / 'results'}: expected results of `make run`, found none")
    cited = yaml.safe_load((root / "CITATION.cff").read_text(encoding="utf-8"))
    found = ROCrate()
    found.name, found.description = f"Results of {cited['title']}", cited["abstract"]
    found.license = f"https://spdx.org/licenses/{cited['license']}"
    found.keywords = cited["keywords"]
    tool = {"name": "imuarray", "version": cited["version"], "license": cited["license"]}
    software = found.add(SoftwareApplication(found, "#imuarray", tool))
    files = [
        found.add_file(dest_path=path.relative_to(root / "results").as_posix())
        for path in sorted(made)
    ]
    action = {"name": "snakemake --cores 2"}
    found.add_action(software, "#run", result=files, properties=action)
    return found.metadata.generate()


if __name__ == "__main__":
    try:
        write_json(crate(Path.cwd()), "results/ro-crate-metadata.json")
    except InputError as error:
        print(f"imuarray: {error}", file=sys.stderr)
        sys.exit(2)
