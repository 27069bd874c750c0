/* score.c
 * In: a range decoder that stands before a score, previews or a window. Out: phones and their
 * times in ticks of the superframe, keys of later superframes.
 * Source: context modelling after Cleary and Witten 1984; the tables are data of the format.
 * Specification: spec/bitstream.md, sections 3 (S1 to S10), 3.1 (M1 to M7), 3.2 (V1, V2). */
#include "payload.h"

#include <string.h>

static const uint16_t NINE[9] = {3648, 3640, 3640, 3640, 3640, 3640, 3640, 3640, 3640};
static const uint16_t SIX[6] = {5463, 5461, 5461, 5461, 5461, 5461};
static const uint16_t REPLACED[2] = {28672, 4096};

unsigned cue_tempo(int ticks) {
    return ticks == 0 ? 0 : ticks <= 3 ? 1 : ticks <= 5 ? 2 : 3; /* S6 */
}

static void read_options(cue_range *r, cue_score *out) {
    for (int i = 0; i < 3; i++) out->cheek[i] = (uint8_t)cue_range_bits(r, 1);
    out->rest_gap = (uint8_t)cue_range_bits(r, 2);
}

static void put(cue_score *out, unsigned number, int start) {
    out->number[out->count] = (uint8_t)number;
    out->start[out->count++] = (int16_t)start;
}

unsigned cue_replacement_read(cue_range *r) {
    if (!cue_range_symbol(r, REPLACED, 2, 2)) return 0;
    unsigned shape = cue_range_symbol(r, NINE, 9, 9);
    return 1 + PLACEMENTS * shape + cue_range_symbol(r, SIX, 6, 6);
}

/* S9, S10: options, and for each key whether another one is shown. */
static void read_special(cue_range *r, cue_score *out) {
    read_options(r, out);
    unsigned before = out->first;
    for (int i = 0; i < out->count; before = out->number[i++]) {
        unsigned number = out->number[i];
        if (number == 0 || (cue_is_vowel(number) && cue_is_consonant(before))) continue;
        out->replaced[out->start[i]] = (uint8_t)cue_replacement_read(r);
    }
}

void cue_score_read(cue_range *r, const cue_tables *t, cue_score *out) {
    static const uint16_t timing[2] = {32640, 128}, special[2] = {32512, 256};
    int even = (int)cue_range_symbol(r, timing, 2, 2);
    int is_special = (int)cue_range_symbol(r, special, 2, 2);
    out->kind = 1;
    out->rest_gap = 1;
    out->first = (uint8_t)cue_phone_of(cue_range_symbol(r, t->first, PHONES, PHONES));
    unsigned earlier = 38, before = out->first;
    if (even) { /* S8 */
        int n = (int)cue_range_bits(r, 5) + 1;
        for (int i = 0; i < n; i++) {
            unsigned letter = cue_range_symbol(r, t->next[earlier][before], PHONES, PHONES);
            earlier = before;
            before = cue_phone_of(letter);
            put(out, before, 32 * i / n);
        }
    } else { /* S4 to S6 */
        int tick = (int)cue_range_symbol(r, t->left[out->first], 33, 32), length = 0;
        out->first_end = (int16_t)tick;
        while (tick < TICKS) {
            unsigned letter = cue_range_symbol(r, t->next[earlier][before], PHONES, PHONES);
            earlier = before;
            before = cue_phone_of(letter);
            length = 1 + (int)cue_range_symbol(r, t->length[before][cue_tempo(length)], 33,
                                               (unsigned)(31 - tick));
            put(out, before, tick);
            tick += length;
            if (before == 0) length = 0;
        }
    }
    if (cue_is_consonant(before)) { /* S7 */
        unsigned letter = cue_range_symbol(r, t->next[earlier][before], PHONES, VOWELS);
        out->ahead = (uint8_t)(letter < VOWELS ? letter + 1 : 0);
    }
    if (is_special) read_special(r, out);
}

unsigned cue_previews_read(cue_range *r, const cue_tables *t, cue_preview out[4]) {
    static const uint16_t which[5] = {12288, 1024, 1024, 4096, 14336}; /* V1 */
    static const uint8_t sets[5] = {0, 1, 2, 3, 7};
    unsigned set = sets[cue_range_symbol(r, which, 5, 5)];
    for (unsigned d = 0; d < 3; d++) {
        if (!(set >> d & 1U)) continue;
        unsigned last = 41;
        for (int cell = -1; cell < 15;) { /* V2 */
            int gap = (int)cue_range_symbol(r, t->gap[last], 17, (unsigned)(15 - cell));
            if (gap == 15 - cell) break;
            cell += 1 + gap;
            unsigned tick = 2U * (unsigned)cell + (d == 0 ? cue_range_bits(r, 1) : 1U);
            last = cue_range_symbol(r, t->key[last], 42, 42);
            if (last > 40) last = 40;
            out[d].tick[out[d].count] = (uint8_t)tick;
            out[d].symbol[out[d].count++] = (uint8_t)last;
        }
    }
    return set;
}

static void read_labels(cue_range *r, const cue_tables *t, cue_preview *out) {
    static const uint16_t after_rest[9] = {2560, 2560, 2560, 2048, 2048, 2048, 1536, 1536, 15872};
    static const uint16_t after_key[9] = {3072, 6656, 7168, 5632, 3584, 2560, 1536, 1024, 1536};
    unsigned last = 41;
    for (int cell = -1; cell < 7;) { /* V7 */
        int gap = (int)cue_range_symbol(r, last < 40 ? after_key : after_rest, 9,
                                        (unsigned)(7 - cell));
        if (gap == 7 - cell) break;
        cell += 1 + gap;
        last = cue_range_symbol(r, t->key[last], 42, 42);
        if (last > 40) last = 40;
        out->tick[out->count] = (uint8_t)(4 * cell + 2);
        out->symbol[out->count++] = (uint8_t)last;
    }
}

unsigned cue_labels_read(cue_range *r, const cue_tables *t, cue_preview *own, cue_preview out[4]) {
    static const uint16_t which[5] = {1024, 20480, 4096, 1024, 6144}; /* V6 */
    static const uint8_t sets[5] = {0, 1, 8, 9, 3};
    unsigned set = sets[cue_range_symbol(r, which, 5, 5)];
    read_labels(r, t, own);
    for (unsigned d = 0; d < 2; d++)
        if (set >> d & 1U && !(d && set & 8U)) read_labels(r, t, &out[d]);
    if (set & 8U) read_labels(r, t, &out[3]);
    return set;
}

void cue_window_read(cue_range *r, const cue_tables *t, cue_score *out, int special) {
    static const uint16_t timings[2] = {8192, 24576};
    static const uint16_t begins[16] = {1536, 2048, 2560, 3072, 3584, 3584, 3072, 2560,
                                        2048, 2048, 1536, 1536, 1024, 1024, 1024, 512};
    static const uint16_t pace_row[8] = {2048, 7168, 8192, 6144, 4096, 2560, 1536, 1024};
    static const uint16_t correction_row[8] = {22528, 2560, 2048, 1536, 1536, 512, 1024, 1024};
    static const int paces[8] = {3, 4, 5, 6, 7, 8, 10, 13};
    static const int corrections[8] = {0, -2, 2, -4, 4, -7, 7, 12};
    out->kind = 2;
    out->rest_gap = 1;
    if (special) read_options(r, out);
    unsigned timing = cue_range_symbol(r, timings, 2, 2); /* M3 */
    int tick = 8 * (int)cue_range_symbol(r, begins, 16, 16) - 16; /* M4 */
    tick += timing ? 4 * (int)cue_range_bits(r, 1) : 2 * (int)cue_range_bits(r, 2);
    int pace = timing ? paces[cue_range_symbol(r, pace_row, 8, 8)] : 0, spoken = 0;
    out->first_end = (int16_t)tick;
    out->end = (int16_t)tick;
    unsigned earlier = 38, before = 38;
    int goes_on = 1;
    while (tick <= 110 && goes_on && out->count < MOST_WINDOW) { /* M5 */
        const uint16_t *row = out->count ? t->next[earlier][before] : t->opening;
        unsigned number = cue_phone_of(cue_range_symbol(r, row, PHONES, PHONES));
        int length;
        if (!r->determined) break;
        if (out->count == 0 && number == 0) { /* M7 */
            length = timing ? 4 : 2;
        } else if (number && timing) { /* M6 */
            length = (t->usual[number] * pace + 64) >> 7;
            if (cue_is_vowel(number)) {
                unsigned symbol = cue_range_symbol(r, correction_row, 8, 8);
                goes_on = r->determined;
                length += goes_on ? corrections[symbol] : 0;
            }
            if (length < 1) length = 1;
        } else {
            unsigned limit = timing ? 15 : 31, n = timing ? 17 : 33;
            row = timing ? t->pause : t->length[number][cue_tempo(spoken)];
            unsigned symbol = cue_range_symbol(r, row, n, limit);
            if (!r->determined || (number == 0 && symbol == limit)) break;
            length = (int)((timing ? 2U : 1U) * (symbol + 1U));
        }
        put(out, number, tick);
        tick += length;
        if (number) out->end = (int16_t)tick;
        spoken = number ? length : 0;
        earlier = before;
        before = number;
    }
    while (out->count && out->number[out->count - 1] == 0) out->count--;
    if (out->count == 0) out->end = out->first_end;
}
