"""What ends, and what outlives, a start of Taichi: in processes of their own, because what went wrong here ended the process."""

import pytest
from programs import PRELUDE, run_program

pytestmark = pytest.mark.usefixtures("quick_environment")


def output(code, folder, prelude=PRELUDE):
    done = run_program(code, folder, prelude)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_init_again_with_the_same_arguments_changes_nothing_and_own_fields_keep_working(tmp_path):
    said = output(
        """
ti = rts.ti
first = rts.init("cpu")
before = ti.field(ti.f32, 4)
before.fill(1.0)
sim = build()
after = ti.field(ti.f32, 4)
after.fill(2.0)
sim.advance_to(0.02)
assert rts.init("cpu") is first and rts.init("cpu", "f32") is first
sim.advance_to(0.04)
print(before[1], after[1], build().count, sim.time, float(sim.positions().max()) > 0.4)
""",
        tmp_path,
    )
    assert said.split() == ["1.0", "2.0", "20", "0.04", "True"]


@pytest.mark.parametrize(
    "again",
    [
        pytest.param("rts.init('cpu', 'f64')", marks=pytest.mark.slow),
        "rts.init('cpu', restart=True)",
        pytest.param("ti.init(ti.cpu)", marks=pytest.mark.slow),
        "ti.reset()",
    ],
)
def test_a_simulation_of_before_another_init_says_so_whatever_it_is_asked(tmp_path, again):
    said = output(
        f"""
import inspect
ti = rts.ti
rts.init("cpu")
sim = build()
{again}
repr(sim), sim.time, sim.count
calls = [
    lambda: sim.advance_to(0.1), lambda: sim.run(0.1), sim.positions, sim.energy, sim.show, sim.step, sim.check,
    lambda: sim.statistics, lambda: rts.save_checkpoint(sim, "a.npz"), lambda: rts.change_stepper(sim, rts.Regional()),
    lambda: rts.Series("a.csv", sim)(sim),
]
for call in calls:
    try:
        call()
        print("nothing raised by", inspect.getsource(call))
    except rts.Error as error:
        assert "earlier init" in str(error) or "started again" in str(error), error
        print("refused")
""",
        tmp_path,
    )
    assert [line for line in said.splitlines() if not line.startswith("[Taichi]")] == ["refused"] * 11


def test_fields_of_a_user_are_not_destroyed(tmp_path):
    said = output(
        """
ti = rts.ti
ti.init(ti.cpu, default_fp=ti.f64, log_level=ti.ERROR)
own, array = ti.field(ti.f32, 4), ti.ndarray(ti.f32, 3)
own.fill(3.0)
try:
    rts.init("cpu")
except rts.BackendError as error:
    print(error)
try:
    build()
except rts.BackendError as error:
    print(error)
for wrong in (dict(precision="f32"), dict(arch="cuda"), dict(debug=True)):
    try:
        rts.init(reuse=True, **wrong)
    except rts.BackendError as error:
        print(error)
device = rts.init(reuse=True)
sim = build()
sim.advance_to(0.05)
print(device.arch, device.precision, sim.positions().dtype, own[3])
assert rts.init("cpu", "f64") == device
try:
    rts.init("cpu", "f32")
except rts.BackendError as error:
    print("still refused")
print(own[2], sim.positions().shape)
""",
        tmp_path,
    ).splitlines()
    said = [line for line in said if not line.startswith("[Taichi]")]
    assert "destroys the fields" in said[0]
    assert "init(reuse=True)" in said[0]
    assert "not initialised" in said[1]
    assert said[2] == "Taichi's default_fp is f64, and f32 is needed; give it to ti.init, or leave out reuse"
    assert said[3] == "Taichi runs on arch 'cpu', and cuda is needed; give it to ti.init, or leave out reuse"
    assert said[4].startswith("reuse leaves Taichi as it is, so debug cannot be obeyed")
    assert said[5:] == ["cpu f64 float64 3.0", "still refused", "3.0 (20, 2)"]


def test_whatever_a_user_has_made_counts_and_nothing_is_no_taichi_to_reuse(tmp_path):
    said = output(
        """
ti = rts.ti
try:
    rts.init(reuse=True)
except rts.BackendError as error:
    print(error)
for make in (lambda: ti.field(ti.f32, 4), lambda: ti.ndarray(ti.f32, 4), lambda: ti.Vector.field(3, float, 2)):
    ti.init(ti.cpu, log_level=ti.ERROR)
    rts.init("cpu")  # nothing would be lost
    ti.init(ti.cpu, log_level=ti.ERROR)
    own = make()
    try:
        rts.init("cpu")
    except rts.BackendError:
        print("refused")
    del own
    ti.reset()
    print(rts.init("cpu").arch)
    ti.reset()
""",
        tmp_path,
    ).splitlines()
    said = [line for line in said if not line.startswith("[Taichi]")]
    assert said[0] == "there is no Taichi to reuse; call ti.init first, or leave out reuse"
    assert said[1:] == ["refused", "cpu"] * 3


IN_A_THREAD = """
import threading
def in_a_thread(work):
    def run():
        try:
            print("done", work())
        except rts.Error as error:
            print("refused", error)
    thread = threading.Thread(target=run, name="worker")
    thread.start()
    thread.join()
"""


def test_a_simulation_may_be_built_and_run_in_a_thread_of_its_own(tmp_path):
    said = output(
        IN_A_THREAD
        + """
rts.init("cpu")
sims = []
def work():
    sims.append(build())
    return sims[-1].advance_to(0.03)
in_a_thread(work)  # init was in the main thread
sims[0].advance_to(0.05)
print(sims[0].time, sims[0].show().size)
in_a_thread(lambda: sims[0].run(0.06).time)
try:
    build()  # now the main thread is the other one
except rts.Error as error:
    print("refused", error)
""",
        tmp_path,
    ).splitlines()
    assert said[:3] == ["done None", "0.05 (1280, 720)", "done 0.06"]
    assert said[3].startswith(
        "refused Taichi was started in thread 'worker' and makes fields only there, not in 'MainThread'"
    )


def test_a_second_simulation_in_another_thread_is_one_error(tmp_path):
    said = output(
        IN_A_THREAD
        + """
rts.init("cpu")
sim = build()
in_a_thread(lambda: sim.run(0.02).time)
in_a_thread(lambda: rts.init("cpu").arch)
in_a_thread(build)
print(sim.advance_to(0.03), sim.time)
""",
        tmp_path,
    ).splitlines()
    assert said[:2] == ["done 0.02", "done cpu"]
    assert said[2].startswith("refused Taichi was started in thread 'MainThread'")
    assert said[3] == "None 0.03"


PROCESSES = """
import multiprocessing
def work(number):
    try:
        rts.init("cpu")
        sim = build()
        sim.advance_to(0.02)
        return sim.time
    except rts.Error as error:
        return type(error).__name__ + ": " + str(error)
def ask(sim):
    try:
        return sim.advance_to(0.05)
    except rts.Error as error:
        return str(error)
if __name__ == "__main__":
    rts.init("cpu")
    sim = build()
    with multiprocessing.get_context(METHOD).Pool(2) as pool:
        for said in pool.map(work, range(2)):
            print(said)
    sim.advance_to(0.04)
    print(sim.time)
"""


FORKED = """
    import os, sys, signal
    sys.stdout.flush()
    child = os.fork()
    if child == 0:
        signal.alarm(20)
        try:
            sim.advance_to(0.05)
        except rts.BackendError as error:
            print(error, flush=True)
            sys.exit(7)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""


@pytest.mark.skipif("fork" not in __import__("multiprocessing").get_all_start_methods(), reason="cannot fork here")
def test_a_forked_process_is_told_at_once_and_its_simulation_is_refused(tmp_path):
    said = output(PROCESSES.replace("METHOD", "'fork'") + FORKED, tmp_path).splitlines()
    assert said[0] == said[1]
    assert said[0].startswith("BackendError: this process was forked after Taichi had started")
    assert 'multiprocessing.get_context("spawn")' in said[0]
    assert said[2] == "0.04"  # the parent goes on
    assert said[3].startswith("this process was forked")
    assert said[4] == "7"


@pytest.mark.slow
def test_spawned_processes_simulate(tmp_path):
    assert output(PROCESSES.replace("METHOD", "'spawn'"), tmp_path).split() == ["0.02", "0.02", "0.04"]
