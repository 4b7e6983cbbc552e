"""Calibrations for other tools: the same numbers again, formulas that hold, trust goes along."""

import csv
import io
import json
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest
import xarray as xr
import yaml
from scipy.spatial.transform import Rotation

import imuarray
from imuarray.analysis.formats import _link_names
from imuarray.cli import main
from imuarray.engine.dataset import (
    noise_variables,
    positions_dataset,
    with_readings,
)
from imuarray.engine.parameters import model_of
from imuarray.errors import InputError
from imuarray.firstorder.turns import nearest_orthogonal
from imuarray.model.array_model import parameter_names
from imuarray.motion import Motion
from imuarray.provenance import trust, write_netcdf
from tests.firstorder.test_allan import still

EFFECTS = (
    "sensor_delay", "gyroscope_delay", "accelerometer_bias", "gyroscope_bias",
    "gyroscope_scale", "gyroscope_misalignment", "accelerometer_misalignment",
)  # fmt: skip
UNDERSIDE = np.array([[0.0, -1, 0], [-1, 0, 0], [0, 0, -1]])


def random_maps(rng, count):
    turned = Rotation.from_rotvec([0.0, 0.3, 0.6]).as_matrix()
    maps = np.eye(3) + 0.01 * rng.standard_normal((count, 3, 3))
    maps[0] = np.triu(maps[0])
    maps[-1] = maps[-1] @ turned
    return maps


@pytest.fixture(scope="module")
def made():
    """(calibration, its model and parameters, what chips read of the array's unit triads)."""
    rng, count = np.random.default_rng(1), 4
    plain = still(count, samples=8)
    maps = {kind: random_maps(rng, count) for kind in ("accelerometer", "gyroscope")}
    maps["gyroscope"][-1] = maps["accelerometer"][-1] @ maps["gyroscope"][0]
    offsets = {kind: rng.standard_normal((count, 3)) for kind in maps}
    chips = np.tile(np.eye(3), (count, 1, 1))
    chips[1] = UNDERSIDE
    correction = xr.Dataset({
        f"{kind}_{name}": ((kind, "axis", "axis_other")[: value.ndim], value)
        for kind in maps
        for name, value in (("inverse", np.linalg.inv(maps[kind])), ("offset", offsets[kind]),
                            ("offset_sd", 0.01 * np.ones((count, 3))),
                            ("offset_walk", np.zeros(count)))
    })  # fmt: skip
    back = np.swapaxes(nearest_orthogonal(maps["accelerometer"]), 1, 2)
    root = 1e-4 * rng.standard_normal((36, 36))
    recording = replace(
        plain, correction=correction, accelerometer_axes=back @ chips,
        map_covariance=root @ root.T,
    )  # fmt: skip
    model = model_of(recording, EFFECTS)
    values = 1e-5 + model.effect_prior_sd * rng.standard_normal(model.effect_size)
    size = 9 + model.effect_size
    whole = rng.standard_normal((size, size))
    whole = 1e-10 * whole @ whole.T
    places = recording.relative_positions() + 1e-3 * rng.standard_normal((count, 3)) * [
        [0],
        [1],
        [1],
        [1],
    ]
    dataset = positions_dataset(recording, places, whole[:9, :9])
    labels = recording.accelerometer_labels, recording.gyroscope_labels
    dataset = dataset.assign(noise_variables(model.noise)).assign(
        effect_parameter=("parameter", values),
        effect_sd=("parameter", np.sqrt(np.diag(whole)[9:])),
        whole_covariance=(("unknown", "unknown_other"), whole),
    ).assign_coords(parameter=parameter_names(model, labels))  # fmt: skip
    dataset.attrs |= {"effects": ",".join(EFFECTS), "time_origin": 0.0, "span": 1.0}
    dataset.attrs |= {"created_by": "imuarray", "versions": "{}"}
    calibration = with_readings(dataset, [recording, recording])

    def read(u, w):
        """What the recording has raw, and what the chips read, of u and w in the array's frame."""
        out = []
        for kind, motion in ((0, (0 * w, 0 * u, u)), (1, (w, 0 * u, 0 * u))):
            seen = np.asarray(model.predict(Motion.of(*motion), places, _late(model, values))[kind])
            name = ("accelerometer", "gyroscope")[kind]
            raw = np.einsum("kij,kj->ki", maps[name], seen) + offsets[name]
            out.append((raw, np.einsum("kji,kj->ki", chips, raw)))
        return out

    return calibration, model, values, read


def _late(model, values):
    """The parameters without delays: a reading's instant is no matter of its matrix."""
    parts = model.split(values)
    return model.join({name: part for name, part in parts.items() if "delay" not in name})


TRUTH = np.array([3.0, -4.0, 8.0]), np.array([0.5, 2.0, -1.0])


def test_the_document_s_corrections_lead_to_the_truth(made):
    calibration, _, _, read = made
    document = json.loads(imuarray.export(calibration))
    for kind, (raw, chip), truth in zip(
        ("accelerometer", "gyroscope"), read(*TRUTH), TRUTH, strict=True
    ):
        for k, imu in enumerate(document["imus"]):
            x = raw[k]
            np.testing.assert_allclose(np.array(imu["axes"]) @ chip[k], x, atol=1e-12)
            assert [step["from"] for step in imu[kind]["corrections"]] == [
                "first-order",
                "calibrate",
            ]
            for step in imu[kind]["corrections"]:
                x = np.array(step["inverse"]) @ (x - np.array(step["offset"]))
            np.testing.assert_allclose(x, truth, atol=1e-9)
    assert document["imus"][1]["axes"] == UNDERSIDE.tolist()
    assert document["not_in_matrices"] == []
    assert document["trusted"] is None and document["imus"][0]["rotation_sd_rad"][0] > 0


def test_kalibr_s_model_holds_and_its_frames_are_those_of_the_board(made):
    calibration, _, _, read = made
    (_, force), (_, rate) = read(*TRUTH)
    text = imuarray.export(calibration, "kalibr")
    found, document = yaml.safe_load(text), json.loads(imuarray.export(calibration))
    assert list(found) == ["imu0", "imu1", "imu2", "imu3"]
    seen = []
    for k, imu in enumerate(found.values()):
        whole = np.array(imu["T_i_b"])
        turn, place = whole[:3, :3], -whole[:3, :3].T @ whole[:3, 3]
        acc, gyr = imu["accelerometers"], imu["gyroscopes"]
        for part in (acc["M"], gyr["M"]):
            assert not np.triu(part, 1).any() and (np.diag(part) > 0).all()
        u = turn.T @ np.linalg.solve(acc["M"], force[k] - acc["bias"])
        w = np.linalg.solve(gyr["M"], rate[k] - gyr["bias"])
        w = turn.T @ np.array(gyr["C_gyro_i"]).T @ w
        own = calibration["position"].to_numpy()[k]
        for one, two in (
            ((u, w), TRUTH),
            ((u, place), (TRUTH[0], own)),
            ((w, place), (TRUTH[1], own)),
        ):
            assert np.dot(*one) == pytest.approx(np.dot(*two), abs=1e-9)
        seen.append((u, w))
        assert imu["T_i_b"] == document["imus"][k]["kalibr"]["T_i_b"]  # to the last bit
        assert acc["M"] == document["imus"][k]["kalibr"]["accelerometer"]["M"]
        assert all(isinstance(x, float) for x in [imu["time_offset"], *np.ravel(gyr["M"]).tolist()])
        assert "accelerometer_random_walk" not in imu and imu["accelerometer_noise_density"] > 0
    for other in seen[1:]:
        np.testing.assert_allclose(other, seen[0], atol=1e-9)
    assert found["imu0"]["T_i_b"] == np.eye(4).tolist()
    assert "accelerometer_random_walk: left open" in text


def test_times_are_those_of_the_model_against_the_first_accelerometer(made):
    calibration, model, values, _ = made
    delays, places = model.split(values), model.split(np.arange(model.effect_size))
    covariance = calibration["whole_covariance"].to_numpy()[9:, 9:]
    found = yaml.safe_load(imuarray.export(calibration, "kalibr"))
    document = json.loads(imuarray.export(calibration))
    own, lag = delays["sensor_delay"], delays["gyroscope_delay"]
    for k, imu in enumerate(document["imus"]):
        assert imu["accelerometer"]["time_offset_s"] == pytest.approx(own[k] - own[0], abs=1e-15)
        assert imu["gyroscope"]["time_offset_s"] == pytest.approx(own[k] + lag[k] - own[0])
        assert found[f"imu{k}"]["time_offset"] == imu["accelerometer"]["time_offset_s"]
        if k:
            pair = [places["sensor_delay"][k], places["sensor_delay"][0]]
            block = covariance[np.ix_(pair, pair)]
            sd = np.sqrt(block[0, 0] + block[1, 1] - 2 * block[0, 1])
            assert imu["accelerometer"]["time_offset_sd_s"] == pytest.approx(sd)
    assert document["imus"][0]["accelerometer"]["time_offset_sd_s"] is None


def test_a_clock_of_its_own_is_in_the_time(made):
    calibration, model, values, _ = made
    lies = ((0.0, 0.0, 0.0), (2.5, 3e-5, 40.0), (-1.0, 0.0, 7.0), (0.1, -1e-5, 9.0))
    offset, drift, middle = np.array(lies).T
    known = {
        "clock_offset": offset, "clock_offset_sd": np.full(4, 1e-3), "clock_drift": drift,
        "clock_drift_sd": np.full(4, 1e-7), "clock_middle": middle,
        "log_rate": [100.0, 200.0, 100.0, 50.0],
    }  # fmt: skip
    own = calibration.assign({name: ("accelerometer", x) for name, x in known.items()})
    delay, text = model.split(values)["sensor_delay"], imuarray.export(own, "kalibr")
    for k, imu in enumerate(json.loads(imuarray.export(own))["imus"]):
        found = imu["accelerometer"]["time_offset_s"]
        if k:
            clock = imu["clock"]
            time = 50.0 + found - clock["drift"] * (50.0 - clock["at_s"])
            first = 50.0 - offset[k] - drift[k] * (50.0 - middle[k])  # that clock's stamp
            assert time == pytest.approx(first + delay[k] - delay[0], abs=1e-12)
            assert imu["accelerometer"]["time_offset_sd_s"] == pytest.approx(1e-3, rel=0.01)
        assert yaml.safe_load(text)[f"imu{k}"]["time_offset"] == found
        assert yaml.safe_load(text)[f"imu{k}"]["update_rate"] == known["log_rate"][k]
    assert "at the stamp 40.000000; it falls by 3e-05" in text


def test_links_have_names_that_a_urdf_may_have():
    labels = ["1", "/imu1", "imu1", "front left", "imuarray"]
    assert _link_names(labels) == ["imu_1", "imu1", "imu1_3", "imu_front_left", "imuarray_5"]


def test_joints_and_rows_are_the_document_s(made):
    calibration = made[0]
    document = json.loads(imuarray.export(calibration))
    robot = ElementTree.fromstring(imuarray.export(calibration, "urdf"))
    assert len(robot.findall("link")) == 5
    rows = csv.DictReader(io.StringIO(imuarray.export(calibration, "csv")))
    table = list(rows)
    for k, (imu, joint) in enumerate(zip(document["imus"], robot.findall("joint"), strict=True)):
        origin = {
            name: [float(x) for x in text.split()] for name, text in joint.find("origin").items()
        }
        assert origin["xyz"] == imu["position_m"]
        turn = Rotation.from_euler("xyz", origin["rpy"]).as_matrix()
        np.testing.assert_allclose(turn, np.array(imu["rotation"]).T, atol=1e-14)
        assert [float(table[k][f"{axis}_m"]) for axis in "xyz"] == imu["position_m"]
        assert [float(table[k][f"{axis}_sd_m"]) for axis in "xyz"] == imu["position_sd_m"]
        turn = Rotation.from_rotvec([float(table[k][f"turn_{axis}_rad"]) for axis in "xyz"])
        np.testing.assert_allclose(turn.as_matrix(), imu["rotation"], atol=1e-14)


@pytest.mark.parametrize("upper", [True, False])
def test_the_turns_sds_are_those_of_drawn_maps(made, upper):
    """1500 draws of what first order left, seed 2: 5 sds of an sd are 9 %."""
    from imuarray.analysis.formats import lower_times_rotation, turn_sds
    from imuarray.firstorder.turns import upper_times_rotation

    calibration = made[0]
    part = upper_times_rotation if upper else lower_times_rotation
    matrices = np.linalg.inv(calibration["accelerometer_inverse"].to_numpy()[0])
    turns = np.array([part(matrix)[1] for matrix in matrices])
    own, others = turn_sds(calibration, turns, turns)
    left = calibration["map_covariance"].to_numpy()
    draws = np.random.default_rng(2).multivariate_normal(np.zeros(36), left, 1500)
    seen = []
    for draw in draws.reshape(-1, 4, 3, 3):
        drawn = np.array(
            [part(m @ (np.eye(3) + d))[1] for m, d in zip(matrices, draw, strict=True)]
        )
        apart = drawn if upper else drawn @ drawn[0].T
        exact = turns if upper else turns @ turns[0].T
        seen.append(Rotation.from_matrix(apart @ np.swapaxes(exact, 1, 2)).as_rotvec())
    np.testing.assert_allclose(np.std(seen, axis=0), own if upper else others, rtol=0.1, atol=1e-12)


def test_noise_is_that_of_a_still_recording_of_the_same_imus(made):
    calibration, noise = made[0], imuarray.allan(still(4, samples=20000))
    found = yaml.safe_load(imuarray.export(calibration, "kalibr", noise))
    assert found["imu2"]["accelerometer_noise_density"] == pytest.approx(2e-3, rel=0.05)
    assert found["imu2"]["accelerometer_random_walk"] == pytest.approx(5e-4, rel=0.5)
    text = imuarray.export(calibration, "kalibr", noise)
    assert text.count("gyroscope_random_walk: left open, below ") == 4
    with pytest.raises(InputError, match="expected that of accelerometer 3, found none"):
        imuarray.export(calibration, "json", imuarray.allan(still(2, samples=1000)))


def test_what_is_not_to_be_trusted_says_so_in_every_file(made, tmp_path, capsys):
    reason = "the array comes out 57 times <too> -- large"
    cal = tmp_path / "cal.nc"
    write_netcdf(made[0].assign_attrs(trust([reason])), cal)
    for number, format in enumerate(("json", "kalibr", "urdf", "csv")):
        out = tmp_path / format
        assert main(f"export {cal} --format {format} --json --out {out}".split()) == 3
        said = json.loads(capsys.readouterr().out)
        assert said["trusted"] is False and reason in said["reasons"][0]
        text = out.read_text()
        assert "57 times" in text and (number > 0 or json.loads(text)["reasons"] == [reason])
    ElementTree.fromstring((tmp_path / "urdf").read_text())
    write_netcdf(made[0].assign_attrs(trust()), cal)
    assert main(f"export {cal} --format csv --quiet --out {tmp_path / 'csv'}".split()) == 0
    assert pd.read_csv(tmp_path / "csv").trusted.all()


DAMAGED = {
    "found no position": lambda data: data.drop_vars("position"),
    "finite numbers": lambda data: data.assign(
        accelerometer_offset=np.nan * data.accelerometer_offset
    ),
    "mirror nothing": lambda data: data.assign(gyroscope_inverse=0 * data.gyroscope_inverse),
    "all of its parameters": lambda data: data.isel(
        parameter=slice(0, 5), unknown=slice(0, 14), unknown_other=slice(0, 14)
    ),
    "rotations as axes": lambda data: data.assign(accelerometer_axes=-data.accelerometer_axes),
    "a rate in Hz": lambda data: data.assign_attrs(rate="fast"),
    "JSON list": lambda data: data.assign_attrs(reasons="{"),
    "expected any of json": None,
}


@pytest.mark.parametrize("match", DAMAGED)
def test_a_damaged_calibration_or_another_format_is_one_line(made, match):
    change = DAMAGED[match]
    with pytest.raises(InputError, match=match):
        imuarray.export(*((made[0], "yaml") if change is None else (change(made[0]),)))
