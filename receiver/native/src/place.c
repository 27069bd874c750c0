/* place.c
 * In: superframes whose place in the broadcaster's period is not known. Out: the first key that
 * leads to his chain, and so the public number of each superframe, at a bounded cost.
 * Source: one function for each step tells a block by one hash (Kogan and others 2017).
 * Specification: spec/authentication.md, section 6 (E20, E28). */
#include "proofs.h"

#include <math.h>
#include <string.h>

#define EPOCH_S 1767225600.0 /* E2 */
#define SUPERFRAME_S 0.64

enum {
    FIRST_HASHES = 1 << 23,  /* that a stream may cost to be compared with chains */
    MORE_HASHES = 1 << 12,   /* and with each superframe */
    SCAN_HASHES = 1 << 16,   /* of these at once: as many as a try costs */
    CANDIDATES = 2,          /* keys of a block: the first is a wrong one once in 512 blocks */
    DIRECT = 2               /* blocks by the clock whose whole chain is computed for one key */
};

typedef struct span {
    int64_t first, stop;
    double now; /* the likeliest, as a number of blocks */
} span;

static int64_t least(int64_t a, int64_t b) { return a < b ? a : b; }

static int64_t most(int64_t a, int64_t b) { return a > b ? a : b; }

/* Blocks that end while the announcement holds. */
static span held_blocks(const cue_proofs *p) {
    int64_t length = cue_layout(p)->block;
    return (span){p->trusted.first / length, (p->trusted.until + length - 1) / length, 0.0};
}

static bool afford(cue_proofs *p, int64_t hashes) {
    if (hashes > p->hashes) return false;
    p->hashes -= hashes;
    return true;
}

/* Blocks that the one which begins here may be by the clock; false without a clock. */
static bool by_clock(cue_proofs *p, int32_t begin, span *out) {
    int length = cue_layout(p)->block;
    double away = p->tolerance_s / SUPERFRAME_S;
    for (int32_t index = begin; index < begin + length; index++) {
        const cue_arrived *one = cue_arrived_at(p, index);
        if (!one || isnan(one->utc_s)) continue;
        double now = (one->utc_s - EPOCH_S) / SUPERFRAME_S - (index - begin);
        span held = held_blocks(p);
        if (!(fabs(now) < 1e12)) return false;
        *out = (span){most(held.first, (int64_t)ceil((now - away) / length)),
                      least(held.stop, (int64_t)floor((now + away) / length) + 1), now / length};
        return true;
    }
    return false;
}

/* E10, E19: whether a key leads to the latest one known of its period, or to the period's end. */
static bool leads(cue_proofs *p, const cue_known *found) {
    const cue_proof_layout *l = cue_layout(p);
    int64_t blocks = PERIOD / l->block, period = found->block / blocks;
    int64_t first = period * blocks;
    cue_known late = *found, early = {first - 1, {0}};
    const cue_known *latest = &p->latest[p->wide];
    memcpy(early.key, cue_end_of(p, period), KEY_BYTES);
    if (p->has_latest[p->wide] && latest->block / blocks == period) {
        early = latest->block < found->block ? *latest : *found;
        late = latest->block < found->block ? *found : *latest;
    }
    int64_t steps = late.block - early.block;
    if (!afford(p, steps)) return false;
    cue_chain chain;
    cue_chain_of(&chain, p->trusted.channel, period, l->width);
    cue_chain_before(&chain, late.key, late.block - first, steps);
    return memcmp(late.key, early.key, KEY_BYTES) == 0;
}

/* Go on with a scan, `most` blocks of it at most: whether a key that leads to the chain was found. */
static bool go_on(cue_proofs *p, int64_t at_most, cue_known *found) {
    const cue_proof_layout *l = cue_layout(p);
    cue_scan *s = &p->scan;
    int64_t blocks = PERIOD / l->block, period = -1;
    cue_chain chain;
    for (; s->next < s->stop && at_most > 0; at_most--) {
        int64_t block = s->next++;
        uint8_t key[KEY_BYTES];
        if (block / blocks != period) {
            period = block / blocks;
            cue_chain_of(&chain, p->trusted.channel, period, l->width);
        }
        if (block % blocks == 0) continue;
        memcpy(key, s->key, KEY_BYTES);
        cue_chain_before(&chain, key, block % blocks, 1);
        if (memcmp(key, s->earlier, KEY_BYTES) != 0) continue;
        found->block = block;
        memcpy(found->key, s->key, KEY_BYTES);
        if (leads(p, found)) return true;
    }
    return false;
}

void cue_place_restart(cue_proofs *p, bool found) {
    p->guesses = 0;
    p->scan.next = p->scan.stop = 0;
    if (!found) return;
    p->tried = 0;
    p->hashes = FIRST_HASHES;
}

/* The nth key that may be that of the block which begins here, 0 if there are not as many. */
static const uint8_t *guess_at(const cue_proofs *p, int32_t begin, int nth) {
    for (int i = 0; i < p->guesses; i++)
        if (p->guess[i].begin == begin && nth-- == 0) return p->guess[i].key;
    return 0;
}

static void forget_guesses(cue_proofs *p, int32_t before) {
    int kept = 0;
    for (int i = 0; i < p->guesses; i++)
        if (p->guess[i].begin >= before) p->guess[kept++] = p->guess[i];
    p->guesses = kept;
}

static void keep_guess(cue_proofs *p, int32_t begin, const uint8_t key[KEY_BYTES]) {
    if (p->guesses == LONGEST_BLOCK) p->guesses--;
    p->guess[p->guesses].begin = begin;
    memcpy(p->guess[p->guesses++].key, key, KEY_BYTES);
}

/* Whether a key leads to the chain, alone by the clock, or after one of the block before. */
static bool is_placed(cue_proofs *p, int32_t begin, const span *clock, cue_known *found) {
    for (int i = 0; clock && i < DIRECT; i++) { /* the nearest block, then the next nearest */
        int64_t nearest = (int64_t)nearbyint(clock->now);
        int64_t block = i == 0 ? nearest : nearest + (clock->now > (double)nearest ? 1 : -1);
        if (block < clock->first || block >= clock->stop) continue;
        found->block = block;
        if (leads(p, found)) return true;
    }
    const uint8_t *earlier;
    span all = held_blocks(p);
    for (int nth = 0; (earlier = guess_at(p, begin - cue_layout(p)->block, nth)); nth++) {
        p->scan.begin = begin;
        memcpy(p->scan.key, found->key, KEY_BYTES);
        memcpy(p->scan.earlier, earlier, KEY_BYTES);
        for (int i = clock ? 0 : 1; i < 2; i++) {
            p->scan.next = i ? all.first : clock->first;
            p->scan.stop = i ? all.stop : clock->stop;
            if (p->scan.next >= p->scan.stop) continue;
            if (!afford(p, p->scan.stop - p->scan.next)) p->scan.next = p->scan.stop;
            else if (go_on(p, SCAN_HASHES, found)) return true;
        }
        if (p->scan.next < p->scan.stop) return false; /* it goes on with the next superframe */
    }
    return false;
}

bool cue_place_look(cue_proofs *p, int32_t index, cue_known *found, int32_t *at) {
    static const int strides[3] = {1, 7, 23}; /* E28: none shares a factor with a block */
    const cue_proof_layout *l = cue_layout(p);
    int32_t begin = index - l->block + 1;
    span clock = {0, 0, 0.0};
    bool timed = by_clock(p, begin, &clock);
    p->hashes = least(p->hashes + MORE_HASHES, FIRST_HASHES);
    if (p->scan.next < p->scan.stop) {
        *at = p->scan.begin;
        if (cue_arrived_at(p, p->scan.begin)) return go_on(p, SCAN_HASHES, found);
        p->scan.next = p->scan.stop;
    }
    int step = (p->tried >= 4 * l->block) + (p->tried >= 16 * l->block);
    if (timed && clock.first >= clock.stop && step < 1) step = 1;
    if (index % strides[step] && !guess_at(p, begin - l->block, 0)) return false;
    const cue_arrived *covered;
    int64_t sent = cue_sent_bits(p, begin), quick = cue_quick(p, begin, &covered);
    if (sent < 0 || quick < 0) return false;
    p->tried++;
    for (int i = 0; i < 6; i++) found->key[i] = (uint8_t)(sent >> (40 - 8 * i));
    *at = begin;
    forget_guesses(p, begin - l->block);
    uint32_t hidden = 0;
    for (int i = 0; i < CANDIDATES && p->scan.next >= p->scan.stop; i++, hidden++) {
        hidden = cue_tag_search(p->trusted.channel, found->key, hidden, l->block - l->quick,
                                covered->covered, covered->bytes, (uint32_t)quick);
        if (hidden == 65536) break;
        keep_guess(p, begin, found->key);
        if (is_placed(p, begin, timed ? &clock : 0, found)) return true;
    }
    return false;
}
