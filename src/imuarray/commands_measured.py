"""The work behind the commands for measured data: convert to repeat."""

from __future__ import annotations

import numpy as np
import pandas as pd
import xarray as xr

from imuarray.errors import InputError
from imuarray.provenance import atomic_write, digest, seal, stamp, write_csv
from imuarray.recording import Recording, read_recording, write_recording
from imuarray.recording.validate import FIRST_ORDER


def convert_mimu(arguments) -> None:
    """A MIMU board's packets to a recording, with an account of what was dropped."""
    from imuarray.recording.mimu import read_mimu
    from imuarray.recording.mimu_recording import read_positions, to_recording, turned_labels

    positions, labels = read_positions(arguments.positions)
    underside = turned_labels(labels, arguments.underside)
    stream = read_mimu(arguments.data)
    recording = to_recording(
        stream, positions, labels, underside, arguments.accelerometer_noise,
        float(np.radians(arguments.gyroscope_noise_dps)), arguments.position_prior,
        source=arguments.data.name,
    )  # fmt: skip
    attrs = stamp({"source": str(arguments.data)}, 0) | stream.account.attributes()
    write_recording(recording, arguments.out, attrs=attrs)
    _say_converted(arguments, recording, stream.account.lines())


def convert_csv(arguments) -> None:
    """A table and its description to a recording."""
    from imuarray.recording.table import read_table

    recording = read_table(arguments.data, arguments.columns)
    write_recording(recording, arguments.out, attrs=stamp({"source": str(arguments.data)}, 0))
    _say_converted(arguments, recording, [])


def _say_converted(arguments, recording: Recording, lines) -> None:
    if arguments.quiet:
        return
    samples, count = recording.specific_force.shape[:2]
    seconds = recording.time[-1] - recording.time[0]
    rate = 1 / np.median(np.diff(recording.time)) if samples > 1 else np.nan
    print(f"{arguments.out}: {samples} samples of {count} IMUs, {rate:.2f} Hz, {seconds:.1f} s")
    print("\n".join(lines), end="\n" if lines else "")


def first_order(arguments) -> None:
    """Per-triad calibration from still poses; the corrected recording carries it."""
    from imuarray.firstorder import calibrate_first_order
    from imuarray.firstorder.report import noise_table, residual_table

    recording = read_recording(arguments.recording)
    found = calibrate_first_order(recording, arguments.gravity)
    write_corrected(recording, found, arguments.out)
    if arguments.quiet:
        return
    length = sum(pose.stop - pose.start for pose in found.poses)
    print(f"{len(found.poses)} still poses, {length} samples, gravity {found.gravity:g} m/s^2")
    print("triad  residual mm/s^2  poses left out  offset mm/s^2")
    for row, offset in zip(
        residual_table(found, recording).itertuples(), found.triads.offset, strict=True
    ):
        shown = ", ".join(f"{1e3 * value:.0f}" for value in offset)
        print(f"{row.triad:>5}  {1e3 * row.residual_rms:15.2f}  {row.left_out:14d}  {shown}")
    ratios = noise_table(found, recording).groupby("sensor").ratio
    for sensor, ratio in ratios.median().items():
        print(f"noise of {sensor}: {ratio:.2f} times the declared one (median over axes)")


def write_corrected(recording: Recording, found, path) -> None:
    """The corrected recording, with the calibration's numbers in a group of its own."""
    from imuarray.firstorder import correct

    data = digest(recording.specific_force, recording.angular_rate)
    attrs = stamp({"recording": data, "gravity": found.gravity}, 0)
    with atomic_write(path) as temporary:
        write_recording(correct(recording, found), temporary, attrs=attrs)
        _first_order_dataset(recording, found).to_netcdf(
            temporary, mode="a", group=FIRST_ORDER, engine="h5netcdf"
        )
        seal(temporary)


def _first_order_dataset(recording: Recording, found) -> xr.Dataset:
    """Matrix, offset and their covariance, poses, residuals, noise."""
    fit = found.triads
    accelerometer, gyroscope = ("accelerometer", "axis"), ("gyroscope", "axis")
    times = recording.time
    limits = [(times[pose.start], times[pose.stop - 1]) for pose in found.poses]
    variables = {
        "matrix": (("accelerometer", "axis", "axis_other"), fit.matrix, {"units": "1"}),
        "offset": (accelerometer, fit.offset, {"units": "m s-2"}),
        "covariance": (
            ("parameter", "parameter_other"), fit.covariance,
            {"long_name": "of (matrix row by row, offset), triad by triad"},
        ),
        "residual": (("pose", "accelerometer", "axis"), fit.residual, {"units": "m s-2"}),
        "used": (("pose", "accelerometer"), fit.used),
        "pose_time": (("pose", "edge"), np.array(limits), {"units": "s"}),
        "accelerometer_noise": (accelerometer, found.accelerometer_noise, {"units": "m s-2"}),
        "gyroscope_offset": (gyroscope, found.gyroscope_offset, {"units": "rad s-1"}),
        "gyroscope_offset_sd": (gyroscope, found.gyroscope_offset_sd, {"units": "rad s-1"}),
        "gyroscope_noise": (gyroscope, found.gyroscope_noise, {"units": "rad s-1"}),
    }  # fmt: skip
    coords = {
        "accelerometer": list(recording.accelerometer_labels),
        "gyroscope": list(recording.gyroscope_labels), "axis": list("xyz"),
        "axis_other": list("xyz"),
    }  # fmt: skip
    attrs = {"gravity": found.gravity, "residual_ratio": fit.residual_ratio}
    return xr.Dataset(variables, coords, attrs)


def select(arguments) -> None:
    """Samples worth calibrating with."""
    from imuarray.estimation.selection import select_dynamic

    recording = read_recording(arguments.recording)
    found = select_dynamic(recording)
    index = found.informative
    if arguments.samples is not None:
        index = found.disjoint([arguments.samples])[arguments.samples]
    data = digest(recording.specific_force, recording.angular_rate)
    write_recording(recording.select(index), arguments.out, attrs=stamp({"recording": data}, 0))
    if not arguments.quiet:
        print(f"{len(recording.time)} samples")
        for words, count in found.removed.items():
            print(f"{-count:7d} {words}")
        print(f"{len(found.informative)} informative, {len(index)} written to {arguments.out}")


def residuals(arguments) -> None:
    """The papers' model against the recording, beside its simulation."""
    from imuarray.estimation.selection import select_dynamic
    from imuarray.measured.residuals import compare

    recording = read_recording(arguments.recording)
    moving = recording.select(select_dynamic(recording).usable)
    table, shape = compare(moving, np.random.default_rng(arguments.seed))
    write_csv(table, arguments.out)
    if arguments.figure is not None:
        from imuarray.figures.measured import residual_figure

        figure = residual_figure(table, shape, [f"{arguments.recording.name}"])
        with atomic_write(arguments.figure) as temporary:
            figure.savefig(temporary, format=arguments.figure.suffix.lstrip(".") or "png")
    if not arguments.quiet:
        axes = table[table["by"] == "axis"]
        for (source, quantity), part in axes.groupby(["source", "quantity"]):
            size = np.sqrt(np.mean(part.rms**2))
            print(f"{source:>9} {quantity:>14}: residual {size:8.2f} assumed sigmas rms")


def repeat(arguments) -> None:
    """z-scores between recordings of one board."""
    from imuarray.estimation.selection import select_dynamic
    from imuarray.measured.positions import agreement, locate, pairwise, position_table

    if len(arguments.recordings) < 2:
        raise InputError("repeat: expected two or more recordings, found one")
    names = [path.resolve() for path in arguments.recordings]
    if len(set(names)) < len(names):
        raise InputError("repeat: expected different recordings, found one of them twice")
    parts, labels = [], None
    for path in arguments.recordings:
        recording = read_recording(path)
        labels = labels or recording.accelerometer_labels
        if recording.accelerometer_labels != labels:
            raise InputError(f"{path}: expected the triads {', '.join(labels)}, found others")
        chosen = select_dynamic(recording).disjoint([arguments.samples])[arguments.samples]
        found = locate(recording.select(chosen), arguments.accelerometer_noise)
        name = str(path)
        parts.append(position_table(found, labels, recording=name))
        if not arguments.quiet:
            state = "" if found.converged else ", NOT converged"
            print(f"{path}: sigma_a {found.accelerometer_sd:.3g} assumed,"
                  f" {found.residual_sd:.3g} m/s^2 in the residual{state}")  # fmt: skip
    table = pd.concat(parts, ignore_index=True)
    pairs = pairwise(table)
    write_csv(pairs, arguments.out)
    if not arguments.quiet:
        found = agreement(pairs, table)
        print(f"50 % intervals cover {100 * found['coverage_50']:.0f} %, 95 % cover"
              f" {100 * found['coverage_95']:.0f} %; rms z {found['z_rms']:.2f};"
              f" claimed sd {1e6 * found['claimed_m']:.1f} um, between recordings"
              f" {1e6 * found['spread_m']:.1f} um")  # fmt: skip
