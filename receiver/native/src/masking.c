/* masking.c - how strong a mark each band of a frame hides, the same at both ends.
 *
 * In: powers of a frame's bins; out: powers per bin of the mark's unit before the growth limit.
 * Source: Schroeder, Atal and Hall, JASA 66, 1979. Specification: section 5 (W23 to W28).
 */

#include "hearing.h"

static double bark(double hz) {
    return 13 * atan(0.00076 * hz) + 3.5 * atan(hz / 7500 * (hz / 7500));
}

void cue_mask_init(cue_mask *mask) {
    int n = 0;
    mask->edge[0] = 0;
    while (mask->edge[n] < HOP) {
        int a = mask->edge[n], b = a;
        while (b < HOP && bark(50.0 * b) < bark(50.0 * a) + 0.5) b++;
        b = b > a + 5 ? b : a + 5;
        mask->edge[++n] = (uint16_t)(b < HOP ? b : HOP);
    }
    mask->bands = n;
    for (int j = 0; j < n; j++) {
        double centre = bark(25.0 * (mask->edge[j] + mask->edge[j + 1])), sum = 0, gain[BANDS];
        for (int i = 0; i < n; i++) {
            double x = centre - bark(25.0 * (mask->edge[i] + mask->edge[i + 1])) + 0.474;
            gain[i] = (double)cue_power10((float)(0.1 * (15.81 + 7.5 * x - 17.5 * sqrt(1 + x * x))));
            sum += gain[i];
        }
        double offset = (double)cue_power10((float)(-0.1 * (centre / 4 > 3 ? centre / 4 : 3)));
        for (int i = 0; i < n; i++) mask->matrix[j][i] = (float)(gain[i] / sum * offset);
    }
}

void cue_mask_energy(const cue_mask *mask, const float *power, float *energy) {
    for (int j = 0; j < mask->bands; j++) {
        float sum = 0;
        for (int k = mask->edge[j]; k < mask->edge[j + 1]; k++) sum += power[k];
        energy[j] = sum / (float)(mask->edge[j + 1] - mask->edge[j]);
    }
}

void cue_mask_thresholds(const cue_mask *mask, const float *energy, int used, int count,
                         float silent, float *threshold, float *spread) {
    const float cap = 0.25118864f; /* 10^-0.6 */
    for (int j = 0; j < count; j++) {
        float sum = 0;
        for (int i = 0; i < used; i++) sum += mask->matrix[j][i] * energy[i];
        if (spread) spread[j] = sum;
        float limit = cap * energy[j];
        if (energy[j] < silent) {
            threshold[j] = 0;
            continue;
        }
        float least = sum < limit ? sum : limit;
        float pressed = 1e-8f * exp2f(0.7f * log2f(least * 1e8f));
        threshold[j] = pressed < limit ? pressed : limit;
    }
}
