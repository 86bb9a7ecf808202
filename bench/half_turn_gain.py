#!/usr/bin/python3
"""What the half turns of `sixpoint jig --protocol production+` buy: half_turn_gain.py build/sixpoint --size 0.03

The same virtual units by both protocols: the jig's base is tilted, and the sensor turned in its case, each by --size
degrees in a direction drawn from the seed. Printed are what `gap diagnose` names of the two, of 20 units, with Wilson's
intervals (1927, 95 %), and how many components lie within two standard uncertainties of the truth. With --forgotten a
person at a terminal is played who lays the unit on the three faces and forgets the half turn (a minute for ten units).
"""

import argparse
import json
import math
import os
import pty
import random
import re
import subprocess
import tempfile


def vector_deg(rng, count, size_deg):
    direction = [rng.gauss(0, 1) for _ in range(count)]
    length = math.hypot(*direction)
    return [component * size_deg / length for component in direction] + [0] * (3 - count)


def interval(hits, count):
    z = 1.96
    middle = (hits + z * z / 2) / (count + z * z)
    half = z / (count + z * z) * math.sqrt(hits * (count - hits) / count + z * z / 4)
    return f"{hits} of {count} [{max(0, middle - half):.2f}, {min(1, middle + half):.2f}]"


def run_alone(command):
    return json.loads(subprocess.run(command, capture_output=True, text=True).stdout)


def run_by_words(command):
    """Answers each "turn the unit to +x: its ..." with +x, and a half turn, too."""
    ours, theirs = pty.openpty()
    program = subprocess.Popen(command, stdin=theirs, stderr=theirs, stdout=subprocess.PIPE)
    os.close(theirs)
    text = ""
    while True:
        try:
            text += os.read(ours, 4096).decode()
        except OSError:  # the program ended
            break
        while "\n" in text:
            line, text = text.split("\n", 1)
            if asked := re.search(r" (?:on|to) ([+-][xyz]): its", line):
                os.write(ours, (asked[1] + "\n").encode())
    answer = json.loads(program.stdout.read())
    program.wait()
    return answer


def diagnosed(sixpoint, folder, seed, protocol, tilt_deg, misalignment_deg, forgotten):
    text = lambda vector: "/".join(f"{component:.5f}" for component in vector)
    device = f"virtual:seed={seed},jig_tilt_deg={text(tilt_deg)},misalignment_deg={text(misalignment_deg)}"
    store = f"{folder}/{seed}{protocol}.db"
    command = [sixpoint, "jig", "--protocol", protocol, "--store", store, "--json", "--device"]
    if forgotten:
        run = run_by_words(command + [device + ",pace=40", "--state", f"{folder}/state"])
    else:
        run = run_alone(command + [device + ",jig=auto"])
    return run_alone([sixpoint, "gap", "diagnose", "--run", run["run"], "--store", store, "--json"])


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sixpoint")
    parser.add_argument("--size", type=float, default=0.03, help="of both rotations, in degrees")
    parser.add_argument("--seed", type=int, default=101, help="of the first unit")
    parser.add_argument("--units", type=int, default=20)
    parser.add_argument("--forgotten", action="store_true")
    options = parser.parse_args()
    for protocol in ["production+"] if options.forgotten else ["production", "production+"]:
        tilts = misalignments = both = unknown = others = within = components = 0
        with tempfile.TemporaryDirectory() as folder:
            for seed in range(options.seed, options.seed + options.units):
                rng = random.Random(seed)
                truth = {"tilt": vector_deg(rng, 2, options.size), "misalignment": vector_deg(rng, 3, options.size)}
                answer = diagnosed(options.sixpoint, folder, seed, protocol, *truth.values(), options.forgotten)
                named = {effect["name"]: effect for effect in answer["effects"]}
                tilts += "tilt" in named
                misalignments += "misalignment" in named
                both += "tilt" in named and "misalignment" in named
                unknown += answer["unknown"]["probability"] > 0.5
                others += len(named.keys() - truth.keys())
                for name in named.keys() & truth.keys():
                    for axis in range(2 if name == "tilt" else 3):
                        found = named[name]["parameters"]["rotation_vector_deg"][axis]
                        sd = named[name]["standard_uncertainty"]["rotation_vector_deg"][axis]
                        components += 1
                        within += abs(found - truth[name][axis]) <= 2 * sd
        print(
            f"{protocol} at {options.size} degrees: both {interval(both, options.units)}, tilt {tilts}, misalignment "
            f"{misalignments}, unknown {unknown}, others {others}, within two standard uncertainties {within} of {components}"
        )


main()
