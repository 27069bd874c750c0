/* voice.c
 * In: a file of `cuecast voice export`. Out: tables of the format, bases, the model of a voice.
 * Source: byte planes as in HDF5's shuffle filter, so that a general compressor does well.
 * Specification: spec/voice.md (O2), spec/bitstream.md (G5, S11, table 4, T1).
 *
 * All numbers stand with their lowest byte first.
 *   0  8  CUEVOICE           8  2  layout, 1         10  2  F: parameters of the head
 *  12  2  H: of the forearm 14  2  A: angles         16  8  identity of the coding (I1)
 *  24  8  identity of the voice (O3)                 32  4  bytes of the file     36  4  0
 *  40     arrays as byte planes: the lowest byte of all numbers, then the next one of all, ..
 *         tables: first next left length opening pause usual key gap held alone magnitude inset,
 *         16 bits; language: shape and placement by phone, those of absent phones, 8 bits;
 *         table 4 in its order; arrays of O2 without those that only senders use: 32 bits IEEE 754,
 *         but hand.regression, 24 bits: whole numbers of 2^-12 mm, 2 n, or -2 n - 1 if negative
 *  -32 32 SHA-256 of all bytes before */
#include "payload.h"

#include <math.h>
#include <string.h>

typedef struct reader {
    const uint8_t *data;
    size_t at, end;
    int broken;
} reader;

static uint32_t planes(const reader *r, size_t count, size_t i, size_t width) {
    uint32_t value = 0;
    for (size_t plane = 0; plane < width; plane++)
        value |= (uint32_t)r->data[r->at + plane * count + i] << 8 * plane;
    return value;
}

static int has(reader *r, size_t bytes) {
    if (bytes > r->end - r->at) r->broken = 1;
    return !r->broken;
}

static void read_u16(reader *r, uint16_t *out, size_t count) {
    if (!has(r, 2 * count)) return;
    for (size_t i = 0; i < count; i++) out[i] = (uint16_t)planes(r, count, i, 2);
    r->at += 2 * count;
}

/* Rows of `n` numbers into rows of `stride`; a number that is not finite breaks the file. */
static void read_f32(reader *r, float *out, size_t rows, size_t n, size_t stride) {
    size_t count = rows * n;
    if (!has(r, 4 * count)) return;
    for (size_t i = 0; i < count; i++) {
        uint32_t bits = planes(r, count, i, 4);
        float value;
        memcpy(&value, &bits, sizeof value);
        if (!(fabsf(value) <= 1e6F)) r->broken = 1;
        out[i / n * stride + i % n] = r->broken ? 0 : value;
    }
    r->at += 4 * count;
}

/* Rows of frequencies must each have the sum 32768 (G5). */
static void read_rows(reader *r, uint16_t *out, size_t rows, size_t n) {
    read_u16(r, out, rows * n);
    for (size_t row = 0; row < rows && !r->broken; row++) {
        uint32_t sum = 0;
        for (size_t i = 0; i < n; i++) sum += out[row * n + i];
        if (sum != 32768) r->broken = 1;
    }
}

static void read_tables(reader *r, cue_tables *t) {
    uint16_t inset[75];
    read_rows(r, t->first, 1, PHONES);
    read_rows(r, t->next[0][0], 39 * PHONES, PHONES);
    read_rows(r, t->left[0], PHONES, 33);
    read_rows(r, t->length[0][0], PHONES * 4, 33);
    read_rows(r, t->opening, 1, PHONES);
    read_rows(r, t->pause, 1, 17);
    read_u16(r, t->usual, PHONES);
    read_rows(r, t->key[0], 42, 42);
    read_rows(r, t->gap[0], 42, 17);
    read_rows(r, t->held, 1, 33);
    read_rows(r, t->alone, 1, 41);
    read_rows(r, t->magnitude[0][0], 100, 16);
    read_u16(r, inset, 75);
    if (!has(r, 2 * PHONES + 2)) return;
    for (int i = 0; i < 75; i++) t->inset[i / 3][i % 3] = (int16_t)inset[i];
    memcpy(t->shape, r->data + r->at, PHONES);
    memcpy(t->placement, r->data + r->at + PHONES, PHONES);
    t->shape_alone = r->data[r->at + 2 * PHONES];
    t->placement_alone = r->data[r->at + 2 * PHONES + 1];
    r->at += 2 * PHONES + 2;
    for (int n = 1; n < PHONES; n++)
        if ((cue_is_vowel((unsigned)n) ? t->placement[n] >= PLACEMENTS : t->shape[n] >= SHAPES) ||
            t->usual[n] > 2047)
            r->broken = 1;
    if (t->shape_alone >= SHAPES || t->placement_alone >= PLACEMENTS) r->broken = 1;
}

static void read_basis(reader *r, int b, cue_bases *bases, cue_model *m) {
    float matrix[MOST_P][MOST_P];
    uint16_t scales[MOST_P * TICKS];
    double square[MOST_P * MOST_P], unit[MOST_P * MOST_P];
    size_t n = (size_t)m->n;
    memset(matrix, 0, sizeof matrix);
    memset(scales, 0, sizeof scales);
    read_f32(r, matrix[0], n, n, MOST_P);
    read_u16(r, scales, n * TICKS);
    for (size_t i = 0; i < n * TICKS; i++) {
        int16_t scale = (int16_t)scales[i];
        if (scale < -400 || scale > 80) r->broken = 1; /* values stay below 2^62 */
        bases->scales[b][i / TICKS][i % TICKS] = r->broken ? 0 : scale;
    }
    if (r->broken) return;
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < n; j++) {
            square[i * n + j] = (double)matrix[i][j];
            unit[i * n + j] = i == j;
        }
    /* Parameters are channels times the inverse. */
    if (!cue_solve(square, unit, m->n, m->n)) r->broken = 1;
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < n; j++) m->inverse[b][i][j] = unit[i * n + j];
}

static void read_coding(reader *r, cue_bases *bases, cue_model *m) {
    size_t head = (size_t)m->n_head, arm = (size_t)m->n_forearm;
    float constants[CONSTANTS] = {0};
    read_f32(r, m->hand[0], KEY_NUMBERS, N_HAND, N_HAND);
    read_f32(r, m->head[0], KEY_NUMBERS, head, MOST_GROUP);
    read_f32(r, m->forearm[0], KEY_NUMBERS, arm, MOST_GROUP);
    read_f32(r, m->arc, 1, arm, MOST_GROUP);
    read_f32(r, m->face[0], PHONES, N_FACE, N_FACE);
    read_f32(r, m->places[0], KEY_NUMBERS, 3, 3);
    read_f32(r, m->late, 1, N_HAND + head + arm, N_HAND + 2 * MOST_GROUP);
    read_f32(r, constants, 1, CONSTANTS, CONSTANTS);
    for (int i = 0; i < CONSTANTS; i++) {
        m->constants[i] = nearbyint((double)constants[i] * 1e6) / 1e6;
        if (fabs(m->constants[i]) > 100.0) r->broken = 1;
    }
    if (!(m->constants[FASTEST] > 0.0 && m->constants[NATURAL] > 0.0 && m->constants[POWER] > 0.0))
        r->broken = 1;
    bases->channels = m->n;
    for (int b = 0; b < BASES && !r->broken; b++) read_basis(r, b, bases, m);
    read_f32(r, m->mean, 1, (size_t)m->n, MOST_P);
}

static void read_voice(reader *r, cue_model *m) {
    size_t a = (size_t)m->n_angles, rows = 1 + 2 * a, count = rows * HAND_MARKERS * 3;
    read_f32(r, m->face_mean[0], FACE_MARKERS, 3, 3);
    read_f32(r, m->face_directions[0][0], N_FACE, FACE_MARKERS * 3, FACE_MARKERS * 3);
    read_f32(r, m->face_pivot, 1, 3, 3);
    read_f32(r, m->face_motion_mean, 1, 6, 6);
    read_f32(r, m->face_motion[0], (size_t)m->n_head, 6, 6);
    read_f32(r, m->face_weights[0], FACE_MARKERS, 6, 6);
    read_f32(r, m->angle_mean, 1, a, MOST_ANGLES);
    read_f32(r, m->angle_directions[0], N_HAND, a, MOST_ANGLES);
    if (!has(r, 3 * count)) return;
    for (size_t i = 0; i < count; i++) {
        uint32_t packed = planes(r, count, i, 3);
        int32_t whole = packed & 1U ? -(int32_t)(packed >> 1) - 1 : (int32_t)(packed >> 1);
        m->regression[i / (HAND_MARKERS * 3)][i / 3 % HAND_MARKERS][i % 3] = (float)whole / 4096.0F;
    }
    r->at += 3 * count;
    read_f32(r, m->hand_pivot, 1, 3, 3);
    read_f32(r, m->hand_motion_mean, 1, 6, 6);
    read_f32(r, m->hand_motion[0], (size_t)m->n_forearm, 6, 6);
    read_f32(r, m->visemes[0], PHONES, N_FACE, N_FACE);
}

size_t cue_model_load(const uint8_t *file, size_t bytes, cue_tables *tables, cue_bases *bases,
                      cue_model *model) {
    uint8_t digest[32];
    reader r = {file, 0, bytes, 0};
    model->loaded = 0;
    if (bytes < 72 || memcmp(file, "CUEVOICE", 8) != 0) return 1;
    if (file[8] != 1 || file[9] != 0) return 9;
    model->n_head = file[10] | file[11] << 8;
    model->n_forearm = file[12] | file[13] << 8;
    model->n_angles = file[14] | file[15] << 8;
    model->n = N_FACE + N_HAND + model->n_head + model->n_forearm;
    if (model->n > MOST_P || model->n_head < 1 || model->n_head > MOST_GROUP ||
        model->n_forearm < 1 || model->n_forearm > MOST_GROUP || model->n_angles > MOST_ANGLES)
        return 11;
    size_t total = (size_t)file[32] | (size_t)file[33] << 8 | (size_t)file[34] << 16 |
                   (size_t)file[35] << 24;
    if (total != bytes) return 33;
    cue_sha256(file, bytes - 32, digest);
    if (memcmp(digest, file + bytes - 32, 32) != 0) return bytes - 31;
    memcpy(model->coding, file + 16, 8);
    memcpy(model->voice, file + 24, 8);
    bases->identity = (uint16_t)(file[16] << 8 | file[17]);
    r.at = 40;
    r.end = bytes - 32;
    read_tables(&r, tables);
    read_coding(&r, bases, model);
    read_voice(&r, model);
    if (r.broken || r.at != r.end) return r.at + 1;
    cue_bases_order(bases);
    cue_lips_prepare(tables, model);
    model->loaded = 1;
    return 0;
}
