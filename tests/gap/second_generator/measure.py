#!/usr/bin/python3
"""Makes a set of bundles, diagnoses each, and prints the scores: measure.py build/sixpoint --set all --jobs 2

Sets and seeds stand in SETS. Shares have Wilson's intervals (1927), 95 %. An effect has to be named where it is
at least twice the bound (bound.py). `--keep FOLDER` leaves bundles, labels and answers there.
"""

import argparse
import concurrent.futures
import json
import math
import pathlib
import subprocess
import tempfile

import generate

# name: stratum, protocol, count, seed, rates
SETS = {
    "realistic": ("realistic", "engineering", 40, 901, False),
    "realistic_rates": ("realistic", "engineering", 20, 902, True),
    "realistic_production": ("realistic", "production", 60, 903, False),
    "triple": ("triple", "engineering", 40, 904, False),
    "triple_production": ("triple", "production", 60, 905, False),
    "none": ("none", "engineering", 20, 906, False),
    "none_rates": ("none", "engineering", 30, 907, True),
    "none_production": ("none", "production", 100, 908, True),
}


def interval(right, of):
    if of == 0:
        return 0.0, 1.0
    z, p = 1.96, right / of
    centre = (p + z * z / (2 * of)) / (1 + z * z / of)
    half = z * math.sqrt(p * (1 - p) / of + z * z / (4 * of * of)) / (1 + z * z / of)
    return max(0.0, centre - half), min(1.0, centre + half)


def diagnose(program, bundle):
    """The answer, or None where the program fails."""
    done = subprocess.run([program, "gap", "diagnose", str(bundle), "--json"], capture_output=True, check=False)
    return json.loads(done.stdout) if done.returncode in (0, 1, 2) else None


def flat(value):
    return [x for row in value for x in flat(row)] if isinstance(value, list) else [value]


def covered(effect, truth):
    """Of each number that has an uncertainty: whether the true one is within twice that, and of which parameter."""
    for name, sds in effect["standard_uncertainty"].items():
        if name in truth:
            values, sds, real_ones = map(flat, (effect["parameters"][name], sds, truth[name]))
            if name == "vector_mg" and sum(v * r for v, r in zip(values, real_ones)) < 0:
                values = [-v for v in values]  # of an oscillation, whose phase is free
            for value, sd, real in zip(values, sds, real_ones):
                if sd is not None and sd > 0:
                    yield abs(value - real) <= 2 * sd, name


class Scores:
    def __init__(self):
        self.shares = {}

    def count(self, name, right):
        share = self.shares.setdefault(name, [0, 0])
        share[0] += bool(right)
        share[1] += 1

    def take(self, label, answer):
        if answer is None:
            self.count("failures", True)
            return
        named = [e["name"] for e in answer["effects"]]
        there = {e["name"]: e["parameters"] for e in label["effects"]}
        must = {e["name"] for e in label["effects"] if e["must"]}
        unknown = answer["unknown"]["present"]
        if not there:
            self.count("alarms", named or unknown)
            return
        for e in label["effects"]:
            if e.get("dominant") and e["must"]:
                self.count("dominant first", named[:1] == [e["name"]])
        for name in must:
            self.count("recall", name in named)
        for name in named:
            self.count("precision", name in there)
        for e in answer["effects"]:
            for right, of in covered(e, there.get(e["name"], {})):
                self.count("two sigma", right)
                self.count(f"  {e['name']}.{of}", right)
        self.count("exact set", must <= set(named) <= there.keys() and not unknown)
        self.count("needless unknown", unknown)

    def lines(self):
        for name, (right, of) in self.shares.items():
            low, high = interval(right, of)
            yield f"{name:<18} {right} of {of} = {right / of:.3f} [{low:.3f}, {high:.3f}]"
        if {"recall", "precision"} <= self.shares.keys():
            r, p = (self.shares[k][0] / self.shares[k][1] for k in ("recall", "precision"))
            yield f"{'F1':<18} {2 * r * p / (r + p):.3f}"


def run(program, name, folder, jobs):
    stratum, kind, count, seed, rates = SETS[name]
    labels = generate.make(folder / name, stratum, kind, count, seed, rates)
    (folder / name / "labels.json").write_text(json.dumps(labels, indent=1))
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        answers = list(pool.map(lambda bundle: diagnose(program, folder / name / bundle), labels))
    scores = Scores()
    for (bundle, label), answer in zip(labels.items(), answers):
        scores.take(label, answer)
        (folder / name / f"{bundle}.answer.json").write_text(json.dumps(answer))
    return scores


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("--set", choices=[*SETS, "all"], default="all")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--keep", type=pathlib.Path)
    a = parser.parse_args()
    for name in SETS if a.set == "all" else [a.set]:
        print(f"{name} {SETS[name]}", flush=True)
        with tempfile.TemporaryDirectory() as temporary:
            for line in run(a.program, name, a.keep or pathlib.Path(temporary), a.jobs).lines():
                print("  " + line, flush=True)


if __name__ == "__main__":
    main()
