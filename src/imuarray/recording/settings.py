"""Every number by which a file is refused or its form recognised: value, unit, origin."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Settings:
    """Numbers of reading and checking files, set by judgement; `SETTINGS` are those in use."""

    # `channels`
    least_samples: int = 10  # samples below which equal readings may be chance
    turning: float = 0.2  # rad/s; at rest, coarse readings do repeat
    held_share: float = 0.3  # share of repeated readings; filled up from half the rate it is 0.5
    frozen: int = 20  # readings in a row
    dead_values: int = 5  # values of a dead axis that flickers
    dead_samples: int = 100  # in at least so many samples
    own_share: float = 1e-6  # of a triad's readings that is its own; noise is 2e-5 of the range
    patience: float = 60.0  # s, that reading a file may last
    patient_size: float = 500e6  # bytes, for each of which it may last as long again
    # `draft`
    draft_gravity: float = 0.2  # of one unit of gravity, by which readings at rest may be off
    spinning: float = 40.0  # rad/s, faster than a hand turns a board
    noisiest: float = 0.025  # rad/s, sd of a gyroscope's readings
    draft_rises: float = 0.9  # of a column's steps, upwards: no sensor's
    draft_rows: int = 3  # rows
    draft_stamped: float = 0.02  # of the rows have a stamp of their own
    draft_rate: float = 200.0  # Hz, the likeliest of IMUs, between units that are both possible
    draft_even: float = 0.2  # of a step between stamps, by which half of them may differ
    # `layout`
    widest: float = 2.0  # m; positions without a declared unit beyond it are in another one
    position_prior: float = 3e-3  # m, sd of nominal positions where none is declared
    # `rig`
    longest_gap: float = 86400.0  # s, between readings: beyond, common instants fit no memory
    # `table`
    few_stamps: int = 20  # stamps, of which a rate is worth looking at
    blank_share: float = 0.1  # share of blank cells from which a sensor is slower than the log
    shared_stamps: float = 0.5  # of the rows share their stamps: one row for each sensor, perhaps
    clock_sd: float = 1e-3  # of a rate that is declared: oscillators of chips are off by up to 1 %
    long_log: int = 400  # rows, in which missed readings are bridged; else a table is damaged
    # `units`
    slowest: float = 2.0  # Hz, of an IMU that is to show a motion of the hand
    fastest: float = 5e4  # Hz
    # `validate`
    gap: float = 5.0  # times the usual step, a pause to report: estimators that smooth bridge it
    beyond_range: float = 1.8  # times; turned triads reach sqrt 3: this finds wrong units
    # `written`
    sniffed: int = 1 << 16  # bytes from which an encoding is recognised
    head: int = 60  # lines among which the header is
    equal_stamps: float = 0.05  # share of rows from which equal stamps are how the logger stamps
    few_rows: int = 20  # rows, of which nothing is sure
    most_sensors: int = 64  # distinct values of a column that may number the sensors


SETTINGS = Settings()
