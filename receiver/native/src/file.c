/* file.c
 * In: a stream file in memory. Out: its superframes, one after the other, in the slots of the
 * timeline. A line of any length is read along with them: strokes and phones that are over go.
 * Source: recursive least squares with a ridge for what is learnt (F13).
 * Specification: spec/bitstream.md, section 8 (F1 to F13). */
#include "payload.h"

#include <math.h>
#include <string.h>

enum {
    HEAD = 26,             /* bytes of the head */
    MOST_TICKS = 4320000,  /* F5 */
    AHEAD = 256,           /* ticks of the line that are known beyond a superframe */
    HEARD = 64,            /* ticks after which a phone has no say any more (P7: 22.5) */
    FAR = 1 << 28          /* no length and no time of a line is greater */
};

static uint32_t number_at(const uint8_t *at, int bytes) {
    uint32_t value = 0;
    for (int i = 0; i < bytes; i++) value = value << 8 | at[i];
    return value;
}

static uint32_t crc32_of(const uint8_t *data, size_t bytes) {
    uint32_t crc = UINT32_MAX;
    for (size_t i = 0; i < bytes; i++) {
        crc ^= data[i];
        for (int bit = 0; bit < 8; bit++) crc = crc >> 1 ^ (crc & 1U ? 0xEDB88320U : 0U);
    }
    return ~crc;
}

/* F7: the record at `*at`, before `end`; -1 if there is none whole. */
static int32_t record_at(const uint8_t *file, size_t end, size_t *at) {
    if (*at >= end) return -1;
    uint32_t length = file[(*at)++];
    if (length == 255) {
        if (end - *at < 3) return -1;
        length = number_at(file + *at, 3);
        *at += 3;
    }
    if (length > end - *at) return -1;
    *at += length;
    return (int32_t)length;
}

/* ---- The line (F8 to F12) ------------------------------------------------------------------ */

/* F9 */
static int32_t length_of(cue_range *r, const uint16_t *row) {
    int32_t ticks = 0;
    for (;;) {
        unsigned symbol = cue_range_symbol(r, row, 33, 32);
        if (symbol < 32) return ticks + (int32_t)symbol + 1;
        if (ticks < FAR) ticks += 32;
    }
}

/* F12 */
static int32_t silence_of(cue_range *r, int32_t left) {
    static const uint16_t row[16] = {2978, 744, 744,  744, 1489, 2978, 5967, 5957,
                                     4468, 2234, 1489, 744, 744,  744,  372,  372}; /* table 6 */
    unsigned width = cue_range_symbol(r, row, 16, 16);
    return width ? (int32_t)(1U << (width - 1) | cue_range_bits(r, width - 1)) : left;
}

/* F11: one of some phones by their weights; `phones` has `n` of them, the table its rest first. */
static unsigned phone_of(cue_range *r, const uint8_t *phones, const uint8_t *weights, unsigned n) {
    uint16_t row[MOST_SCORE];
    unsigned sum = 0, given = 0, best = 0;
    for (unsigned i = 0; i < n; i++) {
        sum += weights[i];
        if (weights[i] > weights[best]) best = i;
    }
    for (unsigned i = 0; i < n; i++) {
        row[i] = (uint16_t)(32768U * weights[i] / sum);
        given += row[i];
    }
    row[best] = (uint16_t)(row[best] + 32768U - given);
    return phones[cue_range_symbol(r, row, n, n)];
}

/* F11: consonant and vowel of a key of this symbol, 0 for none. */
static void key_phones(cue_range *r, const cue_tables *t, const cue_file *f, unsigned symbol,
                       unsigned *consonant, unsigned *vowel) {
    static const uint8_t usual[8] = {18, 20, 24, 26, 29, 31, 35, 36}; /* d k ʁ n t l g j */
    uint8_t phones[MOST_SCORE], weights[MOST_SCORE];
    unsigned shape = 1 + symbol / 5, place = 1 + symbol % 5, n = 0;
    for (unsigned phone = VOWELS + 1; phone < PHONES; phone++) {
        if (t->shape[phone] != shape) continue;
        weights[n] = memchr(usual, (int)phone, sizeof usual) ? 10 : 1;
        phones[n++] = (uint8_t)phone;
    }
    if (shape == t->shape_alone) weights[n] = 10, phones[n++] = 0;
    *consonant = n ? phone_of(r, phones, weights, n) : 0;
    n = 0;
    for (unsigned phone = 1; phone <= VOWELS; phone++) {
        const cue_cue alone = {.phones = {(uint8_t)phone, 0}};
        if (cue_key_number(&alone, f->cheek, t) % PLACEMENTS != place) continue;
        weights[n] = 1;
        phones[n++] = (uint8_t)phone;
    }
    if (place == t->placement_alone) weights[n] = 1, phones[n++] = 0;
    *vowel = n ? phone_of(r, phones, weights, n) : 0;
}

static void put(cue_file *f, cue_line *line, unsigned number, int32_t ticks) {
    int32_t end = ticks < FAR - f->tick ? f->tick + ticks : FAR;
    f->before = (uint8_t)number;
    if (number && line && line->sounds < MOST_LINE)
        line->sound[line->sounds++] = (cue_sound){f->tick, end, (uint8_t)number, 0, 0, 0};
    f->tick = end;
}

/* Read one phone or key further, into a line if there is one; F10: 0 if its code ended before. */
static int read_on(cue_file *f, cue_range *r, const cue_tables *t, cue_line *line) {
    int32_t end = TICKS * f->stop;
    unsigned symbol = f->keyed ? cue_range_symbol(r, t->alone, 41, 41)
                               : cue_range_symbol(r, t->next[f->earlier][f->before], PHONES, PHONES);
    if (r->position > r->bytes + 8) return 0;
    if (!f->keyed) {
        unsigned number = cue_phone_of(symbol);
        f->earlier = f->before;
        if (number || f->tick < end) {
            int32_t ticks = length_of(r, t->length[number][cue_tempo(f->spoken)]);
            f->spoken = number ? ticks : 0;
            put(f, line, number, ticks);
        } else {
            put(f, line, 0, 0);
        }
    } else if (symbol == 40) {
        put(f, line, 0, f->tick < end ? silence_of(r, end - f->tick) : 0);
    } else {
        static const uint16_t rare[2] = {31744, 1024};
        unsigned consonant, vowel;
        key_phones(r, t, f, symbol, &consonant, &vowel);
        int32_t ticks = length_of(r, t->held);
        if (consonant && vowel) {
            int32_t part = ticks < 17 ? (4 * ticks + 5) / 10 : 7;
            if (cue_range_symbol(r, rare, 2, 2)) part = (int32_t)cue_range_bits(r, 5) + 1;
            if (part < 1) part = 1;
            put(f, line, consonant, part);
            ticks = ticks - part > 1 ? ticks - part : 1;
        }
        put(f, line, vowel ? vowel : consonant ? consonant : 17, ticks);
    }
    f->ended = f->tick >= end && f->before == 0;
    return 1;
}

/* Stand before the first phone of the line. */
static void begin_line(cue_file *f, const uint8_t *file, const cue_tables *t) {
    static const uint16_t special[2] = {32512, 256};
    cue_range *r = &f->line;
    cue_range_begin(r, file + f->line_at, f->line_bytes, 0);
    f->keyed = (uint8_t)cue_range_bits(r, 1);
    f->special = (uint8_t)cue_range_symbol(r, special, 2, 2);
    f->rest_gap = 1;
    memset(f->cheek, 0, sizeof f->cheek);
    for (int i = 0; f->special && i < 3; i++) f->cheek[i] = (uint8_t)cue_range_bits(r, 1);
    if (f->special) f->rest_gap = (uint8_t)cue_range_bits(r, 2);
    f->learns = (uint8_t)cue_range_bits(r, 1);
    f->tick = TICKS * f->start - 33;
    f->spoken = 0;
    f->earlier = 38;
    if (f->keyed) {
        int32_t ticks = silence_of(r, TICKS * f->stop - f->tick);
        put(f, 0, 0, ticks > 1 ? ticks : 1);
    } else {
        put(f, 0, 0, length_of(r, t->length[0][0]));
    }
    f->ended = f->tick >= TICKS * f->stop;
}

/* ---- Opening (F1 to F10) ------------------------------------------------------------------- */

static cue_rule check(cue_file *f, const uint8_t *file, size_t bytes, const cue_tables *t) {
    if (bytes < HEAD) return RULE_F1;
    if (memcmp(file, "CUES", 4) != 0) return RULE_F2;
    if (file[4] != 4) return RULE_F3;
    if (cue_check_of(file, HEAD - 2, 16, 0x1021, 0xFFFF) != number_at(file + HEAD - 2, 2))
        return RULE_F4;
    uint32_t first = number_at(file + 13, 4), ticks = number_at(file + 17, 4);
    if (first > MOST_TICKS || ticks < 1 || ticks > MOST_TICKS) return RULE_F5;
    f->first_tick = (int32_t)first;
    f->end_tick = (int32_t)(first + ticks);
    f->start = f->next = f->first_tick / TICKS;
    f->stop = (f->end_tick + TICKS - 1) / TICKS;
    f->n0 = (uint16_t)(number_at(file + 21, 3) >> 12);
    f->n1 = (uint16_t)(number_at(file + 21, 3) & 4095);
    f->at = HEAD;
    f->bytes = bytes;
    size_t count = (size_t)(f->stop - f->start), at = HEAD;
    if (f->n0) return bytes == HEAD + count * ((size_t)f->n0 + f->n1) ? RULE_NONE : RULE_F6;
    if (bytes < HEAD + 4 || crc32_of(file, bytes - 4) != number_at(file + bytes - 4, 4))
        return RULE_F7;
    for (size_t i = 0; i <= count; i++) {
        int32_t length = record_at(file, bytes - 4, &at);
        if (length < 0) return RULE_F6;
        if (i) continue;
        f->line_bytes = (size_t)length;
        f->line_at = at - f->line_bytes;
        f->at = at;
    }
    if (at != bytes - 4) return RULE_F6;
    if (f->line_bytes == 0) return RULE_NONE;
    begin_line(f, file, t);
    while (!f->ended)
        if (!read_on(f, &f->line, t, 0)) return RULE_F10;
    f->replaced = f->line;
    begin_line(f, file, t);
    return RULE_NONE;
}

/* No pointer stays in the state. */
static void let_go(cue_file *f) {
    f->line.data = f->replaced.data = 0;
}

cue_rule cue_payload_file(cue_payload *p, const uint8_t *file, size_t bytes) {
    cue_file *f = &p->file;
    (void)cue_payload_reset(p);
    cue_rule rule = check(f, file, bytes, &p->tables);
    let_go(f);
    f->opened = rule == RULE_NONE;
    p->work.line.sounds = p->work.line.cues = 0;
    cue_strokes_begin(&p->work.strokes);
    for (int i = 0; i < SHAPES; i++) f->hand.square[i][i] = 25.0; /* F13 */
    for (int i = 0; i < KINDS - SHAPES; i++) f->arm.square[i][i] = 25.0;
    if (f->opened) {
        p->from_s = 0.02 * f->first_tick;
        p->until_s = 0.02 * f->end_tick;
    }
    return rule;
}

/* ---- Superframes --------------------------------------------------------------------------- */

/* J4, S9: the keys of what was read of the line since, and their strokes. */
static void chart(cue_payload *p) {
    cue_file *f = &p->file;
    cue_line *line = &p->work.line;
    int count = line->sounds - f->charted, keys = line->cues;
    if (!f->ended && count && cue_is_consonant(line->sound[line->sounds - 1].number)) count--;
    line->cues += cue_chart(line->sound + f->charted, count, line->cue + keys, MOST_CUES - keys);
    f->charted += count;
    for (cue_cue *cue = line->cue + keys; cue < line->cue + line->cues; cue++) {
        cue->number = cue_key_number(cue, f->cheek, &p->tables);
        unsigned key = f->special && !f->keyed ? cue_replacement_read(&f->replaced) : 0;
        if (key) cue->number = (uint8_t)(key - 1);
        cue_strokes_key(&p->work.strokes, f->keys ? &f->key : 0, cue, 0, f->rest_gap, &p->model);
        f->key = *cue;
        f->keys = 1;
    }
    if (f->ended && f->keys == 1) {
        cue_strokes_end(&p->work.strokes, &f->key, &p->model);
        f->keys = 2;
    }
}

/* Let go of what is over before a superframe. */
static void forget(cue_payload *p, int32_t first) {
    cue_file *f = &p->file;
    cue_line *line = &p->work.line;
    int over = 0;
    while (over < f->charted && line->sound[over].end < first - HEARD) over++;
    f->charted -= over;
    line->sounds -= over;
    memmove(line->sound, line->sound + over, (size_t)line->sounds * sizeof line->sound[0]);
    cue_strokes_drop(&p->work.strokes, &p->model, first);
}

/* Keys and phones that start before `end`; phones from `first` on, so that each comes once. */
static void report(cue_payload *p, cue_slot *s, int32_t first, int32_t end) {
    cue_line *line = &p->work.line;
    int done = 0;
    for (; done < line->cues && line->cue[done].start < end; done++)
        cue_key_show(s, &line->cue[done], 0, 1);
    line->cues -= done;
    memmove(line->cue, line->cue + done, (size_t)line->cues * sizeof line->cue[0]);
    for (int i = 0; i < line->sounds; i++)
        if (line->sound[i].start >= first && line->sound[i].start < end)
            cue_phone_show(s, &line->sound[i]);
}

/* F13: add the corrections so far, or learn from what a prediction lacked. */
static void correct(const cue_payload *p, const cue_learner *l, int kinds, int kind, int column,
                    int width, cue_block *out) {
    for (int t = 0; t < TICKS; t++)
        for (int k = 0; k < width; k++)
            for (int i = 0; i < kinds; i++)
                out->value[t][column + k] += p->other_block.value[t][kind + i] * l->table[i][k];
}

static void learn(cue_learner *l, const cue_block *weights, const cue_block *lacked, int kinds,
                  int kind, int column, int width) {
    double square[KINDS * KINDS];
    for (int t = 0; t < TICKS; t++) {
        const double *w = &weights->value[t][kind], *g = &lacked->value[t][column];
        for (int i = 0; i < kinds; i++) {
            for (int j = 0; j < kinds; j++) l->square[i][j] += w[i] * w[j];
            for (int k = 0; k < width; k++) l->right[i][k] += w[i] * g[k];
        }
    }
    for (int i = 0; i < kinds; i++)
        for (int j = 0; j < kinds; j++) square[i * kinds + j] = l->square[i][j];
    memcpy(l->table, l->right, sizeof l->table);
    /* The columns of the right side lie MOST_GROUP apart. */
    (void)cue_solve(square, l->table[0], kinds, MOST_GROUP);
}

static void draw(cue_payload *p, const uint8_t *data, size_t bytes, int32_t number, cue_slot *s) {
    cue_file *f = &p->file;
    const cue_model *m = &p->model;
    const cue_line *line = &p->work.line;
    cue_block *block = &p->block, *other = &p->other_block;
    int arm = m->n - m->n_forearm, has_score = f->line_bytes > 0;
    cue_content *content = &s->content;
    cue_record_read(data, bytes, has_score ? 0 : 1, &p->tables, &p->bases, content, &p->found);
    cue_predict(line->sound, line->sounds, m, TICKS * number, content->course, content->shift,
                &p->work, block);
    if (f->learns) {
        cue_predict_kinds(m, TICKS * number, content->course, content->shift, &p->work, other);
        correct(p, &f->hand, SHAPES, 0, N_FACE, N_HAND, block);
        correct(p, &f->arm, KINDS - SHAPES, SHAPES, arm, m->n_forearm, block);
    }
    cue_use_shares(content, m, block);
    cue_residual(content, &p->found, &p->bases, m, other);
    for (int t = 0; t < TICKS; t++)
        for (int k = 0; k < m->n; k++) block->value[t][k] += other->value[t][k];
    if (f->learns) {
        cue_block *lacked = &f->lacked;
        cue_predict(line->sound, line->sounds, m, TICKS * number, 0, 0, &p->work, lacked);
        for (int t = 0; t < TICKS; t++)
            for (int k = 0; k < m->n; k++)
                lacked->value[t][k] = block->value[t][k] - lacked->value[t][k];
        cue_predict_kinds(m, TICKS * number, 0, 0, &p->work, other);
        learn(&f->hand, other, lacked, SHAPES, 0, N_FACE, N_HAND);
        learn(&f->arm, other, lacked, KINDS - SHAPES, SHAPES, arm, m->n_forearm);
    }
    if (p->with_lips && has_score && !f->keyed)
        cue_lips(line->sound, line->sounds, m, TICKS * number, block);
    cue_slot_show(s, block, m->n);
}

/* F6: a superframe of constant size, as if a carrier had delivered it. */
static void read_constant(cue_payload *p, const uint8_t *data, int32_t number) {
    const cue_file *f = &p->file;
    unsigned lead = data[0] & 0x20 || f->n0 < 2 ? 2 : data[1] >> 4 & 3U; /* H11 */
    cue_rule rule;
    double due_s = 0.64 * number;
    (void)cue_payload_put(p, data, f->n0, data + f->n0, f->n1, due_s - 0.64 * lead, &rule);
}

/* Whether phones follow that start behind the last superframe. */
static int goes_on(const cue_file *f, const cue_line *line) {
    int32_t end = TICKS * f->next;
    if (f->n0 || !f->line_bytes) return 0;
    return !f->ended || (line->sounds && line->sound[line->sounds - 1].start >= end);
}

static void read_line(cue_payload *p, const uint8_t *file, int32_t end) {
    cue_file *f = &p->file;
    cue_line *line = &p->work.line;
    f->line.data = f->replaced.data = file + f->line_at;
    while (!f->ended && line->sounds < MOST_LINE - 1 &&
           (line->sounds == 0 || line->sound[line->sounds - 1].start < end))
        if (!read_on(f, &f->line, &p->tables, line)) f->ended = 1;
    chart(p);
    let_go(f);
}

cue_status cue_payload_file_next(cue_payload *p, const uint8_t *file, size_t bytes) {
    cue_file *f = &p->file;
    if (!f->opened || bytes != f->bytes) return CUE_BAD_ARGUMENT;
    if (f->next >= f->stop && !goes_on(f, &p->work.line)) return CUE_EMPTY;
    int32_t number = f->next++, first = TICKS * number;
    if (f->n0) {
        read_constant(p, file + f->at, number);
        f->at += (size_t)f->n0 + f->n1;
        if (f->next == f->stop) (void)cue_payload_flush(p);
        return CUE_OK;
    }
    cue_slot *s = cue_slot_new(p, number, 0.64 * number);
    if (f->line_bytes) read_line(p, file, first + TICKS + AHEAD);
    if (number < f->stop) {
        int32_t length = record_at(file, bytes - 4, &f->at);
        if (length < 0) return CUE_BAD_DATA; /* the file was changed after it was opened */
        draw(p, file + f->at - length, (size_t)length, number, s);
    }
    report(p, s, number == f->start ? -FAR : first, first + TICKS);
    forget(p, first + TICKS);
    return CUE_OK;
}

cue_status cue_payload_open(cue_payload *p, const void *file, size_t bytes, cue_file_info *info) {
    const cue_file *f = &p->file;
    if (!p->model.loaded) return CUE_NO_VOICE;
    p->broken = cue_payload_file(p, file, bytes);
    if (p->broken != RULE_NONE) return CUE_BAD_DATA;
    if (memcmp((const uint8_t *)file + 5, p->model.coding, sizeof p->model.coding) != 0) {
        (void)cue_payload_reset(p);
        return CUE_NO_VOICE;
    }
    info->start_s = 0.02 * f->first_tick;
    info->duration_s = 0.02 * (f->end_tick - f->first_tick);
    info->superframes = (uint32_t)(f->stop - f->start);
    return CUE_OK;
}

const char *cue_payload_broken(const cue_payload *p) { return cue_rule_name(p->broken); }
