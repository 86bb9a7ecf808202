"""How large an effect is against the smallest that the recording shows: the detection index over 3.

A matched filter on means (of at most a minute) and tone amplitudes that knows the form of the effect. Noise,
seating, gain, offset and all other effects of the catalogue at their small sizes are Gaussian beside it, whether
they are there or not: who diagnoses does not know. Of a random effect, index^2 is twice the Kullback-Leibler
divergence (Kay, Fundamentals of Statistical Signal Processing II, 1998, 4.3 and 5.3).
"""

import math

import numpy as np

import protocol
import unit as unit_module

# Effects of means and tones: per number of each parameter the size that every unit has.
SMALL = {
    "misalignment": ("rotation_vector_deg", 0.2),
    "non_orthogonality": ("yz_xz_xy", 0.004),
    "second_order": ("mg_per_g2", 0.25),
    "third_order": ("mg_per_g3", 0.03),
    "offset_tempco": ("mg_per_c", 0.25),
    "sensitivity_tempco": ("percent_per_c", 0.02),
    "drift": ("mg_per_h", 1.0),
    "tilt": ("rotation_vector_deg", 0.05),
    "hysteresis": ("mg", 0.2),
    "warm_up": ("mg", 1.0),
}
EXACT = 100.0  # marks that noise cannot make


def effect(name, parameters, bend=0.0):
    return {"name": name, "parameters": parameters, "bend": bend}


def of_size(name, vector):
    parameters = {SMALL[name][0]: list(vector)}
    if name == "warm_up":
        parameters["tau_s"] = 300.0
    return effect(name, parameters)


class Features:
    """Means and tone amplitudes without noise, and the covariance of what is random in them."""

    def __init__(self, segments, temperature, rate_hz, unit):
        self.unit, self.temperature = unit, temperature
        signs = unit_module.approach_signs(segments)
        self.rows = []  # segment, sign, middle of the piece, seconds, tone or not
        for s, sign in zip(segments, signs):
            pieces = 1 if s.tone else max(1, int(s.seconds // protocol.LONG_PIECE_S))
            for i in range(pieces):
                length = s.seconds / pieces
                self.rows.append((s, sign, (i + 0.5) * length, length, False))
            if s.tone and s.tone["frequency_hz"] < rate_hz / 2 and s.tone["amplitude_g"] < 8:
                self.rows.append((s, sign, s.seconds / 2, s.seconds, True))
        self.white = np.concatenate(
            [unit.noise_mg**2 * (2 if tone else 1) / (length * rate_hz) for *_, length, tone in self.rows]
        )
        nominal = self.mean_mg([])
        covariance = np.diag(self.white) + self.seating(unit_module.SEATING_DEG)
        for axis in range(3):
            for column, sd in ((nominal, 0.02), (np.full(len(nominal), 1.0), 35)):
                t = np.where(np.arange(len(nominal)) % 3 == axis, column, 0)
                covariance += sd**2 * np.outer(t, t)
        self.base = covariance
        self.parts = {}
        for name, (_, size) in SMALL.items():
            columns = [self.mean_mg([of_size(name, size * np.eye(3)[i])]) - nominal for i in range(3)]
            self.parts[name] = sum(np.outer(c, c) for c in columns)
        self.all = covariance + sum(self.parts.values())

    def mean_mg(self, effects, turns=None):
        out = []
        for i, (s, sign, middle, _, tone) in enumerate(self.rows):
            if s.tone:
                phase = np.arange(32) / 32
                t = phase / s.tone["frequency_hz"]
            else:
                t = np.array([middle])
            host = np.full(len(t), s.start_s + middle)
            turn = np.zeros(3) if turns is None else turns[i]
            a = 1000 * self.unit.sensed(effects, s, t, host, self.temperature.at(host), turn, sign)
            if tone:
                wave = np.sin(2 * np.pi * phase + s.tone["phase_rad"])
                out.append(2 * wave @ a / 32)
            else:
                out.append(a.mean(axis=0))
        return np.concatenate(out)

    def seating(self, sd_deg):
        nominal = self.mean_mg([])
        placement = np.array([s.placement for s, *_ in self.rows])
        same = np.repeat(np.repeat(placement[:, None] == placement[None, :], 3, 0), 3, 1)
        out = np.zeros((len(nominal), len(nominal)))
        for axis in range(3):
            turn = 0.1 * np.eye(3)[axis]
            lever = (self.mean_mg([], np.tile(turn, (len(self.rows), 1))) - nominal) / 0.1
            out += sd_deg**2 * np.outer(lever, lever) * same
        return out

    def walk(self, mg_per_sqrt_s):
        t = np.array([s.start_s + middle for s, _, middle, _, _ in self.rows])
        shared = mg_per_sqrt_s**2 * np.minimum(t[:, None], t[None, :])
        shared[np.array([tone for *_, tone in self.rows])] = 0
        shared[:, np.array([tone for *_, tone in self.rows])] = 0
        return np.kron(shared, np.eye(3))

    def shift_mg(self, e):
        if e["name"] != "truncation":
            return self.mean_mg([e]) - self.mean_mg([])
        # Toward zero takes half a count off a mean, less where noise reaches the other side of zero.
        mean, noise = self.mean_mg([]), np.tile(self.unit.noise_mg, len(self.rows))
        share = np.array([math.erf(m / n / math.sqrt(2)) for m, n in zip(mean, noise)])
        return np.where(np.repeat([s.tone is None for s, *_ in self.rows], 3), -500 * unit_module.LSB_G * share, 0)

    def index(self, e):
        """Of an effect of the means."""
        shift = self.shift_mg(e)
        covariance = self.all - self.parts.get(e["name"], 0)
        return float(np.sqrt(max(0.0, shift @ np.linalg.solve(covariance, shift))))

    def index_of_scatter(self, extra):
        ratio = np.linalg.solve(self.all, self.all + extra)
        _, log_det = np.linalg.slogdet(ratio)
        return float(np.sqrt(max(0.0, np.trace(ratio) - len(ratio) - log_det)))

    def gap_mg(self, e):
        """Root mean square of means and tones beyond what gains and offsets take over."""
        if e["name"] == "seating":
            return float(np.sqrt(np.mean(np.diag(self.seating(e["parameters"]["sd_deg"])))))
        if e["name"] not in SMALL:
            return 0.0
        nominal = self.mean_mg([])
        shift = self.mean_mg([e]) - nominal
        left = shift.copy()
        for axis in range(3):
            rows = np.arange(len(shift)) % 3 == axis
            design = np.column_stack([nominal[rows], np.ones(rows.sum())])
            left[rows] -= design @ np.linalg.lstsq(design, shift[rows], rcond=None)[0]
        return float(np.sqrt(np.mean(left**2)))


def size_over_bound(e, features, segments, rate_hz, unit):
    name, p = e["name"], e["parameters"]
    still = sum(s.seconds for s in segments if not s.tone)
    if name in SMALL or name == "truncation":
        return features.index(e) / 3
    if name == "seating":
        return features.index_of_scatter(features.seating(p["sd_deg"])) / 3
    if name == "random_walk":
        return features.index_of_scatter(features.walk(p["mg_per_sqrt_s"])) / 3
    if name in ("floor_vibration", "electrical_line"):
        power = np.sum(np.array(p["vector_mg"]) ** 2 / unit.noise_mg**2)
        return float(np.sqrt(power * still * rate_hz / 2)) / 3
    if name == "clock_error":
        t = np.concatenate([s.start_s + np.arange(0, s.seconds, 1.0) for s in segments])
        sd_ppm = 1e6 * 0.002 / np.sqrt(3) / np.sqrt(within_segments(segments, t))
        tones = [s for s in segments if s.tone]
        for s in tones:  # the frequency of a sine (Rife and Boorstyn 1974)
            snr = (1000 * s.tone["amplitude_g"] / unit.noise_mg[2]) ** 2 / 2
            sd = np.sqrt(6 / snr / (s.seconds * rate_hz)) / (2 * np.pi * s.seconds * s.tone["frequency_hz"])
            sd_ppm = 1 / np.sqrt(sd_ppm**-2 + (1e6 * sd) ** -2)
        return float(abs(p["ppm"]) / sd_ppm) / 3
    if name == "jitter":
        extra = [1000 * s.tone["amplitude_g"] * 2 * np.pi * s.tone["frequency_hz"] * 1e-3 * p["rms_ms"]
                 for s in segments if s.tone]
        ratio = 1 + np.array(extra) ** 2 / 2 / unit.noise_mg[2] ** 2
        return float(np.sqrt(np.sum(10 * rate_hz * (ratio - 1 - np.log(ratio))))) / 3
    if name == "settling":
        steps = sum(np.sum(np.square(1000 * s.approach_g / unit.noise_mg)) for s in segments)
        return float(p["amplitude"] * np.sqrt(steps * p["decay_s"] * rate_hz / 4)) / 3
    if name == "filter_mismatch":
        return abs(1 - p["gain"]) / 0.02 / 3
    return EXACT


def within_segments(segments, t):
    """Sum of squares of the stamps' times about each segment's mean: a clock is only known inside segments."""
    total = 0.0
    for s in segments:
        inside = t[(t >= s.start_s - 1e-6) & (t < s.start_s + s.seconds - 1e-6)]
        total += np.sum((inside - inside.mean()) ** 2)
    return total
