"""The work behind `imuarray sample`."""

from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from imuarray.analysis.model import assumed
from imuarray.analysis.sampling import sample as sampled
from imuarray.analysis.sampling import summary
from imuarray.commands.output import Answer, Output
from imuarray.provenance import trust, write_netcdf
from imuarray.recording import read_recording
from imuarray.trust import of_file, reasons_of_poses, reasons_of_posterior

VERDICT = (
    "sampler", "converged", "rhat_max", "ess_min", "burn_in_steps", "steps", "divergent",
    "accelerometer_noise_sd", "gyroscope_noise_sd",
)  # fmt: skip
TOLD = "pareto_k", "instead_of"  # by samplers that have them


def sample(arguments, output: Output) -> Answer:
    """Chains of the positions' posterior; see `imuarray.sample`."""
    recording = read_recording(arguments.recording)
    posterior = sampled(
        recording, arguments.model, arguments.method, arguments.steps, arguments.seed,
        arguments.effects, arguments.accelerometer_noise, output.progress, output.notify,
    )  # fmt: skip
    recording = assumed(recording, arguments.accelerometer_noise)
    reasons = reasons_of_poses(of_file(arguments.recording))
    reasons += reasons_of_posterior(recording, posterior)
    return written(posterior, reasons, arguments.out)


def written(posterior: xr.DataTree, reasons: list[str], out: Path) -> Answer:
    """Writes the chains and reports on them."""
    posterior.attrs |= trust(reasons)
    write_netcdf(posterior, out)
    table = summary(posterior)
    return Answer(report(posterior, table), document(posterior, table), reasons)


def document(posterior: xr.DataTree, table: pd.DataFrame) -> dict:
    """The chains' verdict, and mean and sd of each coordinate."""
    found = {name: posterior.attrs[name] for name in VERDICT}
    found["converged"] = bool(found["converged"])
    found |= {name: posterior.attrs[name] for name in TOLD if name in posterior.attrs}
    columns = ["accelerometer", "axis", "mean_m", "sd_m", "rhat", "ess"]
    return found | {"coordinates": table[columns].to_dict(orient="records")}


def report(posterior: xr.DataTree, table: pd.DataFrame) -> str:
    """Lines on the chains for a person."""
    attrs = posterior.attrs
    lines = ["triad axis   mean mm   sd um"]
    for row in table.itertuples():
        numbers = f"{1e3 * row.mean_m:9.4f} {1e6 * row.sd_m:7.2g}"
        lines.append(f"{row.accelerometer:>5} {row.axis:>4} {numbers}")
    lines.append(
        f"noise: accelerometers {attrs['accelerometer_noise_sd']:.3g} m/s^2, gyroscopes"
        f" {np.degrees(attrs['gyroscope_noise_sd']):.3g} deg/s"
    )
    state = "converged" if attrs["converged"] else "NOT converged: take more --steps"
    lines.append(
        f"{attrs['sampler']}, {state}: R-hat {attrs['rhat_max']:.3f}, smallest ESS"
        f" {attrs['ess_min']:.0f}, burn-in {attrs['burn_in_steps']} of {attrs['steps']} steps"
    )
    if attrs["divergent"]:
        lines.append(
            f"{attrs['divergent']} transitions diverged: a part of the posterior may be missed"
        )
    return "\n".join(lines)
