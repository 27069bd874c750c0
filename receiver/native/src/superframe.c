/* superframe.c
 * In: L0 and L1 of one superframe, tables, scales of the bases. Out: header, setting, score,
 * previews, coefficients; or the paragraph that the bytes break.
 * Source: the checks are cyclic codes after Peterson and Brown 1961.
 * Specification: spec/bitstream.md, section 2 (H1 to H12), 3.1 (M1, M2), 8.1 (F7). */
#include "payload.h"

#include <string.h>

static const uint16_t BASIS[2][4] = {{16384, 8192, 4096, 4096}, {1024, 1024, 15360, 15360}};
static const uint16_t LEVEL[7] = {14336, 5120, 5120, 3072, 2560, 1536, 1024};
static const uint16_t COURSE[4] = {24576, 4096, 2048, 2048};
static const uint16_t SHIFT[5] = {20480, 4096, 4096, 2048, 2048};
static const uint16_t USE[3] = {16384, 8192, 8192};
static const uint16_t FILMED_STEP[8] = {512, 1024, 4096, 21504, 4096, 512, 512, 512}; /* H13 */
static const uint16_t FILMED_USE[3] = {12288, 18432, 2048};
static const uint16_t FILMED_BASIS[4] = {1024, 1024, 3072, 27648};
static const uint16_t SHARE[3] = {12288, 4096, 16384};

const char *cue_rule_name(cue_rule rule) {
    static const char NAMES[][4] = {"",   "H1", "H2", "H6", "M2",  "F1",  "F2",  "F3",
                                    "F4", "F5", "F6", "F7", "F10", "E15", "E16", "E18"};
    return NAMES[rule];
}

unsigned cue_check_of(const uint8_t *data, size_t bytes, unsigned width, unsigned polynomial,
                 unsigned preset) {
    unsigned crc = preset, top = 1U << (width - 1U), mask = (top << 1) - 1U;
    for (size_t i = 0; i < bytes; i++) {
        crc ^= (unsigned)data[i] << (width - 8U);
        for (int bit = 0; bit < 8; bit++)
            crc = (crc & top ? crc << 1 ^ polynomial : crc << 1) & mask;
    }
    return crc;
}

/* H8, H13 and F7: how a superframe codes what its prediction lacks. */
static void read_setting(cue_range *r, cue_content *out) {
    unsigned coarse = out->filmed ? cue_range_symbol(r, FILMED_STEP, 8, 8) : 0;
    out->step = (uint8_t)(8 * coarse + cue_range_bits(r, out->filmed ? 3 : 6));
    if (out->step == 63) return; /* H10 */
    unsigned use = out->mode == 0 ? cue_range_symbol(r, out->filmed ? FILMED_USE : USE, 3, 3) : 1;
    const uint16_t *bases = out->filmed ? FILMED_BASIS : BASIS[use == 1];
    out->basis = (uint8_t)cue_range_symbol(r, bases, 4, 4);
    out->level = (uint8_t)cue_range_symbol(r, LEVEL, 7, 7);
    if (use == 1) {
        if (out->mode == 0) memset(out->shares, 2, sizeof out->shares);
        return;
    }
    out->course = (uint8_t)cue_range_symbol(r, COURSE, 4, 4);
    out->shift = (uint8_t)cue_range_symbol(r, SHIFT, 5, 5);
    for (int part = 0; use == 2 && part < 4; part++)
        out->shares[part] = (uint8_t)cue_range_symbol(r, SHARE, 3, 3);
}

static void begin(cue_content *out, const cue_bases *bases, cue_coefficients *found) {
    memset(out, 0, sizeof *out);
    out->step = 63;
    found->count = bases->channels * TICKS;
    memset(found->index, 0, sizeof found->index);
    memset(found->value, 0, sizeof found->value);
}

static cue_rule read_compact(const uint8_t *l0, size_t n0, const cue_tables *tables,
                             const cue_bases *bases, cue_content *out) {
    if (n0 < 4 || n0 > 12) return RULE_H1;
    out->mode = 2;
    out->sequence = l0[0] & 15;
    out->is_signed = l0[0] >> 4 & 1;
    out->lead = 2; /* H11 */
    unsigned has = l0[n0 - 1] >> 2 * out->is_signed & 3U;
    if (has != (bases->identity >> (14 - 2 * (out->sequence % 8)) & 3U)) return RULE_M2;
    if (l0[0] >> 6) return RULE_H2;
    out->proof = out->is_signed ? l0[n0 - 1] & 3U : 0;
    cue_range r;
    cue_range_begin(&r, l0 + 1, n0 - 1, 2U + 2U * out->is_signed);
    static const uint16_t rare[2] = {32512, 256};
    if (cue_range_symbol(&r, rare, 2, 2)) {
        out->slow_count = 1;
        out->slow[0] = (uint16_t)cue_range_bits(&r, 16);
    }
    int special = (int)cue_range_symbol(&r, rare, 2, 2);
    cue_window_read(&r, tables, &out->score, special);
    return RULE_NONE;
}

/* H7: whether L1 belongs to this L0, whose check counts as with a proof of 0. */
static int fits(const uint8_t *l0, size_t n0, int is_signed, const uint8_t *l1, size_t n1,
                unsigned mask) {
    unsigned check = (unsigned)l0[n0 - 2] << 8 | l0[n0 - 1];
    if (is_signed) {
        /* The proof is the last nine bits before the check: as 0, from the bytes before it on. */
        uint8_t last[2] = {l0[n0 - 4] & 0xFE, 0};
        check = cue_check_of(l0, n0 - 4, 16, 0x1021, 0xFFFF);
        check = cue_check_of(last, 2, 16, 0x1021, check) ^ mask;
    }
    uint8_t bound[2] = {(uint8_t)(check >> 8), (uint8_t)(check & 255)};
    unsigned crc = cue_check_of(bound, 2, 8, 0x2F, 0xFF);
    return (cue_check_of(l1, n1 - 1, 8, 0x2F, crc) ^ 0xFF) == l1[n1 - 1];
}

cue_rule cue_superframe_read(const uint8_t *l0, size_t n0, const uint8_t *l1, size_t n1,
                             const cue_tables *tables, const cue_bases *bases, cue_content *out,
                             cue_coefficients *found) {
    begin(out, bases, found);
    if (n0 > 0 && l0[0] & 0x20) return read_compact(l0, n0, tables, bases, out); /* H3 */
    if (n0 < 5) return RULE_H1;
    out->mode = l0[0] >> 4 & 3;
    out->sequence = (uint8_t)((l0[0] & 15) << 2 | l0[1] >> 6);
    out->lead = l0[1] >> 4 & 3;
    out->is_signed = l0[1] >> 3 & 1;
    if (out->is_signed && n0 < 7) return RULE_H1;
    unsigned check = (unsigned)l0[n0 - 2] << 8 | l0[n0 - 1];
    if ((cue_check_of(l0, n0 - 2, 16, 0x1021, 0xFFFF) ^ bases->identity) != check) return RULE_H6;
    if (l0[0] >> 6) return RULE_H2;
    if (out->is_signed) out->proof = (uint16_t)(((l0[n0 - 4] & 1) << 8) | l0[n0 - 3]); /* H12 */
    cue_range r;
    cue_range_begin(&r, l0 + 2, n0 - 4, 9U * out->is_signed);
    out->slow_count = l0[1] >> 1 & 3;
    out->filmed = l0[1] & 1;
    for (int i = 0; i < out->slow_count; i++) out->slow[i] = (uint16_t)cue_range_bits(&r, 16);
    read_setting(&r, out);
    if (out->mode == 0 && out->filmed) {
        out->previews = (uint8_t)cue_labels_read(&r, tables, &out->own, out->preview);
        cue_stand_in(&out->own, &out->score); /* V8 */
    } else if (out->mode == 0) {
        cue_score_read(&r, tables, &out->score);
        out->previews = (uint8_t)cue_previews_read(&r, tables, out->preview);
    }
    if (out->step == 63) return RULE_NONE;
    int known = cue_coefficients_read(&r, tables, bases, out, 0, found);
    if (n1 > 0 && fits(l0, n0, out->is_signed, l1, n1, bases->identity)) {
        out->has_l1 = 1; /* H9 */
        cue_range_begin(&r, l1, n1 - 1, 0);
        cue_coefficients_read(&r, tables, bases, out, known, found);
    }
    cue_coefficients_value(tables, bases, out, found);
    return RULE_NONE;
}

void cue_record_read(const uint8_t *data, size_t bytes, unsigned mode, const cue_tables *tables,
                     const cue_bases *bases, cue_content *out, cue_coefficients *found) {
    cue_range r;
    begin(out, bases, found);
    out->mode = (uint8_t)mode;
    cue_range_begin(&r, data, bytes, 0);
    read_setting(&r, out);
    if (out->step == 63) return;
    cue_coefficients_read(&r, tables, bases, out, 0, found);
    cue_coefficients_value(tables, bases, out, found);
}
