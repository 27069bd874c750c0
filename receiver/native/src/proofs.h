/* proofs.h - private types of authentication: who speaks in the superframes that arrive.
 *
 * announcement.c reads whom to trust, chain.c has the keys, tags and checks, place.c finds where a
 * stream stands in its period, proofs.c remembers what arrived and gives verdicts.
 * Specification: spec/authentication.md; "public number" as in E2. */
#ifndef CUE_PROOFS_H
#define CUE_PROOFS_H

#include "internal.h"

#include <stdbool.h>

enum {
    PERIOD = 4147200,     /* superframes, E3 */
    MOST_PERIODS = 357,   /* thirty years */
    KEY_BYTES = 8,
    COVERED = 32,         /* bytes of a superframe that can be proved */
    LONGEST_BLOCK = 96,
    MOST_CHECKS = 10,
    WAIT_BLOCKS = 5,      /* E22 */
    REMEMBERED = 1024     /* superframes: more than WAIT_BLOCKS + 2 blocks */
};

typedef struct cue_sha512 {
    uint64_t h[8], bytes;
    uint8_t block[128];
} cue_sha512;

void cue_sha512_begin(cue_sha512 *sha);
void cue_sha512_add(cue_sha512 *sha, const uint8_t *data, size_t bytes);
void cue_sha512_end(cue_sha512 *sha, uint8_t digest[64]);
void cue_sha256(const uint8_t *data, size_t bytes, uint8_t digest[32]);

/* ---- Announcement (section 5) ----------------------------------------------------------- */

typedef struct cue_announcement {
    int64_t first, until;      /* public numbers */
    uint8_t key[32], channel[8];
    uint8_t ends[2][MOST_PERIODS][KEY_BYTES]; /* of width 2, of width 9 */
} cue_announcement;

typedef enum cue_trusted { TRUST_FINE, TRUST_MALFORMED, TRUST_SIGNATURE, TRUST_FIRST_EDITION } cue_trusted;

cue_trusted cue_announcement_read(const void *file, size_t bytes, cue_verify verify, void *context,
                                  cue_announcement *out);

/* ---- Keys, tags, checks (sections 2 to 4) ----------------------------------------------- */

typedef struct cue_proof_layout {
    int width, block, checks, quick; /* quick: place that the quick tag covers, E6 */
} cue_proof_layout;

extern const cue_proof_layout cue_proof_layouts[2]; /* widths 2 and 9 */

/* The key of a block: its number on the public clock, which is period * blocks + place. */
typedef struct cue_known {
    int64_t block;
    uint8_t key[KEY_BYTES];
} cue_known;

/* E10: what separates a period's steps from all others. */
typedef struct cue_chain {
    uint8_t prefix[32];
} cue_chain;

void cue_chain_of(cue_chain *chain, const uint8_t channel[8], int64_t period, int width);
/* The key `steps` blocks before that of the block at `place` of the period. */
void cue_chain_before(const cue_chain *chain, uint8_t key[KEY_BYTES], int64_t place, int64_t steps);
/* E11 */
uint32_t cue_tag(const uint8_t channel[8], const uint8_t key[KEY_BYTES], int distance,
                 const uint8_t *covered, size_t bytes);
/* The hidden bits from `from` on under which a superframe has a tag; 65536 if there are none. */
uint32_t cue_tag_search(const uint8_t channel[8], uint8_t key[KEY_BYTES], uint32_t from,
                        int distance, const uint8_t *covered, size_t bytes, uint32_t tag);

/* What arrived of a block: checks by number, -1 for a lost one; tags by place, -1 likewise. */
typedef struct cue_parities {
    int32_t check[MOST_CHECKS], tag[LONGEST_BLOCK];
    uint8_t missing[LONGEST_BLOCK]; /* places that count as lost; others without a tag as not sent */
} cue_parities;

/* E21: 1 agree, 0 disagree, -1 too few are left over. */
int cue_parities_agree(const cue_parities *found, const cue_proof_layout *layout, int spare);

/* ---- A stream --------------------------------------------------------------------------- */

typedef struct cue_arrived {
    int32_t index;
    uint8_t covered[COVERED], bytes, width, reason; /* width of its proof, 0: none */
    uint16_t proof;
    int8_t agreed;       /* -1 not compared */
    bool reported;       /* an event has said whose it is */
    double utc_s, time_s; /* arrival by a clock, NaN without; on the receiver's own clock */
} cue_arrived;

/* A scan of all blocks of an announcement for two keys in a row (E20). */
typedef struct cue_scan {
    int32_t begin;       /* index of the later key's block */
    uint8_t key[KEY_BYTES], earlier[KEY_BYTES];
    int64_t next, stop;  /* block numbers still to be tried */
} cue_scan;

typedef struct cue_proofs {
    bool trusting, started, locked, was_located, has_clock;
    uint8_t wide;        /* 1: fields of width 9 */
    cue_announcement trusted;
    double tolerance_s;
    /* the grid of superframes, and how far it was read */
    double base_s, clock_s, clock_utc_s;
    int32_t last, first, run, report, closed; /* indices; before `report` all were reported */
    int bare, others, misses;
    cue_arrived arrived[REMEMBERED];
    /* place in the period */
    int64_t offset, first_offset; /* public number less index */
    int64_t pending, next;        /* blocks whose key is not known yet: pending .. next - 1 */
    bool has_known, has_latest[2];
    cue_known known, latest[2];
    /* search */
    int tried, guesses;
    int64_t hashes;
    struct { int32_t begin; uint8_t key[KEY_BYTES]; } guess[LONGEST_BLOCK];
    cue_scan scan;
    /* what is said */
    bool was_signed, tell_unsigned;
    double unsigned_s;
    uint8_t status, reason;       /* of the stream: cue_authenticity, cue_proof_reason */
    float age_s;
    uint32_t verified, forged;
} cue_proofs;

cue_arrived *cue_arrived_at(cue_proofs *proofs, int32_t index);
const cue_proof_layout *cue_layout(const cue_proofs *proofs);
int64_t cue_sent_bits(cue_proofs *proofs, int32_t begin);
/* The quick tag and what it covers; -1 if one of them was lost. */
int64_t cue_quick(cue_proofs *proofs, int32_t begin, const cue_arrived **covered);
/* The end of a period's chain. */
const uint8_t *cue_end_of(const cue_proofs *proofs, int64_t period);

/* E20: look whether the superframes up to an index end a block of the broadcaster's. */
bool cue_place_look(cue_proofs *proofs, int32_t index, cue_known *found, int32_t *begin);
void cue_place_restart(cue_proofs *proofs, bool found);

void cue_proofs_init(cue_proofs *proofs);
void cue_proofs_reset(cue_proofs *proofs);
void cue_proofs_take(cue_proofs *proofs, const uint8_t *l0, size_t bytes, double on_air_s);
/* A superframe that has been read: what its proof covers, its field of `width` bits. */
void cue_proofs_add(cue_proofs *proofs, const cue_arrived *one);
void cue_proofs_end(cue_proofs *proofs);
cue_status cue_proofs_next(cue_proofs *proofs, cue_event *event);

#endif
