/* mdct.c - modulated complex lapped transform of frames of 960 samples.
 *
 * In: samples; out: 480 complex bins whose real part is the MDCT. One real Fourier transform; the
 * sine window is the difference of two turns of it. Sources: Malvar, "A modulated complex lapped
 * transform and its applications to audio processing", ICASSP 1999; mixed radices as in Cooley and
 * Tukey 1965. Specification: W8.
 */

#include "hearing.h"

/* By the nearest whole turn and a power series. */
double cue_cos(double angle) {
    double turns = angle / (2 * PI), x = 2 * PI * (turns - floor(turns + 0.5)), term = 1, sum = 1;
    for (int n = 1; n < 13; n++) sum += term *= -x * x / ((2 * n - 1) * (2 * n));
    return sum;
}

static cue_complex mul(cue_complex a, cue_complex b) {
    return (cue_complex){a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re};
}

static cue_complex polar_form(double size, double angle) {
    return (cue_complex){(float)(size * cue_cos(angle)), (float)(size * cue_sin(angle))};
}

void cue_mdct_init(cue_mdct *m) {
    for (int k = 0; k < HOP; k++) {
        double angle = -PI * (0.5 + HOP / 2) * (k + 0.5) / HOP - PI / 2; /* the last: 1 / j */
        double size = sqrt(2.0 / HOP) / 2, half = PI / (4.0 * HOP);
        m->turn[k] = polar_form(1, -2 * PI * k / HOP);
        m->own[k] = polar_form(size, angle + half);
        m->next[k] = polar_form(-size, angle - half);
    }
    for (int k = 0; k <= HOP / 2; k++) m->half[k] = polar_form(1, -PI * k / HOP);
}

/* Transform n = HOP / stride values that lie `stride` apart. */
static void transform(const cue_mdct *m, const cue_complex *in, cue_complex *out, int n,
                      int stride) {
    int radix = n % 5 == 0 ? 5 : n % 3 == 0 ? 3 : n % 4 == 0 ? 4 : 2, part = n / radix;
    for (int q = 0; q < radix; q++) {
        if (part == 1) out[q] = in[q * stride];
        else transform(m, in + q * stride, out + q * part, part, stride * radix);
    }
    for (int k = 0; k < part; k++) {
        cue_complex x[5];
        x[0] = out[k];
        for (int q = 1; q < radix; q++) x[q] = mul(out[q * part + k], m->turn[q * k * stride]);
        if (radix == 4) {
            cue_complex a = {x[0].re + x[2].re, x[0].im + x[2].im};
            cue_complex b = {x[0].re - x[2].re, x[0].im - x[2].im};
            cue_complex c = {x[1].re + x[3].re, x[1].im + x[3].im};
            cue_complex d = {x[1].re - x[3].re, x[1].im - x[3].im};
            out[k] = (cue_complex){a.re + c.re, a.im + c.im};
            out[k + part] = (cue_complex){b.re + d.im, b.im - d.re};
            out[k + 2 * part] = (cue_complex){a.re - c.re, a.im - c.im};
            out[k + 3 * part] = (cue_complex){b.re - d.im, b.im + d.re};
            continue;
        }
        for (int p = 0; p < radix; p++) {
            cue_complex sum = x[0];
            for (int q = 1; q < radix; q++) {
                cue_complex y = mul(x[q], m->turn[p * q % radix * (HOP / radix)]);
                sum.re += y.re;
                sum.im += y.im;
            }
            out[k + p * part] = sum;
        }
    }
}

void cue_mdct_run(const cue_mdct *m, const float *x, cue_complex *spectrum) {
    cue_complex in[HOP], z[HOP], next, whole[HOP + 1];
    for (int n = 0; n < HOP; n++) in[n] = (cue_complex){x[2 * n], x[2 * n + 1]};
    transform(m, in, z, HOP, 1);
    whole[0] = (cue_complex){z[0].re + z[0].im, 0};
    whole[HOP] = (cue_complex){z[0].re - z[0].im, 0};
    for (int k = 1; k <= HOP / 2; k++) { /* of even and of odd samples */
        cue_complex a = z[k], b = z[HOP - k];
        cue_complex even = {(a.re + b.re) / 2, (a.im - b.im) / 2};
        cue_complex odd = mul((cue_complex){(a.im + b.im) / 2, (b.re - a.re) / 2}, m->half[k]);
        whole[k] = (cue_complex){even.re + odd.re, even.im + odd.im};
        whole[HOP - k] = (cue_complex){even.re - odd.re, odd.im - even.im};
    }
    for (int k = 0; k < HOP; k++) {
        spectrum[k] = mul(whole[k], m->own[k]);
        next = mul(whole[k + 1], m->next[k]);
        spectrum[k].re += next.re;
        spectrum[k].im += next.im;
    }
}
