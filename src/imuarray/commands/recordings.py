"""The work behind the commands that make recordings, from logs, by simulation, or of others."""

import numpy as np
import xarray as xr

from imuarray.commands.output import Answer
from imuarray.errors import require, require_one_of
from imuarray.provenance import digest, stamp, write_bytes
from imuarray.recording import Recording, read_recording, write_recording


def convert_mimu(arguments, _) -> Answer:
    """A MIMU board's packets to a recording, with an account of what was dropped."""
    from imuarray.recording.mimu_recording import read_board

    recording, account = read_board(
        arguments.data, arguments.positions, arguments.underside,
        accelerometer_noise_sd=arguments.accelerometer_noise,
        gyroscope_noise_sd=float(np.radians(arguments.gyroscope_noise_dps)),
        position_prior_sd=arguments.position_prior, output_rate=arguments.output_rate,
    )  # fmt: skip
    attrs = stamp({"source": str(arguments.data)}, 0) | account.attributes()
    write_recording(recording, arguments.out, attrs=attrs)
    return _report(arguments, recording, account.lines())


def draft_columns(arguments, _) -> Answer:
    """A log's description, guessed from its header and readings; never over another one."""
    from imuarray.recording.draft import draft

    out = arguments.out
    require(not out.exists(), str(out), "a new file", "one that is there already")
    text, asked = draft(arguments.data)
    write_bytes(text.encode(), out)
    lines = [f"{out}: a draft; look at", *(f"- {line}" for line in asked)]
    return Answer("\n".join(lines), {"not_known": asked})


def convert_logs(arguments, _) -> Answer:
    """Tables or bags, and their description, to a recording."""
    from imuarray.analysis.logs import open_logs

    found = open_logs(arguments.data, arguments.columns, getattr(arguments, "topics", ()))
    attrs = stamp({"source": ", ".join(map(str, arguments.data))}, 0)
    write_recording(found.recording, arguments.out, attrs=attrs)
    return _report(arguments, found.recording, found.lines)


def _report(arguments, recording: Recording, lines: list[str]) -> Answer:
    samples, count = recording.specific_force.shape[:2]
    seconds = float(recording.time[-1] - recording.time[0])
    rate = float(1 / np.median(np.diff(recording.time))) if samples > 1 else np.nan
    first = f"{arguments.out}: {samples} samples of {count} IMUs, {rate:.2f} Hz, {seconds:.1f} s"
    return Answer("\n".join([first, *lines]), {
        "samples": samples, "accelerometers": count, "rate_hz": rate, "duration_s": seconds,
        "account": lines,
    })  # fmt: skip


def simulate(arguments, _) -> Answer:
    """A recording of a board twisted by hand; see `imuarray.simulate`."""
    from imuarray.analysis.prepare import simulate as simulated
    from imuarray.geometry.boards import BOARDS

    require_one_of("--board", arguments.board, BOARDS)
    given = {"duration": arguments.duration, "sampling_rate": arguments.rate}
    board = BOARDS[arguments.board]()
    recording, truth = simulated(board, **given, seed=arguments.seed, effects=arguments.effects)
    origin = stamp({"board": arguments.board, **given}, arguments.seed)
    write_recording(recording, arguments.out, truth, origin)
    samples, accelerometers = recording.specific_force.shape[:2]
    text = f"{arguments.out}: {samples} samples of {accelerometers} accelerometer triads"
    return Answer(text, {"samples": samples, "accelerometers": accelerometers})


def first_order(arguments, _) -> Answer:
    """Calibration of each triad from poses and moves; the corrected recording carries it."""
    from imuarray.firstorder import report
    from imuarray.firstorder.correct import calibrate_first_order
    from imuarray.trust import of_first_order, reasons_of_poses

    recording = read_recording(arguments.recording)
    found = calibrate_first_order(
        recording, arguments.gravity, arguments.gyroscopes, arguments.shortest_pose,
        [read_recording(path) for path in arguments.others],
    )  # fmt: skip
    report.write_corrected(recording, found, arguments.out)
    table, offsets = report.residual_table(found, recording), found.triads.offset
    ratios = report.noise_table(found, recording).groupby("sensor").ratio.median()
    return Answer("\n".join(report.summary_lines(found, recording)), {
        "poses": len(found.poses), "still_samples": found.still_samples,
        "gravity_m_s2": found.gravity, "triads": list(table.triad),
        "residual_m_s2": table.residual_rms.to_numpy(), "offset_m_s2": offsets,
        "residual_ratio": found.triads.residual_ratio,
        "noise_over_declared": ratios.to_dict(), "gyroscopes": arguments.gyroscopes,
        "gyroscope_matrix": found.maps["gyroscope"],
        "gyroscope_common_scale_sd": found.common_scale_sd,
    }, reasons_of_poses(of_first_order(found)))  # fmt: skip


def select(arguments, _) -> Answer:
    """Select moving, unsaturated, informative samples."""
    from imuarray.analysis.selection import select_dynamic

    recording = read_recording(arguments.recording, stored=True)
    found = select_dynamic(recording)
    index = found.spread(arguments.samples)
    data = digest(recording.specific_force, recording.angular_rate)
    with xr.open_datatree(arguments.recording) as file:  # what first order found goes along
        groups = {name: file[name].to_dataset().load() for name in file.children}
    attrs = stamp({"recording": data}, 0)
    write_recording(recording.select(index), arguments.out, attrs=attrs, groups=groups)
    lines = [f"{len(recording.time)} samples"]
    lines += [f"{-count:7d} {words}" for words, count in found.removed.items()]
    lines.append(f"{len(found.informative)} informative, {len(index)} written to {arguments.out}")
    return Answer("\n".join(lines), {
        "samples": len(recording.time), "removed": found.removed,
        "informative": len(found.informative), "written": len(index),
    })  # fmt: skip
