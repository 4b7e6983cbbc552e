"""paper_figures/published.csv: each published file's bytes, commit and code, and what is stale."""

import hashlib
import io
import subprocess
import tarfile
from pathlib import Path

import pytest

from imuarray.errors import InputError

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def published():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "workflow"))
        import published

        return published


@pytest.fixture(scope="module")
def sources(published):
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "workflow"))
        return published.Sources()


@pytest.fixture(scope="module")
def committed():
    """By name, the files of paper_figures/ as committed: a run may have written them anew."""
    done = subprocess.run(
        ["git", "archive", "HEAD", "paper_figures"], cwd=ROOT, capture_output=True, check=False
    )
    if done.returncode:
        pytest.skip("not a git repository")
    with tarfile.open(fileobj=io.BytesIO(done.stdout)) as tar:
        return {Path(m.name).name: tar.extractfile(m).read() for m in tar if m.isfile()}


def test_no_published_file_rests_on_code_that_has_changed_since(published, sources):
    rows = published.read((ROOT / published.MANIFEST).read_text(encoding="utf-8"))
    found = published.changed(rows, sources)
    assert not found, f"{found}: `make publish`, or `make stale`, which says so in published.csv"


def test_every_published_file_has_the_bytes_the_manifest_states(published, committed):
    rows = published.read(committed.pop("published.csv").decode())
    found = {name: hashlib.sha256(content).hexdigest() for name, content in committed.items()}
    assert {row["file"]: row["sha256"] for row in rows} == found
    for row in rows:
        assert len(row["commit"]) == 40 and row["command"].endswith(row["file"])
        assert row["current"] == "no" or row["scripts"]


def test_a_changed_source_makes_stale_what_rests_on_it(published, sources, monkeypatch):
    names = {"claims.csv": "claims", "2021_table1.csv": "tune table_2021_table1"}
    rows = [
        {"file": file, "current": current, "code": sources.digest(*scripts.split()),
         "scripts": scripts}
        for file, scripts in names.items()
        for current in ("yes", "no")
    ]  # fmt: skip
    assert published.changed(rows, sources) == []
    scope = published.Sources.digest.__globals__
    content, place = scope["_content"], sources.files("tune")["scripts/tune.py"]
    monkeypatch.setitem(
        scope, "_content", lambda path: content(path) + ("changed" if path == place else "")
    )
    assert published.changed(rows, sources) == ["2021_table1.csv"]


def test_a_file_rests_on_all_that_made_what_it_was_made_from(published, sources, tmp_path):
    table = [
        ("output_file", "date", "rule", "log-file(s)", "input-file(s)", "plan"),
        ("a.csv", "-", "tune", "-", "-", "no update"),
        (f"{tmp_path}/results/paper/b.csv", "-", "claims", "-", "a.csv,not_made.csv", "no update"),
        (f"{tmp_path}/c.csv", "-", "copy", "-", f"{tmp_path}/results/paper/b.csv", "no update"),
        ("other.csv", "-", "rate_error", "-", "-", "update pending"),
    ]
    made = published.ancestry("\n".join(map("\t".join, table)))
    file, scripts = tmp_path / "c.csv", {name: name for name in ("tune", "claims", "rate_error")}
    file.write_text("1\n", encoding="utf-8")
    row = published.entry(str(file), made, scripts, sources)
    assert (row["scripts"], row["scale"]) == ("claims tune", "paper")
    assert row["sha256"] == hashlib.sha256(b"1\n").hexdigest()
    published.write([row | {"commit": "0"}], tmp_path / "published.csv")
    with pytest.raises(InputError, match="found one of a clone"):
        published.entry("a.csv", made, scripts, sources)
    made["a.csv"] = made["a.csv"]._replace(outdated=True)
    with pytest.raises(InputError, match="found a.csv to be made again"):
        published.entry(str(file), made, scripts, sources)
    [again] = published.read((tmp_path / "published.csv").read_text(encoding="utf-8"))
    assert again == row | {"commit": "0"}


def test_a_file_made_of_published_ones_rests_on_what_they_state(
    published, sources, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    made = {
        "paper_figures/findings.pdf": published.Made(
            "claims", ["paper_figures/blind.csv", "page.typ"], False
        ),
        "paper_figures/blind.csv": published.Made("copy", ["results/blind.csv"], True),
        "results/blind.csv": published.Made("rate_error", ["-"], True),
    }
    stated = {"file": "blind.csv", "scripts": "rate_error tune", "scale": "default"}
    given = made, {"claims": "claims", "rate_error": "rate_error"}, sources
    Path("paper_figures").mkdir()
    Path("paper_figures/findings.pdf").touch()
    row = published.entry("paper_figures/findings.pdf", *given, [stated])
    assert (row["scripts"], row["scale"]) == ("claims rate_error tune", "default")
    with pytest.raises(InputError, match="found paper_figures/blind.csv to be made again"):
        published.entry("paper_figures/findings.pdf", *given)


def test_files_of_a_clone_are_made_anew_once(published, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for folder in ("results", "paper_figures"):
        Path(folder).mkdir()
    drawn = Path("paper_figures/a.png")
    published.write([{"file": drawn.name}], published.MANIFEST)
    for stays in (False, True):  # what was made since it began stays
        drawn.touch()
        published.begin()
        assert drawn.exists() is stays
