/* resample.c - the sound that was heard last, at 48 kHz, readable at any place and speed.
 *
 * In: mid and side at the input's rate; out: samples between samples. Windowed sinc responses
 * (Smith and Gossett, ICASSP 1984) with Kaiser's window, tabulated at 128 fractions of a sample.
 * The conversion counts in integers, so that blocks of any size give the same samples.
 * Specification: W7.
 */
#include <string.h>

#include "hearing.h"

static double bessel(double x) {
    double sum = 1, term = 1;
    for (int k = 1; k < 40; k++) sum += term *= x / (2.0 * k) * (x / (2.0 * k));
    return sum;
}

/* One response per fraction: weight of tap j is that of the sample j - (taps / 2 - 1) away. */
static void make_table(float *table, int row, int taps, double cutoff) {
    const double beta = 8.0;
    double reach = taps / 2;
    for (int p = 0; p <= STEPS; p++)
        for (int j = 0; j < taps; j++) {
            double t = (double)p / STEPS - (j - (taps / 2 - 1)), u = 1 - t / reach * (t / reach);
            double x = PI * cutoff * t, sinc = fabs(x) < 1e-9 ? 1 : cue_sin(x) / x;
            double window = u > 0 ? bessel(beta * sqrt(u)) / bessel(beta) : 0;
            table[p * row + j] = (float)(cutoff * sinc * window);
        }
}

void cue_sound_init(cue_sound *s, uint32_t rate) {
    memset(s, 0, sizeof *s);
    s->rate = rate;
    make_table(&s->table[0][0], TAPS, TAPS, 1.0);
    if (rate == FS) return;
    double cutoff = rate > FS ? 0.94 * FS / rate : 1.0;
    s->taps = rate > FS ? 2 * (int)(17 / cutoff) : TAPS;
    make_table(&s->rate_table[0][0], RATE_TAPS, s->taps, cutoff);
}

void cue_sound_clear(cue_sound *s) {
    s->taken = s->count = s->first = 0;
    memset(s->input, 0, sizeof s->input);
    memset(s->ring, 0, sizeof s->ring);
}

static void append(cue_sound *s, float mid, float side) {
    int64_t at = s->count++ % RING;
    s->ring[0][at] = mid;
    s->ring[1][at] = side;
    if (s->count - s->first > RING) s->first = s->count - RING;
}

void cue_sound_push(cue_sound *s, float mid, float side) {
    if (!s->taps) {
        append(s, mid, side);
        return;
    }
    int64_t end = ++s->taken;
    s->input[0][(end - 1) % INPUT] = mid;
    s->input[1][(end - 1) % INPUT] = side;
    for (;;) { /* sample n lies at n rate / 48000 */
        int64_t place = s->count * (int64_t)s->rate, whole = place / FS;
        if (whole + s->taps / 2 >= end) return;
        int64_t scaled = place % FS * STEPS;
        const float *low = s->rate_table[scaled / FS], *high = s->rate_table[scaled / FS + 1];
        float part = (float)(scaled % FS) / FS, out[2] = {0, 0};
        for (int j = 0; j < s->taps; j++) {
            int64_t from = whole + j - (s->taps / 2 - 1);
            if (from < 0) continue;
            float weight = low[j] + part * (high[j] - low[j]);
            out[0] += weight * s->input[0][from % INPUT];
            out[1] += weight * s->input[1][from % INPUT];
        }
        append(s, out[0], out[1]);
    }
}

/* Copy samples of a mix; silence outside of the ring. */
static void cut(const cue_sound *s, const float mix[2], int64_t from, int count, float *out) {
    int i = 0;
    for (; i < count && from + i < s->first; i++) out[i] = 0;
    while (i < count && from + i < s->count) {
        int at = (int)((from + i) % RING), n = count - i < RING - at ? count - i : RING - at;
        if (n > s->count - (from + i)) n = (int)(s->count - (from + i));
        for (int j = 0; j < n; j++)
            out[i + j] = mix[0] * s->ring[0][at + j] + mix[1] * s->ring[1][at + j];
        i += n;
    }
    for (; i < count; i++) out[i] = 0;
}

void cue_sound_read(const cue_sound *s, const float mix[2], double position, double ratio,
                    int count, float *out) {
    if (ratio == 1.0 && position == floor(position)) {
        cut(s, mix, (int64_t)position, count, out);
        return;
    }
    enum { PIECE = 240, LANES = 8 };
    float x[PIECE + PIECE / 8 + TAPS + 4];
    for (int done = 0; done < count; done += PIECE) {
        double start = position + done * ratio;
        int64_t begin = (int64_t)floor(start) - (TAPS / 2 - 1);
        int n = count - done < PIECE ? count - done : PIECE;
        cut(s, mix, begin, (int)(n * ratio) + TAPS + 3, x);
        start -= (double)begin;
        for (int i = 0; i < n; i++) {
            double place = start + i * ratio;
            int whole = (int)place;
            float where = (float)((place - whole) * STEPS);
            int cell = (int)where < STEPS - 1 ? (int)where : STEPS - 1;
            const float *near = x + whole - (TAPS / 2 - 1), *a = s->table[cell],
                        *b = s->table[cell + 1];
            float sum[LANES] = {0}, weight = where - (float)cell, total = 0;
            for (int j = 0; j < TAPS; j += LANES) /* lanes: the order of sums is free */
                for (int k = 0; k < LANES; k++)
                    sum[k] += near[j + k] * (a[j + k] + weight * (b[j + k] - a[j + k]));
            for (int k = 0; k < LANES; k++) total += sum[k];
            out[done + i] = total;
        }
    }
}
