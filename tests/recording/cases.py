"""Small tables and recordings that several tests of readers use."""

import numpy as np
import yaml

from imuarray.recording import Recording
from imuarray.recording.layout import read_layout
from imuarray.recording.table import load, recording_of

HEADER = ["t", *(f"{kind}{axis}{i}" for i in (1, 2, 3) for kind in "ag" for axis in "xyz")]
CORNERS = np.array([[0.01, 0.0, 0.0], [-0.01, 0.0, 0.0], [0.0, 0.02, 0.0], [0.0, 0.0, 0.03]])


def layout() -> dict:
    triads = {
        kind: {
            str(i): {"columns": [f"{kind}{axis}{i}" for axis in "xyz"]} for i in (1, 2, 3)
        }
        for kind in "ag"
    }  # fmt: skip
    for i, place in enumerate([[0, 0, 0], [10, 0, 0], [0, 10, 0]]):
        triads["a"][str(i + 1)]["position"] = place
    return {
        "time": {"column": "t", "unit": "ms"}, "position_unit": "mm",
        "accelerometers": {"unit": "g", "noise": 0.004, "range": 16, "triads": triads["a"]},
        "gyroscopes": {"unit": "deg/s", "noise": 0.06, "range": 2000, "triads": triads["g"]},
    }  # fmt: skip


def table(rows=4) -> list[list[str]]:
    """Header and rows of cells; each cell of a row differs."""
    cells = [[str(10 * i), *(f"{0.1 * j + 0.01 * i:.2f}" for j in range(18))] for i in range(rows)]
    return [HEADER, *cells]


def read_csv(path, columns):
    """A board's table as it is, without a look at blank cells."""
    layout = read_layout(columns)
    return recording_of(load(path, layout, columns)[0], layout, path, columns)[0]


def read(folder, rows, columns=None, delimiter=","):
    text = rows if isinstance(rows, str) else "\n".join(delimiter.join(row) for row in rows) + "\n"
    (folder / "log.csv").write_text(text)
    columns = layout() if columns is None else columns
    text = columns if isinstance(columns, str) else yaml.safe_dump(columns)
    (folder / "columns.yaml").write_text(text)
    return read_csv(folder / "log.csv", folder / "columns.yaml")


def blank(rows, columns, which):
    """The cells of ``columns`` empty in data rows ``which``."""
    places = [HEADER.index(name) for name in columns]
    return [
        ["" if i in which and place in places else cell for place, cell in enumerate(row)]
        for i, row in enumerate(rows)
    ]


def make(samples=20, gyroscopes=2, **changes):
    """A small valid recording from a fixed seed."""
    rng = np.random.default_rng(1)
    values = dict(
        time=0.01 * np.arange(samples),
        specific_force=rng.normal(0, 5, (samples, len(CORNERS), 3)),
        angular_rate=rng.normal(0, 2, (samples, gyroscopes, 3)),
        accelerometer_position=CORNERS,
        accelerometer_labels=("1", "2", "3", "4"),
        gyroscope_labels=tuple(f"g{k}" for k in range(gyroscopes)),
        accelerometer_noise_sd=0.05,
        gyroscope_noise_sd=0.01,
        accelerometer_range=156.9,
        gyroscope_range=34.9,
        position_prior_sd=1e-3,
        stationary=np.arange(samples) < 5,
        title="a title",
    )
    return Recording(**(values | changes))


def save(dataset, path):
    dataset.to_netcdf(path, engine="h5netcdf")
    return path


def one_line(info):
    text = str(info.value)
    assert "\n" not in text
    return text
