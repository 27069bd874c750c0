/* payload.h - private types of the payload half: superframes to keys, motion and markers.
 *
 * Order of use: voice.c loads tables and voice; superframe.c, score.c and residual.c read the bits;
 * joining.c makes lines of phones and keys; strokes.c, motion.c and lips.c make parameters, markers.c
 * positions; timeline.c puts all of it on the programme's clock (cue_payload_* of internal.h),
 * events.c reports it.
 * Doubles throughout: in float32 the rounding of P1 flips (0.046 mm).
 */
#ifndef CUE_PAYLOAD_H
#define CUE_PAYLOAD_H

#include "proofs.h"

enum {
    TICKS = CUE_TICKS,
    PHONES = 38,        /* G4: 0 pause, 1..16 vowels, 17..37 consonants */
    VOWELS = 16,
    PLACEMENTS = 6,
    SHAPES = 9,
    KEY_NUMBERS = 54,   /* 6 shape + placement, J4 */
    KINDS = 24,         /* shapes of the hand; placements and shapes of the forearm, F13 */
    BASES = 4,          /* Q6 */
    MOST_P = CUE_PARAMETERS,
    N_FACE = 7,         /* parameters of the face, O4 */
    N_HAND = 12,        /* parameters of the hand's shape */
    MOST_GROUP = 12,    /* most parameters of the head, and of the forearm */
    FACE_MARKERS = 63,
    HAND_MARKERS = 50,
    MOST_ANGLES = 96,
    MOST_SCORE = 34,    /* phones of a score or window: one a tick at most */
    MOST_WINDOW = 160,  /* phones of a compact window: one a tick from -16 to 110, and one more */
    MOST_PREVIEW = 16,  /* starts of a preview: one a cell */
    HALF = 16384        /* frequency of an even bit, S1 */
};

/* Result of reading bits: CUE_OK as 0, else the paragraph that is broken. */
typedef enum cue_rule {
    RULE_NONE, RULE_H1, RULE_H2, RULE_H6, RULE_M2, RULE_F1,
    RULE_F2, RULE_F3, RULE_F4, RULE_F5, RULE_F6, RULE_F7, RULE_F10,
    RULE_E15, RULE_E16, RULE_E18
} cue_rule;

const char *cue_rule_name(cue_rule rule);

/* ---- Range decoder (section 7) ---------------------------------------------------------- */

typedef struct cue_range {
    const uint8_t *data; /* of the caller; never stored in a state */
    size_t bytes, position;
    uint32_t unknown;    /* bits of the last byte that are no code, as a mask (R8) */
    uint32_t code, range;
    uint64_t slack;
    int determined;      /* whether the last symbol was (R6) */
} cue_range;

void cue_range_begin(cue_range *r, const uint8_t *data, size_t bytes, unsigned tail_bits);
/* Symbol of a row of `n` frequencies; `limit` below n lumps all from it on (R5), else n. */
unsigned cue_range_symbol(cue_range *r, const uint16_t *row, unsigned n, unsigned limit);
unsigned cue_range_bits(cue_range *r, unsigned count);

/* ---- Tables and voice ------------------------------------------------------------------- */

typedef struct cue_tables {
    uint16_t first[PHONES], opening[PHONES], usual[PHONES], pause[17], held[33], alone[41];
    uint16_t next[39][PHONES][PHONES];
    uint16_t left[PHONES][33], length[PHONES][4][33];
    uint16_t key[42][42], gap[42][17];
    uint16_t magnitude[25][4][16];
    int16_t inset[25][3];
    uint8_t shape[PHONES], placement[PHONES]; /* S11; 255 for none */
    uint8_t shape_alone, placement_alone;
} cue_tables;

typedef struct cue_bases {
    uint16_t identity;                    /* number of H5 */
    int channels;
    int16_t scales[BASES][MOST_P][TICKS];
    uint16_t scan[BASES][MOST_P * TICKS]; /* T2: channel * 32 + frequency by number */
    uint16_t rank[BASES][MOST_P * TICKS]; /* the inverse */
} cue_bases;

void cue_bases_order(cue_bases *bases);

/* Constants of movement (table 5), rounded to six decimals. */
enum {
    LEAD_SHARE, CALM_SHARE, HURRIED, LEAST_LEAD, MOST_LEAD, LEAD_PER_MM, LAG_SHARE, OVERLAP, SHORTEST,
    FASTEST, LATE, FIRST_LEAD, REST_DELAY, REST_MOVE, STROKE, FINGERS_BEGIN, FINGERS_END, HEAD_BEGIN,
    HEAD_END, TURN_BEGIN, TURN_END, POWER, UNDERSHOOT, NATURAL, CONSTANTS
};

typedef struct cue_model {
    int loaded;
    int n_head, n_forearm, n_angles, n;   /* n = 7 + 12 + n_head + n_forearm */
    uint8_t coding[8], voice[8];          /* identities */
    double constants[CONSTANTS];
    float hand[KEY_NUMBERS][N_HAND], head[KEY_NUMBERS][MOST_GROUP], forearm[KEY_NUMBERS][MOST_GROUP];
    float arc[MOST_GROUP], face[PHONES][N_FACE], places[KEY_NUMBERS][3];
    float late[N_HAND + 2 * MOST_GROUP], mean[MOST_P];
    double inverse[BASES][MOST_P][MOST_P]; /* of the bases' matrices, T1 */
    float face_mean[FACE_MARKERS][3], face_directions[N_FACE][FACE_MARKERS][3], face_pivot[3];
    float face_motion_mean[6], face_motion[MOST_GROUP][6], face_weights[FACE_MARKERS][6];
    float angle_mean[MOST_ANGLES], angle_directions[N_HAND][MOST_ANGLES];
    float regression[1 + 2 * MOST_ANGLES][HAND_MARKERS][3], hand_pivot[3];
    float hand_motion_mean[6], hand_motion[MOST_GROUP][6];
    float visemes[PHONES][N_FACE];
    double near[PHONES], lips[N_FACE][2], features[N_FACE][2], still[2]; /* K3, K5 */
} cue_model;

/* Read a file of `cuecast voice export`. 0, or the byte at which it is malformed plus 1. */
size_t cue_model_load(const uint8_t *file, size_t bytes, cue_tables *tables, cue_bases *bases,
                      cue_model *model);

/* ---- What a superframe says ------------------------------------------------------------- */

typedef struct cue_preview {
    uint8_t count, tick[MOST_PREVIEW], symbol[MOST_PREVIEW];
} cue_preview;

typedef struct cue_score {
    uint8_t kind;       /* 0 none, 1 of section 3, 2 window, 3 stands for a preview (J8) */
    uint8_t first, ahead, rest_gap, cheek[3], count;
    int16_t first_end, end;
    uint8_t number[MOST_WINDOW];
    int16_t start[MOST_WINDOW];
    uint8_t replaced[TICKS]; /* 1 + key number where one replaces the rule's (S9) */
} cue_score;

typedef struct cue_content {
    uint8_t mode, sequence, lead, is_signed, step, basis, level, course, shift, shares[4];
    uint8_t slow_count, previews; /* previews: bit 0, 1, 2 for distance 2, 4, 6, bit 3 for -1 */
    uint8_t has_l1, filmed;
    uint16_t proof, slow[3];
    cue_score score;
    cue_preview preview[4], own; /* own: labels of the superframe itself (V6) */
} cue_content;

/* Coefficients as read; scratch, not kept. */
typedef struct cue_coefficients {
    int count;
    int64_t index[MOST_P * TICKS], value[MOST_P * TICKS]; /* by number; 2^-16 mm */
} cue_coefficients;

cue_rule cue_superframe_read(const uint8_t *l0, size_t n0, const uint8_t *l1, size_t n1,
                             const cue_tables *tables, const cue_bases *bases, cue_content *out,
                             cue_coefficients *found);
/* F7: payload of a file that tells its score once. */
void cue_record_read(const uint8_t *data, size_t bytes, unsigned mode, const cue_tables *tables,
                     const cue_bases *bases, cue_content *out, cue_coefficients *found);
unsigned cue_check_of(const uint8_t *data, size_t bytes, unsigned width, unsigned polynomial,
                 unsigned preset);

/* S9: 1 + the number of the key that replaces one, 0 for none. */
unsigned cue_replacement_read(cue_range *r);
void cue_score_read(cue_range *r, const cue_tables *tables, cue_score *out);
unsigned cue_previews_read(cue_range *r, const cue_tables *tables, cue_preview out[4]);
unsigned cue_labels_read(cue_range *r, const cue_tables *tables, cue_preview *own,
                         cue_preview out[4]);
void cue_window_read(cue_range *r, const cue_tables *tables, cue_score *out, int special);
unsigned cue_tempo(int ticks);
static inline unsigned cue_phone_of(unsigned letter) { return (letter + 1) % PHONES; } /* S3 */
static inline int cue_is_vowel(unsigned phone) { return phone >= 1 && phone <= VOWELS; }
static inline int cue_is_consonant(unsigned phone) { return phone > VOWELS; }

/* C1 to C5, Q1 to Q4: read from number `first` on; the first number that is not determined. */
int cue_coefficients_read(cue_range *r, const cue_tables *tables, const cue_bases *bases,
                          const cue_content *content, int first, cue_coefficients *found);
void cue_coefficients_value(const cue_tables *tables, const cue_bases *bases,
                            const cue_content *content, cue_coefficients *found);

/* ---- Joining (section 4) ---------------------------------------------------------------- */

enum { MOST_LINE = 820, MOST_CUES = 820, SCORES = 6 };

typedef struct cue_sound {
    int32_t start, end;                  /* ticks of the programme */
    uint8_t number, open_start, open_end, stands; /* stands: for a key of a list (J8) */
} cue_sound;

typedef struct cue_cue {
    int32_t start, end;
    int16_t consonant;                   /* its ticks, for a key of two phones; else 0 */
    uint8_t number, phones[2], certain;  /* phones: 0 none; certain: J5, J7 */
} cue_cue;

typedef struct cue_line {
    int sounds, cues;
    cue_sound sound[MOST_LINE];
    cue_cue cue[MOST_CUES];
} cue_line;

/* Scores by superframe number, `first` + i; kind 0 where nothing is known. */
typedef struct cue_scores {
    int32_t first;
    int count;
    const cue_score *score[SCORES];
} cue_scores;

void cue_stand_in(const cue_preview *preview, cue_score *out);
void cue_join(const cue_scores *scores, const cue_tables *tables, cue_line *out);
/* J4: keys of sounds, without numbers, at most `most`; S11: the number of one by the chart. */
int cue_chart(const cue_sound *sounds, int count, cue_cue *out, int most);
uint8_t cue_key_number(const cue_cue *cue, const uint8_t cheek[3], const cue_tables *tables);
static inline int32_t cue_floor(int32_t a, int32_t b) { return a / b - (a % b < 0); }
/* The known score nearest to a superframe, of two the later; 0 if there is none. */
const cue_score *cue_nearest(const cue_scores *scores, int32_t index);

/* ---- Prediction (section 5) ------------------------------------------------------------- */

enum { MOST_STROKES = 2 * MOST_CUES + 2 };
#define CUE_LONG_AGO (-(INT64_C(1) << 40))

typedef struct cue_stroke {
    int64_t leave, reach; /* hundredths of a tick */
    uint8_t number;
} cue_stroke;

/* Strokes in order of time. Of a long line earlier ones can be dropped: the first that is left then
 * holds what they leave behind, `held`, for each moving parameter and each kind of keys (F13). */
typedef struct cue_strokes {
    int count, dropped;
    cue_stroke raw, stroke[MOST_STROKES]; /* raw: the last one before the last rule of P1 */
    double held[MOST_P + KINDS];
} cue_strokes;

void cue_strokes_begin(cue_strokes *list);
/* P1 to P3; `before`: 0 for the first key; `waits`: a superframe was lost between both. */
void cue_strokes_key(cue_strokes *list, const cue_cue *before, const cue_cue *cue, int waits,
                     unsigned rest_gap, const cue_model *model);
void cue_strokes_end(cue_strokes *list, const cue_cue *last, const cue_model *model);
void cue_strokes_of(const cue_line *line, unsigned rest_gap, const cue_model *model,
                    cue_strokes *out);
/* Drop what is over before a tick in all parameters. */
void cue_strokes_drop(cue_strokes *list, const cue_model *model, int32_t first);

typedef struct cue_block {
    double value[TICKS][MOST_P];
} cue_block;

/* Scratch of the prediction. */
typedef struct cue_motion_work {
    cue_line line;
    cue_strokes strokes;
    double missed[MOST_STROKES], held[MOST_STROKES], far[MOST_STROKES];
    double sum[TICKS][PHONES];
} cue_motion_work;

/* P4 to P9, with the strokes in `work`. */
void cue_predict(const cue_sound *sounds, int n_sounds, const cue_model *model, int32_t first,
                 unsigned course, unsigned shift, cue_motion_work *work, cue_block *out);
/* F13: the rows of W and V, KINDS columns. */
void cue_predict_kinds(const cue_model *model, int32_t first, unsigned course, unsigned shift,
                       cue_motion_work *work, cue_block *out);
/* P10; `out` holds the prediction, or anything in mode 1. */
void cue_use_shares(const cue_content *content, const cue_model *model, cue_block *out);
/* T1: the residual as parameters. */
void cue_residual(const cue_content *content, const cue_coefficients *found, const cue_bases *bases,
                  const cue_model *model, cue_block *out);
/* K1 to K5 on the face of a block whose first frame is at tick `first`. */
void cue_lips(const cue_sound *sounds, int n_sounds, const cue_model *model, int32_t first,
              cue_block *block);
void cue_lips_prepare(const cue_tables *tables, cue_model *model);
/* O6 to O9: 113 positions of n parameters, mm. */
void cue_markers_of(const cue_model *model, const double *parameters, double place[][3]);

/* Solve a x = b by elimination with pivots, n at most 32; a and b are overwritten. 0 if singular. */
int cue_solve(double *a, double *b, int n, int columns);

/* ---- Stream files (section 8) ----------------------------------------------------------- */

/* F13: sums over what was decoded, and the corrections that follow from them. */
typedef struct cue_learner {
    double square[KINDS - SHAPES][KINDS - SHAPES], right[KINDS - SHAPES][MOST_GROUP],
        table[KINDS - SHAPES][MOST_GROUP];
} cue_learner;

/* A file that is read. Its bytes stay the caller's; the line near a superframe is in cue_motion_work. */
typedef struct cue_file {
    uint8_t opened, special, keyed, learns, cheek[3], rest_gap;
    uint8_t keys, ended;          /* keys: 1 once there was one, 2 after the last */
    uint8_t earlier, before;      /* phones that the next one follows */
    uint16_t n0, n1;
    int32_t first_tick, end_tick, start, next, stop; /* superframes; ticks */
    int32_t tick, spoken;         /* where the next phone starts; length of the one before */
    int charted;                  /* phones of the line that have been made keys */
    size_t bytes, at, line_at, line_bytes; /* at: of the next payload */
    cue_range line, replaced;
    cue_cue key;                  /* the last one */
    cue_learner hand, arm;
    cue_block lacked;
} cue_file;

/* ---- Timeline --------------------------------------------------------------------------- */

enum { SLOTS = 24, MOST_SHOWN = 40 };

typedef struct cue_shown_key {
    int32_t start, end; /* ticks of the timeline */
    uint32_t revision;
    uint8_t number, phones[2], previewed, final, pending;
} cue_shown_key;

/* One superframe on the timeline. */
typedef struct cue_slot {
    int32_t number;
    uint8_t state;         /* 0 nothing known, 1 lost, 2 arrived */
    uint8_t told_distance; /* of the preview below; 0 none */
    uint8_t told_pending;  /* starts of it that are still to be reported, from this one on */
    uint8_t drawn, finished, keys, phones, phones_next, layers;
    double time_s;         /* of its first frame */
    uint32_t revision, pending; /* frames to be reported, bit t for frame t */
    cue_content content;
    cue_preview told;
    cue_shown_key key[MOST_SHOWN];
    struct { int32_t start, end; uint8_t number; } phone[MOST_SHOWN];
    float residual[TICKS][MOST_P], shown[TICKS][MOST_P];
} cue_slot;

struct cue_payload {
    int with_markers, with_lips;
    int started, streak, doubt, away; /* away: bits that agreed, off the grid */
    int32_t last, newest_lost;  /* numbers: of the last that arrived, and of the last known of */
    double last_on_air_s, lead_s;
    uint32_t foreign, other, told_other;
    uint32_t foreign_sum;
    int unreadable;             /* an event waits */
    uint8_t other_version;
    uint64_t bad_at;            /* byte at which a voice file is malformed, plus 1 */
    int marker_slot, marker_frame;
    cue_rule broken;            /* by the file that was opened last */
    double from_s, until_s;     /* frames outside are not reported */
    cue_file file;
    cue_proofs proofs;
    cue_slot slot[SLOTS];
    cue_tables tables;
    cue_bases bases;
    cue_model model;
    cue_motion_work work;
    cue_coefficients found;
    cue_block block, other_block;
    cue_score stand[SCORES];
};

/* The slot of a superframe, 0 if it has none. */
cue_slot *cue_slot_find(cue_payload *payload, int32_t number);
/* An empty one, in place of an older superframe's. */
cue_slot *cue_slot_new(cue_payload *payload, int32_t number, double time_s);
/* Report parameters, a key or a phone of it. */
void cue_slot_show(cue_slot *slot, const cue_block *block, int count);
void cue_key_show(cue_slot *slot, const cue_cue *cue, int previewed, int final);
void cue_phone_show(cue_slot *slot, const cue_sound *sound);

/* F1 to F10: check a file and stand before its first superframe. */
cue_rule cue_payload_file(cue_payload *payload, const uint8_t *file, size_t bytes);

/* Take a superframe of any size that was on air from on_air_s on; n0 = 0: it did not arrive. */
cue_status cue_payload_put(cue_payload *payload, const uint8_t *l0, size_t n0, const uint8_t *l1,
                           size_t n1, double on_air_s, cue_rule *rule);
/* Draw a superframe from all that is known by now; 0 if nothing is. The line around it is in
 * work.line then. For tests. */
const cue_slot *cue_payload_draw(cue_payload *payload, int32_t number, int lips);

/* Elementary functions; x of a power is 0..1. cue_cos is that of the hearing half. */
double cue_exponential(double x);
double cue_power(double x, double exponent);
double cue_cos(double angle);
static inline double cue_sine(double angle) { return cue_cos(angle - 1.57079632679489661923); }

#endif
