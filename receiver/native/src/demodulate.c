/* demodulate.c - a view of sound to payloads: levels, weights of cells, attempts of the decoder.
 *
 * In: a view; out: cue_reading. The level is found by trying: first those that fit the pilots, the
 * last one before others. Weights follow what decoded superframes taught about each cell's place
 * and about three clues: the cell's strength, its frame's, and the noise of a coder of constant
 * rate (Mardia and Jupp, "Directional Statistics", 2000, section 5.3; Johnston, IEEE JSAC 6(2),
 * 1988). Specification: spec/audio-carrier.md, sections 6 and 7.3 (W37, W38, W47).
 */
#include <string.h>

#include "hearing.h"

static const float least_resultant = 0.02f, largest_resultant = 0.95f;

static float clip(float x, float low, float high) { return x < low ? low : x > high ? high : x; }

/* Ratio of a cosine of 1 at a mean resultant length: W38, twice k. */
static float concentration(float r) { return 2 * r * (2 - r * r) / (1 - r * r); }

void cue_reliability_init(cue_reliability *r, int groups) {
    for (int g = 0; g < groups; g++) /* coders treat high bands worst */
        r->resultant[g] = 0.5f * exp2f(-2.32192809f * (float)g / (float)(groups - 1));
    r->exponents[0] = r->exponents[1] = 0;
    r->exponents[2] = -0.3f;
}

/* Which cells are alike: low ones, and above those of mid, left and right. */
static int kind_of(const cue_hearing *h, int profile, int g) {
    const cue_profile *p = &cue_profiles[profile];
    int bin = p->first_bin + g * p->cell_bins;
    return bin < 30 ? 0 : 1 + h->layout.place[profile][bin];
}

/* ---- Clues -------------------------------------------------------------------------------- */

/* Noise of a coder of constant rate, 200 bits per 10 ms, shared by blocks of four frames: its
 * threshold is raised until the bits suffice. Per band; h->clues[2] gets its logarithm. */
static void coder_noise(cue_hearing *h, const cue_view *view, float noise[FRAMES][BANDS]) {
    int bands = 0;
    while (bands < h->mask.bands && h->mask.edge[bands] < 300) bands++;
    for (int block = 0; block < FRAMES; block += 4) {
        float ratio[4][BANDS], low = -8, high = 12;
        for (int f = 0; f < 4; f++)
            for (int j = 0; j < bands; j++) {
                float spread = view->spread[block + f][j];
                spread = spread > 1e-12f ? spread : 1e-12f;
                noise[block + f][j] = 1e-9f * exp2f(0.7f * log2f(spread * 1e9f));
                ratio[f][j] = (view->energy[block + f][j] + 1e-14f) / noise[block + f][j];
            }
        for (int round = 0; round < 12; round++) {
            float middle = (low + high) / 2, less = cue_exp(-middle), bits = 0;
            for (int f = 0; f < 4; f++)
                for (int j = 0; j < bands; j++)
                    bits += (float)(h->mask.edge[j + 1] - h->mask.edge[j])
                            * log2f(1 + ratio[f][j] * less) / 2;
            if (bits <= 800) high = middle;
            else low = middle;
        }
        for (int f = 0; f < 4; f++)
            for (int j = 0; j < bands; j++) noise[block + f][j] *= cue_exp(high);
    }
}

static void find_clues(cue_hearing *h, const cue_view *view, int profile) {
    const cue_profile *p = &cue_profiles[profile];
    int groups = cue_groups(p);
    float noise[FRAMES][BANDS];
    coder_noise(h, view, noise);
    for (int f = 0; f < FRAMES; f++) {
        float frame = cue_log(view->power[f] + 1e-12f);
        for (int g = 0, band = 0; g < groups; g++) {
            int at = f * groups + g;
            float unit = 0, pressed = 0;
            for (int k = p->first_bin + g * p->cell_bins, i = 0; i < p->cell_bins; i++, k++) {
                while (h->mask.edge[band + 1] <= k) band++;
                unit += view->unit[f][k];
                pressed += noise[f][band];
            }
            unit /= (float)p->cell_bins;
            h->clues[0][at] = 2 * cue_log(unit > 1e-7f ? unit : 1e-7f);
            h->clues[1][at] = frame;
            h->clues[2][at] = cue_log(pressed / (float)p->cell_bins) - h->clues[0][at];
        }
    }
    for (int c = 0; c < 3; c++)
        for (int g = 0; g < groups; g++) {
            float mean = 0;
            for (int f = 0; f < FRAMES; f++) mean += h->clues[c][f * groups + g] / FRAMES;
            for (int f = 0; f < FRAMES; f++) {
                float *clue = &h->clues[c][f * groups + g];
                *clue = clip(*clue - mean, -5, 5);
            }
        }
}

/* ---- Weights ------------------------------------------------------------------------------ */

static void weigh(cue_hearing *h, const float *cells, const float *exponents, float part, int groups) {
    for (int f = 0; f < FRAMES; f++)
        for (int g = 0; g < groups; g++) {
            int at = f * groups + g;
            float sum = exponents[0] * h->clues[0][at] + exponents[1] * h->clues[1][at]
                        + exponents[2] * h->clues[2][at];
            h->weights[at] = cells[g] * cue_exp(part * sum);
        }
}

/* Weights with which bits are read that nothing is known of: nearer to each other than what was
 * learnt. */
static void cautious(cue_hearing *h, int profile, const cue_reliability *r) {
    int groups = cue_groups(&cue_profiles[profile]);
    float cells[GROUPS];
    for (int g = 0; g < groups; g++) {
        float root = sqrtf(concentration(r->resultant[g]));
        cells[g] = root * sqrtf(root);
    }
    weigh(h, cells, r->exponents, 0.75f, groups);
}

static void learnt(cue_hearing *h, int profile, const float *exponents) {
    const cue_reliability *r = &h->reliability[profile];
    float cells[GROUPS];
    int groups = cue_groups(&cue_profiles[profile]);
    for (int g = 0; g < groups; g++) cells[g] = concentration(r->resultant[g]);
    weigh(h, cells, exponents, 1, groups);
}

/* Factors by how near the cells of each place lie to the right points: a single channel bears what
 * stands there. `near` and `seen` are sums per group. */
static void factors(const cue_hearing *h, int profile, const float *near, const float *seen,
                    float *out) {
    int groups = cue_groups(&cue_profiles[profile]), best = 1;
    float mean[4] = {0}, count[4] = {0}, deviation[4], sure[4];
    bool apart = false;
    for (int g = 0; g < groups; g++) {
        mean[kind_of(h, profile, g)] += near[g];
        count[kind_of(h, profile, g)] += seen[g];
    }
    for (int i = 0; i < 4; i++) {
        count[i] = count[i] > 1 ? count[i] : 1;
        mean[i] /= count[i];
        deviation[i] = sqrtf(0.5f / count[i]);
        sure[i] = mean[i] - 2 * deviation[i];
        if (i > 1 && mean[i] > mean[best]) best = i;
    }
    for (int i = 1; i < 4; i++)
        apart |= mean[i] < mean[best] - 2.5f * sqrtf(deviation[i] * deviation[i]
                                                      + deviation[best] * deviation[best]);
    float unit = sure[best] > deviation[best] ? sure[best] : deviation[best];
    for (int g = 0; g < groups; g++)
        out[g] = apart ? clip(sure[kind_of(h, profile, g)] / unit, 0.02f, 1) : 1;
}

/* Factors by the second harmonic, in which both bits agree. */
static void standing(const cue_hearing *h, int profile, const float *soft, float *out) {
    int groups = cue_groups(&cue_profiles[profile]);
    float near[GROUPS] = {0}, seen[GROUPS] = {0};
    for (int f = 0; f < FRAMES; f++)
        for (int g = 0; g < groups; g++) {
            float s = soft[f * groups + g];
            near[g] += s != 0 ? 2 * s * s - 1 : 0;
            seen[g] += s != 0;
        }
    factors(h, profile, near, seen, out);
}

/* Weights by how well known cells agree around each cell of this superframe: a window of 1.5
 * frames and 2.5 cells, beside it the mean over frames. */
static void local(cue_hearing *h, int profile, const float *soft, const int8_t *expected) {
    int groups = cue_groups(&cue_profiles[profile]);
    float place[GROUPS], *near = h->clues[0], *seen = h->clues[1], *pass = h->clues[2];
    float along[21], across[13];
    for (int d = -10; d <= 10; d++) along[d + 10] = cue_exp(-0.08f * (float)(d * d)) / 6.2665706f;
    for (int d = -6; d <= 6; d++) across[d + 6] = cue_exp(-0.2222222f * (float)(d * d)) / 3.7599424f;
    for (int g = 0; g < groups; g++) {
        float sum = 0, count = 0;
        for (int f = 0; f < FRAMES; f++) {
            int at = f * groups + g;
            bool known = expected[at] && soft[at] != 0;
            near[at] = known ? soft[at] * (float)expected[at] : 0;
            seen[at] = known;
            sum += near[at];
            count += seen[at];
        }
        place[g] = clip(sum / (count > 1 ? count : 1), least_resultant, largest_resultant);
    }
    for (int which = 0; which < 2; which++) {
        float *x = which ? seen : near;
        for (int f = 0; f < FRAMES; f++)
            for (int g = 0; g < groups; g++) {
                float sum = 0;
                for (int d = -10; d <= 10; d++)
                    if (g + d >= 0 && g + d < groups)
                        sum += along[d + 10] * x[f * groups + g + d];
                pass[f * groups + g] = sum;
            }
        for (int f = 0; f < FRAMES; f++)
            for (int g = 0; g < groups; g++) {
                float sum = 0;
                for (int d = -6; d <= 6; d++)
                    if (f + d >= 0 && f + d < FRAMES)
                        sum += across[d + 6] * pass[(f + d) * groups + g];
                x[f * groups + g] = sum;
            }
    }
    for (int i = 0; i < FRAMES * groups; i++) {
        float r = (47.12389f * near[i] + 20 * place[i % groups]) / (47.12389f * seen[i] + 20);
        h->weights[i] = concentration(clip(r, least_resultant, largest_resultant));
    }
}

/* ---- Attempts ------------------------------------------------------------------------------ */

static void gather(cue_hearing *h, int profile, const float *soft, const float *by_group) {
    const cue_profile *p = &cue_profiles[profile];
    int groups = cue_groups(p), count = cue_coded(p);
    for (int i = 0; i < count; i++) {
        int at = h->layout.order[profile][i];
        h->ratios[i] = soft[at] * h->weights[at] * (by_group ? by_group[at % groups] : 1);
    }
}

static void spread(cue_hearing *h, int profile, int layer, const int8_t *coded) {
    const cue_profile *p = &cue_profiles[profile];
    int first = layer ? p->l0_coded : 0, end = layer ? cue_coded(p) : p->l0_coded;
    for (int i = first; i < end; i++) h->reading.expected[h->layout.order[profile][i]] =
        coded[i - first];
}

static bool second(cue_hearing *h, int profile, int paths) {
    const cue_profile *p = &cue_profiles[profile];
    int8_t coded[4096];
    if (!p->l1_bytes) return false;
    h->reading.l1_ok = cue_link_decode(&h->link, profile, 1, h->ratios + p->l0_coded, paths,
                                       &h->work.polar, h->reading.l1, coded);
    if (h->reading.l1_ok) spread(h, profile, 1, coded);
    return h->reading.l1_ok;
}

static bool attempt(cue_hearing *h, int profile, float level, const float *by_group, int paths) {
    cue_reading *r = &h->reading;
    int8_t coded[4096];
    r->level = level;
    gather(h, profile, r->soft, by_group);
    r->l0_ok = cue_link_decode(&h->link, profile, 0, h->ratios, paths, &h->work.polar, r->l0, coded);
    if (!r->l0_ok) return false;
    memset(r->expected, 0, sizeof r->expected);
    spread(h, profile, 0, coded);
    second(h, profile, paths);
    return true;
}

static float agreement(const cue_hearing *h, int profile, float level, float *soft) {
    int count = FRAMES * cue_groups(&cue_profiles[profile]);
    float sum = 0;
    cue_soft(h, &h->view, profile, cue_step(&cue_profiles[profile], level), soft);
    for (int i = 0; i < count; i++) sum += soft[i] * (float)h->reading.expected[i];
    return sum;
}

/* Move to the level at which the decoded bits fit best: L0 survives a wrong one. */
static void settle(cue_hearing *h, int profile) {
    float soft[FRAMES * GROUPS], start = h->reading.level, best = start;
    float most = agreement(h, profile, start, soft);
    for (int change = -2; change <= 2; change++) {
        float fit = change ? agreement(h, profile, start + (float)change, soft) : most;
        if (fit > most) {
            most = fit;
            best = start + (float)change;
        }
    }
    if (best == start) return;
    cue_reading kept = h->reading;
    agreement(h, profile, best, h->reading.soft);
    local(h, profile, h->reading.soft, kept.expected);
    if (!attempt(h, profile, best, NULL, 8)) h->reading = kept;
    find_clues(h, &h->view, profile);
}

int cue_likely_levels(const cue_hearing *h, const cue_view *view, const cue_track *track,
                      float *levels) {
    enum { SPARE = 2, FIRST = -SPARE, COUNT = LEVELS / TIER_LEVELS + 2 * SPARE };
    const cue_profile *p = &cue_profiles[track->profile];
    float score[COUNT];
    int chosen[3], n = 0, count = 0, best = 0;
    for (int i = 0; i < COUNT; i++) {
        float step = cue_pilot_step(p, (float)(FIRST + i) + track->offset / TIER_LEVELS);
        score[i] = cue_pilot_score(h, view, track->profile, step);
        if (score[i] > score[best]) best = i;
    }
    if (best < SPARE || best >= COUNT - SPARE) chosen[n++] = best;
    for (int round = 0; round < 2; round++) { /* the two likeliest of the profile's own */
        int top = -1;
        for (int i = SPARE; i < COUNT - SPARE; i++)
            if ((n == 0 || chosen[n - 1] != i) && (top < 0 || score[i] > score[top])
                && !(n > 1 && chosen[0] == i))
                top = i;
        if (top >= 0) chosen[n++] = top;
    }
    if (score[best] < 24) n = 1; /* pilots hardly show a level: try its neighbours, too */
    for (int c = 0; c < n; c++)
        for (int i = 0; i < TIER_LEVELS; i++)
            levels[count++] = (float)((FIRST + chosen[c]) * TIER_LEVELS + i) + track->offset;
    if (score[best] < 24)
        for (int reach = 0; reach < 2 * LEVELS && count < 2 * TIER_LEVELS; reach++)
            for (int sign = -1; sign <= 1 && count < 2 * TIER_LEVELS; sign += 2) {
                float level = floorf(track->level - track->offset + 0.5f) + (float)(sign * reach);
                bool known = level < 0 || level >= LEVELS || (sign > 0 && !reach);
                for (int i = 0; i < TIER_LEVELS; i++)
                    known |= levels[i] == level + track->offset;
                if (!known) levels[count++] = level + track->offset;
            }
    for (int c = 0; c + TIER_LEVELS <= count; c += TIER_LEVELS) /* nearest to the last one first */
        for (int i = c + 1; i < c + TIER_LEVELS; i++)
            for (int j = i; j > c && fabsf(levels[j] - track->level)
                                     < fabsf(levels[j - 1] - track->level); j--) {
                float swap = levels[j];
                levels[j] = levels[j - 1];
                levels[j - 1] = swap;
            }
    return count;
}

/* Read h->view at the first of some levels that the link accepts; harder where a superframe is
 * due, and hardly beyond the first attempts in brief. */
bool cue_read(cue_hearing *h, int profile, const float *levels, int count,
              enum cue_effort effort) {
    const cue_profile *p = &cue_profiles[profile];
    const cue_view *view = &h->view;
    int groups = cue_groups(p), longer = effort == DUE ? 64 : 32, likely = effort == DUE ? 4 : 2;
    float by_group[GROUPS], promise[16], noisy[3] = {0.5f, 0, 0};
    cue_reliability plain;
    find_clues(h, view, profile);
    cautious(h, profile, &h->reliability[profile]);
    h->reading.l0_ok = h->reading.l1_ok = false;
    for (int i = 0; i < count; i++) {
        cue_soft(h, view, profile, cue_step(p, levels[i]), h->reading.soft);
        promise[i] = 0;
        for (int at = 0; at < FRAMES * groups; at++) {
            float s = h->reading.soft[at];
            promise[i] += s != 0 ? h->weights[at] * (2 * s * s - 1) : 0;
        }
        if (!view->paired) standing(h, profile, h->reading.soft, by_group);
        if (attempt(h, profile, levels[i], view->paired ? NULL : by_group, 8)) {
            settle(h, profile);
            return true;
        }
    }
    if (effort == BRIEF) return false;
    /* Longer lists: half of the levels the likeliest, half the most promising. */
    int order[16], n = 0;
    for (int i = 0; i < likely / 2 && i < count; i++) order[n++] = i;
    for (int round = 0; round < likely / 2; round++) {
        int top = -1;
        for (int i = 0; i < count; i++) {
            bool used = false;
            for (int j = 0; j < n; j++) used |= order[j] == i;
            if (!used && (top < 0 || promise[i] > promise[top])) top = i;
        }
        if (top >= 0) order[n++] = top;
    }
    for (int which = 0; which < 4; which++) { /* learnt, plain, even, noisy weights */
        cue_reliability_init(&plain, groups);
        if (which == 1) cautious(h, profile, &plain);
        if (which == 2)
            for (int at = 0; at < FRAMES * groups; at++) h->weights[at] = 1;
        if (which == 3) learnt(h, profile, noisy);
        for (int j = 0; j < (which ? effort == DUE ? 2 : 1 : n) && j < n; j++) {
            float level = levels[order[j]];
            cue_soft(h, view, profile, cue_step(p, level), h->reading.soft);
            if (attempt(h, profile, level, NULL, which == 3 ? 32 : longer)) {
                settle(h, profile);
                return true;
            }
        }
    }
    for (int kind = 2; kind < 4 && !view->paired; kind++) { /* cells of left or of right alone */
        int best = 0;
        float most = -1e9f;
        for (int g = 0; g < groups; g++) by_group[g] = kind_of(h, profile, g) == kind ? 1 : 0.02f;
        for (int i = 0; i < count; i++) {
            float sum = 0;
            cue_soft(h, view, profile, cue_step(p, levels[i]), h->reading.soft);
            for (int at = 0; at < FRAMES * groups; at++) {
                float s = h->reading.soft[at];
                sum += s != 0 && kind_of(h, profile, at % groups) == kind ? 2 * s * s - 1 : 0;
            }
            if (sum > most) {
                most = sum;
                best = i;
            }
        }
        cautious(h, profile, &h->reliability[profile]);
        cue_soft(h, view, profile, cue_step(p, levels[best]), h->reading.soft);
        if (attempt(h, profile, levels[best], by_group, longer)) {
            settle(h, profile);
            return true;
        }
    }
    return false;
}

/* Seek L1 where only L0 was read: h->view lies where the bits of L0 fit best. */
bool cue_read_second(cue_hearing *h, int profile) {
    float soft[FRAMES * GROUPS];
    cue_reliability plain;
    cue_reliability_init(&plain, cue_groups(&cue_profiles[profile]));
    cue_soft(h, &h->view, profile, cue_step(&cue_profiles[profile], h->reading.level), soft);
    for (int which = 0; which < 3; which++) {
        if (which == 0) local(h, profile, soft, h->reading.expected);
        if (which == 1) find_clues(h, &h->view, profile);
        if (which >= 1) cautious(h, profile, which == 1 ? &h->reliability[profile] : &plain);
        gather(h, profile, soft, NULL);
        if (second(h, profile, PATHS)) break;
    }
    find_clues(h, &h->view, profile);
    return h->reading.l1_ok;
}

/* ---- What decoded bits teach --------------------------------------------------------------- */

void cue_trusted(cue_hearing *h, int profile, const cue_reading *r, float *weighted) {
    int groups = cue_groups(&cue_profiles[profile]);
    float near[GROUPS] = {0}, seen[GROUPS] = {0}, by_group[GROUPS];
    learnt(h, profile, h->reliability[profile].exponents);
    for (int at = 0; at < FRAMES * groups; at++) {
        bool known = r->expected[at] && r->soft[at] != 0;
        near[at % groups] += known ? r->soft[at] * (float)r->expected[at] : 0;
        seen[at % groups] += known;
    }
    factors(h, profile, near, seen, by_group);
    for (int at = 0; at < FRAMES * groups; at++)
        weighted[at] = (float)r->expected[at] * h->weights[at]
                       * (h->view.paired ? 1 : by_group[at % groups]);
}

void cue_reliability_learn(cue_hearing *h, int profile, const cue_reading *reading) {
    cue_reliability *r = &h->reliability[profile];
    int groups = cue_groups(&cue_profiles[profile]);
    for (int g = 0; g < groups; g++) {
        float known = 0, sum = 0;
        for (int f = 0; f < FRAMES; f++) {
            int at = f * groups + g;
            known += reading->expected[at] && reading->soft[at] != 0;
            sum += reading->soft[at] * (float)reading->expected[at];
        }
        if (known > 8)
            r->resultant[g] = clip(0.7f * r->resultant[g] + 0.3f * sum / known, least_resultant,
                                   largest_resultant);
    }
    learnt(h, profile, r->exponents);
    for (int c = 0; c < 3; c++) {
        float gradient = -20 * r->exponents[c], curvature = 20;
        for (int at = 0; at < FRAMES * groups; at++) {
            float ratio = h->weights[at] * reading->soft[at] * (float)reading->expected[at];
            float slope = ratio / (1 + cue_exp(clip(ratio, -30, 30))), clue = h->clues[c][at];
            gradient += clue * slope;
            curvature += clue * clue * fabsf(slope);
        }
        h->ratios[c] = clip(r->exponents[c] + 0.3f * gradient / curvature, -1, 1);
    }
    for (int c = 0; c < 3; c++) r->exponents[c] = h->ratios[c];
}

float cue_gain_change(const cue_hearing *h, int profile, const cue_reading *reading) {
    float soft[FRAMES * GROUPS];
    float below = agreement(h, profile, reading->level - 0.25f, soft);
    float here = agreement(h, profile, reading->level, soft);
    float above = agreement(h, profile, reading->level + 0.25f, soft);
    if ((below > above ? below : above) <= 1.02f * here) return 0;
    return below > above ? -0.25f : 0.25f;
}
