"""Snakemake looks for jobs once at a time, and has what this rests on."""

import inspect
import sys
from pathlib import Path
from threading import Semaphore
from types import SimpleNamespace

from snakemake.scheduling.job_scheduler import JobScheduler

WORKFLOW = str(Path(__file__).parents[1] / "workflow")


def test_no_second_look_is_put_off_while_one_is(monkeypatch):
    monkeypatch.syspath_prepend(WORKFLOW)
    sys.modules.pop("support", None)
    from support import one_look_at_a_time

    scheduler = SimpleNamespace(_open_jobs=Semaphore(0))
    one_look_at_a_time(scheduler)
    for _ in range(2):  # the next series begins when the first look has come
        for _ in range(5):
            scheduler._schedule_reevalutation(0.05)
        assert scheduler._open_jobs.acquire(timeout=30.0)
        assert not scheduler._open_jobs.acquire(timeout=0.5)


def test_snakemake_schedules_its_looks_as_expected():
    source = inspect.getsource(JobScheduler)
    assert "self._schedule_reevalutation(self.job_rate_limiter.timespan)" in source
    assert "self._open_jobs.release()" in inspect.getsource(JobScheduler._schedule_reevalutation)
