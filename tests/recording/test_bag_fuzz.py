"""Damaged bags: one line, or readings of the topics' shapes; no other exception, no hang.

Neither ROS 1's format nor SQLite's has a checksum: numbers may be wrong.
"""

import shutil

import numpy as np
import pytest

from imuarray.recording.bags import read_bags
from imuarray.recording.table import read_tables
from tests.bag_writer import KINDS, write
from tests.recording.test_bags import TOPICS, put, readings, rig
from tests.recording.test_csv_logs import put as put_tables
from tests.recording.test_csv_logs import three
from tests.recording.test_fuzz import damaged, outcome

FILES = 40


@pytest.mark.parametrize("kind", KINDS)
def test_bags(tmp_path, kind):
    read = attempts(tmp_path, kind, FILES, seed=6)
    assert 0 < read


def tables(*given):
    return read_tables(*given)[0]


def attempts(folder, kind: str, count: int, seed: int) -> int:
    """How many of ``count`` damaged bags are read, each in one of its files."""
    rng, read = np.random.default_rng([seed, KINDS.index(kind)]), 0
    columns = put(folder, rig())
    whole = write(folder / "whole", kind, readings(6))
    files = [whole] if whole.is_file() else sorted(whole.iterdir(), reverse=True)
    contents = [file.read_bytes() for file in files]
    bag = folder / whole.name.replace("whole", "bag")
    for _ in range(count):
        if whole.is_dir():
            shutil.rmtree(bag, ignore_errors=True)
            bag.mkdir()
        # the description of a bag now and then, else what it holds
        which = len(files) - 1 if rng.integers(5) == 0 else 0
        for i, (file, content) in enumerate(zip(files, contents, strict=True)):
            place = bag / file.name if whole.is_dir() else bag
            place.write_bytes(damaged(rng, content) if i == which else content)
        found = outcome(lambda: read_bags([bag], columns))
        if found is not None:
            read += 1
            assert [log.label for log in found.logs] == list(TOPICS)
            assert all(x.specific_force.shape == (len(x.accelerometer_time), 3) for x in found.logs)
            assert all((np.diff(x.gyroscope_time) > 0).all() for x in found.logs)
    return read


@pytest.mark.parametrize("kind", ["mcap", "csv"])
def test_descriptions(tmp_path, kind):
    read = descriptions(tmp_path, kind, 5 * FILES, seed=7)
    assert 0 < read


def descriptions(folder, kind: str, count: int, seed: int) -> int:
    """How many of ``count`` descriptions of a rig's logs, but the first damaged, describe them."""
    rng, read = np.random.default_rng(seed), 0
    if kind == "csv":
        stamps, files = three()
        put_tables(folder, files)
        logs, reader = [folder / f"{name}.csv" for name in stamps], tables
    else:
        put(folder, rig())
        logs, reader = [write(folder / "run", kind, readings(4))], read_bags
    content = (folder / "rig.yaml").read_bytes()
    for i in range(count):
        (folder / "rig.yaml").write_bytes(damaged(rng, content) if i else content)
        found = outcome(lambda: reader(logs, folder / "rig.yaml"))
        if found is not None:
            read += 1
            assert 0 < len(found.logs) <= 4 and found.position_prior_sd > 0
    return read
