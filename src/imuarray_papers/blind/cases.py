"""Cases by name, those that a scale asks for, and the recording and truth a seed makes of one."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass

import numpy as np

from imuarray.recording import Recording
from imuarray.streams import stream
from imuarray_papers.blind.change import noisy_readings
from imuarray_papers.blind.inject import CATALOGUE, EFFECTS, GAUGE, OUTSIDE
from imuarray_papers.blind.scene import Scene
from imuarray_papers.blind.sizes import scale_to, size_of

KINDS = ("clean", "one", "pair", "gauge", "outside", "struck")
EXACT_STEPS = 4  # Gauss-Newton steps behind `sigma_exact`
SIZES = (4.0, 8.0, 12.0, 20.0, 50.0, None)
OUTSIDE_SIZES = (20.0, 50.0)
PAIR_SIZE, STRUCK_SIZE = 12.0, 20.0
HOW_MANY = ("one", "all")
# Repeats of each set: "one" per effect, size and number of IMUs; "gauge" per gauge; "outside" per
# effect, size and number of IMUs; "struck" per effect and number of IMUs.
REPEATS = {
    "default": {"clean": 400, "one": 2, "pair": 120, "gauge": 4, "outside": 2, "struck": 1},
    "paper": {"clean": 600, "one": 8, "pair": 800, "gauge": 20, "outside": 6, "struck": 4},
}
# The quick scale takes so many of the default one, evenly spread.
QUICK = {"clean": 4, "one": 12, "pair": 4, "gauge": 3, "outside": 4, "struck": 3}
# Settings and how often: the criteria are for 8 IMUs, 125 Hz, 24 s.
SETTINGS = (
    (0.68, {}),
    (0.17, {"rails": True}),
    (0.05, {"imus": 32, "duration": 8.0}),
    (0.05, {"sampling_rate": 62.5, "duration": 8.0}),
    (0.05, {"sampling_rate": 500.0, "duration": 8.0}),
)


@dataclass(frozen=True)
class Case:
    """A recording to be made: effects, and what they are injected into.

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
    changes = []
    for effect, sensors in case.effects:
        directions, entry = int(rng.integers(2**63)), EFFECTS[effect]
        amplitude = entry.realistic(rng)
        if case.sigma is not None and entry.scalable:
            amplitude = scale_to(scene, effect, sensors, directions, case.sigma)
        changes.append(entry.draw(scene, np.random.default_rng(directions), sensors, amplitude))
    readings = noisy_readings(scene, changes, rng)
    recording = Recording(
        time=scene.time, specific_force=readings.force, angular_rate=readings.rate,
        accelerometer_position=scene.array.positions, accelerometer_labels=scene.array.labels,
        gyroscope_labels=scene.array.labels, accelerometer_noise_sd=scene.noise[0],
        gyroscope_noise_sd=scene.noise[1], accelerometer_range=scene.limits[0],
        gyroscope_range=scene.limits[1], position_prior_sd=scene.position_prior_sd,
        source="simulated", accelerometer_axes=scene.array.axes,
    )  # fmt: skip
    effects = []
    for change in changes:
        labels = [scene.array.labels[k] for k in change.sensors]
        effects.append({
            "effect": change.effect,
            "sensors": ["all"] if len(labels) == scene.accelerometers else labels,
            **change.described(), "sigma": size_of(scene, change),
            "sigma_exact": size_of(scene, change, EXACT_STEPS),
        })  # fmt: skip
    at_rail = recording.at_rail("accelerometer") | recording.at_rail("gyroscope")
    return recording, {
        "case": asdict(case), "seed": int(seed), "effects": effects,
        "sigma": size_of(scene, changes), "sigma_exact": size_of(scene, changes, EXACT_STEPS),
        "struck": list(case.struck), "positions_m": scene.positions.tolist(),
        "at_rail": float(at_rail.mean()),
    }  # fmt: skip


HIDDEN = ("lever_arms", "drawn", "nothing")
HIDDEN_SIZES = 12.0, 30.0  # sigma


def hidden(which: str, seed: int) -> Case:
    """One of `HIDDEN`: what is hidden, drawn from ``seed``, the scene and noise alike for all.

    Lever arms are those of all IMUs, of a realistic size; "drawn" is any scalable effect of the
    catalogue in one IMU.
    """
    rng, effects, sigma = stream(seed, "blind", "hidden", which), (), None
    if which == "lever_arms":
        effects = (("size_effect", tuple(range(8))),)
    elif which == "drawn":
        name = str(rng.choice([name for name in CATALOGUE if EFFECTS[name].scalable]))
        effects, sigma = ((name, (int(rng.integers(8)),)),), float(rng.uniform(*HIDDEN_SIZES))
    return Case("hidden", effects, sigma, kind="one" if effects else "clean")


def matrix(scale: str = "default") -> list[Case]:
    """The cases of a scale, always the same: "quick" (30), "default" (1200), "paper" (4068).

    Raises ValueError for another scale.
    """
    if scale not in ("quick", *REPEATS):
        raise ValueError(f"scale: expected quick, default or paper, found {scale!r}")
    repeats = REPEATS["default" if scale == "quick" else scale]
    found = []
    for kind in KINDS:
        rng = stream(0, "blind", "matrix", kind)
        plans = list(_plans(kind, repeats[kind], rng))
        cases = [_case(kind, number, *plan, rng) for number, plan in enumerate(plans)]
        if scale == "quick":
            count = QUICK[kind]
            cases = [cases[(2 * i + 1) * len(cases) // (2 * count)] for i in range(count)]
        found += cases
    return found


def _case(kind: str, number: int, names, wanted, sigma, rng) -> Case:
    """One case; ```wanted``` says for each effect on how many IMUs: one, two or all."""
    shares, settings = zip(*SETTINGS, strict=True)
    setting = settings[rng.choice(len(settings), p=shares)]
    if "saturation" in names and "all" in wanted:
        # where every IMU has lost the samples at the declared rail, no such effect is small
        setting = {name: value for name, value in setting.items() if name != "rails"}
    imus = setting.get("imus", 8)
    counts = {"one": 1, "two": 2, "all": imus}
    effects = tuple(
        (name, tuple(sorted(int(k) for k in rng.permutation(imus)[: counts[how]])))
        for name, how in zip(names, wanted, strict=True)
    )
    level = "realistic" if sigma is None else f"{sigma:g}sigma"
    words = [kind, f"{number:04d}", *("+".join(pair) for pair in zip(names, wanted, strict=True))]
    label = "-".join(words + ([level] if names else []))
    return Case(label, effects, sigma, kind=kind, **setting)


# Of one effect: which, at which sizes (an effect without an amplitude to set comes so many times
# instead), on how many IMUs.
SINGLE = {
    "one": (CATALOGUE, SIZES, 3, HOW_MANY),
    "gauge": (GAUGE, (), 1, ("all",)),
    "outside": (OUTSIDE, OUTSIDE_SIZES, 2, HOW_MANY),
    "struck": (CATALOGUE, (STRUCK_SIZE,), 1, HOW_MANY),
}


def _plans(kind: str, repeats: int, rng) -> Iterator[tuple]:
    """Effects, on how many IMUs each is, and their size in sigma, of the cases of a kind."""
    if kind == "clean":
        yield from [((), (), None)] * repeats
    elif kind == "pair":
        names = [name for name in CATALOGUE if EFFECTS[name].scalable]
        for _ in range(repeats):
            chosen = tuple(names[k] for k in sorted(rng.permutation(len(names))[:2]))
            wanted = tuple(rng.choice(["one", "two", "all"], 2, p=[0.55, 0.15, 0.3]).tolist())
            yield chosen, wanted, PAIR_SIZE
    else:
        names, sizes, without, wanted = SINGLE[kind]
        for name in names:
            for sigma in sizes if EFFECTS[name].scalable else (None,) * without:
                for how in wanted:
                    yield from [((name,), (how,), sigma)] * repeats
