"""Dynamic programming over keys: the likeliest line, how likely each key is, a given line."""

import math

import numpy as np

from codec.compiled import njit

FAR = -1e18
"""Log likelihood of what never is."""


@njit(cache=True)
def likeliest(hold, shapes, places, shape_of, end_of, enter, edge, states):  # type: ignore[no-untyped-def]
    """Write the held key of each frame, or -1 on the way, to `states` (T,).

    `hold` (T, K) are log densities; those of the way from key `a` to `b` are the sum of `shapes`
    (T, S, S) at `shape_of` (K,) of both and of `places` (T, E, E) at `end_of` (K,). `enter` (K, K)
    is the price of going from the first key to the second and `edge` that of a line that begins or
    ends at a key; key 0 is rest.
    """
    n, k = hold.shape
    held = np.empty((n, k))
    moving = np.full((k, k), FAR)
    from_way = np.empty((n, k), np.int16)
    began = np.zeros((n, k, k), np.bool_)
    for b in range(k):
        held[0, b] = hold[0, b] + (0.0 if b == 0 else enter[0, b] + edge)
        from_way[0, b] = -2
        if b > 0:
            way = shapes[0, 0, shape_of[b]] + places[0, end_of[0], end_of[b]]
            moving[0, b] = way + enter[0, b]
    # held[t, b] = hold[t, b] + max(held[t - 1, b], max over a of moving[t - 1, a, b])
    # moving[t, a, b] = way[t, a, b] + max(moving[t - 1, a, b], held[t - 1, a] + enter[a, b])
    for t in range(1, n):
        for b in range(k):
            held[t, b] = held[t - 1, b]
            from_way[t, b] = -1
        for a in range(k):
            for b in range(k):
                if moving[a, b] > held[t, b]:
                    held[t, b] = moving[a, b]
                    from_way[t, b] = a
        for b in range(k):
            held[t, b] += hold[t, b]
        for a in range(k):
            s, e = shape_of[a], end_of[a]
            for b in range(k):
                start = held[t - 1, a] + enter[a, b]
                way = shapes[t, s, shape_of[b]] + places[t, e, end_of[b]]
                if a != b and start > moving[a, b]:
                    moving[a, b] = start + way
                    began[t, a, b] = True
                else:
                    moving[a, b] += way
    best, at, source = held[n - 1, 0], 0, -1
    for b in range(1, k):
        if held[n - 1, b] + edge > best:
            best, at, source = held[n - 1, b] + edge, b, -1
        if moving[b, 0] > best:
            best, at, source = moving[b, 0], 0, b
    # Back from the best end: `source` is the key that a way comes from, -1 while a key is held.
    states[:] = -1
    t = n - 1
    while t >= 0:
        if source >= 0:
            while t >= 0 and not began[t, source, at]:
                t -= 1
            t -= 1
            at, source = source, -1
            if t < 0:
                break
        states[t] = at
        origin = from_way[t, at]
        if origin == -2:
            break
        t -= 1
        if origin >= 0:
            source = origin
    return best


@njit(cache=True)
def nearness(hold, shapes, places, shape_of, end_of, enter, edge, out):  # type: ignore[no-untyped-def]
    """Write to `out` (T, K) how likely each key is held, coming or just left in each frame.

    Arguments as for `likeliest`. Forward and backward sums (Baum 1972), scaled frame by frame.
    """
    n, k = hold.shape
    forward_hold, forward_way = np.zeros((n, k)), np.zeros((n, k, k))
    e_hold, price = np.empty((n, k)), np.exp(enter)
    e_shapes, e_places = np.empty(shapes.shape), np.empty(places.shape)
    for t in range(n):
        top_shape, top_place, top = shapes[t].max(), places[t].max(), hold[t].max()
        # Ways are scaled by two tables' greatest values, held keys by the same.
        both = max(top, top_shape + top_place)
        e_shapes[t] = np.exp(shapes[t] - top_shape)
        e_places[t] = np.exp(places[t] - top_place + (top_shape + top_place - both))
        e_hold[t] = np.exp(hold[t] - both)
    for b in range(k):
        forward_hold[0, b] = e_hold[0, b] * (1.0 if b == 0 else price[0, b] * math.exp(edge))
        if b > 0:
            way = e_shapes[0, 0, shape_of[b]] * e_places[0, end_of[0], end_of[b]]
            forward_way[0, 0, b] = way * price[0, b]
    into = np.empty(k)
    for t in range(1, n):
        total = 0.0
        into[:] = forward_hold[t - 1]
        for a in range(k):
            s, e, before = shape_of[a], end_of[a], forward_hold[t - 1, a]
            for b in range(k):
                old = forward_way[t - 1, a, b]
                into[b] += old
                if a != b:
                    way = e_shapes[t, s, shape_of[b]] * e_places[t, e, end_of[b]]
                    value = (old + before * price[a, b]) * way
                    forward_way[t, a, b] = value
                    total += value
        for b in range(k):
            forward_hold[t, b] = into[b] * e_hold[t, b]
            total += forward_hold[t, b]
        scale = 1.0 / total
        for b in range(k):
            forward_hold[t, b] *= scale
            for a in range(k):
                forward_way[t, b, a] *= scale
    after_hold, after_way = np.zeros(k), np.zeros((k, k))
    for a in range(k):
        after_hold[a] = 1.0 if a == 0 else math.exp(edge)
        after_way[a, 0] = 1.0 if a > 0 else 0.0
    for t in range(n - 1, -1, -1):
        total = 0.0
        out[t] = 0.0
        for a in range(k):
            share = forward_hold[t, a] * after_hold[a]
            out[t, a] += share
            total += share
            for b in range(k):
                share = forward_way[t, a, b] * after_way[a, b]
                out[t, a] += share
                out[t, b] += share
                total += share
        for a in range(k):
            out[t, a] /= max(total, 1e-300)
        if t == 0:
            break
        # After the frame before: what this frame and those that follow say.
        into[:] = e_hold[t] * after_hold
        scale = 0.0
        for a in range(k):
            s, e, stay = shape_of[a], end_of[a], into[a]
            for b in range(k):
                if a != b:
                    way = e_shapes[t, s, shape_of[b]] * e_places[t, e, end_of[b]]
                    way *= after_way[a, b]
                    stay += price[a, b] * way
                    after_way[a, b] = way + into[b]
            after_hold[a] = stay
            scale += stay
        scale = 1.0 / max(scale, 1e-300)
        for a in range(k):
            after_hold[a] *= scale
            for b in range(k):
                after_way[a, b] *= scale


@njit(cache=True)
def follow(hold, way, line, pair, omit, low, high, at, states):  # type: ignore[no-untyped-def]
    """Find where a line of keys is: write frames of arrival to `at` (N,), -1 where left out.

    `line` (N,) are columns of `hold` (T, S), the first and last are rest; `pair` (N, 2) columns of
    `way` (T, P) that lead there from the predecessor and from the one before it, -1 for no way at
    all; `omit` (N,) what leaving each one out costs (negative); `low` and `high` (T,) bound the
    keys that come into question in each frame, both rising. `states` (T,) receives the number in
    the line that is held, or -1. The hand may repeat a key without moving.
    """
    n, count = len(hold), len(line)
    width = 1
    for t in range(n):
        width = max(width, high[t] - low[t])
    held = np.full((2, width), FAR)
    # On the way to a key from its predecessor, or from the one before if that is left out.
    moving = np.full((2, width, 2), FAR)
    came = np.full((n, width), -1, np.int8)
    began = np.zeros((n, width, 2), np.bool_)
    for t in range(n):
        now, past = t % 2, (t + 1) % 2
        for c in range(width):
            held[now, c] = FAR
            moving[now, c, 0] = FAR
            moving[now, c, 1] = FAR
        shift = low[t] - low[t - 1] if t else 0
        for c in range(high[t] - low[t]):
            number = low[t] + c
            key = line[number]
            if t == 0:
                if number == 0:
                    held[now, c] = hold[0, key]
                    came[0, c] = 2
                continue
            p = c + shift
            best, origin = held[past, p] if p < width else FAR, 3
            for skip in range(2):
                before = p - 1 - skip
                source = number - 1 - skip
                stay = moving[past, p, skip] if p < width else FAR
                start = FAR
                if 0 <= before < width and source >= 0:
                    start = held[past, before] + (omit[number - 1] if skip else 0.0)
                if stay > best:
                    best, origin = stay, skip
                if source >= 0:
                    path = way[t, pair[number, skip]] if pair[number, skip] >= 0 else hold[t, key]
                    if start > stay:
                        moving[now, c, skip] = start + path
                        began[t, c, skip] = True
                    else:
                        moving[now, c, skip] = stay + path
            held[now, c] = best + hold[t, key]
            came[t, c] = origin
    at[:] = -1
    states[:] = -1
    last = count - 1 - low[n - 1]
    total = held[(n - 1) % 2, last] if 0 <= last < width else FAR
    if total <= 0.5 * FAR:
        return total
    number, t, skip = count - 1, n - 1, -1
    while t >= 0:
        c = number - low[t]
        if skip >= 0:
            if began[t, c, skip]:
                number, skip = number - 1 - skip, -1
            t -= 1
            continue
        states[t] = number
        at[number] = t
        origin = came[t, c]
        if origin == 2:
            break
        t -= 1
        if origin < 2:
            skip = origin
    return total
