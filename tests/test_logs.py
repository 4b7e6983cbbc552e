"""Any logger's files as one recording: tables, recordings."""

import numpy as np
import pytest

import imuarray
from imuarray.errors import InputError
from tests.test_convert_csv import read as read_table
from tests.test_convert_csv import table


def test_a_table_or_a_recording(tmp_path):
    expected = read_table(tmp_path, table())
    log, columns = tmp_path / "log.csv", tmp_path / "columns.yaml"
    found, lines, groups = imuarray.open_logs([log], columns)
    np.testing.assert_array_equal(found.specific_force, expected.specific_force)
    assert lines == [] and groups == {}
    imuarray.write_recording(found, tmp_path / "rec.nc")
    again = imuarray.open_logs([tmp_path / "rec.nc"]).recording
    np.testing.assert_array_equal(again.angular_rate, expected.angular_rate)
    with pytest.raises(InputError, match="log.csv: expected a YAML that describes it"):
        imuarray.open_logs([log])
