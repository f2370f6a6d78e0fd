"""Threads have a core each only while nothing else runs there."""

import os

import pytest

from taichi_rts.device import backend, pinning
from taichi_rts.device.pinning import Pinning, Usage, busy_seconds, pays, used_by_others

STAT = """cpu  300 10 50 9000 40 0 10 5 70 0
cpu0 200 10 30 4000 20 0 10 5 70 0
cpu1 100 0 20 5000 20 0 0 0 0 0
cpu12 900 0 0 0 0 0 0 0 0 0
intr 12 3
procs_running 3
"""


@pytest.mark.parametrize(
    ("threads", "cores", "others", "wanted"),
    [
        (2, 2, 0.0, True),
        (2, 2, 0.2, True),
        (2, 2, 0.3, False),
        (2, 2, 1.0, False),  # one other process
        (16, 16, 0.0, True),
        (16, 16, 1.0, False),
        (2, 4, 0.0, False),  # fewer threads than cores are for sharing the machine
        (4, 2, 0.0, False),
        (1, 1, 0.0, False),
        (2, 2, None, False),
    ],
)
def test_threads_are_pinned_only_where_nothing_else_runs(threads, cores, others, wanted):
    assert pays(threads, cores, others) is wanted


def test_what_others_use_is_all_less_ones_own():
    before, after = Usage(10.0, 100.0, 7.0), Usage(12.0, 103.0, 8.0)
    assert used_by_others(before, after) == 1.0
    assert used_by_others(before, Usage(12.0, 101.0, 8.5)) == 0.0  # the two clocks round differently
    assert used_by_others(before, Usage(10.1, 100.1, 7.0)) is None


def test_the_time_that_cores_are_busy():
    assert busy_seconds(STAT, {0}, 100.0) == pytest.approx(2.55)
    assert busy_seconds(STAT, {0, 1}, 100.0) == pytest.approx(3.75)
    assert busy_seconds(STAT, {2}, 100.0) == 0.0


@pytest.fixture
def machine(monkeypatch):
    """Three cores whose use is set, and the threads' cores."""
    cores = {}
    used = [Usage(0.0, 0.0, 0.0)]
    monkeypatch.delenv(pinning.VARIABLE, raising=False)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1, 2}, raising=False)
    monkeypatch.setattr(os, "sched_setaffinity", cores.__setitem__, raising=False)
    monkeypatch.setattr(pinning, "usage", lambda: used[-1])

    def pass_time(seconds, own, others):
        last = used[-1]
        used.append(Usage(last.at + seconds, last.busy + seconds * (own + others), last.own + seconds * own))

    return cores, used, pass_time


def test_threads_are_let_go_when_another_process_begins_and_pinned_when_it_ends(machine):
    cores, used, pass_time = machine
    pass_time(1.0, own=1.0, others=0.0)
    pool = Pinning([10, 11, 12, 13], 3, used[0])
    assert cores == {11: {0}, 12: {1}, 13: {2}}
    pass_time(0.1, own=3.0, others=2.0)  # too short to be sure
    pool.look()
    assert pool.is_pinned
    pass_time(1.0, own=2.0, others=1.0)
    pool.look()
    assert cores == {thread: {0, 1, 2} for thread in (11, 12, 13)}
    pass_time(1.0, own=3.0, others=0.0)
    pool.look()
    assert cores == {11: {0}, 12: {1}, 13: {2}}


def test_a_machine_that_is_shared_from_the_start_is_left_alone(machine):
    cores, used, pass_time = machine
    pass_time(1.0, own=1.0, others=1.0)
    assert not Pinning([10, 11, 12], 3, used[0]).is_pinned
    assert cores == {}


@pytest.mark.parametrize(("wish", "others", "pinned"), [("0", 0.0, False), ("1", 2.0, True)])
def test_the_environment_decides_whatever_runs(machine, monkeypatch, wish, others, pinned):
    _, used, pass_time = machine
    monkeypatch.setenv(pinning.VARIABLE, wish)
    pass_time(1.0, own=1.0, others=others)
    assert Pinning([10, 11, 12], 3, used[0]).is_pinned is pinned


def test_fewer_threads_than_cores_are_free_to_move(machine):
    cores, used, pass_time = machine
    pass_time(1.0, own=1.0, others=0.0)
    Pinning([10, 11], 2, used[0])
    assert cores == {}


@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="Linux only")
def test_the_threads_of_a_start_have_a_core_each_if_told_so(monkeypatch, taichi_cpu):
    cores = os.sched_getaffinity(0)
    monkeypatch.setenv(pinning.VARIABLE, "1")
    backend.settle_threads()
    pinned = [os.sched_getaffinity(int(thread)) for thread in os.listdir("/proc/self/task")]
    if backend.threads() == len(cores) > 1:
        assert {core for each in pinned if len(each) == 1 for core in each} == cores
    assert os.sched_getaffinity(0) == cores  # the caller itself stays free
