/* lips.c
 * In: the face as decoded, the phones around it. Out: a face whose lips show what the phones demand.
 * Source: visemes and their rivals as the lip reader meets them; least change of the markers.
 * Specification: spec/bitstream.md, section 5.1 (K1 to K5). */
#include "payload.h"

#include <math.h>
#include <string.h>

/* UL0 UL1_R UL1_L UL2_R UL2_L LC_R LC_L LL0 LL1_R LL1_L LL2_R LL2_L (voice.md, section 5) */
enum { UL0 = 12, LL0 = 19, LIPS_FIRST = 12, LIPS_END = 24 };

/* K2: how far two faces are from each other, mm. */
static double apart(const cue_model *m, const double face[N_FACE], const float viseme[N_FACE]) {
    double sum = 0.0;
    for (int i = LIPS_FIRST; i < LIPS_END; i++) {
        double square = 0.0;
        for (int k = 0; k < 3; k++) {
            double d = 0.0;
            for (int j = 0; j < N_FACE; j++)
                d += (face[j] - (double)viseme[j]) * (double)m->face_directions[j][i][k];
            square += d * d;
        }
        sum += sqrt(square);
    }
    return sum / (LIPS_END - LIPS_FIRST);
}

static void features_of(const cue_model *m, const double face[N_FACE], double out[2]) {
    for (int e = 0; e < 2; e++) {
        out[e] = m->still[e];
        for (int j = 0; j < N_FACE; j++) out[e] += face[j] * m->features[j][e];
    }
}

/* K5: tolerances of the phones that insist; 0 for the others. */
static int insists(unsigned phone, double tolerance[2]) {
    static const uint8_t closed[3] = {17, 25, 28}, teeth[2] = {30, 21}; /* p b m, f v */
    for (int i = 0; i < 3; i++)
        if (phone == closed[i]) {
            tolerance[0] = 0.1;
            tolerance[1] = 0.3;
            return 1;
        }
    tolerance[0] = tolerance[1] = 0.4;
    return phone == teeth[0] || phone == teeth[1];
}

void cue_lips_prepare(const cue_tables *t, cue_model *m) {
    double square[N_FACE * N_FACE], easy[N_FACE * 2];
    for (int e = 0; e < 2; e++) {
        m->still[e] = (double)m->face_mean[UL0][1 + e] - (double)m->face_mean[LL0][1 + e];
        for (int j = 0; j < N_FACE; j++) {
            m->features[j][e] = (double)m->face_directions[j][UL0][1 + e] -
                                (double)m->face_directions[j][LL0][1 + e];
            easy[2 * j + e] = m->features[j][e];
        }
    }
    for (int i = 0; i < N_FACE; i++)
        for (int j = 0; j < N_FACE; j++) {
            double sum = i == j ? 0.001 : 0.0;
            for (int q = 0; q < FACE_MARKERS; q++)
                for (int k = 0; k < 3; k++)
                    sum += (double)m->face_directions[i][q][k] * (double)m->face_directions[j][q][k];
            square[i * N_FACE + j] = sum;
        }
    memset(m->lips, 0, sizeof m->lips);
    if (cue_solve(square, easy, N_FACE, 2)) {
        double small[4] = {0}, unit[4] = {1, 0, 0, 1};
        for (int e = 0; e < 2; e++)
            for (int f = 0; f < 2; f++)
                for (int j = 0; j < N_FACE; j++)
                    small[2 * e + f] += m->features[j][e] * easy[2 * j + f];
        if (cue_solve(small, unit, 2, 2))
            for (int j = 0; j < N_FACE; j++)
                for (int f = 0; f < 2; f++)
                    m->lips[j][f] = easy[2 * j] * unit[f] + easy[2 * j + 1] * unit[2 + f];
    }
    for (unsigned n = 0; n < PHONES; n++) { /* K3 */
        double nearest = INFINITY, own[N_FACE];
        for (int j = 0; j < N_FACE; j++) own[j] = (double)m->visemes[n][j];
        for (unsigned other = 1; n && other < PHONES; other++) {
            if (other == n || cue_is_vowel(other) != cue_is_vowel(n)) continue;
            if (cue_is_vowel(n) ? t->placement[n] != t->placement[other]
                                : t->shape[n] != t->shape[other])
                continue;
            double far = apart(m, own, m->visemes[other]);
            if (far > 0.7 && far < nearest) nearest = far;
        }
        m->near[n] = fmin(0.4 * nearest, 2.0);
    }
}

/* K1 */
static double weight(const cue_sound *s, double time) {
    double h = 0.5 * (s->end - s->start), core = fmax(0.4 * h, fmin(1.0, h));
    double x = fabs(time - 0.5 * ((double)s->start + (double)s->end));
    if (x >= core + 2.5) return 0.0;
    return x <= core ? 1.0 : 0.5 + 0.5 * cue_cos(3.14159265358979323846 * (x - core) / 2.5);
}

void cue_lips(const cue_sound *sounds, int count, const cue_model *m, int32_t first, cue_block *block)
{
    for (int t = 0; t < TICKS; t++) {
        double *face = block->value[t], moved[N_FACE] = {0}, total = 0.0;
        double have[2], off[2] = {0, 0};
        for (int pass = 0; pass < 2; pass++) {
            features_of(m, face, have);
            for (int i = 0; i < count; i++) {
                const cue_sound *s = &sounds[i];
                if (!s->number || s->open_start || s->open_end || s->stands) continue;
                double w = weight(s, first + t), tolerance[2];
                const float *viseme = m->visemes[s->number];
                if (w <= 0.0) continue;
                if (pass == 0) { /* K4 */
                    double far = apart(m, face, viseme);
                    double part = w * fmax(1.0 - m->near[s->number] / fmax(far, 1e-9), 0.0);
                    total += w;
                    for (int j = 0; j < N_FACE; j++)
                        moved[j] += part * ((double)viseme[j] - face[j]);
                } else if (insists(s->number, tolerance)) { /* K5 */
                    double own[N_FACE], wanted[2];
                    for (int j = 0; j < N_FACE; j++) own[j] = (double)viseme[j];
                    features_of(m, own, wanted);
                    for (int e = 0; e < 2; e++) {
                        double d = have[e] - wanted[e];
                        off[e] -= w * (d - fmax(-tolerance[e], fmin(d, tolerance[e])));
                    }
                }
            }
            if (pass == 0)
                for (int j = 0; j < N_FACE; j++) face[j] += moved[j] / fmax(total, 1.0);
        }
        for (int j = 0; j < N_FACE; j++)
            face[j] += (m->lips[j][0] * off[0] + m->lips[j][1] * off[1]) / fmax(total, 1.0);
    }
}
