"""Every number that a doubt rests on: value, unit, origin."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Settings:
    """Thresholds of the tests, from real and simulated boards; `SETTINGS` are those in use."""

    # `checked`
    same_board: float = 5.0  # prior sds by which two drawings of one board may differ
    indefinite: float = 1e-3  # of a correlation matrix' least eigenvalue; rounding leaves less
    # `drawing`
    alarm: float = 1e-6  # p value from which a departure is no chance: 4.9 sds
    sizes: tuple[float, ...] = (0.5, 2.0)  # beyond these the size is the first thing to be said
    far: float = 5.0  # sds
    same_shape: float = 0.3  # of the drawing's own size: shapes that agree to this are one shape
    flat: float = 0.02  # of the largest extent: a board in one plane
    unexplained: float = 0.1  # of chi-square may an explanation leave
    as_good: float = 10.0  # chi-square by which another explanation may be worse and still be named
    # `misfit`
    unsteady: float = 2.5  # times what noise explains between parts; 1.3 at most of sound ones
    unsteady_alone: float = 1.5  # times the other IMUs': what disturbs one disturbs all a little
    residual: float = 3.0  # times the declared noise: widths are too small
    changed: float = 0.1  # share of the motion in which a triad's is too large, or is not
    changed_within: float = 0.4  # the same between the first such stretch and the last
    pose_noise: float = 3.0  # times the noise of a pose's mean; real boards have up to 1.9
    pose_residual: float = 0.01  # m/s^2, a residual that matters: 0.1 % of gravity
    smoothed: float = 0.5  # correlation of neighbours; a low pass at a fifth of the rate makes 0.3
    common_scale: float = 0.03  # of all gyroscopes' common scale: three of its prior's sds
    common_scale_seen: float = 5e-3  # the same, where the axes' own scales scatter by less
    # `reasons`
    growth: float = 6.0  # sds of the growth; clean and real boards' is within one
    alone: float = 20.0  # of chi-square, by which one IMU's move explains more than a growth
    droop: float = 6e-5  # s^2, that a filter may droop by more than the other kind's; 15 Hz alone
    package: float = 2.5e-3  # m, from an accelerometer's middle; packages are 3 to 5 mm wide
    maps_chance: float = 1e-5  # chance of maps so far from those that poses gave
    triad_residual: float = 10.0  # the same of one triad where the noise of each is estimated
    drift: float = 3.0  # sds of the mean of all samples; offsets that differ by more bias positions
    learnt: float = 0.5  # of the drawing's sd: positions known worse are hardly learnt
    better_elsewhere: float = 1.2  # times less residual; 1.003 of the right board, 2 of another
    same_rate: float = 0.1  # relative difference of rates, up to which they are of one recording
    short: float = 60.0  # s
    # `rigid`
    known_axis: float = 0.03  # of the largest moment: turning about an axis with less is not seen
    step_spread: float = 0.1  # of the usual step, by which neighbours' stamps may differ from it
    moves: int = 9
    few_samples: int = 20  # samples, that anything is said of
    most_samples: int = 20_000  # samples that are looked at
    stretch: int = 500  # of them in a row
    fewest_pairs: int = 60  # pairs of neighbouring samples
    coherent: float = 0.9  # correlation below which the samples are no course of one smooth motion
    near_twice: float = 0.3  # of a step's length, that it may be off twice the stamped one
    least_skipped: int = 5  # such steps, and times as many as those that seem not to be there
    slope: float = 0.015  # gyroscopes' filters and scales make less
    coarse: float = 3 * 11 / 720 * 144  # three times a single wave's: several have more fast ones
    # `suspects`
    far_triad: float = 4.0  # times the median triad's error, and the declared noise
    suspect_left: float = 0.35  # of the error must be left at most
    least_lag: float = 0.3  # samples
    gravity_within: float = 0.05  # of gravity; raw accelerometers are off by some per cent
    wrap_jump: float = 1.6  # of the largest reading, a jump that is a wrap
    least_wraps: int = 3  # of them, that are no chance
    end_readings: int = 10  # readings at a channel's end: a rail
    end_ratio: int = 5  # times those at the values next to it
    decimals: int = 9  # to which readings are equal again when a correction is undone
    slope_within: float = 0.1  # of one: a slope that a factor makes so is right


SETTINGS = Settings()
