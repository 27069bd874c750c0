"""Compiled loops of the hand's timing and visibility."""

import numpy as np
from numpy.typing import NDArray

from codec.compiled import njit

N_PLACEMENTS = 6
"""Placements, rest included: key number = 6 shape + placement."""


@njit(cache=True)
def strokes_into(
    start: NDArray[np.float64],
    end: NDArray[np.float64],
    target: NDArray[np.float64],
    rested: NDArray[np.bool_],
    way: NDArray[np.float64],
    lead_share: float,
    calm_share: float,
    hurried: float,
    least_lead: float,
    most_lead: float,
    lead_per_mm: float,
    overlap: float,
    shortest: float,
    peak_per_mm: float,
    late: float,
    first_lead: float,
    rest_delay: float,
    rest_move: float,
    leave: NDArray[np.float64],
    reach: NDArray[np.float64],
) -> int:
    """Time the strokes to N keys and to the rests between and after them, and count them.

    start, end, target (N,) are when a key sounds and when the hand should be there, rested (N,)
    whether it comes from rest, way (N,) from where, mm. Gesture 0 is the rest before everything:
    its times are there already.
    """
    g = 0
    for i in range(start.size):
        #  from rest:  end[i-1] .. rest_delay .. leave ====> reach (rest) ====> target[i]
        #  from a key: the lead is a share of the time since the last key, another share of the
        #              part beyond a hurried pace, within limits; the upper one grows with the way.
        lead = first_lead
        if rested[i] and i > 0:
            lead = min(first_lead, 0.5 * (start[i] - end[i - 1]))
            g += 1
            leave[g] = end[i - 1] + rest_delay
            reach[g] = max(min(leave[g] + rest_move, start[i] - lead), leave[g] + shortest)
        elif not rested[i]:
            apart = start[i] - start[i - 1]
            quick = min(apart, hurried)
            lead = lead_share * quick + calm_share * (apart - quick)
            lead = max(min(lead, most_lead + lead_per_mm * way[i]), least_lead)
        # The way sets the shortest stroke; strokes overlap by at most `overlap` of the last one.
        least = peak_per_mm * way[i]
        free = reach[g] - overlap * (reach[g] - leave[g])
        g += 1
        leave[g] = max(min(start[i] - lead, target[i] - least), free)
        reach[g] = max(target[i], min(leave[g] + least, target[i] + late), leave[g] + shortest)
    if start.size:
        g += 1
        leave[g] = end[-1] + rest_delay
        reach[g] = leave[g] + max(rest_move, shortest)
    # Last pass: strokes stay in order, whatever the limits above moved.
    for i in range(1, g + 1):
        leave[i] = max(leave[i], reach[i - 1] - overlap * (reach[i - 1] - leave[i - 1]))
        reach[i] = max(reach[i], leave[i] + 1e-3, reach[i - 1] + 1e-3)
    return g + 1


@njit(cache=True, inner=True)
def _jerk(
    time: float, leave: float, reach: float, begin: float, end: float, stroke: float, power: float
) -> float:
    """Return how far a channel has come on a stroke, 0..1."""
    apart = min(1.0, (reach - leave) / stroke)
    first = leave + apart * begin
    length = max(reach + apart * end - first, 0.5 * (reach - leave))
    u = (time - first) / length
    if u <= 0.0:
        return 0.0
    if u >= 1.0:
        return 1.0
    u = u**power
    return float(u * u * u * (10.0 - 15.0 * u + 6.0 * u * u))


@njit(cache=True, inner=True)
def seen_into(
    leave: NDArray[np.float64],
    reach: NDArray[np.float64],
    key: NDArray[np.int64],
    step: float,
    lateness: NDArray[np.float64],
    stroke: float,
    power: float,
    arc: NDArray[np.float64],
    place: NDArray[np.float64],
    tip: NDArray[np.float64],
    knuckle: NDArray[np.float64],
    goal: NDArray[np.float64],
    gram: NDArray[np.float64],
    clear: NDArray[np.float64],
    asked: int,
    until: int,
    begun: NDArray[np.float64],
    held: NDArray[np.float64],
    peak: NDArray[np.float64],
) -> None:
    """Find how long each of G targets is seen, and how fast the knuckles are on the way to it.

    Parameters
    ----------
    leave, reach, key : ndarray, shape (G,)
        Strokes; key number of each target.
    step : float
        Between the moments that are looked at, seconds.
    lateness : ndarray, shape (4,)
        How much later than the place the turn begins and ends, then the fingers.
    arc : ndarray, shape (54, 54, 3)
        How far the middle of a stroke from key to key lies off the straight way, per mm of it.
    place : ndarray, shape (54, 3)
        Wrist of each key.
    tip : ndarray, shape (9, 54, 3)
        From the wrist to the tip that a shape points with, turned as for each key.
    knuckle : ndarray, shape (54, K, 3)
        From the wrist to the knuckles.
    goal : ndarray, shape (9, 6, 3)
        Where the tip is for each key.
    gram : ndarray, shape (9, 9)
        Inner products of the shapes' markers.
    clear : ndarray, shape (2,)
        By how many mm the place, and the shape, has to be nearer than any other.
    asked, until : int
        First of the targets that are asked for, and the one after the last; others are not found.
    begun, held : ndarray, shape (G,)
        Out: from when and how long each target is nearer than any other, seconds.
    peak : ndarray, shape (G,)
        Out: greatest speed of a knuckle, mm/s.
    """
    n = leave.size
    for g in range(n):
        begun[g], held[g], peak[g] = 0.0, 0.0, 0.0
    if n < 2:
        return
    n_knuckles = knuckle.shape[1]
    moved, turned, shaped = np.empty(n), np.empty(n), np.empty(n)
    at, x, before = np.empty(3), np.empty(3), np.empty((n_knuckles, 3))
    now = np.empty((n_knuckles, 3))
    share, apart, away = np.empty(len(gram)), np.empty(len(gram)), np.empty(goal.shape[1])
    last_margin, since, sure = np.empty(n), np.empty(n), np.empty(n)
    for g in range(n):
        moved[g], turned[g], shaped[g] = 0.0, 0.0, 0.0
        last_margin[g], since[g], sure[g] = -1.0, 0.0, 0.0
    low = 1
    # A stroke moves nothing before it begins and after its latest part has ended.
    early = min(0.0, min(lateness[0], lateness[2]))
    late = max(0.0, max(lateness[1], lateness[3]))
    time = leave[1] - 0.1
    first = True
    while time < reach[n - 1] + 0.1:
        if time <= leave[asked] + early - 2.0 * step:
            time += step
            continue
        while low < n - 1 and reach[low] + late < time:
            low += 1
        if low > until:
            break
        high = low
        while high < n and leave[high] + early < time:
            high += 1
        # Shares of the targets base .. high - 1; what came before is done with.
        base = low - 1
        moved[base], turned[base], shaped[base] = 1.0, 1.0, 1.0
        for c in range(3):
            at[c] = place[key[base], c]
        for g in range(low, high):
            p = _jerk(time, leave[g], reach[g], 0.0, 0.0, stroke, power)
            q = _jerk(time, leave[g], reach[g], lateness[0], lateness[1], stroke, power)
            r = _jerk(time, leave[g], reach[g], lateness[2], lateness[3], stroke, power)
            moved[g], turned[g], shaped[g] = p, q, r
            long = 0.0
            for c in range(3):
                d = place[key[g], c] - place[key[g - 1], c]
                at[c] += p * d
                long += d * d
            for c in range(3):
                at[c] += 4.0 * p * (1.0 - p) * np.sqrt(long) * arc[key[g - 1], key[g], c]
        for k in range(n_knuckles):
            for c in range(3):
                now[k, c] = at[c] + knuckle[key[base], k, c]
        for g in range(low, high):
            if turned[g] != 0.0:
                for k in range(n_knuckles):
                    for c in range(3):
                        way = knuckle[key[g], k, c] - knuckle[key[g - 1], k, c]
                        now[k, c] += turned[g] * way
        if not first:
            fastest = 0.0
            for k in range(n_knuckles):
                speed = 0.0
                for c in range(3):
                    speed += (now[k, c] - before[k, c]) ** 2
                fastest = max(fastest, speed)
            fastest = np.sqrt(fastest) / step
            for g in range(low, high):
                if leave[g] <= time <= reach[g] + 0.1:
                    peak[g] = max(peak[g], fastest)
        for k in range(n_knuckles):
            for c in range(3):
                before[k, c] = now[k, c]
        first = False
        _blend_apart(key, base, low, high, shaped, gram, share, apart)
        for g in range(max(low - 1, asked), min(high, until)):
            shape = key[g] // N_PLACEMENTS
            margin = _margin(apart, shape) - clear[1]
            for c in range(3):
                x[c] = at[c] + tip[shape, key[base], c]
            for j in range(low, high):
                if turned[j] != 0.0:
                    for c in range(3):
                        x[c] += turned[j] * (tip[shape, key[j], c] - tip[shape, key[j - 1], c])
            for p in range(away.size):
                away[p] = 0.0
                for c in range(3):
                    away[p] += (x[c] - goal[shape, p, c]) ** 2
            margin = min(margin, _margin(away, key[g] % N_PLACEMENTS) - clear[0])
            old = last_margin[g]
            if margin > 0.0 and old <= 0.0:
                since[g] = time if old == -1.0 else time - step * margin / (margin - old)
            if margin > 0.0:
                sure[g] = time - since[g]
            elif old > 0.0:
                sure[g] += step * old / (old - margin)
            if sure[g] > held[g]:
                held[g], begun[g] = sure[g], since[g]
            if margin <= 0.0:
                sure[g] = 0.0
            last_margin[g] = margin
        time += step


@njit(cache=True)
def line_seen_into(
    start: NDArray[np.float64],
    end: NDArray[np.float64],
    target: NDArray[np.float64],
    key: NDArray[np.int64],
    rest_gap: float,
    rule: tuple[float, ...],
    long_ago: float,
    step: float,
    lateness: NDArray[np.float64],
    stroke: float,
    power: float,
    arc: NDArray[np.float64],
    place: NDArray[np.float64],
    tip: NDArray[np.float64],
    knuckle: NDArray[np.float64],
    goal: NDArray[np.float64],
    gram: NDArray[np.float64],
    clear: NDArray[np.float64],
    asked: int,
    until: int,
    held: NDArray[np.float64],
    peak: NDArray[np.float64],
) -> None:
    """Find how long each of N keys is seen, and how fast the knuckles are on the way to it.

    start, end, target, key, held, peak are of shape (N,), of which the keys from `asked` to
    `until` - 1 are asked for; others' results are of no use. Gaps of `rest_gap` and longer
    send the hand to rest; rule has the numbers of `strokes_into`. The rest is as for `seen_into`.
    Keys that repeat the one before, without a rest between, share their time.
    """
    n = key.size
    rested = np.empty(n, np.bool_)
    at, way = np.empty(n, np.int64), np.empty(n)
    last = -1
    # at[i]: the gesture of key i; a rest before it is a gesture of its own. way[i]: its distance in
    # mm.
    for i in range(n):
        rested[i] = i == 0 or start[i] - end[i - 1] >= rest_gap
        last += 2 if rested[i] else 1
        at[i] = last
        before = 0 if rested[i] else key[i - 1]
        long = 0.0
        for c in range(3):
            long += (place[key[i], c] - place[before, c]) ** 2
        way[i] = np.sqrt(long)
    shown, leave, reach = np.empty(last + 2, np.int64), np.empty(last + 2), np.empty(last + 2)
    for g in range(last + 2):
        shown[g], leave[g], reach[g] = 0, long_ago, long_ago
    for i in range(n):
        shown[at[i]] = key[i]
    (share, calm, hurried, least, most, per_mm, overlap, shortest, peak_per_mm, late, first,
     rest_delay, rest_move) = rule  # fmt: skip
    strokes_into(start, end, target, rested, way, share, calm, hurried, least, most, per_mm,
                 overlap, shortest, peak_per_mm, late, first, rest_delay, rest_move, leave,
                 reach)  # fmt: skip
    begun, seen, fastest = np.empty(last + 2), np.empty(last + 2), np.empty(last + 2)
    while 0 < asked < n and key[asked - 1] == key[asked] and not rested[asked]:
        asked -= 1
    while 0 < until < n and key[until - 1] == key[until] and not rested[until]:
        until += 1
    seen_into(leave, reach, shown, step, lateness, stroke, power, arc, place, tip, knuckle, goal,
              gram, clear, at[asked], at[until - 1] + 1, begun, seen, fastest)  # fmt: skip
    # Repeated keys show as one: all of them get the time from the first's begin to the last's end.
    same = 0
    for i in range(n):
        held[i], peak[i] = seen[at[i]], fastest[at[i]]
        if i + 1 < n and key[i + 1] == key[i] and not rested[i + 1]:
            continue
        if i > same:
            whole = begun[at[i]] + held[i] - begun[at[same]]
            for k in range(same, i + 1):
                held[k] = whole
        same = i + 1


@njit(cache=True, inner=True)
def _margin(apart: NDArray[np.float64], own: int) -> float:
    """Return by how much the own one of some distances, given as squares, is less than others."""
    best = np.inf
    for p in range(apart.size):
        if p != own:
            best = min(best, apart[p])
    return float(np.sqrt(best) - np.sqrt(apart[own]))


@njit(cache=True, inner=True)
def _blend_apart(
    key: NDArray[np.int64],
    base: int,
    low: int,
    high: int,
    shaped: NDArray[np.float64],
    gram: NDArray[np.float64],
    share: NDArray[np.float64],
    apart: NDArray[np.float64],
) -> None:
    """Find the squared distance of a blend of shapes from each; `share` is room for its shares."""
    n = gram.shape[0]
    for i in range(n):
        share[i] = 0.0
    share[key[base] // N_PLACEMENTS] = 1.0
    for g in range(low, high):
        share[key[g] // N_PLACEMENTS] += shaped[g]
        share[key[g - 1] // N_PLACEMENTS] -= shaped[g]
    whole = 0.0
    for i in range(n):
        if share[i] != 0.0:
            for j in range(n):
                whole += share[i] * share[j] * gram[i, j]
    for c in range(n):
        apart[c] = whole + gram[c, c]
    for i in range(n):
        if share[i] != 0.0:
            for c in range(n):
                apart[c] -= 2.0 * share[i] * gram[i, c]
    for c in range(n):
        apart[c] = max(apart[c], 0.0)
