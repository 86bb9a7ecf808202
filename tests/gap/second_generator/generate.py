#!/usr/bin/python3
"""Writes bundles and labels.json: generate.py FOLDER --stratum realistic --count 20 --seed 1

Strata: realistic, triple, none. Protocols: engineering, production. --rates draws 20 to 100 Hz, else 100 Hz.
The same seed gives the same bundles.
"""

import argparse
import json
import pathlib

import numpy as np

import draw
import files


def header(rng):
    """Drawn without regard to the effects."""
    return {
        "serial": f"MOS2A{rng.integers(10_000_000, 99_999_999)}",
        "firmware": str(rng.choice(["1.8.0", "1.9.2"])),
    }


def make(folder, stratum, kind, count, seed, rates):
    labels = {}
    for i in range(count):
        rng = np.random.default_rng([seed, i])
        rate_hz = int(rng.choice(draw.RATES_HZ)) if rates else 100
        segments, counts, sample_s, temperature, label = draw.bundle(stratum, kind, rate_hz, rng)
        name = f"{stratum[0]}{kind[0]}{seed}_{i:03d}"
        files.write(folder / name, segments, counts, sample_s, temperature, rate_hz, header(rng), rng)
        labels[name] = label
    return labels


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--stratum", choices=["realistic", "triple", "none"], default="realistic")
    parser.add_argument("--protocol", choices=["engineering", "production"], default="engineering")
    parser.add_argument("--count", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--rates", action="store_true")
    a = parser.parse_args()
    labels = make(a.folder, a.stratum, a.protocol, a.count, a.seed, a.rates)
    (a.folder / "labels.json").write_text(json.dumps(labels, indent=1))


if __name__ == "__main__":
    main()
