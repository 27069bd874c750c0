/* track.c - from places of superframes to superframes: tries, locks, follows, reads back.
 *
 * In: candidates of the search and the ring of sound; out: cue_superframe values in a queue. A place
 * counts when a check accepts what is read there. Then the place of each next superframe is
 * predicted, and corrected by decoded bits. One that fails is sought beside its place, and starts a
 * search beside the prediction, so that a splice is found while a gap is bridged. Sound from before
 * the lock is read backwards, two superframes per step: the work of a step is bounded.
 * Source of the gains: Morrison, "Introduction to Sequential Smoothing and Prediction", 1969.
 * Specification: spec/audio-carrier.md, sections 7.1 and 7.2 (W35 to W37, W42, W46, W47).
 */
#include <string.h>

#include "hearing.h"

enum { PATIENCE = 6, REMEMBERED = 16, UNREADABLE = 10, YOUNG = 4, PAIR_CHECKS = 8 };

static const double follow_reach = 0.3, same_place = 1.0, same_clock = 2e-4;

void cue_hearing_reset(cue_hearing *h) {
    cue_sound_clear(&h->sound);
    h->now = 0;
    h->tracking = false;
    h->last_start = h->last_given = -1e18;
    h->back_failed = 255;
    h->waiting = 0;
    h->epoch++;
    h->index = 0;
    h->search.loudest = 0;
    h->stereo = false;
    h->search.turn = 0;
    cue_search_start(h, 0, NULL);
}

void cue_hearing_init(cue_hearing *h, const cue_config *config) {
    memset(h, 0, sizeof *h);
    cue_layout_init(&h->layout, config->key, h->work.words);
    cue_mdct_init(&h->mdct);
    cue_mask_init(&h->mask);
    cue_link_init(&h->link, h->work.words);
    cue_search_init(&h->search);
    cue_sound_init(&h->sound, config->rate_hz);
    for (int n = 0; n < PROFILES; n++)
        cue_reliability_init(&h->reliability[n], cue_groups(&cue_profiles[n]));
    h->channels = config->channels;
    h->history = config->history != 0;
    h->seen.first_lock_s = -1;
    h->seen.profile = 255;
    cue_hearing_reset(h);
}

/* ---- Reading at a place --------------------------------------------------------------------- */

/* Power below which bands are silent, at a gain that moved all levels by `offset`. */
static float silence(float offset) {
    return SILENT_POWER * (offset < 0 ? cue_power10(offset / 2) : 1);
}

static void view(cue_hearing *h, const cue_track *t) {
    cue_view_read(h, t, silence(t->offset), &h->view);
}

static void move(cue_track *t, cue_fit fit) {
    t->position += fit.start_delay;
    t->ratio *= 1 + fit.drift;
}

static float data_step(const cue_hearing *h, const cue_track *t) {
    return cue_step(&cue_profiles[t->profile], h->reading.level);
}

/* Seek L1 where only L0 was read, at the place where the bits of L0 fit best. */
static void complete(cue_hearing *h, const cue_track *t) {
    int count = FRAMES * cue_groups(&cue_profiles[t->profile]);
    if (!cue_profiles[t->profile].l1_bytes || h->reading.l1_ok) return;
    float weights[FRAMES * GROUPS];
    for (int i = 0; i < count; i++) weights[i] = h->reading.expected[i];
    cue_track moved = *t;
    move(&moved, cue_search_fit(h, &h->view, cue_data_cells(&h->layout, t->profile),
                                data_step(h, t), weights, 7, 0.2f, 7, 20e-6f, 1));
    view(h, &moved);
    cue_read_second(h, t->profile);
    view(h, t);
}

/* Read at a track's place: as it was, at the nominal gain, then with bands that are too quiet for
 * a programme of full loudness. */
static bool read_at(cue_hearing *h, cue_track *t, enum cue_effort effort) {
    float levels[16];
    view(h, t);
    int count = cue_likely_levels(h, &h->view, t, levels);
    if (cue_read(h, t->profile, levels, count, effort)) {
        complete(h, t);
        return true;
    }
    if (effort == BRIEF) return false;
    cue_track other = *t;
    if (t->offset != 0) {
        other.offset = 0;
        other.level = t->level - t->offset;
        view(h, &other);
        count = cue_likely_levels(h, &h->view, &other, levels);
        if (cue_read(h, t->profile, levels, count, BRIEF)) {
            *t = other;
            complete(h, t);
            return true;
        }
    }
    cue_view_read(h, t, 1e-2f * silence(t->offset), &h->view);
    count = cue_likely_levels(h, &h->view, t, levels);
    if (!cue_read(h, t->profile, levels, count, BRIEF)) return false;
    complete(h, t);
    return true;
}

/* Let decoded bits correct clock, level and the cells' reliabilities. */
static void correct(cue_hearing *h, cue_track *t, bool wide) {
    float weighted[FRAMES * GROUPS], step = data_step(h, t);
    cue_cells cells = cue_data_cells(&h->layout, t->profile);
    cue_trusted(h, t->profile, &h->reading, weighted);
    t->level = h->reading.level;
    t->misses = 0;
    float change = cue_gain_change(h, t->profile, &h->reading);
    cue_reliability_learn(h, t->profile, &h->reading);
    if (wide) {
        move(t, cue_search_fit(h, &h->view, cells, step, weighted, 9, 0.25f, 7, 20e-6f, 1));
        view(h, t);
        move(t, cue_search_fit(h, &h->view, cells, step, weighted, 5, 0.2f, 5, 10e-6f, 1));
    } else {
        double delay = cue_find_delay(h, &h->view, cells, step, weighted, (float)follow_reach);
        double n = t->age + 2, place = 2 * (2 * n - 1) / (n * (n + 1)), pace = 6 / (n * (n + 1));
        t->position += (place > 0.2 ? place : 0.2) * delay;
        t->ratio *= 1 + (pace > 0.02 ? pace : 0.02) * delay / SUPER;
        t->age += t->age < 1000;
    }
    t->offset += change;
}

static void deliver(cue_hearing *h, const cue_track *t, bool ok, bool late, uint64_t index) {
    const cue_profile *p = &cue_profiles[t->profile];
    if (h->waiting == (int)(sizeof h->queue / sizeof *h->queue)) return;
    cue_superframe *s = &h->queue[h->waiting++];
    memset(s, 0, sizeof *s);
    s->index = index;
    s->epoch = h->epoch;
    s->start_samples = t->position * h->sound.rate / FS;
    s->time_s = t->position / FS;
    s->profile = (uint8_t)t->profile;
    s->late = late;
    if (!late) h->last_given = t->position;
    if (!ok) {
        h->seen.failed++;
        return;
    }
    if (!late) h->last_start = t->position;
    h->seen.superframes++;
    h->seen.second_failed += p->l1_bytes && !h->reading.l1_ok;
    s->l0_bytes = p->l0_bytes;
    s->l1_bytes = h->reading.l1_ok ? p->l1_bytes : 0;
    memcpy(s->l0, h->reading.l0, p->l0_bytes);
    memcpy(s->l1, h->reading.l1, s->l1_bytes);
    float sum = 0, known = 0, wrong = 0;
    for (int i = 0; i < FRAMES * cue_groups(p); i++) {
        float agreement = h->reading.soft[i] * (float)h->reading.expected[i];
        sum += agreement;
        known += agreement != 0;
        wrong += agreement < 0;
    }
    s->confidence = sum > 0 ? sum / known : 0;
    s->error_rate = known > 0 ? wrong / known : 0;
}

/* ---- Other places --------------------------------------------------------------------------- */

/* Where a superframe that failed lies by its pilots: the clock may have led astray. */
static bool find_beside(cue_hearing *h, cue_track *t) {
    float expected[FRAMES * SLOTS];
    const cue_profile *p = &cue_profiles[t->profile];
    float tier = floorf((t->level - t->offset) / TIER_LEVELS + 1e-3f);
    float step = cue_pilot_step(p, tier + t->offset / TIER_LEVELS);
    cue_cells cells = cue_pilot_cells(&h->layout);
    cue_pilots_expected(h, t->profile, expected);
    t->age = 0;
    view(h, t);
    cue_fit fit = cue_search_fit(h, &h->view, cells, step, expected, 33, 1.5f, 17, 200e-6f, 1);
    if (fit.score < 24) return false;
    move(t, fit);
    view(h, t);
    fit = cue_search_fit(h, &h->view, cells, step, expected, 5, 0.5f, 7, 50e-6f, 1);
    if (fit.score < 36) return false;
    move(t, fit);
    return true;
}

/* Place where cells of left, or of right, seem written in a single channel: by their second
 * harmonic, which is alike for both bits. The view is that of the track. */
static bool find_lone(cue_hearing *h, cue_track *t, const float *levels, int count) {
    const cue_profile *p = &cue_profiles[t->profile];
    cue_cells cells = cue_data_cells(&h->layout, t->profile);
    cue_track best = *t;
    float most = 0;
    for (int kind = LEFT; kind <= RIGHT; kind++) {
        float expected[FRAMES * GROUPS], sum = 0;
        for (int i = 0; i < FRAMES * cells.groups; i++) {
            int bin = p->first_bin + i % cells.groups * p->cell_bins;
            expected[i] = h->layout.place[t->profile][bin] == kind;
            sum += expected[i];
        }
        for (int i = 0; i < count && i < TIER_LEVELS; i++) {
            cue_fit fit = cue_search_fit(h, &h->view, cells, cue_step(p, levels[i]), expected, 9,
                                         0.2f, 7, 20e-6f, 2);
            float score = (float)fit.score / sqrtf(sum / 2);
            if (score <= 3.5f || score <= most) continue;
            most = score;
            best = *t;
            best.level = levels[i];
            best.age = 0;
            move(&best, fit);
        }
    }
    *t = best;
    return most > 0;
}

/* Read a superframe that failed at other places. `t` becomes the one that holds it. */
static bool read_elsewhere(cue_hearing *h, cue_track *t, enum cue_effort effort) {
    float levels[16];
    cue_track moved = *t;
    if (h->channels == 2 && (h->view.paired || !t->pair)) {
        moved.pair = !t->pair;
        if (read_at(h, &moved, effort)) return *t = moved, true;
        moved = *t;
    }
    double error = 1 - t->ratio;
    if (t->age < YOUNG && error != 0 && fabs(error) < 1.5e-4) { /* perhaps no clock error at all */
        moved.position += SUPER / 2 * error;
        moved.ratio = 1;
        moved.age = 0;
        if (read_at(h, &moved, USUAL)) return *t = moved, true;
        moved = *t;
    }
    if (find_beside(h, &moved) && read_at(h, &moved, USUAL)) return *t = moved, true;
    moved = *t;
    view(h, &moved);
    if (h->view.paired) return false;
    int count = cue_likely_levels(h, &h->view, &moved, levels);
    if (!find_lone(h, &moved, levels, count) || !read_at(h, &moved, USUAL)) return false;
    *t = moved;
    return true;
}

/* Sum of the soft values of known bits of left and right at a track's place; `count` gets their
 * number. */
static float agreement_aside(cue_hearing *h, const cue_track *t, float *count) {
    const cue_profile *p = &cue_profiles[t->profile];
    float soft[FRAMES * GROUPS], sum = 0;
    cue_soft(h, &h->view, t->profile, data_step(h, t), soft);
    *count = 0;
    for (int i = 0; i < FRAMES * cue_groups(p); i++) {
        int bin = p->first_bin + i % cue_groups(p) * p->cell_bins;
        if (h->layout.place[t->profile][bin] == MID || !h->reading.expected[i]) continue;
        sum += soft[i] * (float)h->reading.expected[i];
        *count += 1;
    }
    return sum;
}

/* Go on with cells in mid, left and right, or all in the mid: as known bits fit clearly. An old
 * track seldom asks. The view is that of the track. */
static void settle_pair(cue_hearing *h, cue_track *t) {
    cue_track other = *t;
    bool paired = h->view.paired;
    float count, here;
    if (!h->stereo || (t->pair && !paired)) return;
    if (t->age >= PAIR_CHECKS && t->age % PAIR_CHECKS) return;
    here = agreement_aside(h, t, &count);
    other.pair = !t->pair;
    view(h, &other);
    if (h->view.paired != paired && agreement_aside(h, &other, &count) - here > sqrtf(count / 2))
        t->pair = other.pair;
}

/* ---- Locks ----------------------------------------------------------------------------------- */

static void lock(cue_hearing *h, cue_track t) {
    const cue_track known = h->track;
    double last = h->last_given;
    correct(h, &t, true);
    view(h, &t);
    complete(h, &t);
    settle_pair(h, &t); /* before the past is read */
    if (h->tracking && known.profile == t.profile) {
        double steps = cue_nearest((t.position - known.position) / (SUPER * known.ratio));
        double due = known.position + steps * SUPER * known.ratio, delay = t.position - due;
        if (fabs(t.ratio / known.ratio - 1) <= same_clock && fabs(delay) <= same_place) {
            t.position = due + 0.2 * delay; /* nothing new: the long memory of the clock stays */
            t.ratio = known.ratio;
            t.age = known.age;
        }
        if (fabs(delay) < 480) h->index += (uint64_t)(steps > 0 ? steps : 0);
        else h->epoch++;
    } else {
        h->epoch += h->seen.first_lock_s >= 0;
        h->index = (uint64_t)(t.position > 0 ? t.position / SUPER + 0.5 : 0);
    }
    h->track = t;
    h->tracking = true;
    h->search.active = false;
    h->search.turn = 0;
    h->seen.profile = (uint8_t)t.profile;
    if (h->seen.first_lock_s < 0) h->seen.first_lock_s = (double)h->now / FS;
    deliver(h, &t, true, false, h->index);
    h->back = t;
    h->back_index = h->index;
    h->back_failed = h->history ? 0 : 255;
    h->back_first = last + 0.5 * SUPER;
    h->track.position += SUPER * h->track.ratio;
    h->index++;
}

/* Decode at a candidate's place, and lock there if a check accepts it. */
static bool try_candidate(cue_hearing *h, const cue_candidate *c) {
    const cue_profile *p = &cue_profiles[c->profile];
    float expected[FRAMES * SLOTS], levels[16];
    cue_track t = {.position = c->start, .ratio = 1 + c->clock, .mix = {c->mix[0], c->mix[1]},
                   .profile = c->profile, .pair = false};
    if (t.position < h->last_start + 0.5 * SUPER) return false;
    float tier = log2f(c->pilot_step / cue_pilot_step(p, 0)), near = floorf(tier + 0.5f);
    near = near < 0 ? 0 : near > 2 ? 2 : near;
    t.offset = TIER_LEVELS * (tier - near);
    if (fabsf(t.offset) < 0.01f) t.offset = 0;
    t.level = TIER_LEVELS * near + 1 + t.offset;
    int count = 0; /* levels of its tier and one on either side */
    for (int reach = 0; reach < 4; reach++)
        for (int sign = 1; sign >= -1; sign -= 2) {
            float level = TIER_LEVELS * near + 1 + (float)(sign > 0 ? reach : -reach);
            if ((reach || sign > 0) && level >= 0 && level < LEVELS && count < 6)
                levels[count++] = level + t.offset;
        }
    h->seen.tried++;
    cue_pilots_expected(h, c->profile, expected);
    cue_cells cells = cue_pilot_cells(&h->layout);
    view(h, &t);
    move(&t, cue_search_fit(h, &h->view, cells, c->pilot_step, expected, 11, 0.5f, 5, 40e-6f, 1));
    view(h, &t);
    cue_fit fit = cue_search_fit(h, &h->view, cells, c->pilot_step, expected, 7, 0.25f, 5, 20e-6f, 1);
    move(&t, fit);
    bool sure = fit.score >= 5 * 8;
    t.pair = true;
    for (int i = 0; i < (sure ? 3 : 1); i++) {
        cue_track moved = t;
        moved.position += i == 0 ? 0 : i == 1 ? 0.5 : -0.5;
        view(h, &moved);
        if (cue_read(h, t.profile, levels, count, sure && !i ? USUAL : BRIEF)) {
            lock(h, moved);
            return true;
        }
    }
    if (!sure) return false;
    cue_track moved = t;
    if (h->view.paired) {
        moved.pair = false;
    } else {
        view(h, &t);
        if (!find_lone(h, &moved, levels, count)) return false;
    }
    view(h, &moved);
    if (!cue_read(h, t.profile, levels, count, USUAL)) return false;
    lock(h, moved);
    return true;
}

/* ---- Following -------------------------------------------------------------------------------- */

static void follow(cue_hearing *h) {
    cue_track *t = &h->track;
    cue_track moved = *t;
    if (read_at(h, t, DUE)) {
        h->search.active = false;
        correct(h, t, false);
        settle_pair(h, t);
        deliver(h, t, true, false, h->index);
    } else if (read_elsewhere(h, &moved, DUE)) {
        bool other = moved.pair != t->pair;
        h->search.active = false;
        *t = moved;
        correct(h, t, !other);
        deliver(h, t, true, false, h->index);
    } else {
        t->misses++;
        if (!h->search.active) cue_search_start(h, t->position, t);
        if (t->misses <= PATIENCE) deliver(h, t, false, false, h->index);
        if (t->misses > REMEMBERED) {
            h->tracking = false;
            cue_search_start(h, t->position, NULL);
        }
    }
    t->position += SUPER * t->ratio;
    h->index++;
}

/* Read the superframe before those that were read. */
static void read_back(cue_hearing *h) {
    cue_track *t = &h->back;
    double first = h->sound.first ? (double)h->sound.first + 2 * HOP : -(double)HOP;
    t->position -= SUPER * t->ratio;
    if (t->position < first || t->position < h->back_first || !h->back_index--) {
        h->back_failed = 255;
        return;
    }
    cue_track moved = *t;
    if (read_at(h, &moved, USUAL) || read_elsewhere(h, &moved, USUAL)) {
        float weighted[FRAMES * GROUPS];
        *t = moved;
        t->level = h->reading.level;
        cue_trusted(h, t->profile, &h->reading, weighted);
        deliver(h, t, true, true, h->back_index);
        t->position += 0.5 * cue_find_delay(h, &h->view, cue_data_cells(&h->layout, t->profile),
                                            data_step(h, t), weighted, (float)follow_reach);
        h->back_failed = 0;
    } else if (++h->back_failed >= UNREADABLE) {
        h->back_failed = 255;
    }
}

static bool due(const cue_hearing *h) {
    double end = h->track.position + (SUPER + HOP) * h->track.ratio + 64;
    return h->tracking && end <= (double)h->now;
}

void cue_hearing_end(cue_hearing *h) {
    static const float offsets[] = {2, 1, 3}; /* levels: 1/2, 1/4 and 3/4 of a tier (A4) */
    cue_candidate found;
    if (h->seen.first_lock_s >= 0 || h->now > RING) return;
    for (int i = 0; i < 3 && !h->tracking; i++) {
        cue_search_start(h, 0, NULL);
        h->search.offset = offsets[i];
        for (; !h->tracking && cue_search_ready(h); h->search.batch++)
            if (cue_search_usual(h, &found)) try_candidate(h, &found);
    }
    while (h->back_failed != 255) read_back(h);
    while (due(h)) follow(h);
}

void cue_hearing_step(cue_hearing *h) {
    cue_candidate found;
    float power = 0, beside = 0;
    for (int64_t i = h->now; i < h->now + QUANTUM; i++) {
        float x = h->sound.ring[0][i % RING];
        power += x * x / QUANTUM;
        beside += h->sound.ring[1][i % RING] * h->sound.ring[1][i % RING] / QUANTUM;
    }
    h->stereo |= beside > 1e-8f * power;
    h->now += QUANTUM;
    h->search.loudest *= 0.997f;
    if (power > h->search.loudest) h->search.loudest = power;
    for (int i = 0; i < 2 && due(h); i++) follow(h);
    for (int i = 0; i < 2 && h->back_failed != 255; i++) read_back(h);
    for (int i = 0; i < 2 && cue_search_ready(h); i++) {
        bool tried = cue_search_usual(h, &found) && try_candidate(h, &found);
        bool others = !h->tracking || h->track.misses >= 3;
        for (int ladder = 0; ladder < 2 && !tried && others; ladder++)
            tried = cue_search_other(h, ladder, &found) && try_candidate(h, &found);
        h->search.turn++;
        h->search.batch++;
    }
    h->state = h->tracking && h->track.misses <= PATIENCE
                   ? h->track.misses ? CUE_DEGRADED : CUE_LOCKED
                   : h->seen.first_lock_s >= 0 ? CUE_LOST : CUE_SEARCHING;
}
