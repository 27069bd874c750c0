/* residual.c
 * In: a range decoder that stands before coefficients, the scales of the bases. Out: indices and
 * values in 2^-16 mm; parameters by the inverse transform.
 * Source: DCT-II after Ahmed, Natarajan and Rao 1974; context coding of transform coefficients.
 * Specification: spec/bitstream.md, section 6 (T1 to T3, C1 to C5, Q1 to Q6). */
#include "payload.h"

#include <math.h>
#include <string.h>

static const int8_t LEVELS[7] = {0, 4, -4, 8, -8, 12, -12};

void cue_bases_order(cue_bases *bases) {
    int count = bases->channels * TICKS;
    for (int b = 0; b < BASES; b++) {
        /* T2: insertion into ascending (frequency, channel), stable by descending scale. */
        for (int n = 0; n < count; n++) {
            int f = n / bases->channels, c = n % bases->channels, at = n;
            int scale = bases->scales[b][c][f];
            for (; at > 0; at--) {
                uint16_t other = bases->scan[b][at - 1];
                if (bases->scales[b][other / TICKS][other % TICKS] >= scale) break;
                bases->scan[b][at] = other;
            }
            bases->scan[b][at] = (uint16_t)(c * TICKS + f);
        }
        for (int n = 0; n < count; n++) bases->rank[b][bases->scan[b][n]] = (uint16_t)n;
    }
}

/* C1 */
static int class_of(const cue_bases *bases, const cue_content *content, int place, int *shift) {
    int scale = bases->scales[content->basis][place / TICKS][place % TICKS];
    int ratio = scale + LEVELS[content->level] - content->step + 16;
    *shift = ratio > 24 ? (ratio - 21) >> 2 : 0;
    return ratio - 4 * *shift;
}

/* C4: an index, and whether all its symbols were determined. */
static int64_t read_index(cue_range *r, const uint16_t *row, int shift, int *determined) {
    static const uint16_t even[2] = {HALF, HALF};
    int64_t q = (int64_t)cue_range_symbol(r, row, 16, 16);
    int sure = r->determined;
    if (q == 15) {
        int u = 0;
        for (; u < 20; u++) {
            unsigned bit = cue_range_symbol(r, even, 2, 2);
            sure &= r->determined;
            if (!bit) break;
        }
        int64_t rest = 0;
        for (int i = 0; i < u; i++) {
            rest = 2 * rest + cue_range_symbol(r, even, 2, 2);
            sure &= r->determined;
        }
        q = 15 + (INT64_C(1) << u) + rest - 1;
    }
    for (int i = 0; i < shift; i++) {
        q = 2 * q + cue_range_symbol(r, even, 2, 2);
        sure &= r->determined;
    }
    if (q) {
        if (cue_range_symbol(r, even, 2, 2)) q = -q;
        sure &= r->determined;
    }
    *determined = sure;
    return q;
}

int cue_coefficients_read(cue_range *r, const cue_tables *tables, const cue_bases *bases,
                          const cue_content *content, int first, cue_coefficients *found) {
    const uint16_t *rank = bases->rank[content->basis];
    for (int n = first; n < found->count; n++) {
        int place = bases->scan[content->basis][n], shift;
        int c = place / TICKS, f = place % TICKS, context = 0, determined;
        int class = class_of(bases, content, place, &shift);
        if (class < 0) continue;
        const int near[3] = {f > 0 ? place - 1 : -1, f > 1 ? place - 2 : -1,
                             c > 0 ? place - TICKS : -1}; /* C2 */
        for (int i = 0; i < 3; i++) {
            if (near[i] < 0 || rank[near[i]] >= n) continue; /* C3 */
            int64_t q = found->index[rank[near[i]]];
            q = (q < 0 ? -q : q) >> shift;
            context += q > 2 ? 2 : (int)q;
        }
        if (context > 3) context = 3;
        int64_t q = read_index(r, tables->magnitude[class][context], shift, &determined);
        if (!determined) return n; /* C5 */
        found->index[n] = q;
    }
    return found->count;
}

void cue_coefficients_value(const cue_tables *tables, const cue_bases *bases,
                            const cue_content *content, cue_coefficients *found) {
    static const int64_t widths[4] = {65536, 77936, 92682, 110218}; /* Q1 */
    int64_t width = widths[content->step % 4] << content->step / 4;
    for (int n = 0; n < found->count; n++) {
        int64_t q = found->index[n], size = q < 0 ? -q : q, value;
        int shift, class = class_of(bases, content, bases->scan[content->basis][n], &shift);
        if (q == 0) continue;
        if (shift == 0) /* Q3 */
            value = ((256 * size - tables->inset[class][(size < 3 ? size : 3) - 1]) * width) >> 8;
        else
            value = size * width; /* Q4 */
        found->value[n] = q < 0 ? -value : value;
    }
}

void cue_residual(const cue_content *content, const cue_coefficients *found, const cue_bases *bases,
                  const cue_model *model, cue_block *out) {
    double wave[TICKS][TICKS]; /* by frequency and frame */
    const double pi = 3.14159265358979323846, frames = (double)TICKS;
    memset(out, 0, sizeof *out);
    if (content->step == 63) return;
    for (int f = 0; f < TICKS; f++)
        for (int t = 0; t < TICKS; t++)
            wave[f][t] = sqrt((f ? 2.0 : 1.0) / frames) * cue_cos(pi * (2 * t + 1) * f / (2.0 * frames));
    for (int n = 0; n < found->count; n++) {
        if (found->value[n] == 0) continue;
        int place = bases->scan[content->basis][n];
        const double *row = model->inverse[content->basis][place / TICKS];
        double value = (double)found->value[n] / 65536.0;
        for (int t = 0; t < TICKS; t++) {
            double at = value * wave[place % TICKS][t];
            for (int k = 0; k < model->n; k++) out->value[t][k] += at * row[k];
        }
    }
}
