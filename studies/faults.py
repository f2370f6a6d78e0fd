"""What runs lose when something goes wrong: each fault is really made, then the run goes on with `--resume`.

    python studies/faults.py [--kills 20] [--only kill,full] [--seed 1]

prints a table (docs/evidence/reliability.md). Lost are bytes of frames that the run had written, or would have,
and that in the end are missing or differ from those of a run without a fault.
"""

import argparse
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

from tables import head, row

import taichi_rts as rts

SCENE = ["dam_break_2d", "--arch", "cpu", "--spacing", "0.06", "--end-time", "0.12", "--export-fps", "100"]
PICTURE = ["--width", "320", "--height", "180", "--stepper", "asynchronous"]
RUN = ["run", *SCENE, *PICTURE, "--checkpoint-every", "0.015"]
PATIENCE = 300.0
TINY = 600 << 10  # bytes of a disk that is full after some frames and two checkpoints


@dataclass
class Result:
    """What came of a fault: how often it was tried, what happened how often, and the bytes that were lost."""

    fault: str
    tried: int = 0
    outcomes: dict = field(default_factory=dict)
    lost: int = 0

    def add(self, outcome: str, lost: int = 0) -> None:
        self.tried += 1
        self.outcomes[outcome] = self.outcomes.get(outcome, 0) + 1
        self.lost += lost


def start(*args):
    command = [sys.executable, "-m", "taichi_rts", *args]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def finish(process):
    """Wait for the end; returns exit code and messages."""
    _out, err = process.communicate(timeout=PATIENCE)
    return process.returncode, err


def run(*args):
    return finish(start(*args))


def files(folder):
    """Frames and facts of a run by name, without the seconds it took."""
    found = {path.name: path.read_bytes() for path in sorted(folder.glob("frames/*.png"))}
    if (folder / "run.json").exists():
        facts = json.loads((folder / "run.json").read_text())
        del facts["wall_seconds"]
        found["run.json"] = json.dumps(facts).encode()
    return found


def differing(found, wanted):
    """Bytes of `wanted` that are missing in `found` or differ."""
    return sum(len(data) for name, data in wanted.items() if found.get(name) != data)


def torn(folder, wanted):
    """Bytes of files in the folder that are not as they should be."""
    return sum(len(data) for name, data in files(folder).items() if wanted.get(name) != data)


def wait_for(process, condition):
    began = time.monotonic()
    while process.poll() is None and not condition():
        if time.monotonic() - began > PATIENCE:
            process.kill()
            raise TimeoutError
        time.sleep(0.002)


def progress(folder):
    """How many files the run has written."""
    return len(list(folder.glob("frames/*.png"))) + len(list(folder.glob("checkpoints/*.npz")))


def go_on(folder, wanted):
    """Resume and compare; returns what happened and the bytes lost."""
    code, err = run("run", "--resume", str(folder))
    if "no whole checkpoint" in err:
        code, err = run(*RUN, "--output-dir", str(folder), "--overwrite")
        return ("no checkpoint yet; new run has the same bits" if not code else f"exit {code}", 0)
    if code:
        return f"exit {code}: {err.strip()[-200:]}", sum(map(len, wanted.values()))
    lost = differing(files(folder), wanted)
    return ("same bits" if not lost else "OTHER BITS"), lost


def stop(work, wanted, number, times, chance):
    """Send signal `number` at random moments, then go on."""
    name = signal.Signals(number).name
    result = Result("kill -9" if number == signal.SIGKILL else name)
    total = len(wanted) + 8
    for attempt in range(times):
        folder = work / f"{name}{attempt}"
        process = start(*RUN, "--output-dir", str(folder))
        moment = chance.randrange(total - 3)
        wait_for(process, lambda folder=folder, moment=moment: progress(folder) > moment)
        time.sleep(chance.random() * 0.05)
        process.send_signal(number)
        code, err = finish(process)
        expected = -number if number == signal.SIGKILL else 128 + number
        if code not in (expected, 0):
            result.add(f"exit {code}: {err.strip()[-200:]}")
            continue
        broken = torn(folder, wanted)
        outcome, lost = go_on(folder, wanted)
        ended = "" if number == signal.SIGKILL else f"exit {code}; "
        result.add(ended + outcome, lost + broken)
        shutil.rmtree(folder)
    return result


def full_disk(work, wanted, times):
    """Run on a disk that fills up, make room, go on."""
    result = Result("disk full")
    for attempt in range(times):
        disk = work / f"disk{attempt}"
        disk.mkdir()
        if os.geteuid() or mount("-t", "tmpfs", "-o", f"size={TINY}", "tmpfs", str(disk)):
            result.add("skipped: mounting a small disk needs root")
            return result
        try:
            folder = disk / "out"
            code, err = run(*RUN, "--output-dir", str(folder))
            clear = code == 2 and "No space left" in err and "--resume" in err and "Traceback" not in err
            broken = torn(folder, wanted)
            mount("-o", f"remount,size={64 << 20}", str(disk))
            outcome, lost = go_on(folder, wanted)
            result.add(f"{'clear error' if clear else f'exit {code}: {err}'}; {outcome}", broken + lost)
        finally:
            subprocess.run(["umount", str(disk)], check=False)
    return result


def mount(*args):
    return subprocess.run(["mount", *args], check=False, capture_output=True).returncode


def deleted_folder(work, wanted, times, chance):
    """Delete the output folder while the run writes to it."""
    result = Result("output folder deleted")
    for attempt in range(times):
        folder = work / f"deleted{attempt}"
        process = start(*RUN, "--output-dir", str(folder))
        moment = chance.randrange(2, 8)
        wait_for(process, lambda folder=folder, moment=moment: progress(folder) > moment)
        shutil.rmtree(folder, ignore_errors=True)
        code, err = finish(process)
        warned = "has gone and was made again" in err
        broken = torn(folder, wanted)
        left = len(list(folder.glob("frames/*.png")))
        outcome = (
            "warned, went on, later files whole" if warned and not code and left and not broken else f"exit {code}"
        )
        result.add(outcome, differing(files(folder), wanted))
    return result


def second_run(work, wanted, times):
    """Start a second run into the folder of one that is under way."""
    result = Result("two runs into one folder")
    for attempt in range(times):
        folder = work / f"two{attempt}"
        process = start(*RUN, "--output-dir", str(folder))
        wait_for(process, lambda folder=folder: progress(folder) > 1)
        process.send_signal(signal.SIGSTOP)  # or it might end before the second has begun
        code, err = run(*RUN, "--output-dir", str(folder), "--overwrite")
        refused = code == 2 and "is being written to by process" in err
        process.send_signal(signal.SIGCONT)
        finish(process)
        lost = differing(files(folder), wanted)
        result.add("second refuses, first whole" if refused and not lost else f"exit {code}: {err}", lost)
    return result


def damaged(reference, wanted, times, chance):
    """Truncate, flip and replace checkpoints; the newest one damaged, a folder goes on from the one before."""
    results = [Result(f"checkpoint {how}") for how in ("cut short", "with a flipped bit", "of another program")]
    newest = sorted((reference / "checkpoints").iterdir())[-1]
    data = newest.read_bytes()
    for result in results:
        for _ in range(times * 10):
            changed = bytearray(data)
            if result is results[0]:
                changed = changed[: chance.randrange(len(data))]
            elif result is results[1]:
                changed[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
            else:
                changed = chance.randbytes(len(data))
            newest.write_bytes(changed)
            try:
                rts.load_checkpoint(newest)
                result.add("ACCEPTED")
            except rts.CheckpointError:
                result.add("refused")
    (reference / "run.json").unlink()
    outcome, lost = go_on(reference, wanted)
    results.append(Result("newest checkpoint damaged"))
    results[-1].add(f"the one before: {outcome}", lost)
    return results


def stopped_in_the_middle(work):
    """Stop between two steps with everything that a scene can have, for every stepper and precision; load in a new process."""
    results = []
    script = Path(__file__).parent / "faults_step.py"
    for stepper in ("uniform", "regional", "asynchronous"):
        result = Result(f"stop between two steps, {stepper}")
        for precision in ("f32", "f64"):
            path = work / f"{stepper}_{precision}.npz"
            codes = [
                subprocess.run(
                    [sys.executable, str(script), part, stepper, precision, str(path)], capture_output=True, text=True
                )
                for part in ("save", "load")
            ]
            said = [each.stdout.strip().splitlines()[-1:] for each in codes]
            same = said[0] == said[1] and not any(each.returncode for each in codes)
            result.add(f"same bits ({precision})" if same else f"OTHER BITS ({precision}): {codes[1].stderr[-200:]}")
        results.append(result)
    return results


FAULTS = ("kill", "interrupt", "full", "deleted", "two", "damaged", "middle")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=20, help="times that runs are killed; others less often")
    parser.add_argument("--only", default=",".join(FAULTS))
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    chance, some, only = random.Random(options.seed), max(1, options.kills // 5), options.only.split(",")
    head("fault", "times tried", "outcome", "bytes lost")
    with tempfile.TemporaryDirectory() as scratch:
        work = Path(scratch)
        os.environ.setdefault("TI_OFFLINE_CACHE_FILE_PATH", str(work / "cache"))
        reference = work / "reference"
        code, err = run(*RUN, "--output-dir", str(reference))
        assert code == 0, err
        wanted = files(reference)
        tries = {
            "kill": lambda: [stop(work, wanted, signal.SIGKILL, options.kills, chance)],
            "interrupt": lambda: [stop(work, wanted, n, some, chance) for n in (signal.SIGINT, signal.SIGTERM)],
            "full": lambda: [full_disk(work, wanted, 1)],
            "deleted": lambda: [deleted_folder(work, wanted, some, chance)],
            "two": lambda: [second_run(work, wanted, some)],
            "damaged": lambda: damaged(reference, wanted, options.kills, chance),
            "middle": lambda: stopped_in_the_middle(work),
        }
        for name in only:
            for result in tries[name]():
                outcomes = "; ".join(f"{count} x {outcome}" for outcome, count in result.outcomes.items())
                row(result.fault, result.tried, outcomes, f"{result.lost:,}")


if __name__ == "__main__":
    main()
