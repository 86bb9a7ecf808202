#!/usr/bin/env python3
"""What an archive costs: files a second by the number of threads, processor time per small file, memory
per thread, and headers alone.

    archive_bench.py SIXPOINT [FILES [SMALL]]    default: 200 files of a day at 30 Hz, 2000 of a minute

The whole program as a process, on the real disk, in a folder below $TMPDIR that is removed at the end. Ratios
are those to the baseline that the line names, of the same run; run it on a quiet machine. Four
recordings are simulated and copied, so that all files are in the page cache.
"""
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time

SCENARIO = {
    "schema": "sixpoint/scenario/1",
    "unit": {
        "serial": "MOS2A45130007", "firmware": "1.5.0", "calibrated": "2013-11-12T14:32:13Z",
        "constants": {"positive_lsb": [311, 310, 287], "negative_lsb": [-204, -216, -234],
                      "zero_lsb": [54, 47, 26]},
        "sensor": {"current": {"sensitivity_lsb_per_g": [237.7, 251.8, 242.3],
                               "zero_lsb": [49.9, 95.8, 60.8]}}},
}
CONSTANTS = {"serial": "MOS2A45130007", "filter": "current",
             "constants": {"sensitivity_g_per_lsb": [1 / 237.7, 1 / 251.8, 1 / 242.3],
                           "zero_lsb": [49.9, 95.8, 60.8]}}


class Run:
    """One command: wall time and processor time in seconds, most resident memory in MB."""

    def __init__(self, *command, expect=(0,)):
        start = time.monotonic()
        process = subprocess.Popen([str(word) for word in command], stdout=subprocess.DEVNULL,
                                   stderr=subprocess.PIPE)
        said = process.stderr.read()
        _, status, usage = os.wait4(process.pid, 0)
        self.wall_s = time.monotonic() - start
        self.processor_s = usage.ru_utime + usage.ru_stime
        self.memory_mb = usage.ru_maxrss / 1000
        if os.waitstatus_to_exitcode(status) not in expect:
            sys.exit(f"{' '.join(map(str, command))} failed: {said.decode(errors='replace')}")


def fill(program, folder, count, duration_s, firmware="1.5.0", seeds=4):
    """`count` files; returns the bytes of one."""
    os.makedirs(folder)
    made = []
    for seed in range(1, min(seeds, count) + 1):
        scenario = dict(SCENARIO, seed=seed, motions=[{"kind": "free_living", "duration_s": duration_s}])
        scenario["unit"] = dict(SCENARIO["unit"], firmware=firmware)
        path = os.path.join(folder, f"0{seed}.gt3x")
        with open(folder + ".json", "w") as file:
            json.dump(scenario, file)
        Run(program, "simulate", "--scenario", folder + ".json", "-o", path)
        made.append(path)
    for i in range(len(made), count):
        os.makedirs(os.path.join(folder, str(i // 100)), exist_ok=True)
        shutil.copy(made[i % len(made)], os.path.join(folder, str(i // 100), f"{i}.gt3x"))
    return sum(map(os.path.getsize, made)) / len(made)


def main():
    program = os.path.abspath(sys.argv[1])
    count = int(sys.argv[2]) if len(sys.argv) > 2 else 200
    small = int(sys.argv[3]) if len(sys.argv) > 3 else 2000
    with tempfile.TemporaryDirectory(prefix="sixpoint-bench-") as at:
        constants = os.path.join(at, "c.json")
        with open(constants, "w") as file:
            json.dump(CONSTANTS, file)

        def repair(archive, jobs):
            out = os.path.join(at, f"out{jobs}")
            os.sync()
            run = Run(program, "repair", os.path.join(at, archive), "-o", out, "--constants", constants,
                      "--jobs", jobs)
            shutil.rmtree(out)
            return run

        size = fill(program, os.path.join(at, "days"), count, 86400)
        print(f"{count} files of a day at 30 Hz, {size / 1e6:.1f} MB each")
        one = repair("days", 1)
        for jobs, run in (1, one), (2, repair("days", 2)):
            print(f"repair --jobs {jobs}        {run.wall_s:8.2f} s  {count / run.wall_s:7.1f} files/s  "
                  f"{count * size / run.wall_s / 1e6:6.1f} MB/s  {run.memory_mb:5.1f} MB resident  "
                  f"{one.wall_s / run.wall_s:.2f} times --jobs 1 (baseline)")
        print(f"processor: {one.processor_s / count * 1e3:.1f} ms a file, "
              f"{count * size / one.processor_s / 1e6:.1f} MB/s of a core")
        plan = os.path.join(at, "plan")
        Run(program, "archive", "plan", os.path.join(at, "days"), "-o", plan, "--constants", constants,
            "--shards", 1)
        worker = Run(program, "archive", "run", plan, "--shard", 0, "-o", os.path.join(at, "run"))
        print(f"archive run             {worker.wall_s:8.2f} s  {worker.memory_mb:5.1f} MB resident  "
              f"{one.wall_s / worker.wall_s:.2f} times repair --jobs 1 (baseline)")
        shutil.rmtree(os.path.join(at, "run"))

        # Of the first four minutes, one has too little at rest to be repaired.
        fill(program, os.path.join(at, "minutes"), small, 60, seeds=1)
        run = repair("minutes", 1)
        base = Run("cp", "-r", os.path.join(at, "minutes"), os.path.join(at, "copy"))
        print(f"{small} files of a minute: {run.processor_s / small * 1e3:.2f} ms of processor a file, "
              f"{run.processor_s / base.processor_s:.0f} times cp -r (baseline); "
              f"{run.wall_s / small * 1e3:.2f} ms of wall time, which is the disk's syncs")

        fill(program, os.path.join(at, "sound"), count, 86400, firmware="1.8.0")
        walk = Run(program, "archive", "plan", os.path.join(at, "sound"), "-o", plan + "1", "--scan",
                   "--no-pool", "--jobs", 1)
        headers = Run(program, "archive", "plan", os.path.join(at, "sound"), "-o", plan + "2", "--scan",
                      "--jobs", 1)
        print(f"headers of {count} files that are not affected: {headers.wall_s:.3f} s, "
              f"{count / max(headers.wall_s - walk.wall_s, 1e-9):.0f} files/s beyond the walk (baseline, "
              f"{walk.wall_s:.3f} s)")
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(f"processor of all: {children.ru_utime + children.ru_stime:.0f} s")


if __name__ == "__main__":
    main()
