"""The configuration: read, validated, and turned into models."""

from pathlib import Path

import yaml

from imuarray.errors import LARGEST, SMALLEST, InputError, require_one_of

DEEPEST = 8  # levels; the schema has six
SCHEMA = Path(__file__).parent / "schemas" / "config.schema.yaml"


def read_config(path) -> dict:
    """`check_config` of a YAML file."""
    return check_config(yaml.safe_load(Path(path).read_text(encoding="utf-8")), str(path))


def check_config(config, where: str = "config") -> dict:
    """The configuration with the schema's defaults, after the schema and what it cannot say."""
    import jsonschema

    _check_numbers(config, where)
    with open(SCHEMA, encoding="utf-8") as handle:
        schema = yaml.safe_load(handle)
    config = _completed(config, schema)
    validator = jsonschema.Draft202012Validator(schema)
    fault = jsonschema.exceptions.best_match(validator.iter_errors(config))
    if fault is not None:
        place = ".".join(str(part) for part in fault.absolute_path) or "top level"
        raise InputError(f"{where}: {place}: {fault.message}")
    require_one_of(f"{where}: scale", config["scale"], config["scales"])
    for name, scale in config["scales"].items():
        for key in ("transitions", "experiment_transitions", "measured_transitions"):
            _check_lengths(scale[key], config["paper2021"]["samples"], scale["draws"],
                           f"{where}: scales.{name}.{key}")  # fmt: skip
    _check_recordings(config, where)
    return config


def _completed(given, schema: dict):
    """The values ``given`` before the defaults of the schema, key by key.

    A default stands for all that is below it: of an array or of recordings none is added to the
    user's own. Those of scales are completed, too.
    """
    if not isinstance(given, dict):
        return given
    found = dict(given)
    for key, child in schema.get("properties", {}).items():
        if key == "scales" and isinstance(found.setdefault(key, {}), dict):
            rest = child["default"]  # a new scale has what it does not say from the default one
            both = {name: rest.get(name, rest["default"]) for name in rest | found[key]}
            found[key] = {name: _over(found[key].get(name, {}), x) for name, x in both.items()}
        elif "default" in child:
            found.setdefault(key, child["default"])
        elif "properties" in child:
            found[key] = _completed(found.get(key, {}), child)
    return found


def _over(given, rest: dict):
    return rest | given if isinstance(given, dict) else given


def _check_numbers(value, where: str, place: tuple = ()) -> None:
    """YAML has .nan, .inf, integers of any length, and lists that hold themselves."""
    if len(place) > DEEPEST:
        raise InputError(f"{where}: expected at most {DEEPEST} levels of sections, found more")
    if isinstance(value, dict | list):
        for key, item in value.items() if isinstance(value, dict) else enumerate(value):
            _check_numbers(item, where, (*place, key))
    if not isinstance(value, int | float) or place == ("seed",):
        return
    if value != 0 and not SMALLEST <= abs(value) <= LARGEST:
        found = value if isinstance(value, float) else f"an integer of {value.bit_length()} bits"
        raise InputError(
            f"{where}: {'.'.join(map(str, place))}: expected a size between {SMALLEST:g} and"
            f" {LARGEST:g}, or 0, found {found}"
        )


def _check_recordings(config, where) -> None:
    """Each kind of file comes with what it takes to read it, and the experiment is one of them."""
    needed = {".csv": "columns", ".bin": "positions", ".bin.xz": "positions", ".nc": None}
    for name, entry in config["recordings"].items():
        ending = next((x for x in needed if entry["file"].lower().endswith(x)), None)
        if ending is None:
            raise InputError(
                f"{where}: recordings.{name}.file: expected a file that ends in"
                f" {', '.join(needed)}, found {entry['file']}"
            )
        if needed[ending] is not None and needed[ending] not in entry:
            raise InputError(
                f"{where}: recordings.{name}: expected '{needed[ending]}' beside a {ending} file,"
                " found none"
            )
    found = config["experiment"]["recording"]
    require_one_of(f"{where}: experiment.recording", found, config["recordings"])


def _check_lengths(lengths, samples, draws, where) -> None:
    for count in samples:
        if f"T{count}" not in lengths:
            raise InputError(
                f"{where}: expected an entry T{count}, found {sorted(lengths, key=str)}"
            )
        if lengths[f"T{count}"] < draws:
            raise InputError(
                f"{where}.T{count}: expected at least {draws} transitions (one a stored draw),"
                f" found {lengths[f'T{count}']}"
            )


def model_from(settings: dict, accelerometer_sd: float | None = None):
    """The `ArrayModel` of a configuration; ``accelerometer_sd`` (m/s^2) replaces its own."""
    import numpy as np

    from imuarray.geometry import array_from_config
    from imuarray.model import ArrayModel

    noise = settings["noise"]
    force = noise["accelerometer_sd"] if accelerometer_sd is None else accelerometer_sd
    rate = np.radians(noise["gyroscope_sd_dps"])
    return ArrayModel.isotropic(array_from_config(settings["array"]), force, rate)


def motion_sds(settings: dict) -> tuple[float, float, float]:
    """Sds of omega (rad/s), omega_dot (rad/s^2) and s (m/s^2) in section IV-A of paper 2021."""
    import numpy as np

    paper = settings["paper2021"]
    turning = paper["angular_rate_sd_dps"], paper["angular_acceleration_sd_dps2"]
    return *np.radians(turning), paper["specific_force_sd"]


def describe_schema() -> str:
    """config/README.md: every key of the schema with its meaning, as Markdown."""
    with open(SCHEMA, encoding="utf-8") as handle:
        schema = yaml.safe_load(handle)
    lines = ["# Configuration", "", schema["description"]]
    lines += ["| key | meaning | default |", "|---|---|---|"]
    return "\n".join([*lines, *_rows(schema, schema["$defs"], "")]) + "\n"


def _rows(node, shared, prefix):
    """A table row for each key below ``node``, depth first."""
    for name, child in node.get("properties", {}).items():
        target = shared.get(child.get("$ref", "").rpartition("/")[2], {})
        whole = {**target, **child}
        choices = f" (one of {', '.join(whole['enum'])})" if "enum" in whole else ""
        default = "" if isinstance(whole.get("default", {}), dict) else f"`{whole['default']}`"
        yield f"| `{prefix}{name}` | {whole.get('description', 'section')}{choices} | {default} |"
        yield from _rows(whole, shared, f"{prefix}{name}.")
        if isinstance(whole.get("additionalProperties"), dict):
            yield from _rows(whole["additionalProperties"], shared, f"{prefix}{name}.NAME.")


if __name__ == "__main__":
    print(describe_schema(), end="")
