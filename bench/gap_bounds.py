#!/usr/bin/python3
"""At which size an effect is named half of the time, over the `bound` of a recording: gap_bounds.py build/sixpoint

For each effect, units of `sixpoint simulate` with this effect alone, at some multiples of the bound of a recording with
nothing missing; printed is how many of --units are named by `gap diagnose`, and where half of them are. Of corners and
levels, which show more the lower they are, and of the gain of a wrong mode the multiple is that of what is lacking.
"""

import argparse
import concurrent.futures
import json
import math
import os
import random
import subprocess
import tempfile

# Parameters of an effect of this size; lines and turns have any direction.
EFFECTS = {
    "floor_vibration": lambda size, rng: {"vector_mg": vector(size, rng), "frequency_hz": rng.uniform(5, 40)},
    "electrical_line": lambda size, rng: {"vector_mg": vector(size, rng), "frequency_hz": rng.uniform(5, 40)},
    "settling": lambda size, rng: {"amplitude": size, "frequency_hz": rng.uniform(4, 15)},
    "filter_mismatch": lambda size, rng: {"gain": 1 - size, "offset_g": [0, 0, 0]},
    "seating": lambda size, rng: {"sd_deg": size},
    "random_walk": lambda size, rng: {"mg_per_sqrt_s": size},
    "flicker": lambda size, rng: {"mg": size},
    "dropped_samples": lambda size, rng: {"rate": size},
    "duplicated_samples": lambda size, rng: {"rate": size},
    "jitter": lambda size, rng: {"rms_ms": size},
}


def vector(length, rng):
    direction = [rng.gauss(0, 1) for _ in range(3)]
    return [length * component / math.hypot(*direction) for component in direction]


def diagnosed(sixpoint, protocol, seed, effects):
    with tempfile.TemporaryDirectory() as folder:
        scenario, bundle = os.path.join(folder, "scenario.json"), os.path.join(folder, "bundle")
        with open(scenario, "w") as file:
            json.dump({"schema": "sixpoint/scenario/1", "seed": seed, "protocol": protocol, "effects": effects}, file)
        subprocess.run([sixpoint, "simulate", "--scenario", scenario, "-o", bundle], check=True, capture_output=True)
        # It ends with 1 or 2 where something is named or unknown.
        return json.loads(subprocess.run([sixpoint, "gap", "diagnose", bundle, "--json"], capture_output=True).stdout)


def half(multiples, shares):
    for (low, below), (high, above) in zip(zip(multiples, shares), zip(multiples[1:], shares[1:])):
        if below < 0.5 <= above:
            return f"{low * (high / low) ** ((0.5 - below) / (above - below)):.2f}"
    return "-"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sixpoint")
    parser.add_argument("--protocol", choices=["production", "engineering"], default="production")
    parser.add_argument("--units", type=int, default=20)
    parser.add_argument("--seed", type=int, default=500)
    parser.add_argument("--effects", nargs="+", choices=list(EFFECTS), default=list(EFFECTS))
    options = parser.parse_args()
    multiples = [0.35, 0.5, 0.7, 1, 1.4, 2, 2.8]
    nominal = diagnosed(options.sixpoint, options.protocol, 7, [])
    bounds = {candidate["name"]: candidate["bound"] for candidate in nominal["candidates"]}
    print(f"{'effect':20} {'bound':>10}  " + " ".join(f"x{m:<4g}" for m in multiples) + "  half at")
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        for name in options.effects:
            if bounds[name] is None:
                print(f"{name:20} {'none':>10}")
                continue
            bound = 1 - bounds[name] if name == "filter_mismatch" else bounds[name]

            def is_named(trial):
                multiple, unit = trial
                seed = options.seed + unit
                parameters = EFFECTS[name](multiple * bound, random.Random(f"{name} {seed}"))
                answer = diagnosed(options.sixpoint, options.protocol, seed, [{"name": name, "parameters": parameters}])
                return any(effect["name"] == name for effect in answer["effects"])

            counts = []
            for multiple in multiples:
                counts.append(sum(pool.map(is_named, [(multiple, unit) for unit in range(options.units)])))
            shares = [count / options.units for count in counts]
            print(f"{name:20} {bound:10.4g}  " + " ".join(f"{count:<5}" for count in counts) + f"  {half(multiples, shares)}", flush=True)


if __name__ == "__main__":
    main()
