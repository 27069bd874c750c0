/* proofs.c
 * In: superframes as they arrive, whom to trust, a clock. Out: verdicts, some seconds late: each
 * superframe is verified, forged or unknown, with its age.
 * Source: Perrig, Canetti, Tygar, Song 2000 (TESLA).
 * Specification: spec/authentication.md, section 6 (E19 to E29). */
#include "payload.h"

#include <math.h>
#include <string.h>

#define EPOCH_S 1767225600.0 /* E2 */
#define SUPERFRAME_S 0.64
#define OFF_GRID_S 0.1   /* from which a superframe begins a new run */
#define CLOCK_HOLDS_S 8.0 /* a clock's word counts so long, in seconds of sound */

enum {
    FAR_STEPS = 4,   /* from which the quick tag sorts keys first: one hash, not many */
    OTHERS = 8,      /* E29 */
    MISSES = 2,      /* E29 */
    LOCATING = 4,    /* checks that are left over where one changed superframe is looked for */
    UNSIGNED = 4,    /* E26 */
    LONGEST_GAP = 64 /* superframes; after more the blocks begin anew */
};

const cue_proof_layout *cue_layout(const cue_proofs *p) { return &cue_proof_layouts[p->wide]; }

const uint8_t *cue_end_of(const cue_proofs *p, int64_t period) {
    int64_t at = period - p->trusted.first / PERIOD;
    return p->trusted.ends[p->wide][at < 0 || at >= MOST_PERIODS ? 0 : at];
}

/* ---- What arrived -------------------------------------------------------------------------- */

cue_arrived *cue_arrived_at(cue_proofs *p, int32_t index) {
    int32_t oldest = p->last - (WAIT_BLOCKS + 1) * cue_layout(p)->block;
    cue_arrived *one = &p->arrived[(uint32_t)index % REMEMBERED];
    return index >= p->run && index >= oldest && index <= p->last && one->index == index ? one : 0;
}

/* E6: bits of the fields of the block that begins at an index; -1 where one was lost. */
static int64_t fields_of(cue_proofs *p, int32_t begin, int at, int count, int32_t without) {
    int width = cue_layout(p)->width, first = at / width, last = (at + count - 1) / width;
    uint64_t value = 0;
    for (int i = first; i <= last; i++) {
        const cue_arrived *one = cue_arrived_at(p, begin + i);
        if (!one || one->width != width || one->index == without) return -1;
        value = value << width | one->proof;
    }
    int behind = (last + 1) * width - at - count;
    return (int64_t)(value >> behind & ((UINT64_C(1) << count) - 1));
}

int64_t cue_sent_bits(cue_proofs *p, int32_t begin) {
    return fields_of(p, begin, 12 * cue_layout(p)->checks + 24, 48, -1);
}

int64_t cue_quick(cue_proofs *p, int32_t begin, const cue_arrived **covered) {
    *covered = cue_arrived_at(p, begin + cue_layout(p)->quick);
    return *covered ? fields_of(p, begin, 12 * cue_layout(p)->checks, 24, -1) : -1;
}

/* ---- Checking a block whose key is known --------------------------------------------------- */

static void parities_of(cue_proofs *p, int32_t begin, const uint8_t key[KEY_BYTES],
                        cue_parities *out) {
    const cue_proof_layout *l = cue_layout(p);
    for (int j = 0; j < l->checks; j++) out->check[j] = (int32_t)fields_of(p, begin, 12 * j, 12, -1);
    for (int place = 0; place < l->block; place++) {
        const cue_arrived *one = cue_arrived_at(p, begin - l->block + place);
        out->missing[place] = !one;
        out->tag[place] = -1;
        if (one)
            out->tag[place] = (int32_t)cue_tag(p->trusted.channel, key, 2 * l->block - place,
                                               one->covered, one->bytes);
    }
}

/* E22: places of the block before that are not what was sent, as marks; -1: too many were lost. */
static int find_wrong(cue_proofs *p, int32_t begin, const cue_parities *all,
                      uint8_t wrong[LONGEST_BLOCK]) {
    const cue_proof_layout *l = cue_layout(p);
    int32_t before = begin - l->block;
    memset(wrong, 0, LONGEST_BLOCK);
    int agrees = cue_parities_agree(all, l, 2);
    if (agrees > 0) return 0;
    cue_parities some = *all;
    if (agrees < 0) { /* the first ones may never have been sent (E21) */
        for (int place = 0; place < l->block && before + place <= p->first; place++)
            some.missing[place] = 0;
        return cue_parities_agree(&some, l, 2) > 0 ? 0 : -1;
    }
    for (int place = 0; place < 2 * l->block; place++) {
        if (!cue_arrived_at(p, before + place)) continue;
        some = *all;
        if (place < l->block) {
            some.tag[place] = -1;
            some.missing[place] = 1;
        } else {
            for (int j = 0; j < l->checks; j++)
                some.check[j] = (int32_t)fields_of(p, begin, 12 * j, 12, before + place);
        }
        if (cue_parities_agree(&some, l, LOCATING) <= 0) continue;
        if (place < l->block) wrong[place] = 1;
        return 0;
    }
    for (int place = 0; place < l->block; place++) wrong[place] = all->tag[place] >= 0;
    return 0;
}

/* E24: why the superframes of two blocks are from another time, 0 if they are not. */
static uint8_t lateness(cue_proofs *p, int32_t first, int32_t stop) {
    double away_s = 0.0;
    bool timed = false;
    for (int32_t index = first; index < stop; index++) {
        const cue_arrived *one = cue_arrived_at(p, index);
        if (!one || isnan(one->utc_s)) continue;
        double age_s = one->utc_s - EPOCH_S - SUPERFRAME_S * (double)(index + p->offset);
        if (fabs(age_s) > fabs(away_s)) away_s = age_s;
        p->age_s = (float)age_s;
        timed = true;
    }
    if (!timed && p->has_clock) return CUE_PROOF_NO_TIME;
    if (!timed) away_s = SUPERFRAME_S * (double)(p->first_offset - p->offset);
    return fabs(away_s) <= p->tolerance_s ? CUE_PROOF_FINE : CUE_PROOF_OTHER_TIME;
}

static void judge(cue_arrived *one, bool agrees, uint8_t late) {
    if (agrees && !late) {
        one->agreed = 1;
        one->reason = CUE_PROOF_FINE;
    } else if (one->agreed < 1) {
        one->agreed = 0;
        one->reason = late ? late : CUE_PROOF_CHANGED;
    }
}

static void check_block(cue_proofs *p, int64_t block, const uint8_t key[KEY_BYTES]) {
    const cue_proof_layout *l = cue_layout(p);
    int32_t begin = (int32_t)(block * l->block - p->offset), before = begin - l->block;
    const cue_arrived *covered;
    cue_parities all;
    uint8_t wrong[LONGEST_BLOCK];
    bool changed = false, agreed = false, denied = false, told = false;
    uint8_t late = lateness(p, before, begin + l->block);
    int64_t quick = cue_quick(p, begin, &covered);
    if (quick >= 0) {
        changed = (int64_t)cue_tag(p->trusted.channel, key, l->block - l->quick, covered->covered,
                                   covered->bytes) != quick;
        agreed = !changed;
        if (agreed) judge(cue_arrived_at(p, begin + l->quick), true, late);
    }
    parities_of(p, begin, key, &all);
    for (int j = 0; j < l->checks; j++) told |= all.check[j] > 0; /* else nothing was before */
    if (told && find_wrong(p, begin, &all, wrong) == 0)
        for (int place = 0; place < l->block; place++) {
            if (all.tag[place] < 0) continue;
            judge(cue_arrived_at(p, before + place), !wrong[place], late);
            denied |= wrong[place];
            agreed |= !wrong[place];
        }
    if (late || changed || denied) {
        p->status = CUE_FORGED;
        p->reason = late ? late : CUE_PROOF_CHANGED;
    } else if (agreed) {
        p->status = CUE_VERIFIED;
        p->reason = CUE_PROOF_FINE;
    }
}

/* ---- Keys ---------------------------------------------------------------------------------- */

static void unlock(cue_proofs *p) {
    cue_place_restart(p, p->locked);
    p->locked = p->has_known = false;
    p->misses = 0;
}

/* Check all blocks whose keys follow from this one. */
static void learn(cue_proofs *p, const cue_known *known) {
    const cue_proof_layout *l = cue_layout(p);
    int64_t blocks = PERIOD / l->block, period = known->block / blocks;
    cue_known *latest = &p->latest[p->wide];
    cue_chain chain;
    p->known = *known;
    p->has_known = true;
    if (!p->has_latest[p->wide] || known->block > latest->block) *latest = *known;
    p->has_latest[p->wide] = true;
    cue_chain_of(&chain, p->trusted.channel, period, l->width);
    for (int64_t block = p->pending; block < p->next; block++) {
        uint8_t key[KEY_BYTES];
        if (block / blocks != period) continue;
        memcpy(key, known->key, KEY_BYTES);
        cue_chain_before(&chain, key, known->block % blocks, known->block - block);
        check_block(p, block, key);
    }
    p->pending = p->next;
}

static void lock(cue_proofs *p, const cue_known *known, int32_t begin) {
    const cue_proof_layout *l = cue_layout(p);
    int32_t oldest = p->last;
    p->offset = known->block * l->block - begin;
    if (!p->was_located) p->first_offset = p->offset;
    p->locked = p->was_located = true;
    for (int32_t i = p->last - (WAIT_BLOCKS + 1) * l->block; i < oldest; i++)
        if (cue_arrived_at(p, i)) oldest = i;
    p->pending = (oldest + p->offset) / l->block;
    p->next = known->block + 1;
    learn(p, known);
}

/* E19: 1 if the fields of a block say a key that leads to the chain, 0 if nobody's, -1 if lost. */
static int key_of(cue_proofs *p, int64_t block, int32_t begin, cue_known *found) {
    const cue_proof_layout *l = cue_layout(p);
    int64_t blocks = PERIOD / l->block, period = block / blocks, sent = cue_sent_bits(p, begin);
    if (sent < 0) return -1;
    cue_known known = {period * blocks - 1, {0}};
    memcpy(known.key, cue_end_of(p, period), KEY_BYTES);
    if (p->has_known && p->known.block / blocks == period) known = p->known;
    int64_t steps = block - known.block;
    const cue_arrived *covered = 0;
    int64_t quick = cue_quick(p, begin, &covered);
    if (steps > FAR_STEPS && quick < 0) return -1;
    cue_chain chain;
    cue_chain_of(&chain, p->trusted.channel, period, l->width);
    found->block = block;
    for (int i = 0; i < 6; i++) found->key[i] = (uint8_t)(sent >> (40 - 8 * i));
    for (uint32_t hidden = 0; hidden < 65536; hidden++) {
        if (steps > FAR_STEPS)
            hidden = cue_tag_search(p->trusted.channel, found->key, hidden, l->block - l->quick,
                                    covered->covered, covered->bytes, (uint32_t)quick);
        if (hidden == 65536) break;
        found->key[6] = (uint8_t)(hidden >> 8);
        found->key[7] = (uint8_t)hidden;
        uint8_t key[KEY_BYTES];
        memcpy(key, found->key, KEY_BYTES);
        cue_chain_before(&chain, key, block % blocks, steps);
        if (memcmp(key, known.key, KEY_BYTES) == 0) return 1;
    }
    return 0;
}

static void settle(cue_proofs *p, int64_t block) {
    const cue_proof_layout *l = cue_layout(p);
    cue_known found;
    if (block < p->trusted.first / l->block ||
        block >= (p->trusted.until + l->block - 1) / l->block) { /* E23 */
        p->status = CUE_UNKNOWN;
        p->reason = CUE_PROOF_NOT_HELD;
        return;
    }
    int right = key_of(p, block, (int32_t)(block * l->block - p->offset), &found);
    if (right > 0) {
        p->misses = 0;
        learn(p, &found);
    } else if (right == 0) {
        p->status = CUE_FORGED;
        p->reason = CUE_PROOF_NOBODYS;
        if (++p->misses >= MISSES) unlock(p);
    } else if (p->next - p->pending >= WAIT_BLOCKS) {
        p->status = CUE_UNKNOWN;
        p->reason = CUE_PROOF_NONE;
    }
}

/* ---- Taking superframes -------------------------------------------------------------------- */

static void settle_until(cue_proofs *p, int32_t index) {
    const cue_proof_layout *l = cue_layout(p);
    while (p->locked && (p->next + 1) * l->block - 1 <= index + p->offset) {
        int64_t block = p->next++;
        int64_t kept = p->next - (REMEMBERED / LONGEST_BLOCK);
        if (p->pending < kept) p->pending = kept; /* what is older was forgotten */
        settle(p, block);
    }
}

/* E29: go over to fields of another width when enough of them have come. */
static void follow_width(cue_proofs *p, int width) {
    if (width == 0 || width == cue_layout(p)->width) {
        p->others = 0;
    } else if (++p->others >= OTHERS) {
        p->wide = !p->wide;
        p->others = 0;
        unlock(p);
    }
}

void cue_proofs_add(cue_proofs *p, const cue_arrived *one) {
    int32_t index = one->index, begin;
    cue_known found;
    if (p->first < 0) p->first = index;
    p->last = index;
    p->has_clock |= !isnan(one->utc_s);
    p->arrived[(uint32_t)index % REMEMBERED] = *one;
    follow_width(p, one->width);
    settle_until(p, index);
    if (!p->locked && cue_place_look(p, index, &found, &begin)) lock(p, &found, begin);
}

/* What is to be proved of a part, and its proof (E4, E7). */
static void read_part(const uint8_t *l0, size_t bytes, cue_arrived *out) {
    bool compact = l0[0] & 0x20;
    size_t covered = compact ? bytes : bytes < 2 ? 0 : bytes - 2;
    bool is_signed = compact ? bytes >= 4 && bytes <= 12 && l0[0] & 0x10
                             : bytes >= 7 && l0[1] & 0x08;
    if (covered > COVERED) covered = COVERED;
    memcpy(out->covered, l0, covered);
    out->bytes = (uint8_t)covered;
    out->width = 0;
    if (!is_signed || l0[0] >> 6 || covered == COVERED) return;
    out->width = compact ? 2 : 9;
    unsigned last = (unsigned)out->covered[covered - 2] << 8 | out->covered[covered - 1];
    out->proof = (uint16_t)(last & ((1U << out->width) - 1U));
    out->covered[covered - 1] = compact ? out->covered[covered - 1] & 0xFC : 0;
    if (!compact) out->covered[covered - 2] &= 0xFE;
}

/* End a run: what is open of it stays as it is. */
void cue_proofs_end(cue_proofs *p) {
    if (!p->started) return;
    p->closed = p->last;
    p->run = p->last + 1;
    p->first = -1;
    unlock(p);
}

void cue_proofs_init(cue_proofs *p) {
    memset(p, 0, sizeof *p);
    for (int i = 0; i < REMEMBERED; i++) p->arrived[i].index = -1;
    p->last = p->first = p->closed = -1;
    p->wide = 1;
    p->clock_s = NAN;
    cue_place_restart(p, true);
}

/* Trust a broadcaster; 0: none. */
static void trust(cue_proofs *p, const cue_announcement *trusted, double tolerance_s) {
    if (!trusted || memcmp(trusted->key, p->trusted.key, sizeof trusted->key) != 0)
        cue_proofs_init(p); /* what was learnt holds for one broadcaster (E17, E27) */
    p->trusting = trusted != 0;
    if (trusted) p->trusted = *trusted;
    p->tolerance_s = tolerance_s;
}

void cue_proofs_reset(cue_proofs *p) {
    cue_proofs_end(p);
    p->started = false;
    p->bare = 0;
    p->report = p->closed + 1;
    p->clock_s = NAN;
}

void cue_proofs_take(cue_proofs *p, const uint8_t *l0, size_t bytes, double on_air_s) {
    if (!p->trusting || bytes == 0) return;
    double away = p->started ? (on_air_s - p->base_s) / SUPERFRAME_S : 0.0;
    if (!(fabs(away) < 1e8)) return;
    int32_t index = (int32_t)nearbyint(away);
    double error_s = SUPERFRAME_S * (away - index);
    if (p->started && fabs(error_s) < OFF_GRID_S && index - p->last <= LONGEST_GAP &&
        p->last - index <= LONGEST_GAP) {
        p->base_s += 0.05 * error_s; /* clocks of sender and receiver drift */
    } else { /* indices go on, so that times can be compared */
        cue_proofs_end(p);
        index = p->started && index > p->last ? index : p->last + 1;
        p->base_s = on_air_s - SUPERFRAME_S * index;
        p->started = true;
    }
    if (index <= p->last) return;
    cue_arrived one = {.index = index, .agreed = -1, .utc_s = NAN, .time_s = on_air_s};
    read_part(l0, bytes, &one);
    if (fabs(on_air_s - p->clock_s) < CLOCK_HOLDS_S)
        one.utc_s = p->clock_utc_s + (on_air_s - p->clock_s);
    p->bare = one.width ? 0 : p->bare + 1;
    p->was_signed |= one.width > 0;
    p->tell_unsigned |= p->bare == UNSIGNED; /* E26 */
    p->unsigned_s = on_air_s;
    cue_proofs_add(p, &one);
}

/* ---- Verdicts ------------------------------------------------------------------------------ */

cue_status cue_proofs_next(cue_proofs *p, cue_event *event) {
    cue_proof *out = &event->of.proof;
    event->kind = CUE_EVENT_PROOF;
    memcpy(out->of, p->trusted.key, sizeof out->of);
    out->age_s = p->age_s;
    if (p->tell_unsigned) {
        p->tell_unsigned = false;
        event->time_s = p->unsigned_s;
        out->status = p->status = CUE_UNSIGNED;
        out->reason = p->reason = p->was_signed ? CUE_PROOF_DOWNGRADED : CUE_PROOF_NONE;
        return CUE_OK;
    }
    /* As soon as they are known: the ones before the first whole block may have to wait for E22. */
    int32_t sure = p->last - WAIT_BLOCKS * cue_layout(p)->block;
    if (p->report < p->last - REMEMBERED + 1) p->report = p->last - REMEMBERED + 1;
    for (int32_t i = p->report; p->trusting && i <= p->last; i++) {
        cue_arrived *one = &p->arrived[(uint32_t)i % REMEMBERED];
        bool done = one->index != i || one->reported;
        bool due = !done && (one->agreed >= 0 || i <= sure || i <= p->closed);
        if (i == p->report && (done || due)) p->report++;
        if (!due) continue;
        one->reported = true;
        event->time_s = one->time_s;
        out->status = one->agreed < 0 ? CUE_UNKNOWN : one->agreed ? CUE_VERIFIED : CUE_FORGED;
        out->reason = one->reason;
        p->verified += one->agreed == 1;
        p->forged += one->agreed == 0;
        return CUE_OK;
    }
    return CUE_EMPTY;
}

/* ---- The receiver's side --------------------------------------------------------------------- */

cue_status cue_payload_trust(cue_payload *payload, const void *announcement, size_t bytes,
                             double tolerance_s, cue_verify verify, void *context) {
    static const cue_rule rules[] = {RULE_NONE, RULE_E15, RULE_E16, RULE_E18};
    cue_announcement read;
    if (!announcement) {
        trust(&payload->proofs, 0, 0.0);
        return CUE_OK;
    }
    if (!(tolerance_s > 0.0 && tolerance_s < 1e6)) return CUE_BAD_ARGUMENT;
    memset(&read, 0, sizeof read);
    payload->broken = rules[cue_announcement_read(announcement, bytes, verify, context, &read)];
    if (payload->broken != RULE_NONE) return CUE_BAD_DATA;
    uint8_t digest[32];
    cue_sha256(read.key, sizeof read.key, digest); /* E9 */
    memcpy(read.channel, digest, sizeof read.channel);
    trust(&payload->proofs, &read, tolerance_s);
    return CUE_OK;
}

void cue_payload_clock(cue_payload *payload, double time_s, double utc_s) {
    payload->proofs.clock_s = time_s;
    payload->proofs.clock_utc_s = utc_s;
}

void cue_payload_diagnose(const cue_payload *payload, cue_diagnosis *diagnosis) {
    const cue_proofs *p = &payload->proofs;
    diagnosis->proofs = p->verified;
    diagnosis->forged = p->forged;
    diagnosis->age_s = p->age_s;
    diagnosis->authenticity = p->status;
    diagnosis->proof_reason = p->reason;
}
