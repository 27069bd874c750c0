/* link.c - two classes of bytes from the ratios of a superframe's coded bits.
 *
 * In: one log-likelihood ratio per data cell in the interleaver's order; out: bytes whose check
 * holds, and the signs of their coded bits. A path must also be significant (W35): the correlation
 * of its codeword is compared with what noise reaches.
 * Specification: spec/audio-carrier.md, section 6 (W29 to W35).
 */
#include <string.h>

#include "hearing.h"

static int mother_size(int coded) {
    int size = 1;
    while (2 * size <= coded) size *= 2;
    return size;
}

static int coded_bits(const cue_profile *p, int layer) {
    return layer ? cue_coded(p) - p->l0_coded : p->l0_coded;
}

static int message_bits(const cue_profile *p, int layer) {
    return layer ? 8 * p->l1_bytes + 16 : 8 * p->l0_bytes + 24;
}

/* W32: the inputs of largest weight. */
void cue_link_init(cue_link *link, uint64_t *scratch) {
    static const double root[] = {1, 1.189207115002721, 1.4142135623730951, 1.681792830507429};
    memset(link, 0, sizeof *link);
    for (int n = 0; n < PROFILES; n++)
        for (int layer = 0; layer < (cue_profiles[n].l1_bytes ? 2 : 1); layer++) {
            int size = mother_size(coded_bits(&cue_profiles[n], layer));
            double *weight = (double *)scratch, low = 0, high = 1e3;
            for (int i = 0; i < size; i++) {
                weight[i] = 0;
                for (int j = 0; i >> j; j++)
                    if (i >> j & 1) weight[i] += root[j % 4] * (1 << j / 4);
            }
            for (int round = 0; round < 60; round++) { /* no two weights are equal */
                double middle = (low + high) / 2;
                int above = 0;
                for (int i = 0; i < size; i++) above += weight[i] >= middle;
                if (above >= message_bits(&cue_profiles[n], layer)) low = middle;
                else high = middle;
            }
            for (int i = 0; i < size; i++)
                if (weight[i] >= low) link->free_bits[n][layer][i / 32] |= 1u << i % 32;
        }
}

/* Register of W30 over some bits. */
static uint32_t crc_of(const uint8_t *bits, int count, int width) {
    uint32_t polynomial = width == 24 ? 0x864CFB : 0x1021, mask = (1u << width) - 1, r = mask;
    for (int i = 0; i < count; i++) {
        uint32_t top = (r >> (width - 1) & 1) ^ bits[i];
        r = (r << 1 & mask) ^ (top ? polynomial : 0);
    }
    return r;
}

static bool passes(const uint8_t *message, int count, int width) {
    uint32_t check = crc_of(message, count - width, width);
    for (int i = 0; i < width; i++)
        if ((check >> (width - 1 - i) & 1) != message[count - width + i]) return false;
    return true;
}

bool cue_link_decode(const cue_link *link, int profile, int layer, const float *ratios, int most,
                     cue_polar_work *w, uint8_t *bytes, int8_t *coded) {
    const cue_profile *p = &cue_profiles[profile];
    const uint32_t *free_bits = link->free_bits[profile][layer];
    int length = coded_bits(p, layer), size = mother_size(length), count = message_bits(p, layer);
    int width = layer ? 16 : 24, asked = PATHS;
    float least = 0.97f, energy = 0;
    uint8_t order[PATHS];
    if (most > PATH_CELLS / size) most = PATH_CELLS / size;
    if (most > PATHS) most = PATHS;
    if (layer && count > 200) { /* a long second class: fewer paths, and better ones (W35) */
        asked = 16;
        least = 1.0f;
    }
    memset(w->folded, 0, sizeof(float) * (size_t)size);
    for (int i = 0; i < length; i++) {
        w->folded[i & (size - 1)] += ratios[i];
        energy += ratios[i] * ratios[i];
    }
    if (energy <= 0) return false;
    int paths = cue_polar_paths(free_bits, size, most, w, order);
    for (int q = 0; q < paths && q < asked; q++) {
        int path = order[q];
        for (int i = count - 1; i >= 0; i--) {
            w->message[i] = w->trace_bit[i][path];
            path = w->trace_path[i][path];
        }
        if (!passes(w->message, count, width)) continue;
        for (int i = 0, k = 0; i < size; i++)
            w->coded[i] = free_bits[i / 32] >> (i % 32) & 1 ? w->message[k++] : 0;
        cue_polar_transform(w->coded, size);
        float agreement = 0;
        for (int i = 0; i < size; i++) agreement += w->coded[i] ? -w->folded[i] : w->folded[i];
        if (3 * count <= length && agreement < least * sqrtf(1.3862944f * (float)count * energy))
            continue;
        for (int i = 0; i < (count - width) / 8; i++) {
            bytes[i] = 0;
            for (int b = 0; b < 8; b++) bytes[i] = (uint8_t)(bytes[i] << 1 | w->message[8 * i + b]);
        }
        for (int i = 0; i < length; i++) coded[i] = w->coded[i & (size - 1)] ? -1 : 1;
        return true;
    }
    return false;
}
