"""Where the workflow's own files are: a folder, or a repository that Snakemake reads from afar."""

import os
import sys
from pathlib import Path

from snakemake.sourcecache import LocalGitFile


class Home:
    """``folder``: what Snakemake calls the basedir of the main Snakefile, workflow/."""

    def __init__(self, folder):
        self.folder = folder
        self.is_local = getattr(folder, "is_local", True) and not isinstance(folder, LocalGitFile)
        if isinstance(folder, LocalGitFile):
            LocalGitFile.join = _joined

    def recording(self, path: str) -> str:
        """A recording's file: in the working directory, or else one that came with the workflow.

        Ends with one line and status 2 where there is none.
        """
        if os.path.exists(path):
            return path
        if not self.is_local and path.startswith("data/"):
            return f"results/measured/data/{path}"
        beside = Path(str(self.folder)).resolve().parent / path
        if self.is_local and beside.exists():
            return os.path.relpath(beside)
        print(f"imuarray: {path}: expected a file to read, found none", file=sys.stderr)
        sys.exit(2)

    def blob(self, path: str) -> str:
        """The command that prints a file of the repository: Snakemake's copies are text."""
        repository = getattr(self.folder, "repo_path", None) or self.folder.hosted_repo.repo_clone
        return f"git -C '{os.path.abspath(repository)}' cat-file blob '{self.folder.ref}:{path}'"


def _joined(folder, path, join=LocalGitFile.join):
    """Snakemake 9.27 joins texts only, but gives itself a path that is none (git+file)."""
    return join(folder, str(path))
