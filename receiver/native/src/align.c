/* align.c - the cells of a superframe at a hypothesised place, and how well a place fits.
 *
 * In: a track; out: a view: spectra, the mask's units, projections of cells on their signs. Small
 * delays are tried by turning phases instead of transforming again.
 * Specification: sections 4.4, 5 and 7.2, stereo section 10 (W18, W22, W27, W36, W43, W44).
 */
#include <string.h>

#include "hearing.h"

/* cos(2 pi x) within 2e-6, for any x below 2^22: least squares at Chebyshev's points. */
static inline float cosine(float x) {
    x -= floorf(x + 0.5f);
    float u = x * x;
    return 0.99999921f + u * (-19.73898036f + u * (64.92865742f + u * (-85.27162153f
           + u * (58.79049212f + u * -21.07110563f))));
}

static void project(const cue_view *view, cue_cells cells, float *projection, uint8_t *alive) {
    float scale = 1 / sqrtf((float)cells.bins);
    for (int f = 0; f < FRAMES; f++)
        for (int g = 0; g < cells.groups; g++) {
            float sum = 0;
            uint8_t living = 1;
            for (int i = 0; i < cells.bins; i++) {
                int k = cells.first_bin + g * cells.bins + i;
                float unit = view->unit[f][k];
                if (unit <= 0) living = 0;
                else sum += cells.signs[g * cells.bins + i] * view->spectrum[f][k].re / unit;
            }
            projection[f * cells.groups + g] = living ? sum * scale : 0;
            alive[f * cells.groups + g] = living;
        }
}

/* Units of a frame's bins: W26 to W28. `before` holds the thresholds of the frame before. */
static void set_units(const cue_mask *mask, const float *threshold, float *before, int count,
                      float silent, float *unit) {
    for (int j = 0; j < count; j++) {
        float least = silent * 0.25118864f, limit = 4 * (before[j] > least ? before[j] : least);
        float own = sqrtf(threshold[j] < limit ? threshold[j] : limit);
        before[j] = threshold[j];
        for (int k = mask->edge[j]; k < mask->edge[j + 1] && k < BINS; k++) unit[k] = own;
    }
}

void cue_view_read(cue_hearing *h, const cue_track *track, float silent, cue_view *view) {
    const cue_profile *p = &cue_profiles[track->profile];
    const float other[2] = {track->mix[1], track->mix[0]};
    float x[2][2 * HOP], before[3][BANDS], power[3][HOP], energy[BANDS], threshold[BANDS];
    float unit[3][BINS];
    cue_complex y[2][HOP];
    int count = 0;
    bool pair = track->pair && h->channels == 2 && (track->mix[0] == 0 || track->mix[1] == 0);
    while (h->mask.edge[count] < p->last_bin) count++;
    memset(before, 0, sizeof before);
    memset(unit, 0, sizeof unit);
    view->paired = false;
    for (int f = -2; f < FRAMES; f++) { /* frame f takes the samples 480 f .. 480 f + 959 */
        double place = track->position + (f + 1) * HOP * track->ratio;
        for (int c = 0; c < (pair ? 2 : 1); c++) {
            memmove(x[c], x[c] + HOP, sizeof(float) * HOP);
            cue_sound_read(&h->sound, c ? other : track->mix, place, track->ratio, HOP, x[c] + HOP);
        }
        if (f == -2) continue;
        for (int c = 0; c < (pair ? 2 : 1); c++) {
            cue_mdct_run(&h->mdct, x[c], y[c]);
            for (int k = 0; k < HOP; k++)
                power[c][k] = (y[c][k].re * y[c][k].re + y[c][k].im * y[c][k].im) / 2;
        }
        if (pair) { /* |M +- S|^2 = |M|^2 + |S|^2 +- 2 Re(M S*) */
            for (int k = 0; k < HOP; k++) {
                float both = power[0][k] + power[1][k];
                float cross = y[0][k].re * y[1][k].re + y[0][k].im * y[1][k].im;
                view->paired |= power[1][k] > 0;
                power[1][k] = both + cross > 0 ? both + cross : 0;
                power[2][k] = both - cross > 0 ? both - cross : 0;
            }
        }
        for (int c = 0; c < (pair ? 3 : 1); c++) {
            cue_mask_energy(&h->mask, power[c], energy);
            float *spread = c || f < 0 ? NULL : view->spread[f];
            cue_mask_thresholds(&h->mask, energy, h->mask.bands, spread ? h->mask.bands : count,
                                silent, threshold, spread);
            set_units(&h->mask, threshold, before[c], count, silent, unit[c]);
            if (!spread) continue;
            memcpy(view->energy[f], energy, sizeof energy);
            view->power[f] = 0;
            for (int k = 0; k < HOP; k++) view->power[f] += 2 * power[0][k];
        }
        if (f < 0) continue;
        memcpy(view->spectrum[f], y[0], sizeof view->spectrum[f]);
        memcpy(view->unit[f], unit[0], sizeof view->unit[f]);
        for (int k = 30; pair && k < p->last_bin; k++) {
            int at = h->layout.place[track->profile][k], slot = (k - FIRST_PILOT) / PILOT_BINS;
            if (at == MID || slot == h->layout.slots[f][0] || slot == h->layout.slots[f][1])
                continue;
            float sign = at == LEFT ? 1.0f : -1.0f;
            view->spectrum[f][k].re += sign * y[1][k].re;
            view->spectrum[f][k].im += sign * y[1][k].im;
            view->unit[f][k] = unit[at][k];
        }
    }
    project(view, cue_data_cells(&h->layout, track->profile), view->projection, view->alive);
    project(view, cue_pilot_cells(&h->layout), view->pilot, view->pilot_alive);
}

void cue_soft(const cue_hearing *h, const cue_view *view, int profile, float step, float *soft) {
    cue_cells cells = cue_data_cells(&h->layout, profile);
    float pace = 1 / step;
    for (int i = 0; i < FRAMES; i++)
        for (int g = 0; g < cells.groups; g++) {
            int at = i * cells.groups + g;
            float c = cosine(view->projection[at] * pace - cells.dither[g]);
            soft[at] = view->alive[at] ? c : 0;
        }
}

void cue_pilots_expected(const cue_hearing *h, int profile, float *expected) {
    memset(expected, 0, sizeof(float) * FRAMES * SLOTS);
    for (int f = 0; f < FRAMES; f++)
        for (int i = 0; i < 2; i++)
            expected[f * SLOTS + h->layout.slots[f][i]] = h->layout.pilots[profile][f][i];
}

float cue_pilot_score(const cue_hearing *h, const cue_view *view, int profile, float step) {
    float sum = 0;
    for (int f = 0; f < FRAMES; f++)
        for (int i = 0; i < 2; i++) {
            int slot = h->layout.slots[f][i], at = f * SLOTS + slot;
            if (view->pilot_alive[at])
                sum += h->layout.pilots[profile][f][i]
                       * cosine(view->pilot[at] / step - h->layout.pilot_dither[slot]);
        }
    return sum;
}

/* ---- Fits -------------------------------------------------------------------------------- */

/* Correlation of a view with expected soft values as a function of delay and drift. Terms are
 * weighed and scaled once: a cell's phase at delay d is the real part of a sum of terms turned by
 * d. Cells of which nothing is expected cost nothing. */
typedef struct score {
    cue_complex *terms; /* [cell][bin] of the cells that count, in order */
    const float *expected;
    const cue_view *view;
    cue_cells cells;
    float step, harmonic;
    double pivot;
} score;

static double angular(int k) { return PI / HOP * (k + 0.5); }

static score make_score(cue_hearing *h, const cue_view *view, cue_cells cells, float step,
                        const float *expected, int harmonic) {
    score s = {h->work.terms, expected, view, cells, step, (float)harmonic, 0};
    double seen = 0;
    for (int f = 0; f < FRAMES; f++)
        for (int g = 0; g < cells.groups; g++) {
            float weight = expected[f * cells.groups + g], sum = 0;
            bool alive = true;
            if (weight == 0) continue;
            for (int i = 0; i < cells.bins; i++) {
                int k = cells.first_bin + g * cells.bins + i;
                float unit = view->unit[f][k];
                float scale = unit > 0 ? cells.signs[g * cells.bins + i] * (float)harmonic
                                         / (unit * step * sqrtf((float)cells.bins)) : 0;
                alive = alive && unit > 0;
                cue_complex term = {view->spectrum[f][k].re * scale,
                                    view->spectrum[f][k].im * scale};
                s.terms[(f * cells.groups + g) * cells.bins + i] = term;
                sum += term.re;
            }
            if (!alive) {
                s.terms[(f * cells.groups + g) * cells.bins].re = NAN;
                continue;
            }
            float soft = fabsf(weight * cosine(sum / (float)harmonic - cells.dither[g]));
            seen += soft;
            s.pivot += (double)soft * f;
        }
    s.pivot /= seen > 1e-9 ? seen : 1e-9;
    return s;
}

/* Scores at `count` delays from `first` on, at one drift (relative). */
static void scores_at(const score *s, double first, double delay_step, int count, double drift,
                      double *out) {
    enum { MOST = 33 };
    int bins = s->cells.bins;
    float cs[BINS], zs[BINS], total[MOST] = {0};
    for (int k = 0; k < bins * s->cells.groups; k++) { /* from one delay to the next */
        cs[k] = (float)cue_cos(delay_step * angular(s->cells.first_bin + k));
        zs[k] = (float)cue_sin(delay_step * angular(s->cells.first_bin + k));
    }
    for (int f = 0; f < FRAMES; f++) {
        double late = first + drift * HOP * (f - s->pivot);
        double own = late * angular(s->cells.first_bin), next = late * PI / HOP;
        float c = (float)cue_cos(own), z = (float)cue_sin(own); /* of this bin at the first delay */
        float cn = (float)cue_cos(next), zn = (float)cue_sin(next);
        for (int g = 0; g < s->cells.groups; g++) {
            int at = f * s->cells.groups + g;
            const cue_complex *terms = s->terms + at * bins;
            float weight = s->expected[at], phase[MOST];
            bool counts = weight != 0 && !isnan(terms[0].re);
            for (int d = 0; counts && d < count; d++) phase[d] = -s->harmonic * s->cells.dither[g];
            for (int i = 0; i < bins; i++) {
                if (counts) {
                    float x = terms[i].re * c - terms[i].im * z;
                    float y = terms[i].re * z + terms[i].im * c;
                    for (int d = 0; d < count; d++) {
                        float turned = x * cs[g * bins + i] - y * zs[g * bins + i];
                        phase[d] += x;
                        y = x * zs[g * bins + i] + y * cs[g * bins + i];
                        x = turned;
                    }
                }
                float turned = c * cn - z * zn;
                z = c * zn + z * cn;
                c = turned;
            }
            for (int d = 0; counts && d < count; d++) total[d] += weight * cosine(phase[d]);
        }
    }
    for (int d = 0; d < count; d++) out[d] = total[d];
}

static double peak_of(const double *y, int stride, int i, int count) {
    if (i <= 0 || i >= count - 1) return i;
    double below = y[-stride], top = y[0], above = y[stride], bend = below - 2 * top + above;
    return bend >= 0 ? i : i + 0.5 * (below - above) / bend;
}

cue_fit cue_search_fit(cue_hearing *h, const cue_view *view, cue_cells cells, float step,
                       const float *expected, int delays, float delay_step, int drifts,
                       float drift_step, int harmonic) {
    double out[17][33] = {{0}};
    score s = make_score(h, view, cells, step, expected, harmonic);
    int best[2] = {0, 0};
    double first = -0.5 * (delays - 1) * delay_step, slowest = -0.5 * (drifts - 1) * drift_step;
    for (int r = 0; r < drifts; r++) {
        scores_at(&s, first, delay_step, delays, slowest + (double)drift_step * r, out[r]);
        for (int d = 0; d < delays; d++)
            if (out[r][d] > out[best[0]][best[1]]) {
                best[0] = r;
                best[1] = d;
            }
    }
    double *top = &out[best[0]][best[1]];
    cue_fit fit = {.score = *top};
    fit.delay = first + delay_step * peak_of(top, 1, best[1], delays);
    fit.drift = slowest + drift_step * peak_of(top, 33, best[0], drifts);
    fit.start_delay = fit.delay - fit.drift * HOP * s.pivot;
    return fit;
}

double cue_find_delay(cue_hearing *h, const cue_view *view, cue_cells cells, float step,
                      const float *expected, float reach) {
    enum { FARTHEST = 5, MIDDLE = FARTHEST + 1 };
    score s = make_score(h, view, cells, step, expected, 1);
    double out[2 * MIDDLE + 1];
    int low = MIDDLE - 1, high = MIDDLE + 1, at = MIDDLE;
    scores_at(&s, -(double)reach, reach, 3, 0, out + low);
    for (;;) {
        for (int i = low; i <= high; i++)
            if (out[i] > out[at]) at = i;
        if ((at != low && at != high) || high - low + 1 >= 2 * FARTHEST + 1) break;
        low--;
        high++;
        scores_at(&s, (low - MIDDLE) * (double)reach, reach, 1, 0, out + low);
        scores_at(&s, (high - MIDDLE) * (double)reach, reach, 1, 0, out + high);
    }
    return reach * (low - MIDDLE + peak_of(out + at, 1, at - low, high - low + 1));
}
