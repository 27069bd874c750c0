/* acquire.c - find superframes in sound that may start anywhere, by their pilots.
 *
 * In: the ring of sound, in batches of 0.16 s of starts; out: candidates. Pilots lie below 2.8 kHz,
 * so that a rate of 12 kHz serves; every second sample at 48 kHz is tried as a start, with 35 clock
 * errors. Each batch stands for itself: transforms, masks and soft values are made anew, so that any
 * hypothesis (mix, polarity, gain) can be tried on any batch and none needs memory. Two hypotheses
 * share a batch: the usual one, whose scores of up to three superframes in a row are added, and
 * another one in rotation. Sources: sliding transform of Jacobsen and Lyons, IEEE Signal Processing
 * Magazine 20(2), 2003. Specification: spec/audio-carrier.md, section 7.1 (W35, W37, W42).
 */
#include <string.h>

#include "hearing.h"

#define PARTS 120                        /* of a soft value of 1: sums of 128 and a penalty fit 16 bits */
#define SEARCH_BINS 59                   /* those of the bands that pilots touch */
#define SEARCH_HOP 120
#define BLOCK (BATCH / 2)
#define PERIOD (FRAMES * ROW_HOP)
#define FEW_CLOCKS 9                     /* of rotating hypotheses: 480 ppm */
#define FINE_TIERS 2 /* small steps lose 3 deviations half a sample beside: starts at each sample */
#define WORTH_ADDING (22 * PARTS * 8 / 10) /* 2.2 deviations: scores below are not added up */

static const float deviation = 8.0f;   /* of a score in unmarked sound: sqrt(128 / 2) */
static const float least_score = 4.8f; /* deviations from which a place is tried */

static int search_bands(const cue_mask *mask) {
    int n = 0;
    while (mask->edge[n] < LAST_PILOT) n++;
    return n;
}

void cue_search_init(cue_search *s) {
    memset(s, 0, sizeof *s);
    for (int i = 0; i < 52; i++) { /* low-pass at 0.235 of 48 kHz / 2, 51 taps, Kaiser's window */
        double t = i - 25, u = 1 - t / 26 * (t / 26), x = PI * 0.235 * (i == 25 ? 1e-9 : t), window = 0, term = 1;
        for (int k = 1; k < 40; k++) {
            window += term;
            term *= 9.0 * 9.0 * u / (4.0 * k * k);
        }
        s->fir[i] = (float)(0.235 * cue_sin(x) / x * window / 1093.588); /* I0(9) */
    }
    for (int k = 0; k < 64; k++) {
        for (int i = 0; i < 240; i++) {
            s->wave[0][i][k] = (float)cue_cos(PI / SEARCH_HOP * (i * k % 240));
            s->wave[1][i][k] = (float)-cue_sin(PI / SEARCH_HOP * (i * k % 240));
        }
        double after = -PI * (0.5 + SEARCH_HOP / 2) * (k + 0.5) / SEARCH_HOP - PI / 2;
        double size = sqrt(2.0 / SEARCH_HOP) / 2, half = PI / (4.0 * SEARCH_HOP);
        s->slide_turn[0][k] = (float)cue_cos(PI / SEARCH_HOP * 4 * k);
        s->slide_turn[1][k] = (float)cue_sin(PI / SEARCH_HOP * 4 * k);
        s->own[0][k] = (float)(size * cue_cos(after + half));
        s->own[1][k] = (float)(size * cue_sin(after + half));
        s->next[0][k] = (float)(-size * cue_cos(after - half));
        s->next[1][k] = (float)(-size * cue_sin(after - half));
    }
    s->active = true;
}

/* First sample of the sound of a batch at 48 kHz. */
static int64_t first_sample(int64_t batch) { return batch * QUANTUM - LEAD_ROWS * 16; }

/* Search from a place on, with the mix and the gain that a track had if there was one. */
void cue_search_start(cue_hearing *h, double from, const cue_track *track) {
    cue_search *s = &h->search;
    memset(s->past, 0, sizeof s->past);
    s->batch = (int64_t)floor(from / QUANTUM);
    s->mix[0] = track ? track->mix[0] : 1;
    s->mix[1] = track ? track->mix[1] : 0;
    s->offset = track ? track->offset : 0;
    s->active = true;
}

bool cue_search_ready(const cue_hearing *h) {
    return h->search.active
           && first_sample(h->search.batch) + 4 * SEARCH_SOUND + 32 <= h->now;
}

/* ---- Transforms, masks and projections of a batch ------------------------------------------ */

static void low_sound(const cue_hearing *h, const float mix[2], cue_search_work *w) {
    enum { PIECE = 128 };
    float x[4 * PIECE + 52];
    int64_t first = first_sample(h->search.batch);
    for (int done = 0; done < SEARCH_SOUND; done += PIECE) {
        int n = SEARCH_SOUND - done < PIECE ? SEARCH_SOUND - done : PIECE;
        cue_sound_read(&h->sound, mix, (double)(first + 4 * done - 25), 1.0, 4 * n + 52, x);
        for (int i = 0; i < n; i++) {
            float sum = 0;
            for (int j = 0; j < 52; j++) sum += h->search.fir[j] * x[4 * i + j];
            w->sound[done + i] = sum;
        }
    }
}

/* Projections beyond 4000 units are of no use; soft values need them whole (see soften). */
static float limited(float x) { return x > 4000 ? 4000 : x < -4000 ? -4000 : x; }

/* Band powers and signed sums of slots in rows `first` to `end`. Parts of slots in different bands
 * are scaled apart, so that sums per band are kept: slot g takes bins of at most three bands. */
static void slide(const cue_hearing *h, cue_search_work *w, float silent) {
    const cue_search *s = &h->search;
    const cue_layout *layout = &h->layout;
    int bands = search_bands(&h->mask);
    float x[64], y[64], a[64], b[64], power[64];
    for (int r = 0; r < ROWS; r++) {
        const float *sound = w->sound + 4 * r;
        if (r % 240 == 0) { /* anew: rounding errors do not grow */
            memset(x, 0, sizeof x);
            memset(y, 0, sizeof y);
            for (int i = 0; i < 240; i++)
                for (int k = 0; k < 64; k++) {
                    x[k] += sound[i] * s->wave[0][i][k];
                    y[k] += sound[i] * s->wave[1][i][k];
                }
        } else {
            float d[4];
            for (int i = 0; i < 4; i++) d[i] = sound[236 + i] - sound[i - 4];
            for (int k = 0; k < 64; k++) {
                float u = x[k], v = y[k];
                for (int i = 0; i < 4; i++) {
                    u += d[i] * s->wave[0][i][k];
                    v += d[i] * s->wave[1][i][k];
                }
                x[k] = u * s->slide_turn[0][k] - v * s->slide_turn[1][k];
                y[k] = u * s->slide_turn[1][k] + v * s->slide_turn[0][k];
            }
        }
        for (int k = 0; k < 63; k++) {
            a[k] = s->own[0][k] * x[k] - s->own[1][k] * y[k]
                   + s->next[0][k] * x[k + 1] - s->next[1][k] * y[k + 1];
            b[k] = s->own[0][k] * y[k] + s->own[1][k] * x[k]
                   + s->next[0][k] * y[k + 1] + s->next[1][k] * x[k + 1];
            power[k] = 2 * (a[k] * a[k] + b[k] * b[k]); /* of 48 kHz: four times, and halved */
        }
        float energy[BANDS], threshold[BANDS], factor[BANDS];
        for (int j = 0; j < bands; j++) {
            float sum = 0;
            for (int k = h->mask.edge[j]; k < h->mask.edge[j + 1]; k++) sum += power[k];
            energy[j] = sum / (float)(h->mask.edge[j + 1] - h->mask.edge[j]);
        }
        cue_mask_thresholds(&h->mask, energy, bands, bands, silent, threshold, NULL);
        for (int j = 0; j < bands; j++) {
            float before = r < ROWS_PER_FRAME ? 0 : w->threshold[j][r - ROWS_PER_FRAME];
            float least = silent * 0.25118864f, limit = 4 * (before > least ? before : least);
            w->threshold[j][r] = threshold[j];
            threshold[j] = threshold[j] < limit ? threshold[j] : limit;
            factor[j] = threshold[j] > 0 ? 1 / sqrtf(2 * threshold[j]) : 0; /* sqrt(4 / 8 bins) */
        }
        for (int g = 0, band = 0; g < SLOTS; g++) {
            float re = 0, im = 0;
            w->alive[g][r] = 1;
            for (int i = 0; i < PILOT_BINS; i++) {
                int k = FIRST_PILOT + PILOT_BINS * g + i;
                while (h->mask.edge[band + 1] <= k) band++;
                float unit = layout->pilot_signs[PILOT_BINS * g + i] * factor[band];
                if (factor[band] <= 0) w->alive[g][r] = 0;
                re += unit * a[k];
                im += unit * b[k];
            }
            w->re[g][r] = w->alive[g][r] ? limited(re) : 0;
            w->im[g][r] = w->alive[g][r] ? limited(im) : 0;
        }
    }
}

/* ---- Soft values and correlations ---------------------------------------------------------- */

/* Soft values of all slots at a step, in PARTS, for each place, `aside` samples beside its middle:
 * the row's projections turned on by the slot's centre frequency. Place 0 lies at row 30. */
static void soften(const cue_hearing *h, cue_search_work *w, float step, double aside) {
    for (int g = 0; g < SLOTS; g++) {
        double frequency = PI / SEARCH_HOP * (FIRST_PILOT + PILOT_BINS * (g + 0.5));
        float dither = h->layout.pilot_dither[g];
        const float *re = w->re[g] + 30, *im = w->im[g] + 30;
        const uint8_t *alive = w->alive[g] + 30;
        float turn[2][TURNS];
        float x[8], c[8];
        for (int t = 0; t < TURNS; t++) {
            turn[0][t] = (float)(cue_cos(frequency * (0.5 * t - 1.5 + aside / 4)) / step);
            turn[1][t] = (float)(cue_sin(frequency * (0.5 * t - 1.5 + aside / 4)) / step);
        }
        for (int r = 0; r < ROWS - 30; r++) {
            float parts = alive[r] ? PARTS : 0;
            for (int t = 0; t < TURNS; t++) {
                x[t] = re[r] * turn[0][t] - im[r] * turn[1][t] - dither;
                x[t] -= (float)(int)(x[t] + 8192.5f) - 8192; /* nearest whole number */
                float u = x[t] * x[t];
                c[t] = 0.9985258f + u * (-19.54981647f + u * (61.07633166f + u * -59.49797175f));
            }
            for (int t = 0; t < TURNS; t++)
                w->soft[g][r * TURNS + t] = (int8_t)((int)(parts * c[t] + 300.5f) - 300);
        }
    }
}

/* sums[s][i] += correlation of the pilots of eight frames for the start at place i - SLACK. */
static void add_pilots(const cue_hearing *h, cue_search_work *w, int first, int pilot, int profile,
                       int16_t sums[8][BLOCK + 2 * SLACK]) {
    for (int s = 0; s < 8; s++)
        for (int f = 8 * s; f < 8 * s + 8; f += 2) {
            const int8_t *a = w->soft[h->layout.slots[f][pilot]] + first + f * ROW_HOP;
            const int8_t *b = w->soft[h->layout.slots[f + 1][pilot]] + first + (f + 1) * ROW_HOP;
            int16_t p = h->layout.pilots[profile][f][pilot];
            int16_t q = h->layout.pilots[profile][f + 1][pilot];
            int16_t *out = sums[s];
            for (int i = 0; i < BLOCK + 2 * SLACK; i++)
                out[i] = (int16_t)(out[i] + p * a[i] + q * b[i]);
        }
}

static int clock_ppm(int d) { return (d % 2 ? -1 : 1) * (d + 1) / 2 * 120; }

static int16_t clock_penalty(int d) {
    int size = clock_ppm(d) < 0 ? -clock_ppm(d) : clock_ppm(d);
    return (int16_t)(size > 160 ? PARTS * 8 : PARTS * size / 20);
}

static int clock_shift(int d, int segment) {
    return SLACK + (int)cue_nearest(clock_ppm(d) * 1e-6 * (8 * segment + 3.5) * ROW_HOP);
}

/* Largest score of each start over some clock errors. */
static void find_peaks(int16_t sums[8][BLOCK + 2 * SLACK], int clocks, int16_t *peak) {
    for (int i = 0; i < BLOCK; i++) peak[i] = -16384;
    for (int d = 0; d < clocks; d++) {
        int16_t less = clock_penalty(d);
        const int16_t *at[8];
        for (int s = 0; s < 8; s++) at[s] = sums[s] + clock_shift(d, s);
        for (int i = 0; i < BLOCK; i++) {
            int16_t total = (int16_t)(at[0][i] + at[1][i] + at[2][i] + at[3][i] + at[4][i]
                                      + at[5][i] + at[6][i] + at[7][i] - less);
            peak[i] = total > peak[i] ? total : peak[i];
        }
    }
}

/* Clock error that gave a start its score. */
static int clock_of(int16_t sums[8][BLOCK + 2 * SLACK], int clocks, int place, int16_t peak) {
    for (int d = 0; d < clocks; d++) {
        int total = -clock_penalty(d);
        for (int s = 0; s < 8; s++) total += sums[s][clock_shift(d, s) + place];
        if (total == peak) return clock_ppm(d);
    }
    return 0;
}

static float pilot_steps(int tier) { return exp2f(1.875f + (float)tier); }

/* Number of a tier and profile as marked, -1 if the profile lacks the tier: levels 0..11. */
static int pair_of(int tier, int profile) {
    int own = tier - cue_profiles[profile].lowest_tier;
    return own >= 0 && own < LEVELS / TIER_LEVELS ? 3 * profile + own : -1;
}

/* Best sum of a place with those a superframe and two before: weights make them as rare in
 * unmarked sound as a score by itself (W35). Two places share one remembered score. */
static float summed(const cue_search *s, int pair, int place, int ppm, int16_t peak) {
    float own = (float)peak, total = own, best = own;
    const float weight[2] = {0.66f, 0.507f};
    int lag = PERIOD + (int)cue_nearest(ppm * 1e-6 * PERIOD);
    for (int n = 1; n <= 2; n++) {
        int64_t at = (s->batch * BATCH + place - (int64_t)n * lag) >> 1;
        int near = 0;
        for (int d = -1; d <= 1; d++) {
            int64_t index = at + d + 4 * (int64_t)PAST;
            int value = s->past[pair][index % PAST];
            near = value > near ? value : near;
        }
        total += 128.0f * (float)near;
        if (weight[n - 1] * total > best) best = weight[n - 1] * total;
    }
    return best;
}

/* Search the starts of a batch at one pilot step; `tier` is -1 for a step that is not as marked.
 * Starts lie `aside` samples beside the middle of two; with `again` the better score is kept. */
static void search_step(cue_hearing *h, cue_search_work *w, float step, int tier, double aside,
                        bool again, cue_candidate *best) {
    cue_search *s = &h->search;
    soften(h, w, step, aside);
    for (int first = 0; first < BATCH; first += BLOCK) {
        /* Row LEAD_ROWS is place 0; soft values begin at row 30. */
        int from = (LEAD_ROWS - 30) * TURNS - SLACK + first;
        memset(w->common, 0, sizeof w->common);
        add_pilots(h, w, from, 0, 0, w->common);
        for (int n = 0; n < PROFILES; n++) {
            int pair = tier < 0 ? -1 : pair_of(tier, n);
            if (tier >= 0 && pair < 0) continue;
            memcpy(w->sums, w->common, sizeof w->sums);
            add_pilots(h, w, from, 1, n, w->sums);
            int clocks = tier < 0 ? FEW_CLOCKS : CLOCKS;
            find_peaks(w->sums, clocks, w->peak);
            for (int i = 0; i < BLOCK; i++) {
                if (w->peak[i] < WORTH_ADDING) continue;
                float score = w->peak[i];
                if (pair >= 0)
                    score = summed(s, pair, first + i, clock_of(w->sums, clocks, i, w->peak[i]),
                                   w->peak[i]);
                score /= PARTS * deviation;
                if (score <= best->score) continue;
                best->score = score;
                best->profile = n;
                best->pilot_step = step;
                best->clock = clock_of(w->sums, clocks, i, w->peak[i]) * 1e-6;
                best->start = (double)(s->batch * QUANTUM) + 2.0 * (first + i) - 7.5 + aside;
            }
            for (int i = 0; pair >= 0 && i < BLOCK; i += 2) {
                int16_t top = w->peak[i] > w->peak[i + 1] ? w->peak[i] : w->peak[i + 1];
                int64_t at = ((s->batch * BATCH + first + i) >> 1) + 4 * (int64_t)PAST;
                uint8_t *past = &s->past[pair][at % PAST], part = (uint8_t)(top > 0 ? top >> 7 : 0);
                *past = again && *past > part ? *past : part;
            }
        }
    }
}

/* Power below which a band is silent: as marked, or lower where all sound is much softer. */
static float silence(const cue_hearing *h) {
    float usual = 3.2e-3f, part = h->search.loudest / usual; /* -25 dB */
    return SILENT_POWER * (part > 1 ? 1 : part < 1e-3f ? 1e-3f : part);
}

static bool search(cue_hearing *h, const float mix[2], const float *steps, const int *tiers,
                   int count, float least, cue_candidate *found) {
    cue_search_work *w = &h->work.search;
    *found = (cue_candidate){.score = 0, .mix = {mix[0], mix[1]}};
    low_sound(h, mix, w);
    slide(h, w, silence(h));
    for (int i = 0; i < count; i++) {
        bool fine = tiers[i] >= 0 && tiers[i] < FINE_TIERS;
        search_step(h, w, steps[i], tiers[i], fine ? -0.5 : 0, false, found);
        if (fine) search_step(h, w, steps[i], tiers[i], 0.5, true, found);
    }
    if (found->score > h->seen.pilots) h->seen.pilots = found->score;
    return found->score >= least;
}

bool cue_search_usual(cue_hearing *h, cue_candidate *found) {
    float steps[TIERS];
    int tiers[TIERS];
    for (int i = 0; i < TIERS; i++) {
        steps[i] = pilot_steps(i) * exp2f(h->search.offset / TIER_LEVELS);
        tiers[i] = i;
    }
    return search(h, h->search.mix, steps, tiers, TIERS, least_score, found);
}

/* The rotating hypotheses. Five batches in a row, which hold one start of a superframe, get the
 * same two: a polarity or another mix at the usual steps, and eight steps of a ladder of 48 that are
 * 2^(1/8) apart, from 1/3 of the lowest to 3 times the highest: first of the mid, in both
 * polarities, then of another mix. */
bool cue_search_other(cue_hearing *h, bool ladder, cue_candidate *found) {
    static const float mixes[][2] = {{-1, 0}, {0, 1}, {0, -1}, {1, 1}, {1, -1}, {1, 0}};
    enum { COUNT = 8, GRIDS = 6, MIXES = 6, MID_ROUNDS = 2 * GRIDS };
    int turn = h->search.turn / 5, tiers[COUNT], count = ladder ? COUNT : TIERS;
    int which = h->stereo ? turn % (MIXES - 1) : 0, grid = turn % GRIDS;
    float steps[COUNT];
    if (ladder) {
        int round = turn % (MID_ROUNDS + GRIDS);
        which = round < GRIDS ? MIXES - 1 : 0;
        if (round >= MID_ROUNDS && h->stereo) which = turn / (MID_ROUNDS + GRIDS) % (MIXES - 1);
    }
    for (int i = 0; i < count; i++) {
        steps[i] = ladder ? exp2f(0.375f + (float)(i * GRIDS + grid) / 8.0f) : pilot_steps(i);
        tiers[i] = -1;
    }
    return search(h, mixes[which], steps, tiers, count, 5.2f, found);
}
