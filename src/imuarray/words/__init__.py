"""Numbers with units, and effects, in the words that people read.

What leaves the room: the functions below, which pages, pictures, messages and `diagnosis.json` use.
"""

from imuarray.words.effects import (
    equation,
    imus_named,
    in_short,
    lags_apart,
    meaning,
    part_in_words,
    sensors_of,
    sentences,
    spelled,
    split_name,
)
from imuarray.words.numbers import (
    DEGREE,
    NARROW,
    first_up,
    fixed,
    joined,
    number,
    plus_minus,
    power_of_ten,
    probability,
    quantity,
    ratio,
    shown_in,
    span,
    symbols,
    unit_shown,
)
