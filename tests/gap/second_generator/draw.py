"""Draws units: realistic ones, triples, and ones with nothing missing. Every number comes from the seed."""

import numpy as np

import bound
import protocol
import unit as unit_module

RATES_HZ = (20, 25, 30, 40, 50, 60, 80, 90, 100)
VISIBLE = 2.0  # over the bound: has to be named

ENGINEERING = ("misalignment", "non_orthogonality", "second_order", "third_order", "offset_tempco",
               "sensitivity_tempco", "drift", "seating", "clock_error", "floor_vibration")
# What can dominate the gap between means.
DOMINANT = {
    "engineering": ENGINEERING[:8],
    "production": ("misalignment", "non_orthogonality", "second_order", "seating"),
}
# Typical sizes of faults: of triples.
FAULTS = {
    "production": ("misalignment", "non_orthogonality", "seating", "settling", "floor_vibration",
                   "electrical_line", "filter_mismatch", "axis_rotation", "charging_zeros"),
    "engineering": ENGINEERING + ("tilt", "hysteresis", "warm_up", "settling", "electrical_line", "random_walk",
                                  "jitter", "saturation", "truncation", "filter_mismatch", "axis_rotation",
                                  "charging_zeros"),
}
FAULT_SIZE = {"misalignment": 0.5, "non_orthogonality": 0.005, "second_order": 0.3, "third_order": 0.04,
              "offset_tempco": 0.4, "sensitivity_tempco": 0.03, "drift": 2.0, "tilt": 0.2, "hysteresis": 0.8,
              "warm_up": 4.0}


def direction(rng):
    """Three numbers of root mean square 1, none of them lost."""
    while True:
        v = rng.normal(size=3)
        v *= np.sqrt(3) / np.linalg.norm(v)
        if np.min(np.abs(v)) > 0.15:
            return v


def draw_effect(name, severity, rng, fault):
    """`severity`: multiple of a typical size; of a fault, or of what every unit has."""
    bend = float(rng.uniform(0.03, 0.1) * rng.choice([-1, 1]))
    sizes = FAULT_SIZE if fault else {k: v for k, (_, v) in bound.SMALL.items()}
    if name in sizes:
        p = {bound.SMALL[name][0]: (severity * sizes[name] * direction(rng)).tolist()}
        if name == "warm_up":
            p["tau_s"] = float(rng.uniform(150, 600))
    elif name == "seating":
        p = {"sd_deg": severity * (0.1 if fault else 0.03)}
    elif name == "clock_error":
        p = {"ppm": severity * (300.0 if fault else 20.0) * float(rng.choice([-1, 1]))}
    elif name in ("floor_vibration", "electrical_line"):
        p = {"vector_mg": (severity * (0.7 if fault else 0.3) * direction(rng)).tolist(),
             "frequency_hz": float(rng.uniform(5, 9.5))}
    elif name == "settling":
        p = {"amplitude": 0.03 * severity, "frequency_hz": float(rng.uniform(3, 8)), "decay_s": float(rng.uniform(0.2, 0.6))}
    elif name == "random_walk":
        p = {"mg_per_sqrt_s": 0.2 * severity}
    elif name == "jitter":
        p = {"rms_ms": 0.7 * severity}
    elif name == "saturation":
        p = {"level_g": float(rng.uniform(5, 8))}
    elif name == "filter_mismatch":
        p = {"gain": float(rng.uniform(0.8, 0.95)), "offset_g": (rng.uniform(0.1, 0.2, 3) * rng.choice([-1, 1], 3)).tolist()}
    elif name == "axis_rotation":
        p = {"matrix": [0, -1, 0, 1, 0, 0, 0, 0, 1]}
    elif name == "charging_zeros":
        p = {"seconds": float(rng.uniform(5, 15))}
    else:
        p = {}
    out = bound.effect(name, p, bend)
    out["severity"] = float(severity)
    return out


def small(rng):
    return float(np.exp(rng.uniform(np.log(0.3), np.log(1.2))))


def realistic(kind, features, rng):
    """All ten small effects, or four to eight; one has twice the gap of any other."""
    while True:
        names = list(ENGINEERING)
        if rng.random() < 0.5:
            names = rng.permutation(names)[: rng.integers(4, 9)].tolist()
        able = [n for n in names if n in DOMINANT[kind]]
        if not able:
            continue
        lead = str(rng.choice(able))
        effects = [draw_effect(n, rng.uniform(2.5, 5) if n == lead else small(rng), rng, False) for n in names]
        gaps = {e["name"]: features.gap_mg(e) for e in effects}
        if gaps[lead] > 2 * max(g for n, g in gaps.items() if n != lead):
            for e in effects:
                e["dominant"] = e["name"] == lead
            return effects


def triple(kind, rng):
    names = rng.permutation(FAULTS[kind])[:3].tolist()
    return [draw_effect(n, float(np.exp(rng.uniform(np.log(0.5), np.log(2.5)))), rng, True) for n in names]


def bundle(stratum, kind, rate_hz, rng):
    """Everything that a bundle is written from, and its label."""
    segments = protocol.make(kind, rate_hz, rng)
    temperature = protocol.Temperature(segments, rng)
    span_s = segments[-1].start_s + segments[-1].seconds
    unit = unit_module.Unit(rng, rate_hz, span_s)
    effects = []
    features = None if stratum == "none" else bound.Features(segments, temperature, rate_hz, unit)
    if stratum == "realistic":
        effects = realistic(kind, features, rng)
    elif stratum == "triple":
        effects = triple(kind, rng)
    for e in effects:
        e["size_over_bound"] = round(bound.size_over_bound(e, features, segments, rate_hz, unit), 3)
        e["gap_mg"] = round(features.gap_mg(e), 4)
        e["must"] = e["size_over_bound"] >= VISIBLE
    counts, sample_s = unit_module.stored(unit, effects, segments, temperature, rate_hz, rng)
    label = {"stratum": stratum, "protocol": kind, "rate_hz": rate_hz, "effects": effects}
    return segments, counts, sample_s, temperature, label
