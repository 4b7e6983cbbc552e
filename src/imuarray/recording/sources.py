"""A configured recording: where its file is, and how to read it."""

from pathlib import Path

from imuarray.errors import InputError
from imuarray.recording.format import read_recording
from imuarray.recording.published import SOURCES, fetch
from imuarray.recording.record import Recording


def locate_source(entry: dict, folder: str | Path) -> dict[str, str]:
    """Files of a configured recording: ``data`` and, by kind, ``positions`` or ``columns``.

    ``entry`` as in the config's ``recordings``; published files are fetched to ``folder``.
    InputError where a file is not there and can not be had.
    """
    if "published" in entry:
        source, _, name = entry["published"].partition("/")
        found = {"data": fetch(source, name, folder)}
        found["positions"] = fetch(source, "IMU_positions.csv", folder)
        return {key: str(path) for key, path in found.items()}
    found = {"data": entry["file"]}
    found |= {key: entry[key] for key in ("columns", "positions") if key in entry}
    for path in found.values():
        if not Path(path).is_file():
            raise InputError(f"{path}: expected a file to read, found none")
    return found


def read_source(entry: dict, files: dict[str, str]) -> tuple[Recording, dict]:
    """The recording, and the account of what its importer dropped (empty for others)."""
    ending = Path(files["data"]).suffix.lower()
    if ending == ".nc":
        return read_recording(files["data"]), {}
    if ending == ".csv":
        from imuarray.recording.table import read_csv

        return read_csv(files["data"], files["columns"]), {}
    from imuarray.recording.mimu_recording import read_board

    declared = {}
    if "published" in entry:
        known = SOURCES[entry["published"].partition("/")[0]]
        declared = {"title": known.title, "source": entry["published"]}
    recording, account = read_board(files["data"], files["positions"], **declared)
    return recording, account.attributes()
