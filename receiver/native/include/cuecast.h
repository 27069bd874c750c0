/* cuecast.h - the receiver of Cuecast for televisions, phones and web pages.
 *
 * Sound of a programme in, cues of a virtual French Cued Speech interpreter out. Portable C11
 * without dependencies: no allocation, no files, no clock, no threads, no global state.
 *
 *   sound, any rate and block size (or a stream file)
 *     -> superframe every 0.64 s  | L0: 7, 12 or 20 bytes | L1: 0, 7 or 36 bytes |
 *     -> keys (hand shape and placement), phones, motion parameters, markers, previews, proofs
 *
 * Example: keys of a programme in stereo at 48 kHz (examples/keys.c is the same text).
 *
 *     #include "cuecast.h"
 *     #include <stdio.h>
 *     #include <stdlib.h>
 *
 *     static void show(cue_state *cue) {
 *         cue_event event = {.size = sizeof event};
 *         while (cue_next(cue, &event) == CUE_OK)
 *             if (event.kind == CUE_EVENT_KEY && event.of.key.final)
 *                 printf("%.2f s shape %d placement %d\n", event.time_s, event.of.key.shape,
 *                        event.of.key.placement);
 *     }
 *
 *     int main(int argc, char **argv) {
 *         static unsigned char voice[300000];
 *         FILE *file = argc > 1 ? fopen(argv[1], "rb") : NULL;
 *         size_t frames, bytes = file ? fread(voice, 1, sizeof voice, file) : 0;
 *         cue_config config = cue_default_config(48000, 2);
 *         cue_state *cue = malloc(cue_size(&config));
 *         if (!cue || cue_init(cue, cue_size(&config), &config) != CUE_OK) return 2;
 *         if (cue_voice(cue, voice, bytes) != CUE_OK) return 3;
 *         float block[2 * 480];
 *         while ((frames = fread(block, 2 * sizeof(float), 480, stdin)) > 0) {
 *             if (cue_push(cue, block, frames) != CUE_OK) return 2;
 *             show(cue);
 *         }
 *         if (cue_flush(cue) != CUE_OK) return 2;
 *         show(cue);
 *         free(cue);
 *         return 0;
 *     }
 *
 * Memory. The caller owns one block of cue_size(config) bytes, aligned for double, from cue_init
 * to the last call; the library never allocates or frees. The block holds no pointers: a copy of
 * its bytes is an independent receiver that continues from the same point.
 * Threads. Functions on different blocks may run at the same time; two functions on the same block
 * may not. cue_push does bounded work per sample; call it where a block of sound may take a few
 * milliseconds (a worker), not in a device's audio interrupt.
 * Times. time_s counts seconds of pushed sound from the first sample on.
 * Documents: spec/audio-carrier.md (W), spec/bitstream.md (G H R J P), spec/authentication.md (E).
 */
#ifndef CUECAST_H
#define CUECAST_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#if defined(__GNUC__)
#define CUE_MUST_CHECK __attribute__((warn_unused_result))
#define CUE_NONNULL(...) __attribute__((nonnull(__VA_ARGS__)))
#else
#define CUE_MUST_CHECK
#define CUE_NONNULL(...)
#endif

/* ---- Version ---------------------------------------------------------------------------- */

/* Interface version: 1000000 major + 1000 minor + patch. */
#define CUE_VERSION 1000
/* Version of the bit stream that this receiver reads (H2). */
#define CUE_FORMAT 4

/* CUE_VERSION of the compiled library: compare it with the header's. */
uint32_t cue_version(void);

/* ---- Limits ----------------------------------------------------------------------------- */

enum {
    CUE_LEAST_RATE_HZ = 22050,
    CUE_LARGEST_RATE_HZ = 96000,
    CUE_MOST_CHANNELS = 8,
    CUE_L0_MOST = 20,      /* bytes of the first class, W39 */
    CUE_L1_MOST = 36,      /* bytes of the second class, W39 */
    CUE_TICKS = 32,        /* frames of motion in a superframe, 20 ms each, G3 */
    CUE_PARAMETERS = 31,   /* parameters of a frame of motion */
    CUE_MARKERS = 113      /* most markers of a voice */
};

/* ---- Status ----------------------------------------------------------------------------- */

typedef enum cue_status {
    CUE_OK = 0,
    CUE_EMPTY = 1,           /* no event is waiting; not an error */
    CUE_BAD_ARGUMENT = -1,   /* a value is outside its limits; see cue_explain */
    CUE_NO_MEMORY = -2,      /* the block is smaller than cue_size or not aligned */
    CUE_BAD_STATE = -3,      /* the block was not made by cue_init of this version */
    CUE_BAD_DATA = -4,       /* a voice file, score or proof is malformed */
    CUE_NO_VOICE = -5,       /* the call needs cue_voice first, or another voice */
    CUE_FULL = -6            /* events were not collected: call cue_next until CUE_EMPTY */
} cue_status;

/* ---- Life ------------------------------------------------------------------------------- */

/* Opaque: the caller's block. */
typedef struct cue_state cue_state;

typedef struct cue_config {
    size_t size;           /* sizeof(cue_config), set by cue_default_config */
    uint32_t rate_hz;      /* CUE_LEAST_RATE_HZ..CUE_LARGEST_RATE_HZ */
    uint32_t channels;     /* 1..CUE_MOST_CHANNELS; order of W5: L R C LFE Ls Rs; 7 and 8 ignored */
    uint64_t key;          /* key of the watermark, 0 unless agreed (W10) */
    double start_s;        /* time_s of the first sample pushed */
    uint32_t markers;      /* 1: emit CUE_EVENT_MARKERS for each frame (needs a voice) */
    uint32_t history;      /* 1: emit superframes that were on air before the first lock, too */
} cue_config;

/* Configuration with key 0, start 0, no markers, history on. */
cue_config cue_default_config(uint32_t rate_hz, uint32_t channels);

/* Bytes that the block of a receiver needs; 0 if the configuration is invalid. */
size_t cue_size(const cue_config *config) CUE_NONNULL(1);

/* Prepare a block. Errors: CUE_BAD_ARGUMENT, CUE_NO_MEMORY. Takes some 10 ms. */
CUE_MUST_CHECK cue_status cue_init(void *memory, size_t bytes, const cue_config *config)
    CUE_NONNULL(1, 3);

/* Forget the sound (a seek, another channel): the next sample has the time start_s. What was
 * learnt about voice and trust stays. Events that wait are dropped. */
CUE_MUST_CHECK cue_status cue_reset(cue_state *cue, double start_s) CUE_NONNULL(1);

/* ---- Sound in --------------------------------------------------------------------------- */

/* Take the next `frames` samples of every channel, interleaved, full scale 1. Any number; the
 * events do not depend on how sound is cut into blocks. Not-a-number and infinite samples count as
 * silence. The samples are not used after the call. At most 1 s of sound per call gives room for
 * all its events; CUE_FULL means that events were lost because none were collected. */
CUE_MUST_CHECK cue_status cue_push(cue_state *cue, const float *samples, size_t frames)
    CUE_NONNULL(1);

/* The same from one array per channel, as an AudioWorklet has them. */
CUE_MUST_CHECK cue_status cue_push_planar(cue_state *cue, const float *const *channels,
                                          size_t frames) CUE_NONNULL(1);

/* The same from interleaved 16-bit samples. */
CUE_MUST_CHECK cue_status cue_push_s16(cue_state *cue, const int16_t *samples, size_t frames)
    CUE_NONNULL(1);

/* The programme is over: read what its end still completes. Only cue_next, cue_reset and the
 * diagnosis may follow. */
CUE_MUST_CHECK cue_status cue_flush(cue_state *cue) CUE_NONNULL(1);

/* ---- Events out ------------------------------------------------------------------------- */

typedef enum cue_event_kind {
    CUE_EVENT_STATE = 1,      /* reception changed */
    CUE_EVENT_SUPERFRAME = 2, /* payload bytes as received: for recorders and tests */
    CUE_EVENT_LOST = 3,       /* a superframe did not arrive */
    CUE_EVENT_PHONE = 4,      /* a phone of the score */
    CUE_EVENT_KEY = 5,        /* a key: hand shape and placement */
    CUE_EVENT_PREVIEW = 6,    /* a key that will follow, announced ahead */
    CUE_EVENT_MOTION = 7,     /* parameters of one frame */
    CUE_EVENT_MARKERS = 8,    /* marker positions of one frame */
    CUE_EVENT_PROOF = 9,      /* whose a superframe was */
    CUE_EVENT_UNREADABLE = 10 /* another voice or format version */
} cue_event_kind;

typedef enum cue_reception {
    CUE_SEARCHING = 0, /* nothing found yet */
    CUE_LOCKED = 1,    /* superframes arrive */
    CUE_DEGRADED = 2,  /* some are missing */
    CUE_LOST = 3,      /* the mark was there and is gone */
    CUE_ENDED = 4      /* cue_flush was called */
} cue_reception;

/* A superframe as the carrier delivered it. */
typedef struct cue_superframe {
    uint64_t index;         /* counts superframe positions since the lock of this stream */
    double time_s;          /* start of its on-air span */
    double start_samples;   /* the same in samples at the input's rate since cue_init/cue_reset */
    uint32_t epoch;         /* grows where the grid of superframes breaks (splice, new lock) */
    uint8_t profile;        /* number of the profile (W39) */
    uint8_t l0_bytes;       /* 0: L0's check failed and the superframe is lost */
    uint8_t l1_bytes;       /* 0: no L1, or its check failed */
    uint8_t late;           /* 1: read from sound before the lock */
    float confidence;       /* 0..1, mean agreement of cells with the decoded bits */
    float error_rate;       /* share of wrong coded bits before correction, 0..1 */
    uint8_t l0[CUE_L0_MOST];
    uint8_t l1[CUE_L1_MOST];
} cue_superframe;

typedef struct cue_lost {
    uint64_t index;  /* of cue_superframe */
    uint32_t epoch;
    uint32_t count;  /* superframes in a row, this one included */
} cue_lost;

typedef struct cue_phone {
    double duration_s;
    uint8_t phone;   /* G4 */
    uint8_t final;   /* 1: nothing of it will change */
} cue_phone;

typedef struct cue_key {
    double duration_s;
    uint8_t shape;     /* 0..8, G4 */
    uint8_t placement; /* 0 rest, 1 side, 2 mouth, 3 chin, 4 cheek, 5 throat; G4 */
    uint8_t final;     /* 1: nothing of it will change */
    uint8_t option;    /* bits of the score's options and overrides */
    uint8_t previewed; /* 1: known from a preview only */
    uint8_t phones[2]; /* G4; 0: none */
    uint32_t revision; /* a higher one replaces the key of the same time; duration_s 0 removes it */
} cue_key;

typedef struct cue_motion {
    uint32_t revision;   /* a frame with a higher one replaces those of the same time (P11, J4) */
    uint32_t count;      /* parameters of this voice, CUE_PARAMETERS at most */
    uint8_t layers;      /* bit 0: L0, bit 1: L1; 0 where the frame is concealment */
    float values[CUE_PARAMETERS];
} cue_motion;

typedef struct cue_markers {
    uint32_t revision;
    uint32_t count;                    /* markers of the voice */
    float place_mm[CUE_MARKERS][3];
} cue_markers;

/* Whose a superframe is (section 6 of spec/authentication.md), stated as soon as it is known: up to a
 * minute late, and not in order. */
typedef enum cue_authenticity {
    CUE_UNKNOWN = 0,  /* too much was lost, or it is another broadcaster's */
    CUE_VERIFIED = 1, /* it is the trusted broadcaster's, and as old as age_s says */
    CUE_FORGED = 2,   /* it is not, or is from another time */
    CUE_UNSIGNED = 3  /* four in a row carry no proof, E26 */
} cue_authenticity;

typedef enum cue_proof_reason {
    CUE_PROOF_FINE = 0,
    CUE_PROOF_CHANGED = 1,    /* changed on its way */
    CUE_PROOF_OTHER_TIME = 2, /* older than the tolerance, E24 */
    CUE_PROOF_NO_TIME = 3,    /* a clock was given, but none when these arrived */
    CUE_PROOF_NOBODYS = 4,    /* keys that are not the broadcaster's, E19 */
    CUE_PROOF_NONE = 5,       /* no proofs arrive */
    CUE_PROOF_NOT_HELD = 6,   /* outside of the announcement's dates, E23 */
    CUE_PROOF_DOWNGRADED = 7  /* signed superframes were replaced by unsigned ones, E26 */
} cue_proof_reason;

typedef struct cue_proof {
    uint8_t status;      /* cue_authenticity of the superframe on air at time_s */
    uint8_t reason;      /* cue_proof_reason */
    uint8_t of[16];      /* first bytes of the broadcaster's public key */
    float age_s;         /* arrival less the time on air, of the last one checked; 0 without a clock */
} cue_proof;

typedef struct cue_unreadable {
    uint16_t identity;   /* number of the other coding (H5), 0 if unknown */
    uint8_t version;     /* code of the other version (H2), 0 if it is this one */
} cue_unreadable;

typedef struct cue_event {
    size_t size;          /* sizeof(cue_event), set by the caller before cue_next */
    cue_event_kind kind;
    double time_s;
    union {
        cue_reception state;
        cue_superframe superframe;
        cue_lost lost;
        cue_phone phone;
        cue_key key;
        cue_key preview;
        cue_motion motion;
        cue_markers markers;
        cue_proof proof;
        cue_unreadable unreadable;
    } of;
} cue_event;

/* Take the oldest event that waits. CUE_EMPTY if there is none; CUE_BAD_ARGUMENT if event->size is
 * not sizeof(cue_event). The event is a copy and stays valid. */
CUE_MUST_CHECK cue_status cue_next(cue_state *cue, cue_event *event) CUE_NONNULL(1, 2);

/* sizeof(cue_event), for hosts that cannot read this header. */
size_t cue_event_size(void);

/* ---- Stream files ----------------------------------------------------------------------- */

/* Where a programme's sound cannot be heard, its stream file (.cue, spec/bitstream.md, section 8)
 * may lie beside it. A receiver reads it in place of sound, and gives the same events. */
typedef struct cue_file_info {
    size_t size;           /* sizeof(cue_file_info), set by the caller */
    double start_s;        /* of the motion, seconds of the programme */
    double duration_s;
    uint32_t superframes;  /* that cue_file_read decodes; a score may go on behind them */
} cue_file_info;

/* Check a whole file and stand before its first superframe. Sound and events that wait are dropped;
 * cue_push is refused until cue_reset. A file can be opened any number of times.
 * Errors: CUE_NO_VOICE (none is loaded, or the file is of another one), CUE_BAD_DATA (F1 to F10;
 * cue_explain names the paragraph). */
CUE_MUST_CHECK cue_status cue_file_open(cue_state *cue, const void *file, size_t bytes,
                                        cue_file_info *info) CUE_NONNULL(1, 2, 4);

/* Decode the next superframe (0.64 s); its events wait in cue_next, with times of the programme.
 * CUE_EMPTY after the last. The same bytes must be given again; the library keeps no pointer to
 * them. Files are read forwards, as each superframe builds on those before. */
CUE_MUST_CHECK cue_status cue_file_read(cue_state *cue, const void *file, size_t bytes)
    CUE_NONNULL(1, 2);

/* ---- Voice and trust -------------------------------------------------------------------- */

/* Load voice and tables from a file made by `cuecast voice export`. The block keeps a copy, so the
 * bytes may be freed. Without a voice superframes arrive, but no keys and no motion.
 * Errors: CUE_BAD_DATA (digest, version, lengths). */
CUE_MUST_CHECK cue_status cue_voice(cue_state *cue, const void *file, size_t bytes)
    CUE_NONNULL(1, 2);

/* Verify an Ed25519 signature (RFC 8032) with the host's library: 1 if it is right, else 0. */
typedef int (*cue_verify)(void *context, const uint8_t signature[64], const uint8_t key[32],
                          const uint8_t *message, size_t bytes);

/* Trust the broadcaster of an announcement: his public file, JSON of spec/authentication.md, E15.
 * Its signature is checked here, by `verify` or, if that is NULL, by the library's own function
 * (built with CUE_NO_ED25519 it has none). Another file of the same key continues the first; NULL
 * trusts none. Superframes then give CUE_EVENT_PROOF. `tolerance_s`: how far arrival may be from the
 * time on air: 10 for a broadcast, 60 for segments by HTTP (E25).
 * Errors: CUE_BAD_ARGUMENT (tolerance), CUE_BAD_DATA (E15, E16, E18; see cue_explain). */
CUE_MUST_CHECK cue_status cue_trust(cue_state *cue, const void *announcement, size_t bytes,
                                    double tolerance_s, cue_verify verify, void *context)
    CUE_NONNULL(1);

/* Say what a clock that is trusted shows: the next sample to be pushed arrives at utc_s, seconds since
 * 1970. Say it at least every 5 s of sound; without, replays are not noticed (E24). */
CUE_MUST_CHECK cue_status cue_clock(cue_state *cue, double utc_s) CUE_NONNULL(1);

/* ---- Diagnosis -------------------------------------------------------------------------- */

typedef struct cue_diagnosis {
    size_t size;                 /* sizeof(cue_diagnosis), set by the caller */
    cue_reception state;
    uint32_t rate_hz;            /* as configured */
    double heard_s;              /* sound pushed since cue_init or cue_reset */
    float level_dbfs[CUE_MOST_CHANNELS]; /* mean square of the last second; -200: silence */
    float pilots;                /* best pilot score of the search, standard deviations of noise;
                                    above 4.8 a place is tried (W35) */
    float clock_ppm;             /* of the programme against nominal, 0 before a lock */
    float gain_db;               /* gain since marking, as far as levels show (W37) */
    uint8_t profile;             /* of the lock; 255 before */
    uint8_t pair;                /* 1: cells are read from mid, left and right (W43) */
    uint8_t inverted;            /* 1: the polarity is inverted */
    uint8_t mix;                 /* 0 usual mid, 1 side, 2 left alone, 3 right alone, 4 centre alone */
    double first_lock_s;         /* heard_s at the first lock; -1 before */
    uint32_t superframes;        /* received since cue_init */
    uint32_t failed;             /* lost while locked */
    uint32_t second_failed;      /* received without their L1 */
    uint32_t tried;              /* places tried by the search */
    uint32_t proofs;             /* superframes verified */
    uint32_t forged;             /* superframes whose proofs failed, or that are from another time */
    float age_s;                 /* of the last superframe checked (E25); 0 without a clock */
    uint8_t authenticity;        /* cue_authenticity of the stream */
    uint8_t proof_reason;        /* cue_proof_reason of the stream */
} cue_diagnosis;

/* How reception stands. Errors: CUE_BAD_ARGUMENT if the size differs. */
CUE_MUST_CHECK cue_status cue_diagnose(const cue_state *cue, cue_diagnosis *diagnosis)
    CUE_NONNULL(1, 2);

/* Explain in English the last status other than CUE_OK and CUE_EMPTY, or, after CUE_OK, how
 * reception stands: value, limit, paragraph and likely cause, at most `bytes` with the final 0. */
CUE_MUST_CHECK cue_status cue_explain(const cue_state *cue, char *text, size_t bytes)
    CUE_NONNULL(1, 2);

#ifdef __cplusplus
}
#endif
#endif
