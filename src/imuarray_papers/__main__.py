"""`python -m imuarray_papers`: what the papers did, for a recording of one's own."""

import argparse
import sys

from imuarray.cli import main
from imuarray.commands.argument_types import count
from imuarray.commands.parser import NOISE, RECORDING, SEED, Command, make_parser, number, option

PACKAGE = "imuarray_papers.commands"
COMMANDS = (
    Command(
        "calibrate", "calibrate",
        "Positions by ML-BCD, algorithm 1 of paper 2017, all samples in memory.",
        "corrected.nc --out cal.nc", "estimates to write (NetCDF-4)", (RECORDING, NOISE),
        package=PACKAGE,
    ),
    Command(
        "sample", "sample",
        "The positions' posterior as in paper 2021: PmMH under the flat motion prior, which shrinks"
        " the array (docs/findings.md).",
        "few.nc --rates spread --accelerometer-noise 0.79 --out posterior.nc",
        "posterior to write (NetCDF-4)",
        (
            RECORDING, NOISE,
            option("--rates", "p(omega | y_g) from the gyroscopes' noise (default: declared), or"
                    " from the spread among the gyroscopes of each sample, (30)",
                    choices=("declared", "spread"), default="declared"),
            option("--method", "pmmh (default), N and the step length tuned as in section III-C;"
                    " or nuts, on the exact marginal likelihood", choices=("pmmh", "nuts"),
                    default="pmmh"),
            number("--steps", "N", "steps of each chain (default: 200,000; of NUTS 1,250)",
                    type=count),
            SEED,
        ),
        package=PACKAGE,
    ),
)  # fmt: skip


def papers_parser() -> argparse.ArgumentParser:
    """The parser of `COMMANDS`."""
    return make_parser(COMMANDS, "python -m imuarray_papers")


if __name__ == "__main__":
    sys.exit(main(parser=papers_parser()))
