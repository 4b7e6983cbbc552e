"""Recordings that others published: where they are, what they must be, and how to get them."""

import hashlib
import os
from dataclasses import dataclass
from pathlib import Path

from imuarray.errors import InputError, require_one_of

MIRROR = "IMUARRAY_MIRROR"  # environment variable: a folder that already holds the files


@dataclass(frozen=True)
class Source:
    """A set of files at a pinned address: ``files`` maps a name to its sha256."""

    address: str
    files: dict[str, str]
    title: str
    license: str


SOURCES = {
    "mimu4444": Source(
        "https://raw.githubusercontent.com/hcarlsso/Self-Calibration-Inertial-Sensor-Arrays-BCD.jl/"
        "2f2a8b179882f05b2343e1be6e861af50d583b3d/experimental_data/calibration/",
        {
            "exp_1/data.bin": "4719cc83ea38e181a79be4a23420fe70dffb909143dc871f48042d78e9342fbe",
            "exp_2/data.bin": "88aac16bd6946574fc1deb33a0a78dfb80830b7225b64d2f1e1c2e61d96a930a",
            "exp_3/data.bin": "9ac62de2bc225aeedeab21f7abaf11749f866a1eed2fe3d71eb8870d8c017712",
            "exp_4/data.bin": "4859af5843b3f761809b3c44ccf98ff40b689f2542b9e81e5a0e3c2a93c6abac",
            "exp_5/data.bin": "fabd1ff8086b0c35fb8754c55b30bc15ff06a733ebeca807d09fcd6d7a33e92f",
            "IMU_positions.csv": "f02f1ada2ec3b6ce0a5af792e18773ff16406be8f62d7ecbe0ada36bb6335eff",
        },
        "MIMU4444, 8 corner IMUs, H. Carlsson et al., IEEE Sensors J. 21(6), 2021",
        "MIT (c) 2021 Hakan Carlsson",
    )
}


def fetch(source: str, name: str, folder: str | Path) -> Path:
    """A published file, from the mirror, from ``folder`` if it is there, or downloaded to it.

    InputError where there is no such file, where a copy has another checksum, and where it
    can not be had: the message says why.
    """
    known = [f"{s}/{f}" for s, item in SOURCES.items() for f in item.files]
    require_one_of("published", f"{source}/{name}", known)
    expected = SOURCES[source].files[name]
    mirrors = filter(None, [os.environ.get(MIRROR)])
    for place in [Path(root) / source / name for root in (*mirrors, folder)]:
        if place.is_file():
            found = hashlib.sha256(place.read_bytes()).hexdigest()
            if found != expected:
                raise InputError(f"{place}: expected sha256 {expected}, found {found}")
            return place
    return _download(source, name, Path(folder), expected)


def _download(source, name, folder, expected) -> Path:
    import pooch

    target = folder / source / name
    address = SOURCES[source].address + name
    pooch.get_logger().setLevel("ERROR")
    try:
        pooch.retrieve(
            address, f"sha256:{expected}", target.name, target.parent,
            downloader=pooch.HTTPDownloader(timeout=20),
        )  # fmt: skip
    except Exception as error:  # the network fails in many ways
        reason = " ".join(str(error).split())[:200]
        raise InputError(
            f"{source}/{name}: expected to download it (or to find it under ${MIRROR}), found:"
            f" {type(error).__name__}: {reason}"
        ) from None
    return target
