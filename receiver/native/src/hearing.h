/* hearing.h - constants, tables and state of the hearing half.
 *
 * Everything lies inside the caller's block: tables are computed once by cue_hearing_init, because
 * they depend on the key; scratch memory is shared by search, views and decoder.
 * Times inside are samples at 48 kHz (W2) as double: a day has 4e9 of them.
 */
#ifndef CUE_HEARING_H
#define CUE_HEARING_H

#include <math.h>
#include <stdbool.h>

#include "internal.h"

#define FS 48000
#define HOP 480
#define FRAMES 64                        /* of a superframe */
#define SUPER (FRAMES * HOP)
#define BINS 240                         /* bins that any profile uses; W39: last is 238 at most */
#define GROUPS 116                       /* most data cells of a frame */
#define CODED 6912                       /* most coded bits of a superframe */
#define BANDS 56                         /* room for the masking bands of W23 */
#define PROFILES 4
#define SLOTS 6                          /* pilot slots, W13 */
#define PILOT_BINS 8
#define FIRST_PILOT 6
#define LAST_PILOT (FIRST_PILOT + SLOTS * PILOT_BINS)
#define LEVELS 12
#define TIER_LEVELS 4
#define TIERS 4
#define MESSAGE 304                      /* most bits of a message with its check */
#define RING (4 * FS + 4608)             /* samples of sound that are kept */
#define QUANTUM 7680                     /* samples between two steps of the receiver, 0.16 s */
#define TAPS 32                          /* interpolation between samples at 48 kHz */
#define RATE_TAPS 72                     /* conversion to 48 kHz, 96 kHz at most */
#define STEPS 128                        /* tabulated fractions of a sample */
#define INPUT 256                        /* samples kept at the input's rate */

#define PI 3.14159265358979323846
#define SILENT_POWER 3.9810717e-10f /* 10^-9.4: W26 */

typedef struct { float re, im; } cue_complex;

/* Small functions in place of the library's, which would double the size of a module. */
double cue_cos(double angle); /* within 1e-11 */
static inline double cue_sin(double angle) { return cue_cos(angle - PI / 2); }
static inline float cue_exp(float x) { return exp2f(x * 1.44269504f); }
static inline float cue_log(float x) { return log2f(x) * 0.69314718f; }
static inline float cue_power10(float x) { return exp2f(x * 3.32192809f); }
static inline double cue_nearest(double x) { return floor(x + 0.5); }

/* ---- Profiles and layout (sections 4, 8, 10) -------------------------------------------- */

typedef struct cue_profile {
    uint8_t l0_bytes, l1_bytes, cell_bins, first_bin, last_bin, lowest_tier, side_period;
    uint16_t l0_coded;
    float strength;
} cue_profile;

extern const cue_profile cue_profiles[PROFILES];

static inline int cue_groups(const cue_profile *p) {
    return (p->last_bin - p->first_bin) / p->cell_bins;
}
static inline int cue_coded(const cue_profile *p) {
    return (cue_groups(p) - 2 * PILOT_BINS / p->cell_bins) * FRAMES;
}
float cue_step(const cue_profile *p, float level);       /* W20, any real level */
float cue_pilot_step(const cue_profile *p, float tier);  /* W20, tier above the profile's lowest */

enum { MID, LEFT, RIGHT };

/* Cells that lie side by side in a frame. */
typedef struct cue_cells {
    int first_bin, bins, groups;
    const float *signs, *dither;
} cue_cells;

typedef struct cue_layout {
    float signs[PROFILES][BINS], dither[PROFILES][GROUPS];
    float pilot_signs[SLOTS * PILOT_BINS], pilot_dither[SLOTS];
    uint8_t slots[FRAMES][2];
    int8_t pilots[PROFILES][FRAMES][2];     /* soft values of the pilots */
    uint16_t order[PROFILES][CODED];        /* frame * groups + group of each coded bit */
    uint8_t place[PROFILES][BINS];          /* MID, LEFT, RIGHT outside pilots */
} cue_layout;

void cue_layout_init(cue_layout *layout, uint64_t key, uint64_t *scratch);
cue_cells cue_data_cells(const cue_layout *layout, int profile);
cue_cells cue_pilot_cells(const cue_layout *layout);

/* ---- Transform, masking, sound ---------------------------------------------------------- */

typedef struct cue_mdct {
    cue_complex turn[HOP], half[HOP / 2 + 1], own[HOP], next[HOP];
} cue_mdct;

void cue_mdct_init(cue_mdct *mdct);
/* Spectrum of W8 of 960 samples. */
void cue_mdct_run(const cue_mdct *mdct, const float *x, cue_complex *spectrum);

typedef struct cue_mask {
    int bands;
    uint16_t edge[BANDS + 1];
    float matrix[BANDS][BANDS]; /* [to][from], offset included */
} cue_mask;

void cue_mask_init(cue_mask *mask);
/* Band powers of a frame, and thresholds of W26 of the first `count` bands; spread may be NULL. */
void cue_mask_energy(const cue_mask *mask, const float *power, float *energy);
void cue_mask_thresholds(const cue_mask *mask, const float *energy, int used, int count,
                         float silent, float *threshold, float *spread);

typedef struct cue_sound {
    uint32_t rate;
    int taps;                               /* of `rate_table`, 0 at 48 kHz */
    float table[STEPS + 1][TAPS];
    float rate_table[STEPS + 1][RATE_TAPS];
    int64_t taken;                          /* samples that came in */
    int64_t count;                          /* samples at 48 kHz; the ring ends there */
    int64_t first;                          /* first one that was not forgotten */
    float input[2][INPUT];
    float ring[2][RING];                    /* mid, side */
} cue_sound;

void cue_sound_init(cue_sound *sound, uint32_t rate);
void cue_sound_clear(cue_sound *sound);
/* Append mid and side samples at the input's rate. */
void cue_sound_push(cue_sound *sound, float mid, float side);
/* Samples of a mix (weights of mid and side) at position + n ratio, silence outside. */
void cue_sound_read(const cue_sound *sound, const float mix[2], double position, double ratio,
                    int count, float *out);

/* ---- Link (section 6) ------------------------------------------------------------------- */

enum { PATH_CELLS = 65536, PATHS = 64 };

typedef struct cue_polar_work {
    float folded[4096];
    float ratio[PATH_CELLS];
    uint8_t left[2 * PATH_CELLS];
    uint8_t work[4096];
    uint8_t ratio_row[2][PATHS][14], left_row[2][PATHS][14];
    uint8_t trace_path[MESSAGE][PATHS], trace_bit[MESSAGE][PATHS];
    float metric[PATHS], candidate[2 * PATHS];
    uint8_t message[MESSAGE];
    uint8_t coded[4096];
} cue_polar_work;

typedef struct cue_link {
    uint32_t free_bits[PROFILES][2][4096 / 32]; /* inputs of the mother code that bear a message */
} cue_link;

void cue_link_init(cue_link *link, uint64_t *scratch);
/* Decode a class of a profile from its ratios. True if a path passes; writes bytes and signs of the
 * coded bits (+1 or -1). */
bool cue_link_decode(const cue_link *link, int profile, int layer, const float *ratios, int paths,
                     cue_polar_work *work, uint8_t *bytes, int8_t *coded);
/* Inputs of the polar code and its likeliest paths, best first; see polar.c. */
int cue_polar_paths(const uint32_t *free_bits, int size, int paths, cue_polar_work *work,
                    uint8_t *order);
void cue_polar_transform(uint8_t *x, int size);

/* ---- A superframe at a place (sections 5, 7) --------------------------------------------- */

typedef struct cue_track {
    double position, ratio;   /* start; samples of sound per sample of the mark */
    float mix[2];             /* weights of mid and side */
    int profile;
    float level, offset;      /* of the superframe before; levels by which gain moved all */
    int misses, age;
    bool pair;                /* cells are read from mid, left and right */
} cue_track;

typedef struct cue_view {
    bool paired;
    cue_complex spectrum[FRAMES][BINS];
    float unit[FRAMES][BINS];
    float energy[FRAMES][BANDS], spread[FRAMES][BANDS], power[FRAMES];
    float projection[FRAMES * GROUPS];      /* of data cells, in units of the mask */
    uint8_t alive[FRAMES * GROUPS];
    float pilot[FRAMES * SLOTS];
    uint8_t pilot_alive[FRAMES * SLOTS];
} cue_view;

/* What a superframe was decoded to. */
typedef struct cue_reading {
    bool l0_ok, l1_ok;
    float level;
    uint8_t l0[CUE_L0_MOST], l1[CUE_L1_MOST];
    int8_t expected[FRAMES * GROUPS];       /* signs that the decoded bits ask for, 0 unknown */
    float soft[FRAMES * GROUPS];
} cue_reading;

typedef struct cue_reliability {
    float resultant[GROUPS];
    float exponents[3];
} cue_reliability;

typedef struct cue_fit {
    double delay, start_delay, drift, score; /* samples, samples, relative, correlation */
} cue_fit;

/* ---- Search (section 7.1) ---------------------------------------------------------------- */

#define ROWS_PER_FRAME 30                /* transforms at 12 kHz per frame */
#define TURNS 8                          /* places between two transforms, 2 samples apart */
#define ROW_HOP (ROWS_PER_FRAME * TURNS)
#define BATCH (QUANTUM / 2)              /* places that are searched at once */
#define LEAD_ROWS 34                     /* rows before the first place: growth limit and clock errors */
#define SLACK 32
#define ROWS (LEAD_ROWS + (BATCH + 63 * ROW_HOP + SLACK) / TURNS + 1)
#define SEARCH_SOUND (4 * ROWS + 240)
#define PLACES ((ROWS - 30) * TURNS)
#define PAST (2 * 7740 + BATCH / 2)      /* scores of two superframes before, of two places each */
#define PAIRS 12                         /* tier and profile as marked */
#define CLOCKS 35

typedef struct cue_search_work {
    float sound[SEARCH_SOUND];
    float re[SLOTS][ROWS], im[SLOTS][ROWS];
    float threshold[12][ROWS];
    uint8_t alive[SLOTS][ROWS];
    int8_t soft[SLOTS][PLACES];
    int16_t common[8][BATCH / 2 + 2 * SLACK], sums[8][BATCH / 2 + 2 * SLACK];
    int16_t peak[BATCH / 2];
} cue_search_work;

typedef struct cue_candidate {
    double start;     /* samples at 48 kHz */
    double clock;     /* relative error of the clock */
    int profile;
    float pilot_step; /* of the pilots */
    float score;      /* standard deviations of unmarked sound */
    float mix[2];
} cue_candidate;

typedef struct cue_search {
    float fir[52];
    float wave[2][240][64], slide_turn[2][64], own[2][64], next[2][64];
    int64_t batch;              /* next one: its first place lies QUANTUM * batch samples in */
    int turn;                   /* of the rotating hypotheses */
    bool active;
    float mix[2], offset;       /* of the usual hypothesis */
    float loudest;              /* slow maximum of the power of 10 ms */
    uint8_t past[PAIRS][PAST];  /* scores of places before, in 1/128 of their parts */
} cue_search;

/* ---- The whole hearing half -------------------------------------------------------------- */

typedef struct cue_hearing {
    cue_layout layout;
    cue_mdct mdct;
    cue_mask mask;
    cue_link link;
    cue_reliability reliability[PROFILES];
    cue_search search;
    cue_track track;
    bool tracking;              /* track is valid */
    double last_start, last_given;
    cue_track back;             /* superframes before the lock are read from here backwards */
    int back_failed;            /* superframes in a row that failed there; 255: nothing is left */
    double back_first;
    uint64_t back_index;
    int64_t now;                /* sound before it was processed */
    uint32_t channels, epoch;
    uint64_t index;
    bool history, stereo;       /* stereo: two channels that have differed */
    cue_reception state;
    cue_diagnosis seen;
    cue_view view;
    cue_reading reading;
    float weights[FRAMES * GROUPS], ratios[CODED], clues[3][FRAMES * GROUPS];
    union {
        cue_search_work search;
        cue_polar_work polar;
        cue_complex terms[FRAMES * BINS];
        uint64_t words[CODED];
    } work;
    int waiting;                /* superframes that were read and not yet taken */
    cue_superframe queue[16];
    cue_sound sound;
} cue_hearing;

/* align.c */
void cue_view_read(cue_hearing *h, const cue_track *track, float silent, cue_view *view);
void cue_soft(const cue_hearing *h, const cue_view *view, int profile, float step, float *soft);
float cue_pilot_score(const cue_hearing *h, const cue_view *view, int profile, float step);
cue_fit cue_search_fit(cue_hearing *h, const cue_view *view, cue_cells cells, float step,
                       const float *expected, int delays, float delay_step, int drifts,
                       float drift_step, int harmonic);
double cue_find_delay(cue_hearing *h, const cue_view *view, cue_cells cells, float step,
                      const float *expected, float reach);
void cue_pilots_expected(const cue_hearing *h, int profile, float *expected);

/* demodulate.c */
void cue_reliability_init(cue_reliability *r, int groups);
void cue_reliability_learn(cue_hearing *h, int profile, const cue_reading *reading);
void cue_trusted(cue_hearing *h, int profile, const cue_reading *reading, float *weighted);
int cue_likely_levels(const cue_hearing *h, const cue_view *view, const cue_track *track,
                      float *levels);
enum cue_effort { BRIEF, USUAL, DUE };
bool cue_read(cue_hearing *h, int profile, const float *levels, int count, enum cue_effort effort);
bool cue_read_second(cue_hearing *h, int profile);
float cue_gain_change(const cue_hearing *h, int profile, const cue_reading *reading);

/* acquire.c */
void cue_search_init(cue_search *search);
void cue_search_start(cue_hearing *h, double from, const cue_track *track);
bool cue_search_ready(const cue_hearing *h);
/* Search the next batch under the usual hypothesis, or under the next rotating one. */
bool cue_search_usual(cue_hearing *h, cue_candidate *found);
bool cue_search_other(cue_hearing *h, bool ladder, cue_candidate *found);

/* track.c */
void cue_hearing_init(cue_hearing *h, const cue_config *config);
void cue_hearing_reset(cue_hearing *h);
/* Process one step after QUANTUM new samples. */
void cue_hearing_step(cue_hearing *h);
/* Sound ends. One so short that the gains of the ladder had no turn is searched at some of them. */
void cue_hearing_end(cue_hearing *h);

#endif
