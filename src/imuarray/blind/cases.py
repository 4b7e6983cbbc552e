"""A case by name, and the recording and the truth that a seed makes of it."""

from dataclasses import asdict, dataclass

from imuarray.blind.change import Change, noisy_readings
from imuarray.blind.inject import CATALOGUE, EFFECTS
from imuarray.blind.scene import Scene
from imuarray.blind.sizes import draw_seeded, scale_to, size_of
from imuarray.recording import Recording
from imuarray.streams import stream

KINDS = ("clean", "one", "pair", "gauge", "outside", "struck")
EXACT_STEPS = 4  # Gauss-Newton steps behind `sigma_exact`


@dataclass(frozen=True)
class Case:
    """What to inject, and into what.

    Attributes
    ----------
    id : str
        Names the random stream, too. It may tell the effect: keep it from the diagnosis.
    effects : tuple of (effect id, tuple of IMU indices)
    sigma : float or None
        Size of each effect alone; None for a realistic amplitude. Gauges and the effects that
        are not `scalable` have realistic amplitudes whatever it says.
    imus : int, 8 or 32
    sampling_rate : float, Hz
    rails : bool
    kind : str
        One of `KINDS`; "struck" is one effect that the diagnosis must do without.
    duration : float, seconds
    """

    id: str
    effects: tuple[tuple[str, tuple[int, ...]], ...] = ()
    sigma: float | None = None
    imus: int = 8
    sampling_rate: float = 125.0
    rails: bool = False
    kind: str = "clean"
    duration: float = 24.0

    def __post_init__(self):
        """Raises ValueError for an unknown kind or effect."""
        if self.kind not in KINDS:
            raise ValueError(f"kind: expected one of {', '.join(KINDS)}, found {self.kind!r}")
        for name, _ in self.effects:
            if name not in EFFECTS:
                raise ValueError(f"effects: expected ids of the registry, found {name!r}")

    @property
    def struck(self) -> tuple[str, ...]:
        """Effects that the diagnosis' catalogue is to do without."""
        names = (name for name, _ in self.effects if name in CATALOGUE)
        return tuple(names) if self.kind == "struck" else ()


def make(case: Case, seed: int) -> tuple[Recording, dict]:
    """Simulate a case; the same case and seed give the same recording, to the last digit.

    And what is in it, in plain numbers, texts and lists: ``case`` (the fields of the `Case`) and
    ``seed``; ``effects``, a dict each: ``effect``; ``sensors``: labels, or ["all"]; ``amplitude``
    and each of ``parameters``: {"value", "unit"}, with a row for each affected sensor; ``sigma``:
    size of the effect alone, linear at the truth; ``sigma_exact``: the same minimised over motion
    and positions. ``sigma``, ``sigma_exact`` of all effects together; ``struck``: effects that the
    diagnosis is to be run without; ``positions_m`` (A, 3) relative to the reference triad;
    ``at_rail``: share of samples with any reading at a declared rail.
    """
    rng = stream(seed, "blind", case.id)
    scene = Scene.draw(rng, case.imus, case.sampling_rate, case.duration, case.rails)
    changes = [_draw_effect(scene, case, *effect, rng) for effect in case.effects]
    readings = noisy_readings(scene, changes, rng)
    recording = Recording(
        time=scene.time,
        specific_force=readings.force,
        angular_rate=readings.rate,
        accelerometer_position=scene.array.positions,
        accelerometer_labels=scene.array.labels,
        gyroscope_labels=scene.array.labels,
        accelerometer_noise_sd=scene.accelerometer_noise_sd,
        gyroscope_noise_sd=scene.gyroscope_noise_sd,
        accelerometer_range=scene.accelerometer_range,
        gyroscope_range=scene.gyroscope_range,
        position_prior_sd=scene.position_prior_sd,
        source="simulated",
        accelerometer_axes=scene.array.axes,
    )
    return recording, _truth(scene, case, seed, changes, recording)


def _draw_effect(scene: Scene, case: Case, effect: str, sensors, rng) -> Change:
    """One effect of the case at its size, or at a realistic amplitude."""
    entry = EFFECTS[effect]
    directions = int(rng.integers(2**63))
    amplitude = entry.realistic(rng)
    if case.sigma is not None and entry.scalable:
        amplitude = scale_to(scene, effect, sensors, directions, case.sigma)
    return draw_seeded(scene, effect, sensors, directions, amplitude)


def _truth(scene: Scene, case: Case, seed: int, changes, recording: Recording) -> dict:
    gone = recording.at_rail("accelerometer")
    gone |= recording.at_rail("gyroscope")
    return {
        "case": asdict(case), "seed": int(seed),
        "effects": [_described(scene, change) for change in changes],
        "sigma": size_of(scene, changes), "sigma_exact": size_of(scene, changes, EXACT_STEPS),
        "struck": list(case.struck), "positions_m": scene.positions.tolist(),
        "at_rail": float(gone.mean()),
    }  # fmt: skip


def _described(scene: Scene, change: Change) -> dict:
    """An effect as `make` gives it."""
    labels = [scene.array.labels[k] for k in change.sensors]
    return {
        "effect": change.effect,
        "sensors": ["all"] if len(labels) == scene.accelerometers else labels,
        **change.described(),
        "sigma": size_of(scene, change),
        "sigma_exact": size_of(scene, change, EXACT_STEPS),
    }
