/* layout.c - seeded layout of a superframe: signs, dither, pilots, interleaver, places of stereo.
 *
 * In: the key; out: cue_layout. Everything pseudorandom is drawn from SHAKE-256 (FIPS 202).
 * Specification: spec/audio-carrier.md, sections 4, 8 and 10 (W10 to W20, W39, W43).
 */
#include <string.h>

#include "hearing.h"

/* W39: payload bytes, L, first, last, tier, q of W43, coded bits of L0, strength. */
const cue_profile cue_profiles[PROFILES] = {
    {7, 0, 4, 2, 102, 1, 4, 1344, 1.75f},   /* robust */
    {20, 7, 4, 6, 158, 0, 4, 1536, 1.0f},   /* standard */
    {20, 36, 2, 6, 238, 0, 8, 2816, 0.75f}, /* high */
    {12, 0, 4, 2, 134, 0, 4, 1856, 1.0f},   /* discreet */
};

float cue_step(const cue_profile *p, float level) {
    return p->strength * exp2f(1.5f + level / 4);
}

float cue_pilot_step(const cue_profile *p, float tier) {
    return exp2f(1.875f + (float)p->lowest_tier + tier);
}

/* ---- SHAKE-256 -------------------------------------------------------------------------- */

typedef struct { uint64_t lane[25]; int at; } shake;

static uint64_t rotate(uint64_t x, unsigned n) { return n ? x << n | x >> (64 - n) : x; }

static void keccak(uint64_t a[25]) {
    uint8_t feedback = 1;
    for (int round = 0; round < 24; round++) {
        uint64_t c[5], b[25];
        for (int x = 0; x < 5; x++) c[x] = a[x] ^ a[x + 5] ^ a[x + 10] ^ a[x + 15] ^ a[x + 20];
        for (int i = 0; i < 25; i++) a[i] ^= c[(i + 4) % 5] ^ rotate(c[(i + 1) % 5], 1);
        int x = 1, y = 0; /* rho and pi: lane (x, y) goes to (y, 2 x + 3 y) */
        b[0] = a[0];
        for (unsigned t = 0; t < 24; t++) {
            int to = (2 * x + 3 * y) % 5;
            b[y + 5 * to] = rotate(a[x + 5 * y], (t + 1) * (t + 2) / 2 % 64);
            x = y;
            y = to;
        }
        for (int i = 0; i < 25; i++)
            a[i] = b[i] ^ (~b[i / 5 * 5 + (i + 1) % 5] & b[i / 5 * 5 + (i + 2) % 5]);
        for (unsigned j = 0; j < 7; j++) { /* iota by the register of FIPS 202, section 3.2.5 */
            if (feedback & 1) a[0] ^= (uint64_t)1 << ((1u << j) - 1);
            feedback = (uint8_t)(feedback << 1 ^ (feedback >> 7 ? 0x71 : 0));
        }
    }
}

/* Stream of W10. Purpose and number, e.g. "data 1 signs", make a text of less than 136 bytes. */
static void open_stream(shake *s, const char *purpose, int number, const char *rest, uint64_t key) {
    char text[96], digits[24];
    size_t n = 0, d = 0;
    const char *parts[] = {"cuecast audio 1/", purpose};
    for (int i = 0; i < 2; i++)
        for (const char *c = parts[i]; *c; c++) text[n++] = *c;
    if (number >= 0) text[n++] = (char)('0' + number);
    for (const char *c = rest; *c; c++) text[n++] = *c;
    text[n++] = '/';
    do digits[d++] = (char)('0' + key % 10);
    while (key /= 10);
    while (d) text[n++] = digits[--d];
    memset(s, 0, sizeof *s);
    for (size_t i = 0; i < n; i++) s->lane[i / 8] |= (uint64_t)(uint8_t)text[i] << 8 * (i % 8);
    s->lane[n / 8] ^= (uint64_t)0x1f << 8 * (n % 8);
    s->lane[16] ^= (uint64_t)0x80 << 56;
    s->at = 34;
}

static uint32_t next_word(shake *s) {
    if (s->at == 34) {
        keccak(s->lane);
        s->at = 0;
    }
    uint32_t word = (uint32_t)(s->lane[s->at / 2] >> 32 * (s->at & 1));
    s->at++;
    return word;
}

static float sign_of(uint32_t word) { return word & 1 ? -1.0f : 1.0f; }

/* Sort n keys upwards: Shell's method with Ciura's gaps, no further memory. */
static void sort_words(uint64_t *x, int n) {
    static const int gaps[] = {3937, 1750, 701, 301, 132, 57, 23, 10, 4, 1};
    for (size_t g = 0; g < sizeof gaps / sizeof *gaps; g++)
        for (int i = gaps[g]; i < n; i++) {
            uint64_t own = x[i];
            int j = i;
            for (; j >= gaps[g] && x[j - gaps[g]] > own; j -= gaps[g]) x[j] = x[j - gaps[g]];
            x[j] = own;
        }
}

void cue_layout_init(cue_layout *layout, uint64_t key, uint64_t *scratch) {
    shake s;
    open_stream(&s, "pilot slots", -1, "", key);
    for (int f = 0; f < FRAMES; f++) {
        for (unsigned i = 0; i < SLOTS; i++) scratch[i] = (uint64_t)next_word(&s) << 16 | i;
        sort_words(scratch, SLOTS);
        for (int i = 0; i < 2; i++) layout->slots[f][i] = (uint8_t)(scratch[i] & 7);
    }
    open_stream(&s, "pilot signs", -1, "", key);
    for (int i = 0; i < SLOTS * PILOT_BINS; i++) layout->pilot_signs[i] = sign_of(next_word(&s));
    open_stream(&s, "pilot dither", -1, "", key);
    for (int i = 0; i < SLOTS; i++) layout->pilot_dither[i] = (float)(next_word(&s) / 4294967296.0);
    for (int n = 0; n < PROFILES; n++) {
        const cue_profile *p = &cue_profiles[n];
        int groups = cue_groups(p), low = (FIRST_PILOT - p->first_bin) / p->cell_bins;
        int per_slot = PILOT_BINS / p->cell_bins, usable = 0;
        open_stream(&s, "pilot bits", -1, "", key);
        for (int f = 0; f < FRAMES; f++) layout->pilots[n][f][0] = (int8_t)sign_of(next_word(&s));
        open_stream(&s, "announcement ", n, "", key);
        for (int f = 0; f < FRAMES; f++) layout->pilots[n][f][1] = (int8_t)sign_of(next_word(&s));
        open_stream(&s, "data ", n, " signs", key);
        for (int i = 0; i < groups * p->cell_bins; i++) layout->signs[n][i] = sign_of(next_word(&s));
        open_stream(&s, "data ", n, " dither", key);
        for (int i = 0; i < groups; i++)
            layout->dither[n][i] = (float)(next_word(&s) / 4294967296.0);
        open_stream(&s, "data ", n, " interleaver", key);
        for (int f = 0; f < FRAMES; f++)
            for (int g = 0; g < groups; g++) {
                int slot = g < low ? -1 : (g - low) / per_slot;
                if (slot == layout->slots[f][0] || slot == layout->slots[f][1]) continue;
                scratch[usable++] = (uint64_t)next_word(&s) << 16 | (unsigned)(f * groups + g);
            }
        sort_words(scratch, usable);
        for (int i = 0; i < usable; i++) layout->order[n][i] = (uint16_t)(scratch[i] & 0xffff);
        for (int k = 0; k < BINS; k++) {
            int turn = k < 30 ? -1 : (k - 30) / 4 % p->side_period;
            layout->place[n][k] = (uint8_t)(k >= p->last_bin ? MID
                                            : turn == 0 ? LEFT
                                            : turn == p->side_period / 2 ? RIGHT : MID);
        }
    }
}

cue_cells cue_data_cells(const cue_layout *layout, int profile) {
    const cue_profile *p = &cue_profiles[profile];
    return (cue_cells){p->first_bin, p->cell_bins, cue_groups(p), layout->signs[profile],
                       layout->dither[profile]};
}

cue_cells cue_pilot_cells(const cue_layout *layout) {
    return (cue_cells){FIRST_PILOT, PILOT_BINS, SLOTS, layout->pilot_signs, layout->pilot_dither};
}
