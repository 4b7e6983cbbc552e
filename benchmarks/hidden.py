"""Effects hidden at so many times the size that a diagnosis calls detectable: which are named?

    python benchmarks/hidden.py --recordings 40 --seconds 12 --seed 1 --times 0.5 1 2
    python benchmarks/hidden.py --files corrected/exp_*.nc --drawn 4 --times 2

An effect in one IMU of simulated recordings (`blind`'s own injector), or of the files given: each
of ``--effects`` in each, or ``--drawn`` ones of them in each. Named: it, one of its class, or one
that it is a part of (an offset of a drift), and its IMU; what else is named that was not before.
The same recordings without it are the controls.
"""

import argparse
import json
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import pandas as pd

from imuarray.model.effects import known_effect
from imuarray.recording import read_recording
from imuarray_papers.blind.cases import Case, make
from imuarray_papers.blind.inject import CATALOGUE
from imuarray_papers.blind.measured import SHOWN, hide

SCALABLE = [name for name in CATALOGUE if name in SHOWN]


def named(found) -> dict[str, tuple]:
    """{effect: (its class, IMUs)} of a procedure's answer."""
    items = [*found.search.causes, *found.in_noise, *found.reading_faults]
    return {i.effect: ({i.effect, *found.rivals.get(i.effect, ())}, i.imus) for i in items}


def tried(given, place, seconds, seed, times, effects, drawn):
    """Rows of one recording: {effect, times, named, right, others, recording}."""
    from imuarray.diagnosis.procedure import run_procedure

    if isinstance(given, Path):
        recording = read_recording(given)
    else:
        recording, _ = make(Case(f"power-{given}", duration=seconds), seed)
    name = given.stem if isinstance(given, Path) else given
    first = run_procedure(recording)
    before = named(first)
    classes = [{"effect": e, "indistinguishable_from": sorted(c)} for e, (c, _) in before.items()]
    document = {"causes": classes, "detectable": first.search.detectable}
    rows = [{"recording": name, "effect": "", "times": 0.0, "others": " ".join(sorted(before))}]
    wanted = [(n, (e,)) for n, e in enumerate(effects)] if not drawn else [
        (n, tuple(effects)) for n in range(drawn)
    ]  # fmt: skip
    for number, among in wanted:
        for factor in times:
            try:
                changed, truth = hide(
                    recording, document, seed + 1000 * number + place, factor, among
                )
            except ValueError:  # it has none of them that would show
                continue
            [hidden] = truth["effects"]
            after = named(run_procedure(changed))
            imu = (recording.accelerometer_labels.index(hidden["sensors"][0]),)
            mine = {e: i for e, (c, i) in after.items()
                    if hidden["effect"] in {*c, *known_effect(e).contains}}  # fmt: skip
            others = sorted(set(after) - set(before) - set(mine))
            rows.append({
                "recording": name, "effect": hidden["effect"], "times": factor,
                "named": bool(mine), "right": imu in mine.values(), "others": " ".join(others),
                "clean": imu in mine.values() and not others, "sensor": hidden["sensors"][0],
            })  # fmt: skip
            print(json.dumps(rows[-1]), flush=True)
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--files", type=Path, nargs="+", default=[])
    parser.add_argument("--recordings", type=int, default=40)
    parser.add_argument("--seconds", type=float, default=12.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--times", type=float, nargs="+", default=[1.0])
    parser.add_argument("--effects", nargs="+", default=SCALABLE)
    parser.add_argument("--drawn", type=int, default=0)
    parser.add_argument("--cores", type=int, default=2)
    given = parser.parse_args()
    asked = given.files or range(given.recordings)
    rows = []
    with ProcessPoolExecutor(given.cores) as pool:
        jobs = [
            pool.submit(tried, one, place, given.seconds, given.seed, given.times, given.effects,
                        given.drawn)
            for place, one in enumerate(asked)
        ]  # fmt: skip
        for job in jobs:
            rows += job.result()
    table = pd.DataFrame(rows)
    print(json.dumps({"seed": given.seed, "seconds": given.seconds}))
    hidden = table[table.times > 0]
    counts = hidden.groupby(["effect", "times"])[["named", "right", "clean"]]
    print(counts.agg(["sum", "count"]).astype(int).to_string())
    print(hidden.groupby("times")[["named", "right", "clean"]].agg(["sum", "count"]).to_string())
    print(hidden[hidden.others != ""].groupby(["effect", "others"]).size().to_string())
    print("controls:", table[table.times == 0].others.value_counts().to_dict())


if __name__ == "__main__":
    main()
