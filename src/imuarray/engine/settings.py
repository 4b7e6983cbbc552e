"""Every number that the engine rests on and that no equation gives: value, unit, origin."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Settings:
    """Numbers of the least squares, set by judgement; `SETTINGS` are those in use.

    What they lead to is held by the tests on injected effects and by the blind study.
    """

    # Readings (`readings`)
    weakest: float = 1e-2  # least information of a sample on omega_dot and s, of all readings'
    least_samples: int = 200  # samples; fewer determine next to nothing of any effect
    few: int = 4096  # samples that show in what steps a sensor reads
    same: float = 1e-9  # m/s^2 or rad/s: equal readings
    stretch: int = 128  # samples, of the stretches in which a long recording is looked at first
    most: int = 32000  # of IMUs, samples that positions are estimated from; more say little more
    window: float = 0.04  # s, length of the polynomials that give time derivatives
    slow_window: float = 0.1  # s, of those of the rate that a filter's shape multiplies
    smooth: float = 0.8  # correlation of omega's slope and omega_dot from which motion is smooth
    # Gauss-Newton over motion and parameters (`diagnosis.fit`, `parameters`, `start`)
    steps: int = 15  # Gauss-Newton steps at most
    least_step: float = 0.02  # nats; a step predicted to gain less ends the search
    rough_gain: float = 1e-4  # of the misfit that a step must gain while causes are looked for
    fine_gain: float = 3e-6  # the same at the end
    # of the misfit: a step that gains less leaves derivatives as they are; so does the next one
    # if it gains less than this of the last one's gain
    near_by: float = 0.1
    noisy: float = 1.5  # times its degrees of freedom: a misfit below it is mostly noise
    converged: float = 0.02  # of a parameter's own sd: steps below it end the search
    shortest: float = 0.2  # share of a Gauss-Newton step
    wide: float = 10.0  # prior sd of the third derivatives, in sizes of the differences near by
    gyroscopes_own: float = 2.0  # prior sd of what gyroscopes alone see of omega_dot, in its steps
    offset: float = 1e-4  # s, of what they see of omega, for each of that
    determined: float = 0.03  # of these that readings must tell, for their sds to be estimated
    widening: float = 3.0  # factor by which an iteration may change such an sd
    least_size: float = 1e-3  # of a size that is estimated, times what such sensors have
    most_size: float = 30.0  # the same
    tied: float = 1e-5  # of that sd, as long as it is not free
    near: int = 9  # samples that give the size of the motion's third derivatives
    stiff: float = 1e-3  # of a parameter's prior sd: the sd that a pinned mean keeps
    # Robust estimation of several recordings (`estimate`)
    held: int = 160000  # of IMUs, samples whose derivatives are in memory at once: half a GB
    iterations: int = 40  # Gauss-Newton steps at most
    group_steps: int = 6  # the same of the bare model, before groups of the sensor model are tried
    rung_again: int = 4  # the same while they are tried
    robust_first: int = 4  # of them with Student's t of 4, until readings far out are seen
    tails_late: int = 12  # iterations after which degrees of freedom are to go up or down only
    tails_seen: int = 5  # of them that are looked at
    alternating: float = 0.3  # of a step that the next one goes back: the valley is crossed
    farthest: float = 8.0  # of a step at once, where they go on alike
    same_pace: float = 0.1  # by which their shares of the one before may differ
    same_way: float = 0.03  # of one, that may be across
    settled: float = 0.05  # of a parameter's sd, a jackknife's where larger: shorter steps end it
    exact: float = 1e-4  # the same, where noise is fixed: a likelihood's own maximum
    same_noise: float = 0.005  # relative change of a noise sd below which it is the same
    dense: float = 0.5  # share of samples in gapless runs from which neighbours are looked at
    longest_step: float = 0.025  # s, between neighbours: longer ones say nothing of derivatives
    # Parameters alike on all triads (`alike`)
    least_told: float = 1.0  # differences that readings must tell, for their size to be estimated
    # Held-out time (`heldout`)
    blocks: int = 10  # blocks of time that are held out in turn
    # Clocks by what a delay would gain (`clocks`)
    sawtooth: float = -10.0  # log p of a sawtooth beyond a constant delay
    many: float = 2.6  # log of the independent sawtooths per sample, from simulated white scores
    fair: float = 0.05  # of the constant delay's chi-square that a sawtooth must add
    least_period: float = 3e-5  # s, of a clock: no IMU samples faster than 32 kHz
    least_turns: int = 3  # of a clock against the host's; fewer are a drift of the delay
    edge: float = 0.03  # of a turn: how near to a clock's jump a reading is left out
    # Clocks from the gyroscopes alone (`gyroscope_clocks`)
    enough: int = 4  # gyroscopes with a clock
    least_gyroscope_samples: int = 200  # samples at which all of them were read
    most_gyroscope_samples: int = 2500  # samples, those of the largest angular acceleration
    rounds: int = 18  # of the search
    reach: float = 0.1  # turns, rms, by which a first guess may be off
    drawn_in: float = 0.85  # factor of the reach from round to round
    declared_period: float = 0.2  # log of the found over it, beyond which the found one is used
    knot: float = 10.0  # s, of moving time between the knots of a clock's phase
    phase_rounds: int = 20  # of the search for phases
    most_knots: int = 40  # of them
    jump_jitter: float = 0.1  # turns; a reading farther off is of another turn, and tells no phase
    around_jump: float = 0.25  # turns from a clock's jump within which a reading's side is asked
    # Sizes that are estimated, and widths (`estimate`)
    smooth_share: float = 0.2  # share of rough samples that are looked at as the smooth ones
    spared: float = 1e-3  # least share of the information that blocks but one are taken to have
    # `forward`
    slow_enough: float = 0.02  # of a pair's slope, that a polynomial may make too small
    slope_agrees: float = 1.02  # times the residual that a prior of omega_dot may make
    chance: float = 1e-3  # of maps as far from those of first order, of positions as far apart
    least_difference: float = 0.03  # of the variance, by which two estimates may differ at least
    group_z: float = 2.0  # standard errors of a gain, from which a group is kept
    group_nats: float = 2.0  # nats, as well
    steady_z: float = 1.5  # the same, where smooth motion gains these without its best block:
    steady_nats: float = 10.0  # nats
    known_slope: float = 1e-2  # of angular acceleration, to which slopes know it for a curve
    curved_nats: float = 10.0  # of a curve: two seconds of clean motion had three by chance
    # `readings`
    same_maps: float = 0.05  # of their sds, from which maps are another calibration's
    walk_instants: int = 200  # instants of a walk that a polynomial is laid through
    few_steps: float = 5.5  # steps of a gap between readings that is looked at
    off_step: float = 0.12  # of a step, off a multiple
    seldom: float = 0.05  # share that is chance
    # `robust`
    least_free: float = 1e-3  # of a reading's variance that motion leaves, for its size to count
    scale_rounds: int = 20  # of the scale that goes with each of them
    least_scale: float = 1e-4  # of the declared noise
    # `fusion`
    fusion_tolerance: float = 1e-6  # sds, a step that ends the search
    fusion_steps: int = 200  # of it
    pair_turns: int = 2  # in which a pair's rate and its derivatives follow each other
    # `rough_fusion`
    rough_rounds: int = 6  # of weights and turns
    rough_near: float = 1e-2  # sds of the motion that a search may be off
    rough_freedom: float = 8.0  # degrees of freedom of a sample's noise, once its size is its own
    # `course`
    course_stretches: int = 60  # of time, at most, in which residuals are averaged
    course_samples: int = 20  # samples of one
    course_shaken: float = 1e-7  # chance of a triad's residual in plain noise: then it is far off
    course_several: int = 2  # IMUs off at once: motion faster than samples, no single bad reading
    # `start`
    known_line: float = 0.01  # of the longest arm: accelerometers nearer to a line are on it
    clear_motion: float = 10.0  # times the noise's power, from which a frequency is motion
    slope_windows: tuple[int, ...] = (1, 2, 4)  # parts of a derivative's window that are tried
    coherent_gain: float = 0.3  # sds of what a prior's samples say of one factor common to them all
    # `widths`
    map_nearly: float = 0.25  # of the largest distance of an IMU's map: as likely the one
    fixed_map: float = 1e-7  # sd of a map's entry that is known
    # `derivatives`
    most_gaps: float = 0.5  # of the samples
    # `directions`
    named_share: float = 0.5  # share of a direction that a pattern must make up to give it its name


SETTINGS = Settings()
