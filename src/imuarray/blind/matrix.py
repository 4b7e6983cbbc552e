"""Which cases a scale asks for."""

from collections.abc import Callable, Iterator

from imuarray.blind.cases import Case
from imuarray.blind.inject import CATALOGUE, EFFECTS, GAUGE, OUTSIDE
from imuarray.streams import stream

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


def matrix(scale: str = "default") -> list[Case]:
    """The cases of a scale, always the same: "quick" (30), "default" (1200), "paper" (4068).

    Raises ValueError for another scale.
    """
    if scale not in ("quick", *REPEATS):
        raise ValueError(f"scale: expected quick, default or paper, found {scale!r}")
    repeats = REPEATS["default" if scale == "quick" else scale]
    found = []
    for kind, enumerated in _KINDS.items():
        rng = stream(0, "blind", "matrix", kind)
        plans = list(enumerated(repeats[kind], rng))
        cases = [_case(kind, number, *plan, rng) for number, plan in enumerate(plans)]
        if scale == "quick":
            count = QUICK[kind]
            cases = [cases[(2 * i + 1) * len(cases) // (2 * count)] for i in range(count)]
        found += cases
    return found


def _case(kind: str, number: int, names, wanted, sigma, rng) -> Case:
    """One case; ``wanted`` says for each effect on how many IMUs: one, two or all."""
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


def _clean(repeats: int, rng) -> Iterator[tuple]:
    yield from (((), (), None) for _ in range(repeats))


def _gauge(repeats: int, rng) -> Iterator[tuple]:
    yield from (((name,), ("all",), None) for name in GAUGE for _ in range(repeats))


def _single(names, sizes, without: int) -> Callable:
    """Each effect alone at each size, on one and on all IMUs.

    An effect without an amplitude to set comes ``without`` times instead.
    """

    def plans(repeats: int, rng) -> Iterator[tuple]:
        for name in names:
            for sigma in sizes if EFFECTS[name].scalable else (None,) * without:
                for how in HOW_MANY:
                    yield from (((name,), (how,), sigma) for _ in range(repeats))

    return plans


def _pair(repeats: int, rng) -> Iterator[tuple]:
    names = [name for name in CATALOGUE if EFFECTS[name].scalable]
    for _ in range(repeats):
        chosen = tuple(names[k] for k in sorted(rng.permutation(len(names))[:2]))
        wanted = tuple(rng.choice(["one", "two", "all"], 2, p=[0.55, 0.15, 0.3]).tolist())
        yield chosen, wanted, PAIR_SIZE


_KINDS = {
    "clean": _clean,
    "one": _single(CATALOGUE, SIZES, 3),
    "pair": _pair,
    "gauge": _gauge,
    "outside": _single(OUTSIDE, OUTSIDE_SIZES, 2),
    "struck": _single(CATALOGUE, (STRUCK_SIZE,), 1),
}
