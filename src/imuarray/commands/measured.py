"""The work behind the commands for measured data: first-order, select."""

import xarray as xr

from imuarray.commands.output import Output
from imuarray.provenance import digest, stamp
from imuarray.recording import read_recording, write_recording


def first_order(arguments) -> None:
    """Calibration of each triad from poses and moves; the corrected recording carries it."""
    from imuarray.firstorder.correct import calibrate_first_order
    from imuarray.firstorder.report import (
        noise_table,
        residual_table,
        summary_lines,
        write_corrected,
    )
    from imuarray.trust import of_first_order, reasons_of_poses

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
