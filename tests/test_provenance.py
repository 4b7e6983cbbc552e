"""Stamps, digests, streams and writing whole or not at all."""

import json
import os
import socket
import stat
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

import imuarray
from imuarray.errors import IdentifiabilityError, InputError
from imuarray.provenance import (
    atomic_write,
    code_digest,
    digest,
    stamp,
    versions,
    write_csv,
    write_json,
    write_netcdf,
)
from imuarray.streams import stream

CONFIG = {"scale": "quick", "array": {"labels": ["1", "2"], "sd": 1e-3}, "on": True, "none": None}


def test_versions():
    found = versions()
    assert found["imuarray"] == imuarray.__version__ and found["numpy"] == np.__version__
    assert set(found) >= {"scipy", "jax", "numba", "emcee", "arviz", "python"}


plain = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=8,
)


def reversed_order(value):
    if isinstance(value, dict):
        return {key: reversed_order(value[key]) for key in reversed(value)}
    return tuple(map(reversed_order, value)) if isinstance(value, list) else value


@given(plain)
def test_digest_sees_neither_order_nor_tuples(value):
    assert digest(value) == digest(reversed_order(value))


@given(plain, plain)
def test_digest_tells_values_apart(one, other):
    # repr, since 1 == True == 1.0 in Python
    different = repr(one) != repr(other) and one != other
    assert not different or digest(one) != digest(other)


def test_digest_of_arrays():
    values = np.arange(6.0).reshape(2, 3)
    same = [np.asfortranarray(values), values.astype(">f8"), values[::1]]
    assert {digest(v) for v in same} == {digest(values)}
    others = [values.T, values.ravel(), values.astype("f4"), values + 1e-15, values.tolist()]
    assert len({digest(v) for v in [values, *others]}) == len(others) + 1
    assert digest(np.float64(0.5), np.int64(3)) == digest(0.5, 3)


def test_digest_nests_unambiguously():
    assert len({digest(["a", "b"]), digest("a", "b"), digest([["a"], "b"]), digest("ab")}) == 4
    assert digest("a", ["b"]) != digest(["a"], "b")
    with pytest.raises(TypeError, match="object"):
        digest(object())
    with pytest.raises(TypeError):
        digest(np.array([object()]))


def test_digest_is_the_same_in_another_process():
    code = f"from imuarray.provenance import digest; print(digest({CONFIG!r}))"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == digest(CONFIG)


def test_code_digest_is_stable_hex():
    assert code_digest() == code_digest()
    assert len(code_digest()) == 64 and int(code_digest(), 16) > 0


def test_stamp_is_flat_and_repeats():
    attributes = stamp(CONFIG | {"sizes": np.array([1, 2])}, np.int64(7))
    assert all(isinstance(value, str | int) for value in attributes.values())
    assert json.loads(attributes["config"]) == CONFIG | {"sizes": [1, 2]}
    assert json.loads(attributes["versions"]) == versions()
    assert attributes["seed"] == 7 and attributes["created_by"].startswith("imuarray ")
    assert attributes == stamp(CONFIG | {"sizes": [1, 2]}, 7)


def write_all(folder, tree):
    write_json({"b": np.float64(0.1), "a": [1, np.arange(2)]}, folder / "a.json")
    write_csv(pd.DataFrame({"x": [0.1, 1 / 3], "name": ["é", "b"]}), folder / "a.csv")
    write_netcdf(tree["posterior"].to_dataset(), folder / "dataset.nc")
    write_netcdf(tree, folder / "tree.nc")


def test_files_are_byte_reproducible(tmp_path):
    """HDF5 can store times of creation, to the second."""
    posterior = xr.Dataset(
        {"r": (("chain", "name"), np.ones((2, 3)))},
        {"name": ["a", "bcd", "e"]},
        stamp(CONFIG, 1),
    )
    tree = xr.DataTree.from_dict({"/posterior": posterior, "/prior": posterior})
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        write_all(tmp_path / name, tree)
        time.sleep(1.1 if name == "one" else 0)
    files = sorted(path.name for path in (tmp_path / "one").iterdir())
    assert files == ["a.csv", "a.json", "dataset.nc", "tree.nc"]
    for name in files:
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()


def test_files_read_back(tmp_path):
    write_json({"b": np.float64(0.1), "a": None}, tmp_path / "a.json")
    assert list(json.loads((tmp_path / "a.json").read_text()).items()) == [("b", 0.1), ("a", None)]
    frame = pd.DataFrame({"x": [0.1, 1 / 3], "n": [1, 2]})
    write_csv(frame, tmp_path / "a.csv")
    back = pd.read_csv(tmp_path / "a.csv")
    pd.testing.assert_frame_equal(back, frame, check_exact=True)
    with pytest.raises(ValueError):
        write_json({"x": float("nan")}, tmp_path / "nan.json")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.csv", "a.json"]


def test_a_failed_write_leaves_the_old_file(tmp_path):
    path = tmp_path / "result.csv"
    path.write_text("old")
    with pytest.raises(KeyboardInterrupt), atomic_write(path) as temporary:
        assert temporary.parent.parent == tmp_path and temporary.suffix == ".csv"
        temporary.write_text("half")
        raise KeyboardInterrupt
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]
    with atomic_write(path) as temporary:
        temporary.write_text("new")
    assert path.read_text() == "new" and list(tmp_path.iterdir()) == [path]


def test_missing_folders_are_made_and_links_followed(tmp_path):
    (tmp_path / "link.csv").symlink_to("far/away/target.csv")
    for text in ("first", "second"):
        with atomic_write(tmp_path / "link.csv") as temporary:
            temporary.write_text(text)
    assert (tmp_path / "far/away/target.csv").read_text() == "second"
    assert (tmp_path / "link.csv").is_symlink()
    assert [path.name for path in (tmp_path / "far/away").iterdir()] == ["target.csv"]


def special(path, kind):
    if kind == "a pipe":
        os.mkfifo(path)
    elif kind == "a socket":
        with socket.socket(socket.AF_UNIX) as made:
            made.bind(str(path))
    elif kind == "a device":
        path.symlink_to(os.devnull)
    else:
        path.mkdir()


@pytest.mark.parametrize("kind", ["a pipe", "a socket", "a device", "a folder"])
def test_what_is_no_file_is_left_alone(tmp_path, monkeypatch, kind):
    monkeypatch.chdir(tmp_path)  # a socket's path may not be long
    path = Path("out.nc")
    special(path, kind)
    before = path.lstat()
    said = f"expected a file to write, found {kind}"
    with pytest.raises(OSError, match=said), atomic_write(path):
        pytest.fail("the block is not entered")
    assert os.path.samestat(path.lstat(), before) and os.listdir() == ["out.nc"]
    assert stat.S_ISCHR(os.stat(os.devnull).st_mode)


def test_links_in_a_circle(tmp_path):
    (tmp_path / "a").symlink_to(tmp_path / "b")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    with pytest.raises(OSError, match="symbolic links"), atomic_write(tmp_path / "a"):
        pytest.fail("the block is not entered")


def test_errors_are_one_line():
    assert str(InputError("a\n  b")) == "a b"
    assert issubclass(IdentifiabilityError, InputError) and issubclass(InputError, ValueError)


def test_streams_repeat_and_differ():
    names = [
        (),
        ("a",),
        ("b",),
        ("a", 0),
        ("a", 1),
        (0, "a"),
        ("a", "0"),
        ("ab",),
        ("a", "b"),
        (3,),
    ]
    names += [("a", 2**32), ("a", 0, 1), ("é",)]
    draws = {stream(5, *name).integers(2**63) for name in names}
    draws |= {stream(6, *name).integers(2**63) for name in names}
    assert len(draws) == 2 * len(names)
    assert stream(5, "a", np.int64(1)).normal() == stream(5, "a", 1).normal()
    assert isinstance(stream(5).bit_generator, np.random.PCG64DXSM)


def test_streams_never_change():
    """Stored results rest on these numbers, on every machine and in every later version."""
    assert stream(2021, "fig4", 3).integers(2**63) == 6853156823279755269
    assert stream(2021, "fig4", 3).bit_generator.seed_seq.spawn_key[3:] == (0, 3, 0)


def test_neighbouring_streams_are_uncorrelated():
    """Seed 0; 190 pairs at 4.5 sd each: false alarm in one of some 800 such seeds."""
    draws = np.array([stream(0, "replicate", k).normal(size=4000) for k in range(20)])
    correlations = np.corrcoef(draws)[np.triu_indices(20, 1)]
    assert np.abs(correlations).max() < 4.5 / np.sqrt(4000)


@pytest.mark.parametrize(
    "arguments", [(-1,), (1.5,), (True,), ("1",), (1, -1), (1, 2.0), (1, 2**64)]
)
def test_bad_seeds_and_names(arguments):
    with pytest.raises(InputError, match="expected"):
        stream(*arguments)


def test_a_full_disk_is_an_error_not_the_end_of_the_process(tmp_path):
    """A limit on the file's size stands for the disk; HDF5 by itself ends with a signal there."""
    code = (
        "import resource, sys, numpy, xarray\n"
        "from imuarray.provenance import write_netcdf\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))\n"
        "try: write_netcdf(xarray.Dataset({'a': ('x', numpy.arange(1e4))}), sys.argv[1])\n"
        "except OSError as error: print(error.filename, error.strerror)\n"
    )
    out = tmp_path / "out.nc"
    run = subprocess.run([sys.executable, "-c", code, out], capture_output=True, text=True)
    assert (run.returncode, run.stdout, run.stderr) == (0, f"{out} File too large\n", "")
    assert not list(tmp_path.iterdir())


def test_what_a_killed_process_left_is_no_result(tmp_path):
    code = (
        "import os, signal, sys; from imuarray.provenance import atomic_write\n"
        "with atomic_write(sys.argv[1]) as temporary:\n"
        "    temporary.write_text('half')\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    out = tmp_path / "out.csv"
    subprocess.run([sys.executable, "-c", code, out], check=False)
    assert not out.exists() and all(path.name.startswith(".") for path in tmp_path.iterdir())
    with atomic_write(out) as outer:
        outer.write_text("mine")
        with atomic_write(out) as inner:
            inner.write_text("mine, too")
        assert outer.exists()
    assert out.read_text() == "mine"
