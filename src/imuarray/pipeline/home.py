"""Where the workflow's own files are: a folder, or a repository that Snakemake reads from afar."""

import os
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
        """A recording's file: in the working directory, or else one that came with the workflow."""
        if os.path.exists(path) or os.path.isabs(path):
            return path
        if not self.is_local:
            return f"results/measured/data/{path}" if path.startswith("data/") else path
        beside = Path(str(self.folder)).resolve().parent / path
        return os.path.relpath(beside) if beside.exists() else path

    def blob(self, path: str) -> str:
        """The command that prints a file of the repository: Snakemake's copies are text."""
        repository = getattr(self.folder, "repo_path", None) or self.folder.hosted_repo.repo_clone
        return f"git -C '{os.path.abspath(repository)}' cat-file blob '{self.folder.ref}:{path}'"


def _joined(folder, path, join=LocalGitFile.join):
    """Snakemake 9.27 joins texts only, but gives itself a path that is none (git+file)."""
    return join(folder, str(path))
