#!/usr/bin/python3
"""What the best test of each effect alone would name, as answers for gap score: gap_best_test.py LABELS > ANSWERS

For labels of `sixpoint gap challenge --faint`, units with one effect at most. The best test of an effect of so many unknown
numbers compares the sum of their squares, in standard deviations, with the chi-square that chance exceeds in one of
--alarms recordings, for all effects and all frequencies, time constants or orders that are searched together. The sum
of squares of an effect whose index is d (docs/gap-benchmark.md) is a noncentral chi-square of d^2.
"""

import argparse
import json
import math
import random

INDEX_AT_BOUND = 3  # gap/benchmark/shown.h
LINE = (6, 36000)  # sine and cosine of three axes; 40 minutes up to 15 Hz
# Unknown numbers, and how many of these are searched; those not listed have three, once.
SEARCHED = {
    "tilt": (2, 1),
    "clock_error": (1, 1),
    "hysteresis": (3, 2),
    "warm_up": (3, 4),
    "settling": (6, 30),
    "electrical_line": LINE,
    "floor_vibration": LINE,
    "seating": (120, 1),  # 40 placements about three axes
}


def exceeded(square, numbers):
    """Probability that the squares of so many standard normal numbers sum to more than this."""
    half = square / 2
    if numbers % 2:
        terms = (half ** (i - 0.5) / math.gamma(i + 0.5) for i in range(1, (numbers + 1) // 2))
        return math.erfc(math.sqrt(half)) + math.exp(-half) * sum(terms)
    return math.exp(-half) * sum(half**i / math.factorial(i) for i in range(numbers // 2))


def threshold(numbers, chance):
    low, high = 0.0, 1000.0
    while high - low > 1e-6:
        middle = (low + high) / 2
        low, high = (middle, high) if exceeded(middle, numbers) > chance else (low, middle)
    return high


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("labels")
    parser.add_argument("--alarms", type=float, default=200, help="one in so many recordings")
    parser.add_argument("--effects", type=int, default=15, help="that are tested")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    rng = random.Random(arguments.seed)
    with open(arguments.labels) as file:
        for label in map(json.loads, file):
            if "bundle" not in label:
                continue
            named = []
            for effect in label["effects"]:
                numbers, searches = SEARCHED.get(effect["name"], (3, 1))
                index = INDEX_AT_BOUND * effect["size_over_bound"]
                square = (index + rng.gauss(0, 1)) ** 2 + sum(rng.gauss(0, 1) ** 2 for _ in range(numbers - 1))
                if square > threshold(numbers, 1 / (arguments.alarms * arguments.effects * searches)):
                    named.append({"name": effect["name"], "probability": 0.95})
            print(json.dumps({"bundle": label["bundle"], "effects": named, "unknown": {"probability": 0.01, "present": False}}))


main()
