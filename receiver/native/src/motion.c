/* motion.c
 * In: phones, strokes, a model; what a superframe uses of its prediction. Out: parameters in the 32
 * frames of a superframe.
 * Source: minimum jerk after Flash and Hogan 1985, dominances after Cohen and Massaro 1993.
 * Specification: spec/bitstream.md, section 5 (P4 to P10). */
#include "payload.h"

#include <math.h>
#include <string.h>

static double jerk(double u) {
    return u * u * u * (10.0 - 15.0 * u + 6.0 * u * u);
}

/* P7 */
static void mouths(const cue_sound *sounds, int count, const cue_model *m, int32_t first,
                   double sum[TICKS][PHONES], cue_block *out) {
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

/* What a key asks of a moving parameter k; behind these, whether it is of a kind (F13). */
static double asked(const cue_model *m, unsigned number, int k) {
    if (k < N_HAND) return (double)m->hand[number][k];
    k -= N_HAND;
    if (k < m->n_head) return (double)m->head[number][k];
    k -= m->n_head;
    if (k < m->n_forearm) return (double)m->forearm[number][k];
    k -= m->n_forearm;
    if (k >= SHAPES && k < SHAPES + PLACEMENTS) return (int)number % PLACEMENTS == k - SHAPES;
    return (int)number / PLACEMENTS == k % (SHAPES + PLACEMENTS);
}

/* How a parameter goes through the strokes (P5): hundredths of a tick. */
typedef struct pace {
    double late, later, stroke, power, bend;
} pace;

static pace pace_of(const cue_model *m, int k, unsigned course) {
    static const double powers[4] = {1.0, 0.75, 0.55, 0.42};
    const double *c = m->constants;
    int moving = m->n - N_FACE, arm = k - N_HAND - m->n_head;
    if (k >= moving) { /* a kind moves as the hand's first, or the forearm's last parameter */
        k = k < moving + SHAPES ? 0 : moving - 1;
        arm = -1;
    }
    int group = k < N_HAND ? FINGERS_BEGIN : HEAD_BEGIN, is_arm = k >= N_HAND + m->n_head;
    double begin = is_arm ? 0.0 : c[group], end = is_arm ? 0.0 : c[group + 1];
    double late = (double)m->late[k];
    return (pace){5000.0 * (begin + late), 5000.0 * (end + late), 5000.0 * c[STROKE],
                  c[POWER] * powers[course & 3], arm < 0 ? 0.0 : (double)m->arc[arm]};
}

static double start_of(const cue_stroke *s, const pace *p, double *lasts) {
    double length = (double)(s->reach - s->leave);
    double f = p->stroke > 0.0 ? fmin(1.0, length / p->stroke) : 1.0;
    double start = (double)s->leave + f * p->late;
    *lasts = fmax((double)s->reach + f * p->later - start, fmax(length / 2, 1.0));
    return start;
}

/* P6: the share of its way that a stroke misses. */
static double missed(const cue_strokes *list, int g, const double *c) {
    double natural = nearbyint(5000.0 * c[NATURAL]);
    if (g == 0 || g + 1 >= list->count) return 0.0;
    double h = (double)(list->stroke[g + 1].leave - list->stroke[g].leave);
    return h < natural ? c[UNDERSHOOT] * fmin((natural - h) / (natural / 2), 1.5) : 0.0;
}

void cue_strokes_drop(cue_strokes *list, const cue_model *m, int32_t first) {
    int columns = m->n - N_FACE + KINDS;
    while (list->count > 2) {
        double share = missed(list, 1, m->constants);
        for (int k = 0; k < columns; k++) {
            pace p = pace_of(m, k, 0);
            double lasts, start = start_of(&list->stroke[1], &p, &lasts);
            if (start + lasts > 100.0 * (first - 6)) return; /* P9: 6 ticks */
        }
        for (int k = 0; k < columns; k++) {
            double from = list->dropped ? list->held[k] : asked(m, list->stroke[0].number, k);
            double wanted = asked(m, list->stroke[1].number, k);
            list->held[k] = wanted + share * (from - wanted);
        }
        list->dropped = 1;
        memmove(list->stroke, list->stroke + 1, (size_t)--list->count * sizeof list->stroke[0]);
    }
}

/* P4, P5, P6 for one parameter, or one kind of keys. */
static void travel(const cue_strokes *list, const cue_model *m, int k, unsigned course,
                   unsigned shift, int32_t tick, cue_motion_work *work, cue_block *out, int column)
{
    static const int earlier[5] = {0, 3, -3, 6, -6}; /* P9 */
    const pace p = pace_of(m, k, course);
    double *held = work->held;
    int64_t first = 100 * ((int64_t)tick + earlier[shift < 5 ? shift : 0]);
    int base = 0;
    for (int g = 0; g < list->count; g++) {
        held[g] = asked(m, list->stroke[g].number, k);
        if (g) held[g] += work->missed[g] * (held[g - 1] - held[g]);
        else if (list->dropped) held[g] = list->held[k];
    }
    for (int t = 0; t < TICKS; t++) {
        double time = (double)(first + 100 * t), value = 0.0;
        int begun = 0;
        for (int g = base + 1; g < list->count; g++) {
            double lasts, start = start_of(&list->stroke[g], &p, &lasts);
            if (start > time) break;
            if (!begun && time >= start + lasts) {
                base = g;
                continue;
            }
            begun = 1;
            double u = fmin((time - start) / lasts, 1.0);
            double w = jerk(p.power == 1.0 ? u : cue_power(u, p.power));
            value += w * (held[g] - held[g - 1]) + 4.0 * w * (1.0 - w) * work->far[g] * p.bend;
        }
        out->value[t][column] = held[base] + value;
    }
}

static void weigh(const cue_strokes *list, const cue_model *m, cue_motion_work *work) {
    for (int g = 0; g < list->count; g++) {
        double sum = 0.0;
        for (int k = 0; g && k < m->n_forearm; k++) {
            double d = (double)m->forearm[list->stroke[g].number][k] -
                       (double)m->forearm[list->stroke[g - 1].number][k];
            sum += d * d;
        }
        work->far[g] = sqrt(sum);
        work->missed[g] = missed(list, g, m->constants);
    }
}

void cue_predict(const cue_sound *sounds, int n_sounds, const cue_model *m, int32_t first,
                 unsigned course, unsigned shift, cue_motion_work *work, cue_block *out) {
    mouths(sounds, n_sounds, m, first, work->sum, out);
    weigh(&work->strokes, m, work);
    for (int k = 0; k < m->n - N_FACE; k++)
        travel(&work->strokes, m, k, course, shift, first, work, out, N_FACE + k);
}

void cue_predict_kinds(const cue_model *m, int32_t first, unsigned course, unsigned shift,
                       cue_motion_work *work, cue_block *out) {
    weigh(&work->strokes, m, work);
    for (int k = 0; k < KINDS; k++)
        travel(&work->strokes, m, m->n - N_FACE + k, course, shift, first, work, out, k);
}

void cue_use_shares(const cue_content *content, const cue_model *m, cue_block *out) {
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

int cue_solve(double *a, double *b, int n, int columns) {
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
