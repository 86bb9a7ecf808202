#!/usr/bin/env python3
"""Computes the station's statistics a second time, by other formulas, and compares them with the program's.

  statistics_oracle.py SIXPOINT_PROGRAM

Oracles, nothing of which is shared with station/:
  gage R&R     sums of squares by correction terms in exact fractions (Montgomery, Design and Analysis of
               Experiments, 5.3), p by integrating the density of F; on the table of AIAG's Measurement Systems
               Analysis (4th ed., III-B 6; the same in Minitab's Gageaiag.mtw), whose published results are checked
               as well, and on random studies
  d2, d3, D4   closed forms for two points, 2/sqrt(pi), sqrt(2 - 4/pi), 1 + 3 d3/d2, and Tippett's integral of the
               range of a normal sample
  intervals    Wilson's as the roots of its quadratic, chi-square and normal quantiles by bisection of integrals
"""
import json
import math
import random
import subprocess
import sys
import tempfile
from fractions import Fraction
from pathlib import Path

PROGRAM = sys.argv[1]


def run(*words, allowed=(0,)):
    done = subprocess.run([PROGRAM, *words], capture_output=True, text=True)
    assert done.returncode in allowed, f"{words}: {done.returncode}: {done.stderr}"
    return done.stdout


def near(name, got, wanted, relative=1e-9, absolute=0.0):
    assert got is not None and abs(got - wanted) <= relative * abs(wanted) + absolute, f"{name}: {got} is not {wanted}"


def integral(function, low, high, pieces=4000):
    """Simpson's rule."""
    step = (high - low) / pieces
    return step / 3 * sum((1 if i in (0, pieces) else 4 if i % 2 else 2) * function(low + i * step)
                          for i in range(pieces + 1))


# --- distributions ---

def f_upper_tail(f, a, b):
    """P(F > f): the beta density from 0 to b / (b + a f), with x = sin^2 t so that it has no poles."""
    log_beta = math.lgamma(a / 2) + math.lgamma(b / 2) - math.lgamma((a + b) / 2)
    density = lambda t: 2 * math.sin(t) ** (b - 1) * math.cos(t) ** (a - 1)
    return integral(density, 0, math.asin(math.sqrt(b / (b + a * f)))) / math.exp(log_beta)


def normal_below(x):
    return 0.5 * (1 + math.erf(x / math.sqrt(2)))


def bisect(function, wanted, low, high):
    for _ in range(100):
        middle = (low + high) / 2
        low, high = (middle, high) if function(middle) < wanted else (low, middle)
    return (low + high) / 2


def normal_quantile(p):
    return bisect(normal_below, p, -10, 10)


def chi_square_quantile(p, freedom):
    # x = u^2 takes the pole of one degree of freedom away.
    norm = 2 ** (freedom / 2 - 1) * math.gamma(freedom / 2)
    below = lambda x: integral(lambda u: u ** (freedom - 1) * math.exp(-u * u / 2), 0, math.sqrt(x), 600) / norm
    return bisect(below, p, 0, 20 * freedom + 50)


# --- gage R&R ---

AIAG = {
    "A": ["0.29 -0.56 1.34 0.47 -0.80 0.02 0.59 -0.31 2.26 -1.36",
          "0.41 -0.68 1.17 0.50 -0.92 -0.11 0.75 -0.20 1.99 -1.25",
          "0.64 -0.58 1.27 0.64 -0.84 -0.21 0.66 -0.17 2.01 -1.31"],
    "B": ["0.08 -0.47 1.19 0.01 -0.56 -0.20 0.47 -0.63 1.80 -1.68",
          "0.25 -1.22 0.94 1.03 -1.20 0.22 0.55 0.08 2.12 -1.62",
          "0.07 -0.68 1.34 0.20 -1.28 0.06 0.83 -0.34 2.19 -1.50"],
    "C": ["0.04 -1.38 0.88 0.14 -1.46 -0.29 0.02 -0.46 1.77 -1.49",
          "-0.11 -1.13 1.09 0.20 -1.07 -0.67 0.01 -0.56 1.45 -1.77",
          "-0.15 -0.96 0.67 0.11 -1.45 -0.49 0.21 -0.49 1.87 -2.16"],
}


def anova(rows):
    """rows: (part, operator, text of the value). Sums of squares and degrees of freedom, exact."""
    cells, parts, operators = {}, {}, {}
    total = squares = Fraction(0)
    for part, operator, text in rows:
        value = Fraction(text)
        for table, key in ((cells, (part, operator)), (parts, part), (operators, operator)):
            table[key] = table.get(key, 0) + value
        total += value
        squares += value * value
    n, p, o = len(rows), len(parts), len(operators)
    t = n // (p * o)
    correction = total * total / n
    of_parts = sum(each ** 2 for each in parts.values()) / (o * t) - correction
    of_operators = sum(each ** 2 for each in operators.values()) / (p * t) - correction
    of_cells = sum(each ** 2 for each in cells.values()) / t - correction
    return {"part": (of_parts, p - 1), "operator": (of_operators, o - 1),
            "part x operator": (of_cells - of_parts - of_operators, (p - 1) * (o - 1)),
            "repeatability": (squares - correction - of_cells, p * o * (t - 1))}, (p, o, t)


def gage(rows, pool_above=0.25):
    table, (p, o, t) = anova(rows)
    mean = {name: ss / df for name, (ss, df) in table.items()}
    f = mean["part x operator"] / mean["repeatability"]
    chance = f_upper_tail(float(f), table["part x operator"][1], table["repeatability"][1])
    pooled = chance > pool_above
    error, interaction = mean["repeatability"], Fraction(0)
    against = mean["part x operator"]
    if pooled:
        (a, b), (c, d) = table["part x operator"], table["repeatability"]
        error = against = (a + c) / (b + d)
    else:
        interaction = max(Fraction(0), (mean["part x operator"] - mean["repeatability"]) / t)
    operator = max(Fraction(0), (mean["operator"] - against) / (p * t))
    part = max(Fraction(0), (mean["part"] - against) / (o * t))
    grr = error + operator + interaction
    return {"table": table, "f": float(f), "p": chance, "pooled": pooled, "repeatability": float(error),
            "operator": float(operator), "part x operator": float(interaction), "part": float(part),
            "grr": float(grr), "grr_percent": 100 * math.sqrt(grr / (grr + part)),
            "ndc": int(1.41 * math.sqrt(part / grr))}


def compare_gage(name, rows, folder):
    path = folder / f"{name}.csv"
    path.write_text("part,operator,value\n" + "".join(f"{a},{b},{c}\n" for a, b, c in rows))
    got = json.loads(run("gage-rr", str(path), "--json", allowed=(0, 1)))
    wanted = gage(rows)
    for row in got["anova"]:
        ss, df = wanted["table"][row["source"]]
        near(f"{name} {row['source']} SS", row["sum_of_squares"], float(ss), 1e-9, 1e-12)
        assert row["degrees_of_freedom"] == df, (name, row)
    interaction = next(row for row in got["anova"] if row["source"] == "part x operator")
    near(f"{name} F", interaction["f"], wanted["f"], 1e-8)
    near(f"{name} p", interaction["p"], wanted["p"], 1e-6, 1e-9)
    assert got["pooled"] == wanted["pooled"], name
    for part in ("grr", "repeatability", "operator", "part x operator", "part"):
        near(f"{name} {part}", got["components"][part]["variance"], wanted[part], 1e-8, 1e-14)
    near(f"{name} %GRR", got["grr_percent"], wanted["grr_percent"], 1e-8)
    assert got["ndc"] == wanted["ndc"], name
    return wanted


def check_gage(folder):
    rows = [(part + 1, who, text) for who, trials in AIAG.items() for trial in trials
            for part, text in enumerate(trial.split())]
    aiag = compare_gage("aiag", rows, folder)
    # As published with the table.
    for name, (wanted, digits) in {"part": (88.3619, 5e-5), "operator": (3.1673, 5e-5),
                                   "part x operator": (0.3590, 5e-5), "repeatability": (2.7589, 5e-5)}.items():
        near(f"published {name}", float(aiag["table"][name][0]), wanted, 0, digits)
    near("published p", aiag["p"], 0.974, 0, 5e-4)
    near("published %GRR", aiag["grr_percent"], 27.86, 0, 5e-3)
    assert aiag["ndc"] == 4
    draw = random.Random(7)
    pooled = 0
    for study in range(40):
        p, o, t = draw.randint(2, 12), draw.randint(2, 5), draw.randint(2, 4)
        parts = [draw.gauss(0, 3) for _ in range(p)]
        people = [draw.gauss(0, draw.choice((0, 0.5, 2))) for _ in range(o)]
        odd = draw.choice((0, 0, 1.5))
        both = [[draw.gauss(0, odd) if odd else 0 for _ in range(o)] for _ in range(p)]
        rows = [(f"P{i}", f"O{j}", f"{parts[i] + people[j] + both[i][j] + draw.gauss(0, 0.6):.4f}")
                for i in range(p) for j in range(o) for _ in range(t)]
        pooled += compare_gage(f"study{study}", rows, folder)["pooled"]
    assert 5 < pooled < 35, f"both ways are tried: {pooled} of 40 pooled"


# --- charts, yields, capability ---

def tippett(n):
    """Expected range of n standard normal values."""
    return integral(lambda x: 1 - (1 - normal_below(x)) ** n - normal_below(x) ** n, -9, 9)


def check_charts_and_statistics(folder):
    store = str(folder / "s.db")
    sensor = "serial=MOS2A45130007,true_sensitivity_lsb_per_g=237.7/251.8/242.3"
    for seed in range(21, 27):
        run("jig", "--device", f"virtual:seed={seed},jig=auto", "--store", store, "--operator", "Ada", allowed=(0, 1))
    run("jig", "--device", "virtual:seed=9,serial=MOS2A45130009,jig=auto,zero_lsb=50/200/61,"
        "true_sensitivity_lsb_per_g=237.7/251.8/242.3,true_zero_lsb=49.9/199.8/60.8", "--store", store, allowed=(0, 1))
    run("check-unit", "add", "MOS2A45130007", "--operator", "Eve", "--reason", "w", "--store", store)
    for seed in range(1, 13):
        off = 49.9 + 0.4 * ((seed * 7) % 5)  # the baseline scatters, as a check unit's does
        run("jig", "--device", f"virtual:seed={seed},{sensor},true_zero_lsb={off:.2f}/95.8/60.8,jig=auto", "--store",
            store, "--station", "B")

    d2 = 2 / math.sqrt(math.pi)
    d3 = math.sqrt(2 - 4 / math.pi)
    near("d2", tippett(2), d2, 1e-7)
    near("d2 of the chart", 1.128, d2, 0, 5e-4)
    near("D4 of the chart", 3.267, 1 + 3 * d3 / d2, 0, 1e-3)
    state = json.loads(run("check-unit", "chart", "--station", "B", "--store", store, "--json", allowed=(0, 1)))
    assert len(state["charts"]) == 6
    checked = 0
    for chart in state["charts"]:
        values = chart["values"]
        base = values[:chart["baseline"]]
        centre = math.fsum(base) / len(base)
        ranges = [abs(a - b) for a, b in zip(base, base[1:])]
        mean_range = math.fsum(ranges) / len(ranges)
        near("centre", chart["centre"], centre)
        near("mean range", chart["mean_range"], mean_range)
        least = 0.3 if chart["name"].startswith("zero") else 0.03
        checked += mean_range / d2 > least
        near("sigma", chart["sigma"], max(mean_range / d2, least), 5e-4)
        near("upper", chart["upper"], centre + 3 * chart["sigma"])
        near("lower", chart["lower"], centre - 3 * chart["sigma"])
        near("upper range", chart["upper_range"], (1 + 3 * d3 / d2) * mean_range, 5e-4)
    assert checked >= 1, "a chart whose sigma comes from its scatter"

    statistics = json.loads(run("statistics", "--store", store, "--json"))
    z = normal_quantile(0.975)
    share = statistics["all"]["yield"]
    assert share["of"] == 7, share
    p, n = share["count"] / share["of"], share["of"]
    # |p - x| = z sqrt(x (1 - x) / n): the two roots.
    a, b, c = 1 + z * z / n, -(2 * p + z * z / n), p * p
    roots = [(-b + sign * math.sqrt(b * b - 4 * a * c)) / (2 * a) for sign in (-1, 1)]
    near("Wilson low", share["interval"][0], roots[0], 1e-6)
    near("Wilson high", share["interval"][1], roots[1], 1e-6)
    assert "zero_offset_mg x" in statistics["capability"], list(statistics["capability"])
    for name, one in statistics["capability"].items():
        n, freedom = one["n"], one["n"] - 1
        half = z * math.sqrt(1 / (9 * n) + one["cpk"] ** 2 / (2 * freedom))
        near(f"{name} Cpk low", one["cpk_interval"][0], one["cpk"] - half, 1e-6, 1e-9)
        near(f"{name} Cpk high", one["cpk_interval"][1], one["cpk"] + half, 1e-6, 1e-9)
    cp = statistics["capability"]["zero_offset_mg x"]
    near("Cp", cp["cp"], 1400 / (6 * cp["sd"]))
    near("Cpk", cp["cpk"], (700 - abs(cp["mean"])) / (3 * cp["sd"]))
    for side, tail in ((0, 0.025), (1, 0.975)):
        near("Cp interval", cp["cp_interval"][side],
             cp["cp"] * math.sqrt(chi_square_quantile(tail, cp["n"] - 1) / (cp["n"] - 1)), 1e-5)


with tempfile.TemporaryDirectory() as name:
    check_gage(Path(name))
    check_charts_and_statistics(Path(name))
print("gage R&R of AIAG's table and 40 random studies, chart constants, limits and intervals: as computed here")
