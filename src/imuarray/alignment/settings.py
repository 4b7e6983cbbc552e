"""Every number that common instants rest on and that no equation gives: value, unit, origin."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Settings:
    """Numbers of clocks, stamps and resampling, set by judgement; `SETTINGS` are those in use."""

    # `align`
    paces: tuple[float, ...] = (1e9, 60.0, 20.0, 5.0)  # s between knots of a slow pace
    run: float = 8.5  # steps, beyond which a gap begins another run
    least_run: int = 16  # readings of a run
    rounded: int = 3  # different steps of rounded stamps
    fast_quantile: float = 0.75  # quantile of the readings' change, above which stamps show in them
    slower: float = 1.5  # times the common rate, from which a sensor's readings are averaged
    averaging_missed: float = 0.3  # of the noise that is left, what averaging may miss
    shortest: int = 100  # readings of a sensor, and common instants
    unbroken: int = 32  # readings of a sensor, but for a few missing ones
    paused: int = 100  # times as long as its readings take, which a log may last
    uneven: float = 2.0  # s, by which logs may begin and end apart without a line
    # `clocks`
    coarse: float = 0.01  # s, of the grid on which speeds are compared
    window: float = 20.0  # s, of the piece of a log that is looked for
    hop: float = 5.0  # s, to further ones around it
    ahead: float = 0.05  # s, that a further piece may be off beside what the drift does
    fastest_clock: float = 1e-3  # of a clock against another
    same_motion: float = 0.9  # correlation of two speeds from which they are one motion
    nearly: float = 0.02  # of correlations, within which two places are equally good
    pieces: int = 8  # that are tried
    slack: float = 0.05  # sd of the map's entries about a rotation
    wild: float = 0.25  # of the usual step, that stamps may be wrong
    block: float = 0.5  # s, within which residuals may be alike
    steps: int = 20  # of Gauss-Newton
    close: float = 1e-9  # s, a step that ends the search
    # `resample`
    degree: int = 5  # of the spline
    reach: int = 8  # readings, or knots, beside a rail that show in the spline: 0.43^8 is 0.1 %
    widest: int = 8  # readings that may be missing in a row where the motion is slow enough
    segment: int = 128  # readings in a piece of the spectrum
    noisy: float = 3.0  # times the declared noise that a sensor's own may be
    moving: float = 10.0  # times the noise, from which a piece of the log shows motion
    shocks: float = 0.1  # of these pieces, the worst, that do not count
    # `found`
    noisy_residual: float = 3.0  # times the noise, from which a residual is explained
    jitter: float = 5e-6  # s, that is said
    smallest_sd: float = 1e-4  # degrees, ms or ppm: an sd that is shown


SETTINGS = Settings()
