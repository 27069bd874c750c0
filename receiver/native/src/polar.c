/* polar.c - polar code: transform and successive-cancellation list decoding.
 *
 * In: ratios of the mother code's bits (positive: 0), in work->folded; out: the likeliest paths.
 * Paths share what they have in common: row[p][v] says whose values of level v path p uses. Blocks
 * with no free input but perhaps the last are decided as a whole. Sources: Arikan 2009; Tal and
 * Vardy 2015; Balatsoukas-Stimming, Parizi and Burg 2015; Hashemi, Condo and Gross, WCNC 2017.
 * Specification: spec/audio-carrier.md, section 6.3.
 */
#include <string.h>

#include "hearing.h"

void cue_polar_transform(uint8_t *x, int size) {
    for (int half = 1; half < size; half *= 2)
        for (int start = 0; start < size; start += 2 * half)
            for (int i = start; i < start + half; i++) x[i] ^= x[i + half];
}

static bool is_free(const uint32_t *bits, int i) { return bits[i / 32] >> (i % 32) & 1; }

/* Level of the largest block at `phase` with no free input but the last. */
static int block_level(const uint32_t *free_bits, int phase, int n) {
    int level = 0;
    while (level < n && (phase & ((2 << level) - 1)) == 0) {
        for (int i = phase + (1 << level) - 1; i < phase + (2 << level) - 1; i++)
            if (is_free(free_bits, i)) return level;
        level++;
    }
    return level;
}

/* Ratios of all paths for the block of level `lowest` at `phase`; level v lies at [2^v, 2^(v+1)). */
static void update_ratios(cue_polar_work *w, uint8_t (*row)[14], uint8_t (*left_row)[14], int phase,
                          int lowest, int n, int paths) {
    int level = lowest, size = 1 << n;
    while (level < n - 1 && !(phase >> level & 1)) level++;
    for (int v = level < n - 1 ? level : n - 1; v >= lowest; v--) {
        int half = 1 << v;
        for (int p = 0; p < paths; p++) {
            const float *low = v + 1 == n ? w->folded : w->ratio + row[p][v + 1] * size + 2 * half;
            const float *high = low + half;
            float *out = w->ratio + p * size + half;
            if (phase >> v & 1) {
                const uint8_t *own = w->left + left_row[p][v] * size + half;
                for (int i = 0; i < half; i++)
                    out[i] = high[i] + (1.0f - 2.0f * (float)own[i]) * low[i];
            } else {
                for (int i = 0; i < half; i++) {
                    float a = fabsf(low[i]), b = fabsf(high[i]);
                    out[i] = copysignf(a < b ? a : b, low[i] * high[i]);
                }
            }
        }
        for (int p = 0; p < paths; p++) row[p][v] = (uint8_t)p;
    }
}

/* Carry the decided bits of a block up to the highest block that it completes. */
static void update_bits(cue_polar_work *w, uint8_t (*left_row)[14], const uint8_t *decided,
                        int phase, int level, int n, int paths) {
    int top = level, size = 1 << n;
    while (top < n && phase >> top & 1) top++;
    if (top == n) return;
    for (int p = 0; p < paths; p++) {
        memset(w->work, decided[p], (size_t)1 << level);
        for (int v = level; v < top; v++) {
            const uint8_t *own = w->left + left_row[p][v] * size + (1 << v);
            for (int i = 0; i < 1 << v; i++) {
                uint8_t low = w->work[i];
                w->work[(1 << v) + i] = low;
                w->work[i] = low ^ own[i];
            }
        }
        memcpy(w->left + (paths + p) * size + (1 << top), w->work, (size_t)1 << top);
    }
    for (int p = 0; p < paths; p++) { /* from the spare rows: others may have read these */
        memcpy(w->left + p * size + (1 << top), w->left + (paths + p) * size + (1 << top),
               (size_t)1 << top);
        left_row[p][top] = (uint8_t)p;
    }
}

/* Places of the `kept` least of n values, ascending, equal ones in their old order. */
static void least_of(const float *x, int n, int kept, uint8_t *order) {
    int count = 0;
    for (int i = 0; i < n; i++) {
        if (count == kept && x[i] >= x[order[count - 1]]) continue;
        int place = count < kept ? count++ : kept - 1;
        for (; place && x[order[place - 1]] > x[i]; place--) order[place] = order[place - 1];
        order[place] = (uint8_t)i;
    }
}

int cue_polar_paths(const uint32_t *free_bits, int size, int most, cue_polar_work *w,
                    uint8_t *best) {
    int n = 0, paths = 1, now = 0, count = 0;
    uint8_t decided[PATHS], order[PATHS];
    while (1 << n < size) n++;
    w->metric[0] = 0;
    memset(w->ratio_row, 0, sizeof w->ratio_row);
    memset(w->left_row, 0, sizeof w->left_row);
    for (int phase = 0; phase < size;) {
        int level = block_level(free_bits, phase, n), block = 1 << level;
        update_ratios(w, w->ratio_row[now], w->left_row[now], phase, level, n, paths);
        phase += block;
        for (int p = 0; p < paths; p++) {
            const float *ratio = level == n ? w->folded : w->ratio + p * size + block;
            float sum = 0, size_sum = 0;
            for (int i = 0; i < block; i++) {
                sum += ratio[i];
                size_sum += fabsf(ratio[i]);
            }
            w->candidate[2 * p] = w->metric[p] + (size_sum - sum) / 2;
            w->candidate[2 * p + 1] = w->metric[p] + (size_sum + sum) / 2;
        }
        if (!is_free(free_bits, phase - 1)) {
            for (int p = 0; p < paths; p++) w->metric[p] = w->candidate[2 * p];
            memset(decided, 0, (size_t)paths);
        } else {
            int kept = 2 * paths < most ? 2 * paths : most;
            least_of(w->candidate, 2 * paths, kept, order);
            for (int q = 0; q < kept; q++) {
                int parent = order[q] / 2;
                w->metric[q] = w->candidate[order[q]];
                decided[q] = order[q] & 1;
                w->trace_path[count][q] = (uint8_t)parent;
                w->trace_bit[count][q] = decided[q];
                memcpy(w->ratio_row[!now][q], w->ratio_row[now][parent], 14);
                memcpy(w->left_row[!now][q], w->left_row[now][parent], 14);
            }
            now = !now;
            paths = kept;
            count++;
        }
        update_bits(w, w->left_row[now], decided, phase - 1, level, n, paths);
    }
    least_of(w->metric, paths, paths, best);
    return paths;
}
