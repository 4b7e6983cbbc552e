"""The work behind the commands for measured data: first-order, select, residuals, repeat."""

import numpy as np
import pandas as pd
import xarray as xr

from imuarray.commands.output import Output
from imuarray.errors import InputError
from imuarray.provenance import atomic_write, digest, stamp, write_csv
from imuarray.recording import read_recording, write_recording


def first_order(arguments) -> None:
    """Calibration of each triad from poses and moves; the corrected recording carries it."""
    from imuarray.analysis.trust import of_first_order, reasons_of_poses
    from imuarray.firstorder.correct import calibrate_first_order
    from imuarray.firstorder.report import (
        noise_table,
        residual_table,
        summary_lines,
        write_corrected,
    )

    recording, output = read_recording(arguments.recording), Output(arguments)
    found = calibrate_first_order(
        recording, arguments.gravity, arguments.gyroscopes, arguments.shortest_pose,
        [read_recording(path) for path in arguments.others],
    )  # fmt: skip
    write_corrected(recording, found, arguments.out)
    table, offsets = residual_table(found, recording), found.triads.offset
    ratios = noise_table(found, recording).groupby("sensor").ratio.median()
    output.say("\n".join(summary_lines(found, recording)))
    reasons = reasons_of_poses(of_first_order(found))
    output.done({
        "out": str(arguments.out), "poses": len(found.poses), "still_samples": found.still_samples,
        "gravity_m_s2": found.gravity, "triads": list(table.triad),
        "residual_m_s2": table.residual_rms.to_numpy(), "offset_m_s2": offsets,
        "residual_ratio": found.triads.residual_ratio,
        "noise_over_declared": ratios.to_dict(), "gyroscopes": arguments.gyroscopes,
        "gyroscope_matrix": found.gyroscope_matrix,
        "gyroscope_common_scale_sd": found.common_scale_sd,
    }, reasons)  # fmt: skip


def select(arguments) -> None:
    """Select moving, unsaturated, informative samples."""
    from imuarray.estimation.selection import select_dynamic

    recording, output = read_recording(arguments.recording, stored=True), Output(arguments)
    found = select_dynamic(recording)
    index = found.spread(arguments.samples)
    data = digest(recording.specific_force, recording.angular_rate)
    with xr.open_datatree(arguments.recording) as file:  # what first order found goes along
        groups = {name: file[name].to_dataset().load() for name in file.children}
    attrs = stamp({"recording": data}, 0)
    write_recording(recording.select(index), arguments.out, attrs=attrs, groups=groups)
    lines = [f"{len(recording.time)} samples"]
    lines += [f"{-count:7d} {words}" for words, count in found.removed.items()]
    output.say("\n".join(lines))
    output.say(f"{len(found.informative)} informative, {len(index)} written to {arguments.out}")
    output.done({
        "out": str(arguments.out), "samples": len(recording.time), "removed": found.removed,
        "informative": len(found.informative), "written": len(index),
    })  # fmt: skip


def residuals(arguments) -> None:
    """The papers' model against the recording, beside its simulation."""
    from imuarray.estimation.selection import select_dynamic
    from imuarray.measured.residuals import compare

    recording, output = read_recording(arguments.recording), Output(arguments)
    moving = recording.select(select_dynamic(recording).usable)
    table, shape = compare(moving, np.random.default_rng(arguments.seed))
    if arguments.figure is None:
        write_csv(table, arguments.out)
    else:
        from imuarray.figures.measured import residual_figure
        from imuarray.figures.style import panels

        figure = residual_figure(
            panels(summary=table, shape=shape), [f"{arguments.recording.name}"]
        )
        with atomic_write(arguments.figure) as temporary:
            figure.savefig(temporary, format=arguments.figure.suffix[1:].lower())
            write_csv(table, arguments.out)  # both or none
    sizes: dict[str, dict[str, float]] = {}
    for (source, quantity), part in table[table["by"] == "axis"].groupby(["source", "quantity"]):
        size = float(np.sqrt(np.mean(part.rms**2)))
        sizes.setdefault(source, {})[quantity] = size
        output.say(f"{source:>9} {quantity:>14}: residual {size:8.2f} assumed sigmas rms")
    output.done({"out": str(arguments.out), "residual_assumed_sigmas": sizes})


def repeat(arguments) -> None:
    """z-scores between recordings of one board."""
    from imuarray.measured.positions import agreement, pairwise

    if len(arguments.recordings) < 2:
        raise InputError("repeat: expected two or more recordings, found one")
    names = [path.resolve() for path in arguments.recordings]
    if len(set(names)) < len(names):
        raise InputError("repeat: expected different recordings, found one of them twice")
    output = Output(arguments)
    table = pd.concat(_located(arguments, output), ignore_index=True)
    pairs = pairwise(table)
    write_csv(pairs, arguments.out)
    found = agreement(pairs, table)
    output.say(f"50 % intervals cover {100 * found['coverage_50']:.0f} %, 95 % cover"
               f" {100 * found['coverage_95']:.0f} %; rms z {found['z_rms']:.2f};"
               f" claimed sd {1e6 * found['claimed_m']:.1f} um, between recordings"
               f" {1e6 * found['spread_m']:.1f} um")  # fmt: skip
    output.done({"out": str(arguments.out), **found})


def _located(arguments, output: Output) -> list[pd.DataFrame]:
    """The positions by each recording; InputError for one of other triads."""
    from imuarray.estimation.selection import select_dynamic
    from imuarray.measured.positions import locate, position_table

    parts, labels = [], None
    for path in arguments.recordings:
        recording = read_recording(path)
        labels = labels or recording.accelerometer_labels
        if recording.accelerometer_labels != labels:
            raise InputError(f"{path}: expected the triads {', '.join(labels)}, found others")
        chosen = select_dynamic(recording).spread(arguments.samples)
        found = locate(recording.select(chosen), arguments.accelerometer_noise)
        parts.append(position_table(found, labels, recording=str(path)))
        state = "" if found.converged else ", NOT converged"
        output.say(f"{path}: sigma_a {found.accelerometer_sd:.3g} assumed,"
                   f" {found.residual_sd:.3g} m/s^2 in the residual{state}")  # fmt: skip
    return parts
