"""The work behind `imuarray allan`."""

import numpy as np

from imuarray.commands.output import Answer
from imuarray.firstorder.noise import StillNoise, allan
from imuarray.pictures.noise import noise_figure
from imuarray.pictures.style import saved
from imuarray.provenance import write_bytes, write_csv
from imuarray.recording import read_recording

SHOWN = {"specific_force": ("accelerometer", 1e3, "mm/s^2"),
         "angular_rate": ("gyroscope", np.degrees(1.0), "deg/s")}  # fmt: skip
UNITS = {"noise_density": "{}/sqrt(Hz)", "bias_instability": "{}", "random_walk": "{}/s/sqrt(Hz)"}


def run(arguments, _) -> Answer:
    """Allan deviation, spectrum and noise terms of a recording's still stretches."""
    noise, folder = allan(read_recording(arguments.recording)), arguments.out
    figure = noise_figure(noise, [arguments.recording.name])
    write_csv(noise.deviation, folder / "allan.csv")
    for ending in ("pdf", "png"):
        write_bytes(saved(figure, ending), folder / f"allan.{ending}")
    write_csv(noise.spectrum, folder / "spectrum.csv")
    write_csv(noise.terms, folder / "noise.csv")
    return Answer("\n".join(lines(noise)), {
        "rate_hz": noise.rate_hz, "stretches_s": noise.stretches_s,
        "terms": noise.terms.to_dict("records"),
    })  # fmt: skip


def lines(noise: StillNoise) -> list[str]:
    """For a person: each term of each triad's axes x, y, z."""
    lengths = ", ".join(f"{length:.4g}" for length in sorted(noise.stretches_s)[::-1][:3])
    more = ", ..." if len(noise.stretches_s) > 3 else ""
    said = [f"still stretches of {lengths}{more} s at {noise.rate_hz:.4g} Hz"]
    for (sensor, term), part in noise.terms.groupby(["sensor", "term"], sort=False):
        kind, factor, unit = SHOWN[sensor]
        said.append(f"{kind}s, {term.replace('_', ' ')}, {UNITS[term].format(unit)}: x, y, z (sd)")
        for label, triad in part.groupby("triad", sort=False):
            values = [
                f"open (< {factor * row.below:.2g})" if row.says
                else f"{factor * row.value:.3g} ({factor * row.sd:.1g})"
                for row in triad.itertuples()
            ]  # fmt: skip
            said.append(f"{label:>5}  {', '.join(values)}")
    return said
