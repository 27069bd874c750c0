/* chain.c
 * In: keys, what tags cover, the checks of a block. Out: earlier keys, tags, whether checks agree.
 * Source: Perrig and others 2000 (delayed keys); Kogan and others 2017 (a function for each step);
 * Reed and Solomon 1960 with a Cauchy matrix.
 * Specification: spec/authentication.md, sections 2 to 4 (E6, E10 to E14, E21). */
#include "proofs.h"

#include <string.h>

const cue_proof_layout cue_proof_layouts[2] = {{2, 96, 10, 59}, {9, 16, 6, 7}};

static void put_number(uint8_t *at, uint32_t value, int bytes) {
    while (bytes-- > 0) *at++ = (uint8_t)(value >> 8 * bytes);
}

void cue_chain_of(cue_chain *chain, const uint8_t channel[8], int64_t period, int width) {
    uint8_t text[27];
    memcpy(text, "cuecast-step-3", 14);
    memcpy(text + 14, channel, 8);
    put_number(text + 22, (uint32_t)period, 4);
    text[26] = (uint8_t)width;
    cue_sha256(text, sizeof text, chain->prefix);
}

void cue_chain_before(const cue_chain *chain, uint8_t key[KEY_BYTES], int64_t place, int64_t steps)
{
    uint8_t text[44], digest[32];
    memcpy(text, chain->prefix, 32);
    for (; steps > 0; steps--, place--) {
        put_number(text + 32, (uint32_t)place, 4);
        memcpy(text + 36, key, KEY_BYTES);
        cue_sha256(text, sizeof text, digest);
        memcpy(key, digest, KEY_BYTES);
    }
}

/* What is hashed for a tag; the key's hidden bytes are at 27. */
static size_t tag_text(uint8_t *text, const uint8_t channel[8], const uint8_t key[KEY_BYTES],
                       int distance, const uint8_t *covered, size_t bytes) {
    memcpy(text, "cuecast-tag-3", 13);
    memcpy(text + 13, channel, 8);
    memcpy(text + 21, key, KEY_BYTES);
    put_number(text + 29, (uint32_t)distance, 2);
    memcpy(text + 31, covered, bytes);
    return 31 + bytes;
}

static uint32_t tag_in(const uint8_t *digest) {
    return (uint32_t)digest[0] << 16 | (uint32_t)digest[1] << 8 | digest[2];
}

uint32_t cue_tag(const uint8_t channel[8], const uint8_t key[KEY_BYTES], int distance,
                 const uint8_t *covered, size_t bytes) {
    uint8_t text[31 + COVERED], digest[32];
    cue_sha256(text, tag_text(text, channel, key, distance, covered, bytes), digest);
    return tag_in(digest);
}

uint32_t cue_tag_search(const uint8_t channel[8], uint8_t key[KEY_BYTES], uint32_t from,
                        int distance, const uint8_t *covered, size_t bytes, uint32_t tag) {
    uint8_t text[31 + COVERED], digest[32];
    size_t count = tag_text(text, channel, key, distance, covered, bytes);
    for (; from < 65536; from++) {
        put_number(text + 27, from, 2);
        cue_sha256(text, count, digest);
        if (tag_in(digest) != tag) continue;
        put_number(key + 6, from, 2);
        return from;
    }
    return from;
}

/* ---- Checks (E13, E14, E21) ---------------------------------------------------------------- */

static uint32_t times(uint32_t a, uint32_t b) {
    uint32_t product = 0;
    for (; b; b >>= 1) {
        if (b & 1U) product ^= a;
        a = a << 1 ^ (a & 0x800U ? 0x1053U : 0U);
    }
    return product;
}

static uint32_t inverse(uint32_t a) {
    uint32_t result = 1;
    for (int bit = 11; bit >= 0; bit--) { /* the power 4094 */
        result = times(result, result);
        if (bit) result = times(result, a);
    }
    return result;
}

int cue_parities_agree(const cue_parities *found, const cue_proof_layout *layout, int spare) {
    uint32_t row[MOST_CHECKS][MOST_CHECKS + 1];
    int number[MOST_CHECKS], rows = 0, lost = 0;
    for (int j = 0; j < layout->checks; j++)
        if (found->check[j] >= 0) number[rows++] = j;
    for (int place = 0; place < layout->block; place++) lost += found->missing[place] ? 2 : 0;
    if (rows < lost + spare) return -1;
    for (int r = 0; r < rows; r++) row[r][lost] = (uint32_t)found->check[number[r]];
    int column = 0;
    for (int s = 0; s < 2 * layout->block; s++) {
        int32_t tag = found->tag[s / 2];
        if (found->missing[s / 2]) {
            for (int r = 0; r < rows; r++) row[r][column] = inverse((uint32_t)(number[r] ^ (16 + s)));
            column++;
        } else if (tag >= 0) {
            uint32_t half = (uint32_t)(s % 2 ? tag & 0xFFF : tag >> 12);
            for (int r = 0; r < rows; r++)
                row[r][lost] ^= times(half, inverse((uint32_t)(number[r] ^ (16 + s))));
        }
    }
    for (int c = 0; c < lost; c++) /* each square part of the matrix has an inverse */
        for (int r = c + 1; r < rows; r++) {
            uint32_t factor = times(row[r][c], inverse(row[c][c]));
            for (int k = c; k <= lost; k++) row[r][k] ^= times(factor, row[c][k]);
        }
    for (int r = lost; r < rows; r++)
        if (row[r][lost]) return 0;
    return 1;
}
