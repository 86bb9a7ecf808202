"""One unit: what it senses and what it stores. Every law is bent, as real ones are, by `bend` (at most a tenth).

An effect is a dictionary with `name`, `parameters` and `bend`; see sensed() for what each does. Acceleration
in g, small sizes in mg, temperature in C relative to 25.
"""

import numpy as np

SEATING_DEG = 0.01  # every placement
LSB_G = 1 / 256


def rotation_of(vector_deg):
    """Rodrigues' formula."""
    vector = np.radians(np.asarray(vector_deg, float))
    angle = np.linalg.norm(vector)
    if angle == 0:
        return np.eye(3)
    k = vector / angle
    cross = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


class Unit:
    def __init__(self, rng, rate_hz, span_s):
        self.gain = 1 + 0.02 * rng.normal(size=3)
        self.offset_g = 0.035 * rng.normal(size=3)
        self.noise_mg = np.array([3.9, 3.9, 5.5]) * np.sqrt(rate_hz / 100) * (1 + 0.04 * rng.normal(size=3))
        self.span_s = span_s

    def sensed(self, effects, segment, time_s, host_s, celsius, turn, approach_sign):
        """Without noise, in g, one row per time. `time_s` counts from the segment's start."""
        by = {e["name"]: e for e in effects}
        p = {name: e["parameters"] for name, e in by.items()}
        bend = {name: e["bend"] for name, e in by.items()}
        lab = np.zeros((len(time_s), 3))
        lab[:, 2] = 1
        if segment.tone:
            t = segment.tone
            wave = t["amplitude_g"] * np.sin(2 * np.pi * t["frequency_hz"] * time_s + t["phase_rad"])
            lab += wave[:, None] * t["direction"]
        if "tilt" in p:
            lab = lab @ rotation_of(p["tilt"]["rotation_vector_deg"]).T
        if "floor_vibration" in p:
            q = p["floor_vibration"]
            w = 2 * np.pi * q["frequency_hz"] * host_s
            wave = np.sin(w) + bend["floor_vibration"] * np.sin(2 * w)
            lab = lab + 1e-3 * wave[:, None] * np.array(q["vector_mg"])
        f = lab @ segment.rotation.T @ rotation_of(turn).T
        if "settling" in p and segment.approach_g is not None:
            q = p["settling"]
            ring = q["amplitude"] * np.exp(-time_s / q["decay_s"]) * np.cos(2 * np.pi * q["frequency_hz"] * time_s)
            f = f - ring[:, None] * segment.approach_g
        if "misalignment" in p:
            f = f @ rotation_of(p["misalignment"]["rotation_vector_deg"]).T
        if "non_orthogonality" in p:
            yz, xz, xy = p["non_orthogonality"]["yz_xz_xy"]
            f = f + f @ np.array([[0, xy, xz], [xy, 0, yz], [xz, yz, 0]])
        out = f.copy()
        if "second_order" in p:
            knee = 1 - bend["second_order"] * np.maximum(0, 1 - 0.7 / np.maximum(np.abs(f), 1e-9))
            out += 1e-3 * np.array(p["second_order"]["mg_per_g2"]) * f**2 * knee
        if "third_order" in p:
            shape = 1 - bend["third_order"] * np.minimum(1, np.abs(f) / 8)
            out += 1e-3 * np.array(p["third_order"]["mg_per_g3"]) * f**3 * shape
        warm = (celsius - 25)[:, None]
        if "sensitivity_tempco" in p:
            law = warm * (1 + bend["sensitivity_tempco"] * (warm / 20) ** 2)
            out += f * 0.01 * np.array(p["sensitivity_tempco"]["percent_per_c"]) * law
        if "offset_tempco" in p:
            law = warm * (1 + bend["offset_tempco"] * (warm / 20) ** 2)
            out += 1e-3 * np.array(p["offset_tempco"]["mg_per_c"]) * law
        if "hysteresis" in p:
            sign = approach_sign * (1 + bend["hysteresis"] * (approach_sign > 0))
            out += 1e-3 * np.array(p["hysteresis"]["mg"]) * sign
        if "warm_up" in p:
            q = p["warm_up"]
            law = (1 - bend["warm_up"]) * np.exp(-host_s / q["tau_s"]) + bend["warm_up"] * np.exp(-4 * host_s / q["tau_s"])
            out += 1e-3 * law[:, None] * np.array(q["mg"])
        if "drift" in p:
            # A ripple, peak to peak a share `bend` of all that it drifts.
            law = host_s / 3600 + bend["drift"] / 2 * self.span_s / 3600 * np.sin(2 * np.pi * 2.3 * host_s / self.span_s)
            out += 1e-3 * law[:, None] * np.array(p["drift"]["mg_per_h"])
        if "electrical_line" in p:
            q = p["electrical_line"]
            w = 2 * np.pi * q["frequency_hz"] * host_s
            out += 1e-3 * np.sin(w)[:, None] * np.array(q["vector_mg"])
        if "filter_mismatch" in p:
            out = out * p["filter_mismatch"]["gain"] + np.array(p["filter_mismatch"]["offset_g"])
        return self.gain * out + self.offset_g


def approach_signs(segments):
    """Per segment and axis: +1 where the axis last rose, -1 where it last fell, 0 before its first step."""
    signs, now = [], np.zeros(3)
    for s in segments:
        step = s.approach_g
        now = np.where(np.abs(step) > 0.05, np.sign(step), now)
        signs.append(now)
    return signs


def stored(unit, effects, segments, temperature, rate_hz, rng):
    """Counts of all segments, one after another, and the host's time of each sample."""
    by = {e["name"]: e["parameters"] for e in effects}
    fast = 1 + 1e-6 * by.get("clock_error", {"ppm": 0})["ppm"]
    extra_deg = by.get("seating", {"sd_deg": 0})["sd_deg"]
    signs = approach_signs(segments)
    turns, counts, times = {}, [], []
    walk, walked_until = np.zeros(3), 0.0
    for segment, sign in zip(segments, signs):
        n = int(round(segment.seconds * rate_hz))
        t = np.arange(n) / (rate_hz * fast)
        if "jitter" in by:
            t = t + 1e-3 * by["jitter"]["rms_ms"] * rng.normal(size=n)
        host = segment.start_s + t
        if segment.placement not in turns:
            turns[segment.placement] = SEATING_DEG * rng.normal(size=3) + extra_deg * rng.normal(size=3)
        a = unit.sensed(effects, segment, t, host, temperature.at(host), turns[segment.placement], sign)
        if "random_walk" in by:
            q = by["random_walk"]["mg_per_sqrt_s"]
            steps = rng.normal(size=(n, 3)) / np.sqrt(rate_hz)
            steps[0] *= np.sqrt(max(host[0] - walked_until, 0) * rate_hz)
            path = walk + q * np.cumsum(steps, axis=0)
            walk, walked_until = path[-1], host[-1]
            a = a + 1e-3 * path
        a = a + 1e-3 * unit.noise_mg * rng.normal(size=(n, 3))
        if "saturation" in by:  # the converter's range: noise is clipped, too
            a = np.clip(a, -by["saturation"]["level_g"], by["saturation"]["level_g"])
        if "axis_rotation" in by:
            a = a @ np.array(by["axis_rotation"]["matrix"], float).reshape(3, 3).T
        a = a / LSB_G
        whole = np.trunc(a) if "truncation" in by else np.rint(a)
        counts.append(np.clip(whole, -2048, 2047).astype(np.int16))
        times.append(segment.start_s + np.arange(n) / (rate_hz * fast))
    counts = np.concatenate(counts)
    if "charging_zeros" in by:
        n = int(by["charging_zeros"]["seconds"] * rate_hz)
        first = rng.integers(0, len(counts) - n)
        counts[first : first + n] = 0
    return counts, np.concatenate(times)
