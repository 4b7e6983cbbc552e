"""Every number that first order rests on and that no equation gives: value, unit, origin."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Settings:
    """Numbers of still poses, moves and noise, set by judgement; `SETTINGS` are those in use."""

    # `still`
    averaged: float = 1.0  # s, of the averages whose spread is a pose's
    average_block: float = 0.25  # s, of those that noise is estimated from
    window: float = 1.0  # s, over which a reading's spread is judged
    shortest: float = 3.0  # s, of a pose by default, its ends included
    kept: float = 2.0  # s, of a pose after its ends are cut, that no margin is taken from
    threshold: float = 3.0  # times the noise floor
    dead_band: float = 0.5  # of still readings, from which 0 is a dead band's
    floor: float = 0.02  # quantile of the windows' spreads taken as the noise floor
    moving: float = 10.0  # a floor so many times the declared noise is motion: nothing was still
    bridged: float = 0.1  # s; a pose goes on over so short a gap, and where stamps are late
    missed: float = 3.5  # steps; and where so many are missing
    step_time: float = 0.25  # s, before and after an instant, whose means are compared
    step: float = 0.3  # m/s^2 between them: another pose, with nothing recorded on the way
    turning_together: float = 0.1  # relative, what they agree to then
    bursts: float = 2.0  # of the mean step over the usual one; gaps beyond `lost` are not counted
    lost: float = 1.0  # s
    turn_far: float = 1.0  # of a turn's matrix from the identity: 41 degrees
    enough: int = 20_000  # samples that tell how triads are turned
    # `correct`
    orientations: float = 0.2  # of gravity, root of the sum of squares: more than two orientations
    # `triads`
    triad_steps: int = 100  # of Gauss-Newton
    triad_halvings: int = 12  # of a step that raises the cost
    triad_close: float = 1e-8  # sds, a step that ends the search
    # `outliers`
    pose_outlier: float = 5.0  # times the median size of a residual
    pose_shared: float = 5.0  # times the median gain of leaving out a pose, its worst triad's not
    gravity_gone: float = 0.07  # of gravity: readings without it; those in g have a tenth
    gravity_alike: float = 0.2  # relative sd of sizes in the poses, below which it is there
    gravity_off: float = 0.5  # relative, of a pose's mean specific force from gravity
    poses_left_out: float = 0.2  # of a triad's poses
    pose_nearly: float = 0.5  # of the largest gain: as many triads leave out a reading at once
    # `pose_noise`
    walk_gain: float = 2.0  # nats that a walk must gain
    walk_seen: float = 1.2  # times the noise; a walk is looked for beyond
    walk_range: tuple[float, ...] = (1e-4, 1e8)  # in a second, of an average's variance
    walk_freedom: float = 15.0  # of a triad's averages, from which its own walk and noise are asked
    walk_steps: int = 60  # of the search for each triad's own walk
    walk_close: float = 0.02  # relative change that ends it
    # `moves`
    least_moves: int = 4  # moves
    longest_move: float = 30.0  # s; drift is too large beyond
    farthest_move: float = 30.0  # rad; other errors are too large beyond
    move_bridged: float = 3.5  # steps between samples, over which a spline is good enough
    most_bridged: float = 0.02  # rad, the way over longer gaps: by so much it may be off
    longest_gap: float = 0.15  # s; a turn may hide in a longer one
    map_prior: float = 0.01  # sd about the identity of scales and skews
    turn_prior: float = 0.1  # rad, of a turn
    move_freedom: float = 4.0  # of the t distribution of a move's error
    move_steps: int = 30  # of Gauss-Newton
    move_close: float = 1e-8  # in the map's entries, a step that ends the search
    # `gyroscopes`
    least_moving: int = 100  # moving samples
    weakest_axis: float = 1e-3  # smallest share of the weakest axis in the mean squared rate
    same_size: tuple[float, ...] = (0.5, 2.0)  # of two gyroscopes' rates; else a channel is wrong
    gyroscope_block: float = 1.0  # s, within which residuals may be alike
    robust_steps: int = 5  # of reweighting
    odd_scale: float = 1e-4  # chance of a mean of all axes' scales, by how they scatter
    wrong_rate: float = 1.0  # prior odds that a declared rate is a chip's own, not a crystal's
    wrong_stamps: float = 0.05  # the same of stamps
    wrong_by: float = 0.01  # sd of how much they are off then: data sheets say 1 to 5 % at most
    unlikely: float = 0.05  # chance, below which intervals of 95 % need not heed it
    recordings_apart: float = 1000.0  # s, between recordings that are looked at as one
    # `noise`
    bins: int = 8  # an octave
    slowest: int = 16  # the share of the readings' rate up to which noise is fitted, 1 in so many
    least_coefficients: int = 16  # coefficients; fewer say nothing of a spectrum
    noise_gain: float = 4.5  # nats, those of three sds, from which a term is there
    noise_close: float = 2.0  # nats, up to which flicker and walk are not told apart
    line: float = 1e-6  # chance of a power from which it is a line's
    one_sided: float = 1.645**2 / 2  # nats by which a limit of 95 % is less likely
    limit_farthest: float = 1e4  # of a limit's square over the least that is looked at
    limit_halvings: int = 24  # of the interval that it is looked for in
    long_stretch: float = 0.5  # of the longest still stretch: what is pooled with it lasts as long
    # `rails`
    coupled: float = 0.1  # entry of the correction from which a rail shows in the other axis, too
    # `report`
    walk_apart: float = 3.0  # times the usual walk, from which a sensor's is told by itself


SETTINGS = Settings()
