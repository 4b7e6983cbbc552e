"""Is an effect of the size that a diagnosis calls detectable named as often as it says?

    python benchmarks/power.py --recordings 40 --seconds 12 --seed 1 --times 0.5 1 2

Each recording is simulated and diagnosed, and again with an effect in one IMU (`blind`'s own
injector), so many times as large as `detectable` says; a row an effect.
"""

import argparse
import json
from concurrent.futures import ProcessPoolExecutor

import pandas as pd

from imuarray.blind.cases import Case, make
from imuarray.blind.inject import CATALOGUE, EFFECTS
from imuarray.blind.measured import NOT_FROM_READINGS, hide


def tried(effect, number, seconds, seed, times):
    """(named on its IMU and nothing else, named at all, other names) for each of ``times``."""
    from imuarray.diagnosis.detectable import detectable
    from imuarray.diagnosis.procedure import run_procedure

    recording, _ = make(Case(f"power-{number}", duration=seconds), seed)
    before = run_procedure(recording).search
    document = {"causes": [], "detectable": detectable(before)}
    if effect not in document["detectable"]:
        return []
    rows = []
    for factor in times:
        changed, truth = hide(recording, document, seed + number, factor, (effect,))
        found = run_procedure(changed)
        [hidden] = truth["effects"]
        causes = {c.effect: c for c in found.search.causes}
        names = {n for n in causes if n == effect or effect in found.rivals.get(n, ())}
        imu = recording.accelerometer_labels.index(hidden["sensors"][0])
        right = any(causes[n].imus == (imu,) for n in names)
        others = sorted(
            {*causes, *(i.effect for i in (*found.in_noise, *found.structural))} - names
        )
        rows.append(
            {
                "effect": effect,
                "times": factor,
                "named": bool(names),
                "right": right,
                "others": " ".join(others),
                "number": number,
            }
        )
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--recordings", type=int, default=40)
    parser.add_argument("--seconds", type=float, default=12.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--times", type=float, nargs="+", default=[1.0])
    parser.add_argument(
        "--effects",
        nargs="+",
        default=[
            name for name in CATALOGUE if name not in NOT_FROM_READINGS and EFFECTS[name].scalable
        ],
    )
    parser.add_argument("--cores", type=int, default=2)
    given = parser.parse_args()
    asked = [
        (effect, number, given.seconds, given.seed, given.times)
        for effect in given.effects
        for number in range(given.recordings)
    ]
    rows = []
    with ProcessPoolExecutor(given.cores) as pool:
        for found in pool.map(tried, *zip(*asked, strict=True)):
            rows += found
    table = pd.DataFrame(rows)
    print(json.dumps({"seed": given.seed, "seconds": given.seconds}))
    print(table.groupby(["effect", "times"])[["named", "right"]].agg(["sum", "count"]).to_string())
    print(table[table.others != ""].groupby(["effect", "others"]).size().to_string())


if __name__ == "__main__":
    main()
