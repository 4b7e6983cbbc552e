"""Every number that a diagnosis rests on and that no equation gives: value, unit, origin."""

from dataclasses import dataclass

from imuarray.model.effects import known_effect


@dataclass(frozen=True)
class Settings:
    """Numbers of a diagnosis, all of one origin or another; `SETTINGS` are those in use.

    The critical values come from simulations. The others were set by judgement while the procedure
    was made: what they lead to together is held by the tests on injected effects
    (tests/diagnosis/test_diagnose.py) and by the blind study.
    """

    # Critical values, from simulating the whole procedure on clean recordings
    # (benchmarks/thresholds.py): all tests together give under 5 % of false alarms.
    effect: float = -7.5  # log p of an effect's best test, its IMUs and forms allowed for
    beside: float = 4.0  # nats more of one beside others, which leave something of themselves
    check: float = -7.5  # log p of a check of what is left
    share: float = 0.002  # of the base model's excess that a cause must explain
    explained: float = 0.99  # share of the excess from which failing checks are within tolerance
    rival: float = 3.0  # log p by which another effect may be worse and be listed beside a cause
    alike: float = 0.64  # share of an adopted effect's signal from which another is of its class
    # Readings (`reading_effects`, `final_checks`, `procedure`)
    searched: int = 4096  # samples; of longer recordings, stretches spread over all of it
    large: int = 32  # IMUs; of more, so many samples less
    equal: float = 1e-9  # m/s^2 or rad/s, relative above 1: rounding of maps put back
    repeats_block: int = 64  # samples in which axes repeat alike often by chance
    least_clipped: int = 3  # readings at one value that make a rail
    rare_repeats: float = -12.0  # log p from which repeats are no chance of a coarse converter
    near_turn: float = 0.5  # norm by which a triad's matrix may miss a signed permutation
    alone: float = 1.5  # times farther than any other reading of its triad
    next_largest: int = 30  # readings after the largest that show its usual shortfall
    same: float = 1e-9  # relative difference of equal readings
    least_log: float = -700.0  # of a tail that a double holds
    # Score tests and adoption (`scores`, `adoption`, `state`, `special`)
    observed: float = 1e-5  # of a parameter's own information must survive the projection to count
    visible: float = 1e-3  # the same of a combination that is no gauge of motion and positions
    patience: int = 16  # refusals in a row: what is left is none of the catalogue
    of_one: int = 4  # of them, of one effect: rough motion makes it significant in all IMUs
    most_causes: int = 12  # causes
    others: float = -4.6  # log p of the other IMUs having what some surely have: chips are alike
    kept: float = 0.05  # of the gain that a test predicts must be there on held-out time
    uncertain: float = 50.0  # nats; smaller predicted gains need not be confirmed
    most: float = 0.67  # share of a wider test (of all IMUs) that a narrower must have to go first
    pruned: float = 0.8  # of a cause's gain that some of its IMUs must keep, where motion is rough
    least_z: float = 1.5  # standard errors that a gain on held-out time must have
    rough_z: float = 2.0  # the same where the motion is rough, and few stretches decide
    trace: float = 2e-5  # of the excess there was at first: least chi-square of a cause
    rough_share: float = 5.0  # factor of `share` where motion is rough
    steady_noise: float = 0.02  # relative change of a noise sd below which a fit is not repeated
    steady_size: float = 0.1  # relative change of an effect's size, likewise
    sizings: int = 5  # times that sizes are estimated again after a fit
    likely_drift: float = -4.6  # log p of a drift beside an adopted bias
    changing: float = 0.05  # of a drift's chi-square that its change must gain
    steady_drift: float = -50.0  # log p of a drift that does not change: it is misattributed
    power: float = 0.8  # chance to be named of an effect of the size that is stated
    # Clocks and shifts (`state`, `scans`)
    jitter: float = 0.04  # the same where clocks were estimated from the gyroscopes
    cuts: int = 24  # instants tried at first
    # paces of a course, in the recording's length
    paces: tuple[float, ...] = (-8.0, -4.0, -2.0, 0.0, 2.0, 4.0, 8.0, 16.0, 32.0)
    settled_pace: float = 8.0  # what is over in so short a part is called constant
    zeros: tuple[float, ...] = (-1.0, 2.0)  # of a course from 0 to 1, where all offsets may vanish
    # Noise (`noise`, `noise_effects`, `procedure`)
    least_noise: float = 1e-3  # of the declared sd
    far: float = 4.0  # sds of a difference; beyond is an outlier's
    flat: float = 0.02  # autocorrelation too small to speak of
    most_alike: float = 0.98  # autocorrelation beyond which noise is a drift
    instants: int = 64  # at which is looked what the motion passes on from triad to triad
    least_passed: float = 0.1  # of the largest such share, below which combinations are not told
    told: float = 0.5  # of a triad's noise that must be its own, once what is passed on is undone
    bands: tuple[float, float] = (0.2, 0.35)  # of the sampling rate, where the two bands begin
    coloured: float = 4.5  # sds of the spectrum's slope from which noise is not white
    few: int = 4  # outliers; so few are an accident, not a law
    rounds: int = 3  # in which outliers that others hide are left out
    leaks: float = 0.1  # of a triad's tails that the motion may pass on to others
    maybe: float = -3.0  # log p of one triad's tails, where another's are sure
    agree: float = 3.5  # sds within which two estimates are of one thing
    agree_share: float = 0.5  # of a spectrum's slope, by which colour of another form may differ
    clear: float = 2.5  # sds of a triad's autocorrelation, where all together are beyond doubt
    tailed: float = 0.25  # log ratio by which a mixture's core may miss the noise
    pooled: float = 0.025  # sd of a triad's log noise about that of all, without maps of a few %
    delayed: float = 0.1  # log ratio of noise that a delay of a prior sd may bring with it
    least_share: float = 1e-9  # share of the largest information below which there is none
    # Shocks (`shocks`)
    least_rest: float = 1.0  # degrees of freedom of a sample without its worst IMU
    least_shaken: int = 4  # IMUs; with one of fewer left out, too little is there to agree
    shaken: float = 1e-7  # chance of a sample of plain noise to be called shaken
    ringing: float = 1e-2  # the same beside a shaken sample
    few_calm: float = 0.1  # of like samples, from which they tell what several IMUs do by chance
    beside_shocks: int = 2  # samples left out on each side of a shaken one: some ringing is there
    lasting: float = 0.5  # of a shaken sample's residual that the next one has: misfit, no shock
    apart: int = 5  # samples between two shaken ones that are of two stretches
    stated: int = 20  # stretches
    calm: float = 1.5  # times the noise, up to which smooth samples of shaken motion are explained
    # Checks of what is left (`residual_checks`, `final_checks`, `document`)
    seen_feature: float = 1e-4  # of a feature's information must survive the projection
    coarse: float = 2.0  # noise sds of a step between readings
    slow: int = 3  # turns in the recording; slower ages are a drift
    around: int = 101  # frequencies that give a periodogram's level
    crowd: float = 1.3  # least variance of axes' sum over chi-square's: not quite independent
    little: float = 0.03  # of the noise's own misfit: so little left over is within tolerance
    implausible: float = 10.0  # prior sds of a parameter
    doubtful: float = 0.5  # share of a cause's gain that a placebo must not have
    replicates: int = 99
    stretches_stated: int = 3  # of the longest

    def limit(self, effect: str, beside: object = False) -> float:
        """Critical log p of an effect, ``beside`` others or not; some tests have another tail."""
        own = known_effect(effect).critical
        return (self.effect if own is None else own) - bool(beside) * self.beside


SETTINGS = Settings()
