/* motion.c
 * In: phones, strokes, a model; what a superframe uses of its prediction. Out: parameters in the 32
 * frames of a superframe.
 * Source: minimum jerk after Flash and Hogan 1985, dominances after Cohen and Massaro 1993.
 * Specification: spec/bitstream.md, section 5 (P4 to P10). */
#include "payload.h"

#include <math.h>
#include <string.h>

static double jerk(double u)
{
    return u * u * u * (10.0 - 15.0 * u + 6.0 * u * u);
}

/* P7 */
static void mouths(const cue_sound *sounds, int count, const cue_model *m, int32_t first,
                   double sum[TICKS][PHONES], cue_block *out)
{
    for (int t = 0; t < TICKS; t++) {
        memset(sum[t], 0, sizeof sum[t]);
        sum[t][0] = 0.05;
    }
    for (int i = 0; i < count; i++) {
        const cue_sound *s = &sounds[i];
        double length = s->end - s->start, middle = 0.5 * ((double)s->start + (double)s->end);
        double width = fmax(22.5 - length / 2, 2.5);
        if (s->number == 0) continue;
        for (int t = 0; t < TICKS; t++) {
            double x = fabs(first + t - middle), f = fmax((x - length / 2) / width, 0.0);
            if (f >= 1.0) continue;
            double ratio = x / (0.3 * length + 2.5);
            sum[t][s->number] += cue_exponential(-ratio * sqrt(ratio)) * (1.0 - f) * (1.0 - f);
        }
    }
    for (int t = 0; t < TICKS; t++) {
        double total = 0.0;
        for (int n = 0; n < PHONES; n++) total += sum[t][n];
        for (int k = 0; k < N_FACE; k++) {
            double value = 0.0;
            for (int n = 0; n < PHONES; n++) value += sum[t][n] * (double)m->face[n][k];
            out->value[t][k] = value / total;
        }
    }
}

static double target(const cue_model *m, unsigned number, int k)
{
    if (k < N_HAND) return (double)m->hand[number][k];
    k -= N_HAND;
    return k < m->n_head ? (double)m->head[number][k] : (double)m->forearm[number][k - m->n_head];
}

/* P4, P5 for one parameter; `bend` is its arc. */
static void travel(const cue_stroke *strokes, int count, const double *held, const double *far,
                   double bend, double late, double later, double stroke, double power,
                   int64_t first, cue_block *out, int column)
{
    int base = 0;
    for (int t = 0; t < TICKS; t++) {
        double time = (double)(first + 100 * t), value = 0.0;
        int begun = 0;
        for (int g = base + 1; g < count; g++) {
            double length = (double)(strokes[g].reach - strokes[g].leave);
            double f = stroke > 0.0 ? fmin(1.0, length / stroke) : 1.0;
            double start = (double)strokes[g].leave + f * late;
            if (start > time) break;
            double lasts = fmax((double)strokes[g].reach + f * later - start, fmax(length / 2, 1.0));
            if (!begun && time >= start + lasts) {
                base = g;
                continue;
            }
            begun = 1;
            double u = fmin((time - start) / lasts, 1.0);
            double p = jerk(power == 1.0 ? u : cue_power(u, power));
            value += p * (held[g] - held[g - 1]) + 4.0 * p * (1.0 - p) * far[g] * bend;
        }
        out->value[t][column] = held[base] + value;
    }
}

void cue_predict(const cue_sound *sounds, int n_sounds, const cue_stroke *strokes, int n_strokes,
                 const cue_model *m, int32_t first, unsigned course, unsigned shift,
                 cue_motion_work *work, cue_block *out)
{
    static const double powers[4] = {1.0, 0.75, 0.55, 0.42};
    static const int earlier[5] = {0, 3, -3, 6, -6}; /* P9 */
    const double *c = m->constants, natural = nearbyint(5000.0 * c[NATURAL]);
    int moving = N_HAND + m->n_head + m->n_forearm;
    mouths(sounds, n_sounds, m, first, work->sum, out);
    for (int g = 0; g < n_strokes; g++) {
        double h = g && g + 1 < n_strokes ? (double)(strokes[g + 1].leave - strokes[g].leave)
                                          : natural;
        work->missed[g] = 0.0; /* P6 */
        if (h < natural)
            work->missed[g] = c[UNDERSHOOT] * fmin((natural - h) / (natural / 2), 1.5);
        double sum = 0.0;
        for (int k = 0; g && k < m->n_forearm; k++) {
            double d = (double)m->forearm[strokes[g].number][k] -
                       (double)m->forearm[strokes[g - 1].number][k];
            sum += d * d;
        }
        work->far[g] = sqrt(sum);
    }
    for (int k = 0; k < moving; k++) {
        int arm = k - N_HAND - m->n_head;
        double begin = k < N_HAND ? c[FINGERS_BEGIN] : arm < 0 ? c[HEAD_BEGIN] : 0.0;
        double end = k < N_HAND ? c[FINGERS_END] : arm < 0 ? c[HEAD_END] : 0.0;
        for (int g = 0; g < n_strokes; g++) {
            double wanted = target(m, strokes[g].number, k);
            if (g) wanted += work->missed[g] * (work->held[g - 1] - wanted);
            work->held[g] = wanted;
        }
        travel(strokes, n_strokes, work->held, work->far, arm < 0 ? 0.0 : (double)m->arc[arm],
               5000.0 * (begin + (double)m->late[k]), 5000.0 * (end + (double)m->late[k]),
               5000.0 * c[STROKE], c[POWER] * powers[course & 3],
               100 * ((int64_t)first + earlier[shift < 5 ? shift : 0]), out, N_FACE + k);
    }
}

void cue_use_shares(const cue_content *content, const cue_model *m, cue_block *out)
{
    static const double shares[3] = {1.0, 0.5, 0.0};
    const int ends[4] = {N_FACE, N_FACE + N_HAND, N_FACE + N_HAND + m->n_head, m->n};
    for (int t = 0; t < TICKS; t++)
        for (int k = 0, part = 0; k < m->n; k++) {
            while (k == ends[part]) part++;
            double w = content->mode == 1 ? 0.0 : shares[content->shares[part]];
            double mean = (double)m->mean[k];
            out->value[t][k] = w == 0.0 ? mean : mean + w * (out->value[t][k] - mean);
        }
}

int cue_solve(double *a, double *b, int n, int columns)
{
    for (int i = 0; i < n; i++) {
        int best = i;
        for (int r = i + 1; r < n; r++)
            if (fabs(a[r * n + i]) > fabs(a[best * n + i])) best = r;
        if (!(fabs(a[best * n + i]) > 1e-12)) return 0;
        for (int k = 0; k < n; k++) {
            double x = a[i * n + k];
            a[i * n + k] = a[best * n + k];
            a[best * n + k] = x;
        }
        for (int k = 0; k < columns; k++) {
            double x = b[i * columns + k];
            b[i * columns + k] = b[best * columns + k];
            b[best * columns + k] = x;
        }
        for (int r = 0; r < n; r++) {
            double factor = r == i ? 0.0 : a[r * n + i] / a[i * n + i];
            if (factor == 0.0) continue;
            for (int k = i; k < n; k++) a[r * n + k] -= factor * a[i * n + k];
            for (int k = 0; k < columns; k++) b[r * columns + k] -= factor * b[i * columns + k];
        }
    }
    for (int i = 0; i < n; i++)
        for (int k = 0; k < columns; k++) b[i * columns + k] /= a[i * n + i];
    return 1;
}
