"""Run a script's body with its log file: messages and tracebacks go there."""

import os
import sys
import traceback
from contextlib import contextmanager, redirect_stderr, redirect_stdout

# One BLAS thread: jobs parallelise over realisations and chains, and results must not
# depend on how many threads Snakemake happened to grant.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"


@contextmanager
def job(snakemake):
    """Yield the rule's settings; on failure log the traceback and print one line."""
    from imuarray.errors import InputError

    try:
        with open(snakemake.log[0], "w", encoding="utf-8", buffering=1) as log:
            try:
                with redirect_stdout(log), redirect_stderr(log):
                    yield snakemake.params.get("settings", {})
            except Exception as error:
                lines = [str(error)] if isinstance(error, InputError) else traceback.format_exc()
                log.writelines(lines)
                raise
    except Exception as error:  # of the log, too: its disk may be full
        status = 2 if isinstance(error, InputError) else 1
        said = " ".join(str(error).split())
        print(f"{snakemake.rule}: {said} (see {snakemake.log[0]})", file=sys.stderr)
        sys.exit(status)
