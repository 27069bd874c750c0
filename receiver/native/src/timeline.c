/* timeline.c
 * In: superframes with their times on air, in any order, with losses. Out: keys, phones, previews,
 * motion and markers with times on the programme's clock and revision numbers.
 * Source: superframes keep slots in a ring; events are read out of the slots, so that none can be
 * lost for want of room: what is redrawn before it was collected is reported once, as it is now.
 * Specification: spec/bitstream.md, H4, P11, J4, J5, J8; concealment is the receiver's own. */
#include "payload.h"

#include <math.h>
#include <string.h>

#define SUPERFRAME_S 0.64
#define OFF_GRID_S 0.1 /* from which a superframe belongs to another grid */
#define WAIT_S 1.0     /* after a superframe's end on air, until it counts as lost */

enum { LATEST = -8, LONGEST = 64, CONCEALED = 6, BACK = 4, DOUBT = 8 };

enum { UNKNOWN, LOST, ARRIVED };

size_t cue_payload_size(const cue_config *config) {
    (void)config;
    return (sizeof(cue_payload) + 15) / 16 * 16;
}

cue_status cue_payload_reset(cue_payload *p) {
    p->started = p->streak = p->doubt = p->away = p->unreadable = 0;
    p->last = p->newest_lost = 0;
    p->foreign = 0;
    p->marker_frame = -1;
    cue_proofs_reset(&p->proofs);
    p->from_s = -1e300;
    p->until_s = 1e300;
    memset(&p->file, 0, sizeof p->file);
    memset(p->slot, 0, sizeof p->slot);
    for (int i = 0; i < SLOTS; i++) p->slot[i].number = -1;
    return CUE_OK;
}

cue_status cue_payload_init(cue_payload *p, const cue_config *config) {
    memset(p, 0, sizeof *p);
    p->with_markers = config->markers != 0;
    p->with_lips = 1;
    cue_proofs_init(&p->proofs);
    return cue_payload_reset(p);
}

cue_status cue_payload_voice(cue_payload *p, const void *file, size_t bytes) {
    p->broken = RULE_NONE;
    p->bad_at = cue_model_load(file, bytes, &p->tables, &p->bases, &p->model);
    (void)cue_payload_reset(p);
    return p->bad_at ? CUE_BAD_DATA : CUE_OK;
}

cue_slot *cue_slot_find(cue_payload *p, int32_t number) {
    if (number < 0) return 0;
    cue_slot *s = &p->slot[number % SLOTS];
    return s->number == number ? s : 0;
}

cue_slot *cue_slot_new(cue_payload *p, int32_t number, double time_s) {
    cue_slot *s = &p->slot[number % SLOTS];
    memset(s, 0, sizeof *s);
    s->number = number;
    s->time_s = time_s;
    return s;
}

/* The slot of a superframe; an older one that held it is given up. */
static cue_slot *slot_of(cue_payload *p, int32_t number) {
    cue_slot *s = cue_slot_find(p, number);
    double time_s = p->last_on_air_s + p->lead_s + SUPERFRAME_S * (number - p->last);
    return s ? s : cue_slot_new(p, number, time_s);
}

static int state_of(cue_payload *p, int32_t number) {
    const cue_slot *s = cue_slot_find(p, number);
    return s ? s->state : UNKNOWN;
}

/* What is known of the score of a superframe (J1, J8); `stand` is room for a stand-in. */
static const cue_score *score_of(cue_payload *p, int32_t number, cue_score *stand) {
    cue_slot *s = cue_slot_find(p, number);
    if (!s) return 0;
    if (s->state == ARRIVED) return s->content.score.kind ? &s->content.score : 0;
    if (!s->told_distance) return 0;
    cue_stand_in(&s->told, stand);
    return stand;
}

/* Scores from `first` to `end`. In compact mode previews do not count. */
static cue_scores scores_of(cue_payload *p, int32_t first, int32_t end, int compact) {
    cue_scores scores = {first, 0, {0}};
    for (int32_t k = first; k < end; k++) {
        const cue_score *score = score_of(p, k, &p->stand[scores.count]);
        if (score && compact != (score->kind == 2)) score = 0;
        scores.score[scores.count++] = score;
    }
    return scores;
}

/* Whether a superframe is read by windows: one of them is near and its own is no score. */
static int by_windows(cue_payload *p, int32_t number) {
    const cue_slot *own = cue_slot_find(p, number);
    if (own && own->state == ARRIVED && own->content.score.kind != 2 &&
        own->content.mode != 1)
        return 0;
    for (int32_t k = number - BACK; k <= number + 1; k++) {
        const cue_slot *s = cue_slot_find(p, k);
        if (s && s->state == ARRIVED && s->content.score.kind == 2) return 1;
    }
    return 0;
}

/* The prediction of a superframe from all that is known around it (section 5). */
static void predict(cue_payload *p, int32_t number, unsigned course, unsigned shift, cue_block *out)
{
    int compact = by_windows(p, number);
    cue_scores scores = scores_of(p, number - (compact ? BACK : 1), number + 2, compact);
    cue_line *line = &p->work.line;
    cue_join(&scores, &p->tables, line);
    const cue_score *near = cue_nearest(&scores, number);
    cue_strokes_of(line, near ? near->rest_gap : 1, &p->model, &p->work.strokes);
    cue_predict(line->sound, line->sounds, &p->model, TICKS * number, course, shift, &p->work, out);
}

/* Parameters of a superframe that arrived, not blended with its neighbours (P10, Q5). */
static void draw_alone(cue_payload *p, const cue_slot *s, cue_block *out) {
    predict(p, s->number, s->content.course, s->content.shift, out);
    cue_use_shares(&s->content, &p->model, out);
    for (int t = 0; t < TICKS; t++)
        for (int k = 0; k < p->model.n; k++) out->value[t][k] += (double)s->residual[t][k];
}

/* Q7: blended with neighbours where both are of a filmed cuer. */
static void draw_arrived(cue_payload *p, const cue_slot *s, cue_block *out) {
    static const double weights[4] = {0.4, 0.225, 0.1, 0.025};
    draw_alone(p, s, out);
    for (int side = -1; side <= 1 && s->content.filmed; side += 2) {
        const cue_slot *near = cue_slot_find(p, s->number + side);
        if (!near || near->state != ARRIVED || !near->content.filmed) continue;
        draw_alone(p, near, &p->other_block);
        const cue_block *former = side < 0 ? &p->other_block : out;
        const cue_block *latter = side < 0 ? out : &p->other_block;
        double jump[MOST_P];
        for (int k = 0; k < p->model.n; k++)
            jump[k] = (3.0 * latter->value[0][k] - latter->value[1][k] -
                       3.0 * former->value[TICKS - 1][k] + former->value[TICKS - 2][k]) / 2.0;
        for (int i = 0; i < 4; i++)
            for (int k = 0; k < p->model.n; k++)
                out->value[side < 0 ? i : TICKS - 1 - i][k] += side * weights[i] * jump[k];
    }
}

/* Parameters of a superframe that did not: what its neighbours showed beyond their predictions
 * fades, and without any score near the hand goes to rest. */
static void draw_lost(cue_payload *p, const cue_slot *s, cue_block *out) {
    predict(p, s->number, 0, 0, out);
    for (int side = -1; side <= 1; side += 2) {
        const cue_slot *near = cue_slot_find(p, s->number + side);
        if (!near || near->state != ARRIVED || near->content.mode == 2) continue;
        cue_block *other = &p->other_block;
        predict(p, near->number, 0, 0, other);
        int edge = side < 0 ? TICKS - 1 : 0;
        for (int t = 0; t < TICKS; t++) {
            double u = (side < 0 ? t + 1 : TICKS - t) / (0.5 * (double)TICKS);
            double w = u >= 1.0 ? 0.0 : 1.0 - u * u * u * (10.0 - 15.0 * u + 6.0 * u * u);
            for (int k = 0; k < p->model.n; k++)
                out->value[t][k] +=
                    w * ((double)near->shown[edge][k] - other->value[edge][k]) * near->drawn;
        }
    }
}

void cue_slot_show(cue_slot *s, const cue_block *block, int count) {
    uint32_t changed = 0;
    for (int t = 0; t < TICKS; t++)
        for (int k = 0; k < count; k++) {
            float value = (float)fmax(-1000.0, fmin(block->value[t][k], 1000.0));
            if (!s->drawn || fabsf(value - s->shown[t][k]) > 1e-6F) changed |= UINT32_C(1) << t;
            s->shown[t][k] = value;
        }
    s->revision += s->drawn && changed;
    s->pending |= changed;
    s->drawn = 1;
}

static void draw(cue_payload *p, cue_slot *s) {
    cue_block *block = &p->block;
    if (s->state == ARRIVED)
        draw_arrived(p, s, block);
    else
        draw_lost(p, s, block);
    if (p->with_lips) {
        int compact = by_windows(p, s->number);
        cue_scores scores = scores_of(p, s->number - (compact ? BACK : 1), s->number + 2, compact);
        cue_join(&scores, &p->tables, &p->work.line);
        cue_lips(p->work.line.sound, p->work.line.sounds, &p->model, TICKS * s->number, block);
    }
    cue_slot_show(s, block, p->model.n);
}

void cue_key_show(cue_slot *s, const cue_cue *cue, int previewed, int final) {
    cue_shown_key *key = 0;
    for (int i = 0; i < s->keys; i++)
        if (s->key[i].start == cue->start) key = &s->key[i];
    if (!key) {
        if (s->keys == MOST_SHOWN) return;
        key = &s->key[s->keys++];
        memset(key, 0, sizeof *key);
        key->start = cue->start;
        key->pending = 1;
    } else if (key->final) {
        return;
    } else if (key->end != cue->end || key->number != cue->number || final ||
               key->previewed != previewed) {
        key->revision += !key->pending;
        key->pending = 1;
    }
    key->end = cue->end;
    key->number = cue->number;
    key->previewed = (uint8_t)previewed;
    key->phones[0] = previewed ? 0 : cue->phones[0];
    key->phones[1] = previewed ? 0 : cue->phones[1];
    key->final = (uint8_t)final;
}

void cue_phone_show(cue_slot *s, const cue_sound *sound) {
    if (s->phones == MOST_SHOWN) return;
    s->phone[s->phones].start = sound->start;
    s->phone[s->phones].end = sound->end;
    s->phone[s->phones++].number = sound->number;
}

/* Keys and phones that start in a superframe, from all that is known around it. */
static void read_keys(cue_payload *p, int32_t number, int final) {
    cue_slot *s = cue_slot_find(p, number);
    cue_line *line = &p->work.line;
    if (!s || s->finished) return;
    int compact = by_windows(p, number);
    cue_scores scores = scores_of(p, number - BACK, number + 2, compact);
    cue_join(&scores, &p->tables, line);
    int32_t begin = TICKS * number, end = begin + TICKS;
    for (int i = 0; i < s->keys; i++) { /* withdrawn unless found again */
        int found = s->key[i].final || s->key[i].end == s->key[i].start;
        for (int k = 0; k < line->cues && !found; k++)
            found = line->cue[k].certain && line->cue[k].start == s->key[i].start;
        if (found) continue;
        cue_cue none = {s->key[i].start, s->key[i].start, 0, s->key[i].number, {0, 0}, 1};
        cue_key_show(s, &none, 0, final);
    }
    int previewed = s->state != ARRIVED;
    for (int k = 0; k < line->cues; k++) {
        const cue_cue *cue = &line->cue[k];
        if (!cue->certain || cue->start < begin || cue->start >= end) continue;
        if (cue->end == cue->start) continue; /* J2 can leave a key no time */
        int stands = previewed && cue->start + 1 < end;
        cue_cue shown = *cue;
        if (s->state == ARRIVED && s->content.filmed && cue->start + 1 < end)
            shown.phones[0] = shown.phones[1] = 0; /* V8: stand-ins are no phones */
        cue_key_show(s, &shown, stands, final);
    }
    if (!final) return;
    s->finished = 1;
    for (int i = 0; i < line->sounds && !previewed; i++) {
        const cue_sound *sound = &line->sound[i];
        if (sound->number && !sound->stands && sound->start >= begin && sound->start < end)
            cue_phone_show(s, sound);
    }
}

/* Draw and read again all that a superframe has a say in. */
static void refresh(cue_payload *p, int32_t number) {
    for (int32_t k = number - 2; k <= number + BACK; k++) {
        cue_slot *s = cue_slot_find(p, k);
        if (!s || (s->state == UNKNOWN && k != number - 1)) continue;
        if (k == number - 2 && !s->content.filmed) continue; /* Q7 reaches farther */
        if (s->state != UNKNOWN) draw(p, s);
        read_keys(p, k, state_of(p, k + 1) != UNKNOWN);
    }
}

static void lose(cue_payload *p, int32_t number) {
    cue_slot *s = slot_of(p, number);
    if (s->state != UNKNOWN) return;
    s->state = LOST;
    if (number > p->newest_lost) p->newest_lost = number;
    refresh(p, number);
}

/* Mark as lost what lies between the last known superframe and `end`, of a long gap its ends. */
static void lose_until(cue_payload *p, int32_t end) {
    int32_t k = (p->last > p->newest_lost ? p->last : p->newest_lost) + 1;
    int32_t concealed = p->last + CONCEALED;
    for (; k < end && k <= concealed; k++) lose(p, k);
    for (k = k < end - 2 ? end - 2 : k; k < end; k++) lose(p, k);
}

static int fits(const cue_payload *p, const cue_content *content, double on_air_s, int32_t *number)
{
    double away = (on_air_s - p->last_on_air_s) / SUPERFRAME_S, whole = nearbyint(away);
    int32_t period = content->mode == 2 ? 16 : 64;
    if (!p->started || !(fabs(away - whole) * SUPERFRAME_S < OFF_GRID_S)) return 0;
    if (whole < (double)LATEST || whole > (double)LONGEST) return 0;
    *number = p->last + (int32_t)whole;
    return *number >= 0 && (*number - content->sequence) % period == 0; /* H4 */
}

/* A part that fails its identity or version: two running that state the same other one are
 * another stream's (H5, H6). */
static void refuse(cue_payload *p, const uint8_t *l0, size_t n0, cue_rule rule) {
    uint32_t other = 0x10000, sum = 0;
    for (size_t i = 0; i < n0; i++) sum = sum * 31 + l0[i];
    if (rule == RULE_H6)
        other = cue_check_of(l0, n0 - 2, 16, 0x1021, 0xFFFF) ^ ((unsigned)l0[n0 - 2] << 8 | l0[n0 - 1]);
    if (rule == RULE_H2) other = 0x20000U | l0[0] >> 6;
    int again = p->streak && other == p->foreign && sum != p->foreign_sum;
    p->foreign = other;
    p->foreign_sum = sum;
    p->streak = 1;
    p->away = 0;
    if (!again) return;
    p->doubt = DOUBT;
    if (p->told_other == other) return;
    p->told_other = other;
    p->unreadable = 1;
    p->other_version = (uint8_t)(rule == RULE_H2 ? l0[0] >> 6 : 0);
    p->other = rule == RULE_H6 ? other : 0;
}

static void take_previews(cue_payload *p, const cue_slot *from) {
    for (int d = 0; d < 4; d++) {
        int way = d == 3 ? -1 : 2 * d + 2, distance = d == 3 ? 1 : way;
        if (!(from->content.previews >> d & 1)) continue;
        cue_slot *s = slot_of(p, from->number + way);
        if (s->told_distance && s->told_distance < distance) continue; /* V3: the nearest is best */
        s->told_distance = (uint8_t)distance;
        s->told = from->content.preview[d];
        s->told_pending = s->state == UNKNOWN && way > 0 ? s->told.count : 0;
        if (s->state == LOST) refresh(p, s->number);
    }
}

/* A fine superframe nested in the L1 of a coarse one of the same header and coding. */
static void unnest(const uint8_t **l0, size_t *n0, const uint8_t **l1, size_t *n1) {
    if (*n0 < 5 || *n1 < *n0 || (*l0)[0] & 0x20) return;
    if ((*l0)[0] != (*l1)[0] || (*l0)[1] != (*l1)[1]) return;
    unsigned one = cue_check_of(*l0, *n0 - 2, 16, 0x1021, 0xFFFF);
    unsigned two = cue_check_of(*l1, *n0 - 2, 16, 0x1021, 0xFFFF);
    one ^= (unsigned)(*l0)[*n0 - 2] << 8 | (*l0)[*n0 - 1];
    two ^= (unsigned)(*l1)[*n0 - 2] << 8 | (*l1)[*n0 - 1];
    if (one != two) return;
    *l0 = *l1;
    *l1 += *n0;
    *n1 -= *n0;
}

cue_status cue_payload_put(cue_payload *p, const uint8_t *l0, size_t n0, const uint8_t *l1,
                           size_t n1, double on_air_s, cue_rule *rule) {
    cue_content content;
    int32_t number;
    *rule = RULE_NONE;
    if (!p->model.loaded || !(fabs(on_air_s) < 1e9)) return CUE_OK;
    if (n0 == 0) {
        double away = (on_air_s - p->last_on_air_s) / SUPERFRAME_S;
        if (p->started && away > 0.5 && away < (double)LONGEST)
            lose_until(p, p->last + 1 + (int32_t)nearbyint(away));
        return CUE_OK;
    }
    unnest(&l0, &n0, &l1, &n1);
    *rule = cue_superframe_read(l0, n0, l1, n1, &p->tables, &p->bases, &content, &p->found);
    if (*rule != RULE_NONE) {
        refuse(p, l0, n0, *rule);
        return CUE_OK;
    }
    int agreed = content.mode == 2 ? 2 : 16; /* bits of the identity */
    int goes_on = fits(p, &content, on_air_s, &number);
    p->streak = 0;
    p->away = goes_on || !p->started ? 0 : p->away + agreed;
    if (p->doubt > 0) p->doubt -= agreed;
    if (p->doubt > 0 || (p->away && p->away < DOUBT)) return CUE_OK;
    p->told_other = 0;
    p->away = 0;
    if (!goes_on) { /* a splice, or the first one */
        int32_t least = p->started ? (p->last > p->newest_lost ? p->last : p->newest_lost) + 12 : 64;
        for (int i = 0; i < SLOTS && p->started; i++) read_keys(p, p->slot[i].number, 1);
        number = least + (content.sequence - least % 64 + 64) % 64;
        p->started = 1;
        p->newest_lost = number - 1;
        p->last = number;
        p->last_on_air_s = on_air_s;
        p->lead_s = SUPERFRAME_S * content.lead;
        (void)slot_of(p, number - 1); /* a key may have begun in it */
    } else if (number > p->last) {
        lose_until(p, number);
    }
    cue_slot *s = slot_of(p, number);
    if (s->state == ARRIVED && (s->content.has_l1 || !content.has_l1)) return CUE_OK;
    if (number >= p->last) {
        p->last = number;
        p->last_on_air_s = on_air_s;
        p->lead_s = SUPERFRAME_S * content.lead;
    }
    s->time_s = on_air_s + SUPERFRAME_S * content.lead;
    s->state = ARRIVED;
    s->content = content;
    s->layers = (uint8_t)(content.has_l1 ? 3 : 1);
    s->told_pending = 0;
    s->finished = 0;
    cue_residual(&content, &p->found, &p->bases, &p->model, &p->block);
    for (int t = 0; t < TICKS; t++)
        for (int k = 0; k < p->model.n; k++) s->residual[t][k] = (float)p->block.value[t][k];
    refresh(p, number);
    take_previews(p, s);
    return CUE_OK;
}

const cue_slot *cue_payload_draw(cue_payload *p, int32_t number, int lips) {
    cue_slot *s = cue_slot_find(p, number);
    int usual = p->with_lips;
    if (!s || (s->state == UNKNOWN && !s->told_distance)) return 0;
    p->with_lips = lips;
    draw(p, s);
    p->with_lips = usual;
    int compact = by_windows(p, number);
    cue_scores scores = scores_of(p, number - BACK, number + 2, compact);
    cue_join(&scores, &p->tables, &p->work.line);
    return s;
}

cue_status cue_payload_take(cue_payload *p, const cue_superframe *s) {
    cue_rule rule;
    if (s->l0_bytes > CUE_L0_MOST || s->l1_bytes > CUE_L1_MOST) return CUE_BAD_ARGUMENT;
    cue_proofs_take(&p->proofs, s->l0, s->l0_bytes, s->time_s);
    return cue_payload_put(p, s->l0, s->l0_bytes, s->l1, s->l1_bytes, s->time_s, &rule);
}

cue_status cue_payload_advance(cue_payload *p, double now_s) {
    if (!p->started || !p->model.loaded) return CUE_OK;
    for (int i = 1; i <= CONCEALED; i++)
        if (p->last_on_air_s + SUPERFRAME_S * (i + 1) + WAIT_S <= now_s)
            lose_until(p, p->last + i + 1);
    return CUE_OK;
}

cue_status cue_payload_flush(cue_payload *p) {
    cue_proofs_end(&p->proofs);
    if (!p->model.loaded) return CUE_OK;
    for (int32_t k = p->last - 2; p->started && k <= p->last + 1; k++) read_keys(p, k, 1);
    return CUE_OK;
}
