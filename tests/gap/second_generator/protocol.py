"""What is done with a unit: segments, the times at which they start, and the chamber's temperature.

Written from the description of a bundle alone (docs/scenario.md, Bundles): nothing of sim/ is used.
Lengths are in seconds, so that one list serves every sample rate.
"""

import dataclasses

import numpy as np

LONG_PIECE_S = 60  # a long record counts as pieces of this length where its means are taken


@dataclasses.dataclass
class Segment:
    name: str
    kind: str
    start_s: float  # host time since power-on
    seconds: float
    rotation: np.ndarray  # maps laboratory to sensor
    placement: int
    commanded_c: object  # a number, or (start, end)
    tone: dict = None  # direction, frequency_hz, amplitude_g, phase_rad
    approach_g: np.ndarray = None  # change of the specific force from the pose before


def face(axis, sign, yaw=0.0):
    """Rotation with sensor axis `axis` along `sign` times the vertical, turned by `yaw` about it."""
    up = np.zeros(3)
    up[axis] = sign
    first = np.roll(np.abs(up), 1)
    second = np.cross(up, first)
    x = np.cos(yaw) * first + np.sin(yaw) * second
    return np.column_stack([x, np.cross(up, x), up])


def random_rotation(rng):
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0 else -q


class Plan:
    """Builds the list: `go` waits, `add` records."""

    def __init__(self, rng):
        self.rng = rng
        self.time_s = rng.uniform(25, 60)
        self.placement = -1
        self.segments = []
        self.last_up = None

    def add(self, name, kind, seconds, rotation, commanded_c, pause_s, tone=None, same=False):
        self.time_s += pause_s
        self.placement += 0 if same else 1
        up = rotation[:, 2]
        approach = np.zeros(3) if self.last_up is None else up - self.last_up
        self.segments.append(
            Segment(name, kind, self.time_s, seconds, rotation, self.placement, commanded_c, tone, approach)
        )
        self.time_s += seconds
        self.last_up = up

    def faces(self, name, order, room_c, seconds, pause):
        for axis, sign in order:
            self.add(name, "still", seconds, face(axis, sign), room_c, self.rng.uniform(*pause))


def tone(direction, frequency_hz, amplitude_g, rng):
    return {
        "direction": np.array(direction, float),
        "frequency_hz": float(frequency_hz),
        "amplitude_g": float(amplitude_g),
        "phase_rad": rng.uniform(0, 2 * np.pi),
    }


def shaker(plan, room_c, rate_hz):
    rng = plan.rng
    for axis in range(3):
        rotation = face(axis, 1)
        same = False
        for f in (2, 4, 7, 11, 16, 22, 30, 40):
            if f < 0.45 * rate_hz:  # what the rate can show
                amplitude = min(1.0, 0.01 * (2 * np.pi * f) ** 2 / 9.81)  # 1 cm of stroke
                plan.add("shaker", "vibration", 10, rotation, room_c, 3 if same else rng.uniform(60, 95),
                         tone((0, 0, 1), f, amplitude, rng), same)
                same = True
    if rate_hz < 60:
        return
    for axis in range(3):
        plan.add("shaker_high", "vibration", 10, face(axis, 1), room_c, rng.uniform(60, 95),
                 tone((0, 0, 1), 20, 6, rng))
        plan.add("shaker_high", "vibration", 5, face(axis, 1), room_c, 3, tone((0, 0, 1), 19.3, 11, rng), True)


def chamber(plan, rng):
    up = face(2, 1)
    plan.add("still", "still", 1200, up, 23.0, rng.uniform(80, 140))
    low, high = rng.uniform(12, 16), rng.uniform(36, 42)
    middle = (low + high) / 2
    plan.time_s += 1500
    first = True
    for name, steps in (
        ("ramp_up", [(low, low, 120), (low, middle, 240), (middle, middle, 90), (middle, high, 480), (high, high, 90)]),
        ("ramp_down", [(high, middle, 240), (middle, middle, 90), (middle, low, 480), (low, low, 210)]),
    ):
        for a, b, seconds in steps:
            plan.add(name, "ramp", seconds, up, (float(a), float(b)), 0, same=not first)
            first = False
    for celsius in (low - 2, high):
        plan.time_s += 2000
        order = [(axis, sign) for axis in range(3) for sign in (1, -1)]
        rng.shuffle(order)
        for axis, sign in order:
            plan.add("soak", "soak", 30, face(axis, sign), float(celsius), rng.uniform(4, 9))


def make(kind, rate_hz, rng):
    """`production` or `engineering`: a list of segments."""
    plan = Plan(rng)
    room_c = 23.0
    order = [(axis, sign) for axis in range(3) for sign in (1, -1)]
    rng.shuffle(order)
    seconds = rng.choice([10, 10, 10, 12, 15])
    plan.faces("faces", order, room_c, seconds, (4, 8))
    plan.faces("faces_reversed", order[::-1], room_c, seconds, (4, 8))
    plan.faces("reseat", rng.permutation(order).tolist(), room_c, seconds, (16, 23))
    if kind == "production":
        return plan.segments
    poses = [(a, s, y) for a in range(3) for s in (1, -1) for y in range(4)]
    rng.shuffle(poses)
    for axis, sign, quarter in poses:
        plan.add("yaw", "still", 10, face(int(axis), sign, quarter * np.pi / 2), room_c, rng.uniform(4, 8))
    for _ in range(18):
        plan.add("oblique", "still", 10, random_rotation(rng), room_c, rng.uniform(4, 8))
    shaker(plan, room_c, rate_hz)
    chamber(plan, rng)
    return plan.segments


class Temperature:
    """The unit's own: the commanded one with a lag, and the room's wander."""

    def __init__(self, segments, rng):
        end = segments[-1].start_s + segments[-1].seconds + 5
        self.time_s = np.arange(0, end, 1.0)
        knots = [(0.0, 23.0)]
        for s in segments:
            a, b = s.commanded_c if isinstance(s.commanded_c, tuple) else (s.commanded_c, s.commanded_c)
            last = knots[-1]
            if abs(a - last[1]) > 0.01:  # the chamber is set as soon as it is free
                knots.append((last[0] + 20, a))
            knots += [(s.start_s, a), (s.start_s + s.seconds, b)]
        t, c = np.array(knots).T
        commanded = np.interp(self.time_s, np.maximum.accumulate(t), c)
        lag_s = rng.uniform(120, 260)
        self.celsius = np.empty_like(commanded)
        now = commanded[0] - rng.uniform(0, 0.5)
        for i, target in enumerate(commanded):
            now += (target - now) / lag_s
            self.celsius[i] = now
        self.celsius += 0.15 * np.sin(2 * np.pi * self.time_s / rng.uniform(1500, 4000) + rng.uniform(0, 6))

    def at(self, time_s):
        return np.interp(time_s, self.time_s, self.celsius)
